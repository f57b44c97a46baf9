//! Trainers of what a scenario describes.

use super::{Trainer, TrainingSettings, number_agents};
use crate::run::ranks::Ranks;
use crate::run::training::team_on_ranks::team_on_ranks;
use crate::run::training::thread_count;
use crate::scenario::{Scenario, Schedule, StepsOf};
use seedbed_env::{Environment, Physics, TaskDescription, TaskSpec, build_with_workers};
use seedbed_input::InputError;
use seedbed_learn::team::{LearningTiming, Team, TeamContext};

impl Trainer {
    /// The team and the environment that a scenario describes. A task that is drawn per run is drawn
    /// with the scenario's run seed.
    ///
    /// # Errors
    /// The task cannot be built as the scenario asks.
    pub fn from_scenario(
        scenario: &Scenario,
        description: &TaskDescription,
        threads: usize,
    ) -> Result<Self, InputError> {
        Self::on_ranks(scenario, description, threads, Ranks::SINGLE)
    }

    /// Like [`from_scenario`](Self::from_scenario), with the part of the team that belongs to this
    /// rank.
    ///
    /// # Errors
    /// The task cannot be built as the scenario asks.
    pub fn on_ranks(
        scenario: &Scenario,
        description: &TaskDescription,
        threads: usize,
        ranks: Ranks,
    ) -> Result<Self, InputError> {
        let description = description.for_run(scenario.seed);
        let environments = build_groups(&description, scenario, threads, ranks)?;
        let team = build_team(scenario, description.spec(), ranks);
        let team = team_on_ranks(team, ranks);
        let settings = TrainingSettings {
            ranks,
            ..training_settings(scenario, threads)
        };
        Ok(Self::with_groups(environments, team, settings))
    }

    /// Lets the team act in another task with the same observations and actions. It cannot learn there.
    ///
    /// # Errors
    /// The task cannot be built as the scenario asks.
    pub(crate) fn move_to(
        &mut self,
        description: &TaskDescription,
        scenario: &Scenario,
    ) -> Result<(), InputError> {
        let description = description.for_run(scenario.seed);
        let environments =
            build_groups(&description, scenario, self.settings.threads, Ranks::SINGLE)?;
        let first = &environments[0];
        (self.spec, self.scene) = (first.spec().clone(), first.scene().cloned());
        self.groups = number_agents(environments, 0);
        Ok(())
    }

    /// The team that a scenario describes, for one thread and copies in a shared world. Bodies are
    /// not recorded.
    pub(in crate::run) fn in_shared_world(scenario: &Scenario, spec: &TaskSpec) -> Self {
        let settings = TrainingSettings {
            scene: None,
            ..training_settings(scenario, 1)
        };
        let team = build_team(scenario, spec, Ranks::SINGLE);
        Self::without_copies(spec.clone(), None, team, settings)
    }
}

/// The part of the team that a scenario describes which belongs to a rank.
fn build_team(scenario: &Scenario, spec: &TaskSpec, ranks: Ranks) -> Box<dyn Team> {
    let local_agents = ranks.local_agents(scenario.agents.count.get());
    scenario.algorithm.config().build(&TeamContext {
        run_seed: scenario.seed,
        config: &scenario.agents,
        local_agents: Some((local_agents.start, local_agents.end)),
        spec,
        timing: learning_timing(scenario.schedule),
        record_advantages: scenario.recording.has_advantages(),
    })
}

fn training_settings(scenario: &Scenario, threads: usize) -> TrainingSettings {
    TrainingSettings {
        run_seed: scenario.seed,
        schedule: scenario.schedule,
        stop: scenario.stop.clone(),
        scene: scenario.recording.scene.clone(),
        transitions_kept: scenario.algorithm.transitions_kept(),
        compares_bonuses: scenario.algorithm.compares_bonuses(),
        threads,
        ranks: Ranks::SINGLE,
    }
}

fn learning_timing(schedule: Schedule) -> LearningTiming {
    match schedule {
        Schedule::Lockstep {
            learn_every,
            steps_of,
        } => match steps_of {
            StepsOf::Agent => LearningTiming::EverySteps(learn_every.get()),
            StepsOf::Team => LearningTiming::EveryTransitions(learn_every.get()),
        },
        Schedule::Synchronous { .. } | Schedule::Asynchronous { .. } => {
            LearningTiming::AfterEpisodes
        }
    }
}

/// The groups of copies of a scenario's environment. Worker processes are divided over the groups.
fn build_groups(
    description: &TaskDescription,
    scenario: &Scenario,
    threads: usize,
    ranks: Ranks,
) -> Result<Vec<Box<dyn Environment>>, InputError> {
    let sizes = group_sizes(description, scenario, threads, ranks);
    let workers = worker_count(description, scenario, threads, ranks).div_ceil(sizes.len());
    let build = |copies| build_with_workers(description, scenario.physics, copies, workers);
    sizes.into_iter().map(build).collect()
}

/// Number of worker processes of all groups; 0 if the environment needs none.
fn worker_count(
    description: &TaskDescription,
    scenario: &Scenario,
    threads: usize,
    ranks: Ranks,
) -> usize {
    let agents = ranks.local_agents(scenario.agents.count.get()).len();
    description.worker_count(agents, thread_count(threads))
}

/// Numbers of copies of the groups in which a scenario's environment is built. Rigid bodies that
/// share a world are divided as little as possible, because every world has a cost of its own in
/// each step. A thread waits for at least one worker process. Other copies are divided into more groups
/// than threads, so that all threads are busy to the end of a round.
fn group_sizes(
    description: &TaskDescription,
    scenario: &Scenario,
    threads: usize,
    ranks: Ranks,
) -> Vec<usize> {
    let agents = ranks.local_agents(scenario.agents.count.get()).len();
    if matches!(scenario.schedule, Schedule::Asynchronous { .. }) {
        return vec![agents];
    }
    let workers = worker_count(description, scenario, threads, ranks);
    let threads = thread_count(threads);
    let groups = if workers > 0 {
        threads.min(workers)
    } else if threads == 1 || shares_rapier_world(description, scenario) {
        threads
    } else {
        GROUPS_PER_THREAD * threads
    };
    let groups = groups.min(agents);
    let first_of_group = |group: usize| group * agents / groups;
    (0..groups)
        .map(|group| first_of_group(group + 1) - first_of_group(group))
        .collect()
}

/// Whether the copies of a scenario's environment are rigid bodies in one world of Rapier.
pub(in crate::run) fn shares_rapier_world(
    description: &TaskDescription,
    scenario: &Scenario,
) -> bool {
    scenario.physics == Physics::Rapier
        && description
            .body_task()
            .is_some_and(|task| !task.needs_own_worlds())
}

/// Groups of copies per thread, if copies do not share a world.
const GROUPS_PER_THREAD: usize = 4;
