//! Recordings of teams that learn: they hold what the agents' own episodes hold, whatever the
//! number of threads.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use seedbed::record::recording::RecordingFile;
use seedbed::record::table::TableFiles;
use seedbed::run::folder::RunFolder;
use seedbed::run::trainer::Trainer;
use seedbed::run::{Observer, Options, Plan, Progress, RecorderFactories, RunOutcome, execute};
use seedbed_env::Choice;
use seedbed_learn::experience::{Episode, StepData};

use super::contents::RecordingContents;
use super::{assert_times, outcome_text};

/// Three agents with curiosity that play two episodes a round, all numbers of which are on record.
const CURIOUS: [&str; 5] = [
    "agents.count=3",
    "stop=Episodes(8)",
    "schedule=Synchronous(episodes: 2)",
    "algorithm.bonus=Vime(seeds: Shift)",
    "recording.axes=[Observations, Advantage()]",
];

/// Agents that do not wait for each other, with several continuous actions at once.
const HOPPING: [&str; 4] = [
    "environment=\"hopper\"",
    "agents.count=2",
    "stop=Episodes(4)",
    "schedule=Asynchronous(training: (env_steps: 30))",
];

struct Nobody;

impl Observer for Nobody {
    fn begun(&mut self, _: &Progress) {}

    fn round_finished(&mut self, _: &Progress) {}
}

fn plan(overrides: &[&str]) -> Plan {
    let overrides: Vec<String> = overrides.iter().map(|text| (*text).to_owned()).collect();
    Plan::load(Path::new("scenarios/cartpole.ron"), &overrides).unwrap()
}

fn factories(folder: &RunFolder) -> RecorderFactories {
    let tables = TableFiles {
        folder: folder.path().to_owned(),
    };
    let recording = RecordingFile {
        path: folder.recording(),
        live: None,
    };
    vec![Box::new(tables), Box::new(recording)]
}

fn recorded(plan: &Plan, folder: &Path, threads: usize) -> RecordingContents {
    let folder = RunFolder::new(folder);
    let _lock = folder.lock().unwrap();
    let options = Options {
        folder: folder.clone(),
        resume: false,
        threads,
    };
    let ending = execute(
        plan,
        &options,
        factories(&folder),
        &mut Nobody,
        &AtomicBool::new(false),
    )
    .unwrap();
    assert!(matches!(ending, RunOutcome::Finished(_)));
    RecordingContents::read(&folder.recording())
}

/// What one agent played and learned.
#[derive(Clone, Default)]
struct AgentHistory {
    episodes: Vec<Episode>,
    step_data: Vec<StepData>,
}

/// The history of each agent, from the team itself.
fn played(plan: &Plan) -> Vec<AgentHistory> {
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
fn a_recording_holds_what_the_agents_saw_and_did() {
    for overrides in [&CURIOUS[..], &HOPPING[..]] {
        let (folder, plan) = (tempfile::tempdir().unwrap(), plan(overrides));
        let (contents, agents) = (recorded(&plan, folder.path(), 2), played(&plan));
        assert_ne!(
            agents[0].episodes[0].observations, agents[1].episodes[0].observations,
            "agents that do the same could be mistaken"
        );
        for (agent, history) in agents.iter().enumerate() {
            assert_eq!(
                history.episodes.len(),
                plan.scenario.max_episodes() as usize
            );
            compare(&plan, &contents, &format!("/raw/agent_{agent}"), history);
        }
    }
}

/// Every number of every episode, in order; an episode's end has a last observation and nothing
/// else.
fn compare(plan: &Plan, contents: &RecordingContents, entity: &str, history: &AgentHistory) {
    let AgentHistory {
        episodes,
        step_data,
    } = history;
    compare_observations_and_actions(plan, contents, entity, episodes);
    compare_rewards(plan, contents, entity, episodes);
    compare_step_data(plan, contents, entity, step_data);
    let episodes: Vec<&Episode> = episodes.iter().collect();
    assert_times(&episodes, contents, entity);
    let outcomes: Vec<&str> = episodes
        .iter()
        .map(|episode| outcome_text(episode))
        .collect();
    assert_eq!(contents.texts(entity, "State:outcome"), outcomes);
}

/// Component `index` of the values of each step, of which each step has `width`.
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

fn compare_observations_and_actions(
    plan: &Plan,
    contents: &RecordingContents,
    entity: &str,
    episodes: &[Episode],
) {
    let spec = plan.description.spec();
    let column = |name: &str| contents.f32_values(entity, &format!("State:{name}"));
    for (index, quantity) in spec.observations.iter().enumerate() {
        let width = spec.observations.len();
        let seen = component(episodes, |episode| &episode.observations, index, width);
        assert_eq!(column(&quantity.name), seen, "{entity} {}", quantity.name);
    }
    for (index, action) in spec.actions.iter().enumerate() {
        let width = spec.actions.len();
        let mut done = component(episodes, |episode| &episode.actions, index, width);
        if let Choice::Discrete(values) = &action.choice {
            for action in &mut done {
                *action = values[*action as usize];
            }
        }
        let name = &action.quantity.name;
        assert_eq!(column(name), done, "{entity} {name}");
    }
}

fn compare_rewards(plan: &Plan, contents: &RecordingContents, entity: &str, episodes: &[Episode]) {
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
}

fn compare_step_data(
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
fn any_number_of_threads_gives_the_same_recording() {
    for overrides in [&CURIOUS[..], &HOPPING[..]] {
        let (folder, plan) = (tempfile::tempdir().unwrap(), plan(overrides));
        let [one, three] = [1, 3].map(|threads| {
            recorded(&plan, &folder.path().join(threads.to_string()), threads).columns()
        });
        assert!(
            one.contains_key("/raw/agent_1 State:reward")
                && one.contains_key("/visitation/agent_1/latest DepthImage:buffer")
        );
        let share_difference = one
            .iter()
            .find(|(name, rows)| three.get(*name) != Some(rows))
            .map(|(name, _)| name);
        assert_eq!((share_difference, one.len()), (None, three.len()));
    }
}
