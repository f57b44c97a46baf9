//! Training as an experiment: a team that learns in rounds.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::sync::{Mutex, PoisonError};

use super::{
    Experiment, MeasuredRound, RunControl, RunEnding, RunQueue, RunReport, RunRequest, StopRule,
    measure_one_by_one,
};
use crate::experiment::COST_PER_MINUTE;
use crate::experiment::checkpoint::RunCheckpoint;
use crate::experiment::measure::{Measure, Needs};
use crate::experiment::run_result::{MeasuredRun, RunResult};
use crate::record::table::TableFiles;
use crate::run::execution::stopping::with_grace;
use crate::run::facts::EpisodeRow;
use crate::run::facts::{FINAL_WINDOW, Summary};
use crate::run::folder::Contents;
use crate::run::measures::RoundRows;
use crate::run::ranks::Ranks;
use crate::run::recorder::RecorderFactory;
use crate::run::training::shared_world::{SharedWorld, runs_per_world};
use crate::run::training::{RoundFailure, Trainer};
use crate::run::{
    self, Observer, Options, Plan, Progress, RecorderFactories, RunError, RunOutcome,
};
use crate::scenario::recording::RecordingSettings;
use crate::scenario::{Scenario, Schedule, TaskReference};
use crate::text::pluralize;
use seedbed_env::TaskSpec;
use seedbed_env::gymnasium::{GymnasiumTask, check_start};
use seedbed_input::numbers::{ranged_count, ranged_number};
use seedbed_input::{Located, limits};
use seedbed_learn::agent::bonus::{Bonus, PaidFor};
use seedbed_learn::algorithms::RandomActions;
use seedbed_settings::Settings;

/// Settings of tasks by the texts of their files. Many cells of a study have the same task, and to find what has its
/// default a text is read once for each of its fields.
static TASK_SETTINGS: Mutex<BTreeMap<String, Settings>> = Mutex::new(BTreeMap::new());

/// [`seedbed_env::task_settings`], computed once for each text.
fn task_settings(text: &str) -> Settings {
    let known = || TASK_SETTINGS.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(settings) = known().get(text) {
        return settings.clone();
    }
    let settings = seedbed_env::task_settings(text);
    known().insert(text.to_owned(), settings.clone());
    settings
}

/// A text as a setting.
fn text_setting(text: &str) -> Settings {
    Settings::of(&format!("{text:?}")).expect("a text in quotes is RON")
}

impl Experiment for Plan {
    fn name(&self) -> &str {
        &self.name
    }

    fn run_seed(&self) -> u64 {
        self.scenario.seed
    }

    fn spec(&self) -> &TaskSpec {
        self.description.spec()
    }

    fn walls(&self) -> Vec<Vec<[f32; 2]>> {
        Self::walls(self)
    }

    fn task_definition(&self) -> String {
        self.environment_text.clone()
    }

    fn memory(&self) -> u64 {
        Self::memory(self).total()
    }

    fn warnings(&self) -> Vec<String> {
        let scenario = &self.scenario;
        let has_no_signal = scenario.algorithm.config().learns_from_rewards_only()
            && scenario.agents.seeds.sigma() == 0.0;
        let no_signal = has_no_signal.then(|| {
            "with `value_scale: 0`, no bonus and no reward seeds, policies do not change before an agent \
             receives a reward; such agents are no baseline of learning"
                .to_owned()
        });
        let task = self.description.for_run(scenario.seed);
        let physics = seedbed_env::physics_warnings(&task, scenario.physics);
        no_signal
            .into_iter()
            .chain(physics)
            .chain(self.repeatability_warning())
            .collect()
    }

    fn repeatability_warning(&self) -> Option<String> {
        let gymnasium = self.description.gymnasium()?;
        gymnasium.repeatability_warning()
    }

    fn check_start(&self) -> Result<(), RunError> {
        match self.description.gymnasium() {
            Some(task) => Ok(check_start(task).map_err(RoundFailure::from)?),
            None => Ok(()),
        }
    }

    /// Rounds of which each agent learns from the episodes of all agents have K² such pairs.
    fn round_cost_note(&self) -> Option<String> {
        const MIN_MINUTES: f64 = 0.5;
        let (agents, episodes) = (f64::from(self.agents()), f64::from(self.max_episodes()));
        let minutes = self.cost() / COST_PER_MINUTE / episodes;
        if minutes < MIN_MINUTES {
            return None;
        }
        let learns_from_all = self.learning_cost() >= agents && agents > 1.0;
        let reason = if learns_from_all {
            format!(
                ": each of {agents} agents learns from the episodes of all, which are {} pairs",
                agents * agents
            )
        } else {
            String::new()
        };
        Some(format!(
            "a round may take up to about {} on one core, for one episode per agent at full length{reason}",
            duration_text(minutes)
        ))
    }

    fn agents(&self) -> u32 {
        self.scenario.agents.count.get()
    }

    fn max_episodes(&self) -> u32 {
        self.scenario.max_episodes()
    }

    fn random_actions(&self) -> RandomActions {
        self.scenario.algorithm.config().random_actions()
    }

    fn paid_for(&self) -> PaidFor {
        let bonus = self.scenario.algorithm.config().bonus();
        bonus.map_or(PaidFor::Nothing, Bonus::paid_for)
    }

    fn settings(&self) -> Settings {
        let scenario = with_defaults_except_for_learning(self.scenario.clone(), 0);
        let task = task_settings(&self.environment_text);
        let settings =
            seedbed_input::settings_of::<Scenario>(&scenario.resolved()).with("task", task);
        let task = self.description.gymnasium();
        match task.and_then(GymnasiumTask::package_files) {
            Some(files) => settings.with("task.files", text_setting(files)),
            None => settings,
        }
    }

    fn learning_cost(&self) -> f64 {
        let config = self.scenario.algorithm.config();
        config.cost_per_step(self.scenario.agents.count.get())
    }

    fn measure_obstacle(&self, measure: Measure) -> Option<(&'static str, &'static str)> {
        let has_threshold = self.scenario.stop.threshold(self.spec()).is_some();
        match measure.needs() {
            Needs::Tables => Some((
                "regret is known only for tabular tasks",
                "expected another measure, or a tabular scenario",
            )),
            Needs::Threshold | Needs::Goal if !has_threshold => Some((
                "its task has no threshold at which it counts as solved",
                "expected another measure, `reward_threshold` in its task, or `stop: Solved(return: …, at_most: …)` in its scenario",
            )),
            _ => None,
        }
    }

    fn measure_once(
        &self,
        run_seed: u64,
        stop_rule: StopRule,
        windows: &[u32],
        control: RunControl<'_>,
    ) -> Result<Option<RunResult>, RunError> {
        let scenario = with_defaults_except_for_learning(self.scenario.clone(), run_seed);
        let new_trainer = || Trainer::from_scenario(&scenario, &self.description, 1);
        let checkpoint = own_checkpoint(self, run_seed, windows, control, 1);
        let (mut trainer, mut run) = ActiveRun::begin(new_trainer, run_seed, windows, checkpoint)?;
        let measured = with_grace(control.interrupted, |cancellation| {
            cancellation.run(|| {
                while !is_done(&trainer, stop_rule) {
                    let is_interrupted = control.is_interrupted();
                    run.update_checkpoint(&trainer, is_interrupted);
                    if is_interrupted {
                        return Ok(None);
                    }
                    let round = trainer.advance();
                    let rows = round.map_err(|diverged| located(self, diverged))?.rows;
                    run.measured.add_round(&trainer, &rows);
                    report_round(self, run_seed, &trainer, &rows, control);
                }
                Ok(Some(run.measured.finish()))
            })
        });
        // A long round was abandoned: the checkpoint is of the round before it.
        measured.unwrap_or(Ok(None))
    }

    fn runs_together(&self) -> usize {
        runs_per_world(&self.scenario, &self.description)
    }

    fn measure_together(
        &self,
        places: usize,
        stop_rule: StopRule,
        queue: &mut dyn RunQueue,
        control: RunControl<'_>,
    ) {
        let world = if places > 1 && self.runs_together() > 1 {
            SharedWorld::new(&self.scenario, &self.description, places).ok()
        } else {
            None
        };
        match world {
            Some(world) => with_grace(control.interrupted, |cancellation| {
                // Of rounds that are abandoned, there are no results.
                cancellation.run(|| measure_in_world(self, world, stop_rule, queue, control));
            }),
            None => measure_one_by_one(self, stop_rule, queue, control),
        }
    }

    fn run_in_folder(
        &self,
        options: &Options,
        recording: Option<Box<dyn RecorderFactory>>,
        observer: &mut dyn Observer,
        interrupted: &AtomicBool,
    ) -> Result<RunEnding, RunError> {
        let mut recorder_factories: RecorderFactories = vec![Box::new(TableFiles {
            folder: options.folder.path().to_owned(),
        })];
        recorder_factories.extend(recording);
        let ending = run::execute(self, options, recorder_factories, observer, interrupted)?;
        Ok(match ending {
            RunOutcome::Finished(summary) => RunEnding::Finished(report(&summary, options)),
            RunOutcome::Interrupted { rounds } => RunEnding::Interrupted {
                after: pluralize(rounds as usize, "round"),
                can_resume: options.folder.contents() == Contents::UnfinishedRun,
            },
            RunOutcome::Elsewhere => RunEnding::Elsewhere,
        })
    }

    fn ranks_obstacle(&self, ranks: Ranks) -> Option<String> {
        let agents = self.scenario.agents.count.get();
        if matches!(self.scenario.schedule, Schedule::Asynchronous { .. }) {
            return Some(
                "`schedule: Asynchronous` lets agents learn while others play, in an order that only one \
                 process knows; use `Synchronous` or `Lockstep`"
                    .to_owned(),
            );
        }
        (agents < ranks.count()).then(|| {
            let (agents, ranks) = (pluralize(agents as usize, "agent"), ranks.count());
            format!("it has {agents}; expected at least one for each of the {ranks} ranks")
        })
    }
}

/// Measures the runs of `queue` in the places of a world. A place whose run has ended is taken by
/// the next run. If they are interrupted, each run plays to the end of its round, in which it has its
/// checkpoint.
fn measure_in_world(
    plan: &Plan,
    mut world: SharedWorld,
    stop_rule: StopRule,
    queue: &mut dyn RunQueue,
    control: RunControl<'_>,
) {
    let mut runs: Vec<Option<(RunRequest, ActiveRun<'_>)>> = Vec::new();
    runs.resize_with(world.places(), || None);
    loop {
        if !control.is_interrupted() {
            take_free_places(plan, &mut world, &mut runs, queue, control);
        }
        let Some((place, round)) = world.advance() else {
            return;
        };
        let Some((request, mut run)) = runs[place].take() else {
            continue;
        };
        let trainer = world.trainer(place);
        let round = round.map(|round| {
            run.measured.add_round(trainer, &round.rows);
            report_round(plan, request.run_seed, trainer, &round.rows, control);
        });
        if round.is_err() || is_done(trainer, stop_rule) {
            let failure = round.map_err(|diverged| located(plan, diverged).to_string());
            world.end(place);
            queue.finish(&request, failure.map(|()| run.measured.finish()));
            continue;
        }
        let is_interrupted = control.is_interrupted();
        run.update_checkpoint(trainer, is_interrupted);
        if is_interrupted {
            world.end(place);
        } else {
            runs[place] = Some((request, run));
        }
    }
}

/// Passes a round on, if anyone wants to know.
fn report_round(
    plan: &Plan,
    run_seed: u64,
    trainer: &Trainer,
    rows: &RoundRows,
    control: RunControl<'_>,
) {
    if let Some(on_round) = control.on_round {
        on_round(&MeasuredRound {
            digest: control.digest,
            run_seed,
            progress: &Progress::of(plan, trainer),
            rows,
        });
    }
}

/// The error of a run without a folder, with the place of the formula in the file of its task.
fn located(plan: &Plan, diverged: RoundFailure) -> RoundFailure {
    let file = format!("{}.ron", plan.description.spec().name);
    diverged.located_in(Path::new(&file), &plan.environment_text)
}

/// Begins runs of `queue` in the free places of a world.
fn take_free_places<'a>(
    plan: &Plan,
    world: &mut SharedWorld,
    runs: &mut [Option<(RunRequest, ActiveRun<'a>)>],
    queue: &mut dyn RunQueue,
    control: RunControl<'a>,
) {
    while world.has_free_place()
        && let Some(request) = queue.next()
    {
        let scenario = with_defaults_except_for_learning(plan.scenario.clone(), request.run_seed);
        let new_trainer = || Ok(world.new_trainer(&scenario));
        let (run_seed, windows) = (request.run_seed, &request.windows);
        let checkpoint = own_checkpoint(plan, run_seed, windows, control, world.places());
        let begun = ActiveRun::begin(new_trainer, run_seed, windows, checkpoint);
        let (trainer, run) = begun.unwrap_or_else(|never: Infallible| match never {});
        let place = world.begin(trainer);
        runs[place] = Some((request, run));
    }
}

/// The checkpoint of a run that begins, if it keeps one. `together`: number of runs that share a
/// thread.
fn own_checkpoint<'a>(
    plan: &Plan,
    run_seed: u64,
    windows: &[u32],
    control: RunControl<'a>,
    together: usize,
) -> Option<RunCheckpoint<'a>> {
    let checkpoints = control.checkpoints?;
    let identity = (control.digest.to_owned(), run_seed, windows);
    checkpoints.of_run(identity, plan.scenario.max_episodes(), together)
}

/// A run that is being measured. Its trainer is elsewhere.
struct ActiveRun<'a> {
    measured: MeasuredRun,
    checkpoint: Option<RunCheckpoint<'a>>,
}

impl<'a> ActiveRun<'a> {
    /// Begins a run, or continues it from its checkpoint.
    ///
    /// # Errors
    /// If the trainer cannot be built.
    fn begin<E>(
        new_trainer: impl Fn() -> Result<Trainer, E>,
        run_seed: u64,
        windows: &[u32],
        mut checkpoint: Option<RunCheckpoint<'a>>,
    ) -> Result<(Trainer, Self), E> {
        let resumed = match &mut checkpoint {
            Some(checkpoint) => checkpoint.resume(&new_trainer)?,
            None => None,
        };
        let (trainer, measured) = if let Some(resumed) = resumed {
            resumed
        } else {
            let trainer = new_trainer()?;
            let measured = MeasuredRun::begin(&trainer, run_seed, windows);
            (trainer, measured)
        };
        let run = Self {
            measured,
            checkpoint,
        };
        Ok((trainer, run))
    }

    /// See [`RunCheckpoint::update`].
    fn update_checkpoint(&mut self, trainer: &Trainer, is_interrupted: bool) {
        if let Some(checkpoint) = &mut self.checkpoint {
            checkpoint.update(trainer, &self.measured, is_interrupted);
        }
    }
}

fn is_done(trainer: &Trainer, stop_rule: StopRule) -> bool {
    match stop_rule {
        StopRule::Scenario => trainer.is_done(),
        StopRule::Maximum => trainer.has_played_enough(),
        StopRule::Solved => trainer.has_played_enough() || trainer.is_solved(),
    }
}

/// The scenario with another run seed, and with defaults for everything that learning does not
/// depend on.
fn with_defaults_except_for_learning(mut scenario: Scenario, run_seed: u64) -> Scenario {
    scenario.recording = RecordingSettings {
        scene: None,
        ..RecordingSettings::default()
    };
    scenario.name = Located::default();
    if scenario.environment.named().is_none() {
        // The settings of the task are elsewhere, without those that learning does not depend on.
        let name = scenario.environment.task_name().into_owned();
        scenario.environment = TaskReference::Named(name).into();
    }
    scenario.checkpoint_every = ranged_count(1);
    scenario.checkpoint_share = ranged_number(1.0);
    scenario.seed = run_seed;
    scenario
}

/// Result that is printed for tasks without a threshold.
pub const NO_THRESHOLD: &str = "no threshold set (`reward_threshold` or `stop: Solved`)";

fn report(summary: &Summary, options: &Options) -> RunReport {
    let last = pluralize(FINAL_WINDOW.min(summary.episodes_per_agent), "episode");
    let final_return = summary.final_return.map_or("–".to_owned(), three_digits);
    let mut report = RunReport {
        episodes_per_agent: summary.episodes_per_agent,
        env_steps: summary.env_steps,
        lines: vec![
            ("solved", solved_text(summary)),
            (
                "return",
                format!("{final_return} (mean over all agents and the last {last})"),
            ),
            ("coverage", coverage_text(summary)),
            ("results", options.folder.path().display().to_string()),
        ],
    };
    let warning = summary.repeatability_warning.clone();
    report
        .lines
        .extend(warning.map(|warning| ("note", warning)));
    let [episodes, _] = options.folder.table_files();
    if let Some(hint) = no_signal_hint(summary, &episodes) {
        report.lines.push(("note", hint));
    }
    report
}

/// Number of equal returns that are no accident.
const MIN_EQUAL_RETURNS: usize = 20;

/// What to read if all returns are the same, so that agents had nothing to learn from; `None` if they
/// are not, or if the task is solved. `episodes`: the table of episodes
fn no_signal_hint(summary: &Summary, episodes: &Path) -> Option<String> {
    let table = limits::open_regular(episodes).ok()?;
    let mut rows = csv::Reader::from_reader(table).into_deserialize();
    let first: EpisodeRow = rows.next()?.ok()?;
    let (mut count, value) = (1_usize, first.r#return);
    for row in rows {
        let row: EpisodeRow = row.ok()?;
        if row.r#return != value {
            return None;
        }
        count += 1;
    }
    let min_count = if value == 0.0 { 2 } else { MIN_EQUAL_RETURNS };
    let is_suspicious = count >= min_count && summary.episodes_until_solved.is_none();
    is_suspicious.then(|| {
        format!(
            "all {count} returns are {value}: agents had nothing to learn from, except bonuses if they have any; \
             the page docs/learning_problems.md says what to change, such as a bonus for exploration"
        )
    })
}

fn duration_text(minutes: f64) -> String {
    match minutes {
        minutes if minutes < 1.5 => "a minute".to_owned(),
        minutes if minutes < 90.0 => format!("{minutes:.0} minutes"),
        minutes => format!("{:.0} hours", minutes / 60.0),
    }
}

/// At least three significant digits, and at least one decimal.
fn three_digits(value: f64) -> String {
    let decimals = if value != 0.0 && value.abs() < 1.0 {
        3
    } else {
        1
    };
    format!("{value:.decimals$}")
}

fn solved_text(summary: &Summary) -> String {
    let Some(criterion) = summary.solved_at else {
        return NO_THRESHOLD.to_owned();
    };
    // Thresholds are stored in single precision; as f64 they would print spurious digits.
    let threshold = criterion.r#return as f32;
    let window = pluralize(criterion.window, "episode");
    match summary.episodes_until_solved {
        Some(episodes) => {
            let episodes = pluralize(episodes, "episode");
            format!("after {episodes} per agent: mean return over {window} reached {threshold}")
        }
        None => format!("no: mean return over {window} did not reach {threshold}"),
    }
}

fn coverage_text(summary: &Summary) -> String {
    const MAX_SHOWN_AGENTS: usize = 8;
    let percent = |fraction: &f64| format!("{:.1} %", 100.0 * fraction);
    let agents: Vec<String> = summary
        .coverage
        .iter()
        .take(MAX_SHOWN_AGENTS)
        .map(percent)
        .collect();
    let more = if summary.coverage.len() > MAX_SHOWN_AGENTS {
        " …"
    } else {
        ""
    };
    format!(
        "{}{more} of the state space per agent; {} for the whole team",
        agents.join(", "),
        percent(&summary.team_coverage.unwrap_or_default())
    )
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::experiment::load;

    fn digest(overrides: &[&str]) -> String {
        let overrides: Vec<String> = overrides.iter().map(|&text| text.to_owned()).collect();
        load(Path::new("scenarios/cartpole.ron"), &overrides)
            .unwrap_or_else(|error| panic!("{error}"))
            .experiment
            .digest()
    }

    /// Stored runs are found by their digests.
    #[test]
    fn the_digest_does_not_depend_on_recording_settings() {
        assert_eq!(
            digest(&["seed=7", "checkpoint_every=3", "checkpoint_share=0.5"]),
            digest(&[])
        );
        assert_eq!(
            digest(&[
                "recording.window=7",
                "recording.lines=10",
                "recording.scene=None"
            ]),
            digest(&[])
        );
        assert_ne!(digest(&["agents.count=5"]), digest(&[]));
        // 0.001 is the default of an optimizer, but not of this one.
        let with_step_size = |step_size: &str| {
            let setting = format!("algorithm.policy_optimizer.step_size={step_size}");
            digest(&["environment=pendulum", "algorithm=SeedSac()", &setting])
        };
        let usual = digest(&["environment=pendulum", "algorithm=SeedSac()"]);
        assert_eq!(with_step_size("0.0003"), usual);
        assert_ne!(with_step_size("0.001"), usual);
        // The window of `stop` has the same name, but learning depends on it.
        assert_ne!(
            digest(&["stop=Solved(return: 1, window: 50, at_most: 99)"]),
            digest(&["stop=Solved(return: 1, window: 51, at_most: 99)"])
        );
    }
}
