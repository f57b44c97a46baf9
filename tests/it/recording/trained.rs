//! Recordings of training runs equal the episodes of the trainer, for any number of threads.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use seedbed::run::folder::RunFolder;
use seedbed::run::trainer::Trainer;
use seedbed::run::{Ending, Observer, Options, Plan, Progress, execute};
use seedbed_env::Choice;
use seedbed_learn::experience::Episode;

use super::contents::RecordingContents;
use super::{assert_times, outcome_text};

/// Three agents with a bonus and two episodes per round; every column of `/raw` is recorded.
const WITH_BONUS: [&str; 5] = [
    "agents.count=3",
    "stop=Episodes(8)",
    "schedule=Synchronous(episodes: 2)",
    "algorithm.bonus=Vime(seeds: Shift)",
    "recording.axes=[Observations, Advantage()]",
];

/// Two asynchronous agents in a task with several continuous action components.
const ASYNCHRONOUS_HOPPER: [&str; 4] = [
    "environment=\"hopper\"",
    "agents.count=2",
    "stop=Episodes(4)",
    "schedule=Asynchronous(training: (env_steps: 30))",
];

struct IgnoreProgress;

impl Observer for IgnoreProgress {
    fn begun(&mut self, _: &Progress) {}

    fn round_finished(&mut self, _: &Progress) {}
}

fn plan(overrides: &[&str]) -> Plan {
    let overrides: Vec<String> = overrides.iter().map(|text| (*text).to_owned()).collect();
    Plan::load(Path::new("scenarios/cartpole.ron"), &overrides).unwrap()
}

fn record_run(plan: &Plan, folder: &Path, threads: usize) -> RecordingContents {
    let folder = RunFolder::new(folder);
    let _lock = folder.claim().unwrap();
    let options = Options {
        folder: folder.clone(),
        resume: false,
        threads,
        recording: true,
    };
    let ending = execute(
        plan,
        &options,
        None,
        &mut IgnoreProgress,
        &AtomicBool::new(false),
    )
    .unwrap();
    assert!(matches!(ending, Ending::Finished(_)));
    RecordingContents::read(&folder.recording())
}

/// The episodes of each agent, taken from a trainer without a recording.
fn episodes_by_agent(plan: &Plan) -> Vec<Vec<Episode>> {
    let mut trainer = Trainer::from_scenario(&plan.scenario, &plan.description, 1).unwrap();
    let mut agents = vec![Vec::new(); trainer.agent_count()];
    while !trainer.is_done() {
        trainer.advance().unwrap();
        trainer
            .newest_episodes()
            .into_iter()
            .for_each(|episode| agents[episode.agent as usize].push(episode.clone()));
    }
    agents
}

#[test]
fn recorded_values_equal_those_of_the_trainer() {
    for overrides in [&WITH_BONUS[..], &ASYNCHRONOUS_HOPPER[..]] {
        let (folder, plan) = (tempfile::tempdir().unwrap(), plan(overrides));
        let (contents, agents) = (
            record_run(&plan, folder.path(), 2),
            episodes_by_agent(&plan),
        );
        assert_ne!(
            agents[0][0].observations, agents[1][0].observations,
            "agents must differ, so that mixing them up is detected"
        );
        for (agent, episodes) in agents.iter().enumerate() {
            assert_eq!(episodes.len(), plan.scenario.max_episodes() as usize);
            assert_recorded_values(&plan, &contents, &format!("/raw/agent_{agent}"), episodes);
        }
    }
}

/// Asserts that the recorded columns of an agent equal the values of its episodes, in order.
fn assert_recorded_values(
    plan: &Plan,
    contents: &RecordingContents,
    entity: &str,
    episodes: &[Episode],
) {
    assert_observations_and_actions(plan, contents, entity, episodes);
    assert_rewards(plan, contents, entity, episodes);
    let episodes: Vec<&Episode> = episodes.iter().collect();
    assert_times(&episodes, contents, entity);
    let outcomes: Vec<&str> = episodes
        .iter()
        .map(|episode| outcome_text(episode))
        .collect();
    assert_eq!(contents.texts(entity, "State:outcome"), outcomes);
}

/// Component `index` of the values of all steps, where each step has `width` values.
fn component(
    episodes: &[Episode],
    values: fn(&Episode) -> &Vec<f32>,
    index: usize,
    width: usize,
) -> Vec<f32> {
    episodes
        .iter()
        .flat_map(|episode| values(episode).iter().skip(index).step_by(width))
        .copied()
        .collect()
}

fn assert_observations_and_actions(
    plan: &Plan,
    contents: &RecordingContents,
    entity: &str,
    episodes: &[Episode],
) {
    let spec = plan.description.spec();
    let column = |name: &str| contents.f32_values(entity, &format!("State:{name}"));
    for (index, quantity) in spec.observations.iter().enumerate() {
        let width = spec.observations.len();
        let expected = component(episodes, |episode| &episode.observations, index, width);
        assert_eq!(
            column(&quantity.name),
            expected,
            "{entity} {}",
            quantity.name
        );
    }
    for (index, action) in spec.actions.iter().enumerate() {
        let width = spec.actions.len();
        let mut expected = component(episodes, |episode| &episode.actions, index, width);
        if let Choice::Discrete(values) = &action.choice {
            for action in &mut expected {
                *action = values[*action as usize];
            }
        }
        let name = &action.quantity.name;
        assert_eq!(column(name), expected, "{entity} {name}");
    }
}

fn assert_rewards(plan: &Plan, contents: &RecordingContents, entity: &str, episodes: &[Episode]) {
    let column = |name: &str| contents.f32_values(entity, &format!("State:{name}"));
    let joined = |values| component(episodes, values, 0, 1);
    assert_eq!(column("reward"), joined(|episode| &episode.rewards));
    let log_probs = joined(|episode| &episode.log_probs);
    let of_steps = log_probs.chunks(plan.description.spec().actions.len());
    assert_eq!(
        column("log_prob"),
        of_steps
            .map(|parts| parts.iter().sum())
            .collect::<Vec<f32>>()
    );
    if plan.scenario.algorithm.largest_intrinsic_reward().is_some() {
        assert_eq!(
            column("intrinsic_reward"),
            joined(|episode| &episode.intrinsic_rewards)
        );
        assert_eq!(column("advantage"), joined(|episode| &episode.advantages));
    }
}

#[test]
fn recordings_do_not_depend_on_the_number_of_threads() {
    for overrides in [&WITH_BONUS[..], &ASYNCHRONOUS_HOPPER[..]] {
        let (folder, plan) = (tempfile::tempdir().unwrap(), plan(overrides));
        let [one, three] = [1, 3].map(|threads| {
            record_run(&plan, &folder.path().join(threads.to_string()), threads).columns()
        });
        assert!(
            one.contains_key("/raw/agent_1 State:reward")
                && one.contains_key("/visitation/agent_1/latest DepthImage:buffer")
        );
        let differing_column = one
            .iter()
            .find(|(name, rows)| three.get(*name) != Some(rows))
            .map(|(name, _)| name);
        assert_eq!((differing_column, one.len()), (None, three.len()));
    }
}
