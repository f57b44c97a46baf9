//! Recordings of training runs have all data of the agents' episodes, for any number of threads.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use seedbed::record::recording::RecordingFile;
use seedbed::record::table::TableFiles;
use seedbed::run::folder::RunFolder;
use seedbed::run::measures::RoundRows;
use seedbed::run::ranks::Ranks;
use seedbed::run::training::Trainer;
use seedbed::run::{Observer, Options, Plan, Progress, RecorderFactories, RunOutcome, execute};
use seedbed_env::Choice;
use seedbed_learn::experience::{Episode, StepData};

use super::contents::RecordingContents;
use super::{assert_times, outcome_text};

/// Three agents with a VIME bonus and two episodes per round. Intrinsic rewards and advantages are
/// recorded.
const VIME_OVERRIDES: [&str; 5] = [
    "agents.count=3",
    "stop=Episodes(8)",
    "schedule=Synchronous(episodes: 2)",
    "algorithm.bonus=Vime(seeds: Shift)",
    "recording.axes=[Observations, Advantage()]",
];

/// Two asynchronous agents, whose actions have several continuous components.
const HOPPER_OVERRIDES: [&str; 4] = [
    "environment=\"hopper\"",
    "agents.count=2",
    "stop=Episodes(4)",
    "schedule=Asynchronous(training: (env_steps: 30))",
];

struct SilentObserver;

impl Observer for SilentObserver {
    fn begun(&mut self, _: &Progress) {}

    fn round_finished(&mut self, _: &Progress, _: &RoundRows) {}
}

/// The cart-pole scenario with overrides.
pub(super) fn load_plan(overrides: &[&str]) -> Plan {
    let overrides: Vec<String> = overrides.iter().map(|text| (*text).to_owned()).collect();
    Plan::load(Path::new("scenarios/cartpole.ron"), &overrides).unwrap()
}

fn recorder_factories(folder: &RunFolder) -> RecorderFactories {
    let tables = TableFiles {
        folder: folder.path().to_owned(),
    };
    let recording = RecordingFile {
        path: folder.recording_file(),
        live: None,
    };
    vec![Box::new(tables), Box::new(recording)]
}

/// Runs a plan in a folder, and reads the recording of the run.
pub(super) fn run_and_read_recording(
    plan: &Plan,
    folder: &Path,
    threads: usize,
) -> RecordingContents {
    let folder = RunFolder::new(folder);
    let _lock = folder.lock().unwrap();
    let options = Options {
        folder: folder.clone(),
        resume: false,
        threads,
        save_initial: false,
        other_versions: false,
        ranks: Ranks::SINGLE,
    };
    let outcome = execute(
        plan,
        &options,
        recorder_factories(&folder),
        &mut SilentObserver,
        &AtomicBool::new(false),
    )
    .unwrap();
    assert!(matches!(outcome, RunOutcome::Finished(_)));
    RecordingContents::read(&folder.recording_file())
}

/// Episodes of one agent, and the data of their steps from its updates.
#[derive(Clone, Default)]
struct AgentHistory {
    episodes: Vec<Episode>,
    step_data: Vec<StepData>,
}

/// Trains a team without a recording, and returns the history of each agent.
fn train_without_recording(plan: &Plan) -> Vec<AgentHistory> {
    let mut trainer = Trainer::from_scenario(&plan.scenario, &plan.description, 1).unwrap();
    let mut agents = vec![AgentHistory::default(); trainer.agent_count()];
    while !trainer.is_done() {
        let round = trainer.advance().unwrap();
        for episode in trainer.newest_episodes() {
            agents[episode.agent as usize]
                .episodes
                .push(episode.clone());
        }
        for data in round.step_data {
            agents[data.agent as usize].step_data.push(data);
        }
    }
    agents
}

#[test]
fn recorded_episodes_equal_the_episodes_of_the_agents() {
    for overrides in [&VIME_OVERRIDES[..], &HOPPER_OVERRIDES[..]] {
        let (folder, plan) = (tempfile::tempdir().unwrap(), load_plan(overrides));
        let (contents, agents) = (
            run_and_read_recording(&plan, folder.path(), 2),
            train_without_recording(&plan),
        );
        assert_ne!(
            agents[0].episodes[0].observations, agents[1].episodes[0].observations,
            "if agents did the same, a recording with exchanged agents would pass"
        );
        for (agent, history) in agents.iter().enumerate() {
            assert_eq!(
                history.episodes.len(),
                plan.scenario.max_episodes() as usize
            );
            assert_recorded(&plan, &contents, &format!("/raw/agent_{agent}"), history);
        }
    }
}

/// Asserts that the rows of an entity have every value of an agent's history, in order.
fn assert_recorded(
    plan: &Plan,
    contents: &RecordingContents,
    entity: &str,
    history: &AgentHistory,
) {
    let AgentHistory {
        episodes,
        step_data,
    } = history;
    assert_observations_and_actions_recorded(plan, contents, entity, episodes);
    assert_rewards_recorded(plan, contents, entity, episodes);
    assert_step_data_recorded(plan, contents, entity, step_data);
    let episodes: Vec<&Episode> = episodes.iter().collect();
    assert_times(&episodes, contents, entity);
    let outcomes: Vec<&str> = episodes
        .iter()
        .map(|episode| outcome_text(episode))
        .collect();
    assert_eq!(contents.texts(entity, "State:outcome"), outcomes);
}

/// Component `index` of the values of each step. Each step has `width` values.
fn component<T>(
    episodes: &[T],
    values: fn(&T) -> &Vec<f32>,
    index: usize,
    width: usize,
) -> Vec<f32> {
    episodes
        .iter()
        .flat_map(|episode| values(episode).iter().skip(index).step_by(width))
        .copied()
        .collect()
}

fn assert_observations_and_actions_recorded(
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

fn assert_rewards_recorded(
    plan: &Plan,
    contents: &RecordingContents,
    entity: &str,
    episodes: &[Episode],
) {
    let column = |name: &str| contents.f32_values(entity, &format!("State:{name}"));
    let joined = |values| component(episodes, values, 0, 1);
    assert_eq!(column("reward"), joined(|episode| &episode.rewards));
    let log_probs = joined(|episode| &episode.log_probs);
    let log_probs_by_step = log_probs.chunks(plan.description.spec().actions.len());
    assert_eq!(
        column("log_prob"),
        log_probs_by_step
            .map(|components| components.iter().sum())
            .collect::<Vec<f32>>()
    );
}

fn assert_step_data_recorded(
    plan: &Plan,
    contents: &RecordingContents,
    entity: &str,
    step_data: &[StepData],
) {
    if plan.scenario.algorithm.largest_intrinsic_reward().is_none() {
        assert!(step_data.is_empty());
        return;
    }
    let column = |name: &str| contents.f32_values(entity, &format!("State:{name}"));
    let joined = |values| component(step_data, values, 0, 1);
    assert_eq!(
        column("intrinsic_reward"),
        joined(|data| &data.intrinsic_rewards)
    );
    assert_eq!(column("advantage"), joined(|data| &data.advantages));
}

#[test]
fn recordings_do_not_depend_on_the_number_of_threads() {
    for overrides in [&VIME_OVERRIDES[..], &HOPPER_OVERRIDES[..]] {
        let (folder, plan) = (tempfile::tempdir().unwrap(), load_plan(overrides));
        let [one, three] = [1, 3].map(|threads| {
            run_and_read_recording(&plan, &folder.path().join(threads.to_string()), threads)
                .columns()
        });
        assert!(
            one.contains_key("/raw/agent_1 State:reward")
                && one.contains_key("/visitation/agent_1/latest DepthImage:buffer")
        );
        let first_difference = one
            .iter()
            .find(|(name, rows)| three.get(*name) != Some(rows))
            .map(|(name, _)| name);
        assert_eq!((first_difference, one.len()), (None, three.len()));
    }
}
