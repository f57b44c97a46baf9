//! Runs that share an environment have the results of runs alone, to the bit.

use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};

use seedbed::env::TaskSpec;
use seedbed::experiment::measure::Measure;
use seedbed::experiment::run_result::RunResult;
use seedbed::experiment::{
    Experiment, RunControl, RunEnding, RunQueue, RunRequest, StopRule, load,
};
use seedbed::run::recorder::RecorderFactory;
use seedbed::run::{Observer, Options, RunError};
use seedbed::study::design::plan::StudyPlan;
use seedbed::study::design::run_source::ScenarioRuns;
use seedbed::study::execute::runner::{self, FinishedRun};
use seedbed::study::store::StudyFolder;
use seedbed_settings::Settings;

/// Number of first episodes whose visited states are sampled.
const WINDOWS: [u32; 2] = [3, 1000];

const FIRST_RUN_SEED: u64 = 1000;

/// Hands out run seeds from [`FIRST_RUN_SEED`] on, and keeps the results.
struct Queue {
    next_index: usize,
    count: usize,
    results: Vec<Option<Result<RunResult, String>>>,
}

impl RunQueue for Queue {
    fn next(&mut self) -> Option<RunRequest> {
        (self.next_index < self.count).then(|| {
            let index = self.next_index;
            self.next_index += 1;
            RunRequest {
                index,
                run_seed: FIRST_RUN_SEED + index as u64,
                windows: WINDOWS.to_vec(),
            }
        })
    }

    fn finish(&mut self, request: &RunRequest, outcome: Result<RunResult, String>) {
        let earlier = &mut self.results[request.index];
        assert_eq!(*earlier, None, "a run is finished once");
        *earlier = Some(outcome);
    }
}

fn experiment(scenario: &str, overrides: &[&str]) -> Arc<dyn Experiment> {
    let overrides: Vec<String> = overrides.iter().map(|&text| text.to_owned()).collect();
    let loaded = load(&Path::new("scenarios").join(scenario), &overrides);
    loaded.unwrap().experiment
}

fn results_together(
    experiment: &dyn Experiment,
    places: usize,
    runs: usize,
    rule: StopRule,
) -> Vec<Result<RunResult, String>> {
    let mut queue = Queue {
        next_index: 0,
        count: runs,
        results: vec![None; runs],
    };
    let never = AtomicBool::new(false);
    let control = RunControl::without_checkpoints(&never);
    experiment.measure_together(places, rule, &mut queue, control);
    let results = queue.results.into_iter();
    results
        .map(|result| result.expect("all runs are finished"))
        .collect()
}

fn results_alone(
    experiment: &dyn Experiment,
    runs: usize,
    rule: StopRule,
) -> Vec<Result<RunResult, String>> {
    let never = AtomicBool::new(false);
    let control = RunControl::without_checkpoints(&never);
    (FIRST_RUN_SEED..)
        .take(runs)
        .map(|run_seed| {
            let result = experiment.measure_once(run_seed, rule, &WINDOWS, control);
            result
                .map(|result| result.expect("not interrupted"))
                .map_err(|error| error.to_string())
        })
        .collect()
}

/// Seven runs in three places, so that places are taken again while other runs go on.
fn assert_equal_bits(experiment: &dyn Experiment, rule: StopRule) {
    assert!(experiment.runs_together() > 1, "{}", experiment.name());
    let alone = results_alone(experiment, 7, rule);
    let together = results_together(experiment, 3, 7, rule);
    for (index, (alone, together)) in alone.iter().zip(&together).enumerate() {
        assert_eq!(bits(alone), bits(together), "{} {index}", experiment.name());
    }
}

/// All numbers of a result as text in which NaN equals NaN.
fn bits(result: &Result<RunResult, String>) -> String {
    format!("{result:?}")
}

#[test]
fn runs_of_rigid_bodies_have_the_bits_of_runs_alone() {
    for (scenario, overrides) in [
        ("cartpole_1.ron", &["stop=Episodes(30)"][..]),
        ("cartpole.ron", &["stop=Episodes(12)"]),
        (
            "cartpole.ron",
            &["stop=Episodes(12)", "schedule=Synchronous(episodes: 3)"],
        ),
    ] {
        assert_equal_bits(&*experiment(scenario, overrides), StopRule::Scenario);
    }
}

/// Runs whose tasks differ, because each draws the reward of a step. It is the mean reward of all
/// episodes of the run.
#[test]
fn runs_of_drawn_tasks_have_the_bits_of_runs_alone() {
    let folder = tempfile::tempdir().unwrap();
    let task = r#"Environment(
        extends: "ENVS/cartpole.ron",
        drawn_per_run: [(name: "pay", value: Uniform(1.0, 2.0))],
        reward: "pay",
    )"#;
    let envs = std::env::current_dir().unwrap().join("envs");
    let path = folder.path().join("drawn.ron");
    std::fs::write(&path, task.replace("ENVS", envs.to_str().unwrap())).unwrap();
    let environment = format!("environment={path:?}");
    let experiment = experiment("cartpole.ron", &[&environment, "stop=Episodes(6)"]);
    assert_equal_bits(&*experiment, StopRule::Scenario);
    let runs = results_together(&*experiment, 3, 7, StopRule::Scenario);
    let mut paid: Vec<u32> = Vec::new();
    for (run_seed, run) in (FIRST_RUN_SEED..).zip(runs) {
        let pay = pay_of(&path, run_seed);
        for agent in run.unwrap().returns {
            let steps = agent.iter().map(|total| total / f64::from(pay));
            steps.for_each(|steps| assert!((steps - steps.round()).abs() < 1e-3, "{steps}"));
        }
        paid.push(pay.to_bits());
    }
    paid.sort_unstable();
    paid.dedup();
    assert_eq!(paid.len(), 7, "each run draws its own reward");
}

fn pay_of(task: &Path, run_seed: u64) -> f32 {
    let task = seedbed::env::load(task).unwrap();
    let task = task.for_run(run_seed);
    task.body_task().unwrap().run_constants[0].value
}

#[test]
fn runs_that_learn_during_episodes_have_the_bits_of_runs_alone() {
    let overrides = ["stop=Episodes(20)", "agents.count=3"];
    assert_equal_bits(
        &*experiment("cartpole_q.ron", &overrides),
        StopRule::Scenario,
    );
}

#[test]
fn runs_of_analytic_models_have_the_bits_of_runs_alone() {
    let overrides = ["stop=Episodes(4)", "agents.count=2"];
    let vime = experiment("mountain_car_vime.ron", &overrides);
    assert_equal_bits(&*vime, StopRule::Scenario);
}

/// Runs are solved after different numbers of episodes.
#[test]
fn runs_that_end_early_leave_their_places() {
    let fast = experiment("cartpole_fast.ron", &[]);
    assert_equal_bits(&*fast, StopRule::Solved);
}

/// The policy of every run diverges, each after a number of rounds of its own.
#[test]
fn failures_are_those_of_runs_alone() {
    let overrides = ["stop=Episodes(40)", "agents.seeds=Normal(sigma: 1e30)"];
    let diverging = experiment("cartpole_1.ron", &overrides);
    let results = results_alone(&*diverging, 7, StopRule::Scenario);
    assert!(results.iter().all(Result::is_err), "{results:?}");
    assert_equal_bits(&*diverging, StopRule::Scenario);
}

#[test]
fn scenarios_that_gain_nothing_are_run_alone() {
    for scenario in [
        "corridors.ron",
        "cartpole_256.ron",
        "deep_sea_seed_ensemble.ron",
    ] {
        assert_eq!(experiment(scenario, &[]).runs_together(), 1, "{scenario}");
    }
    let asynchronous = ["schedule=Asynchronous(training: (env_steps: 5))"];
    assert_eq!(
        experiment("cartpole_1.ron", &asynchronous).runs_together(),
        1
    );
}

#[test]
fn an_interruption_finishes_no_run() {
    let experiment = experiment("cartpole_1.ron", &["stop=Episodes(30)"]);
    let mut queue = Queue {
        next_index: 0,
        count: 5,
        results: vec![None; 5],
    };
    let interrupted = AtomicBool::new(true);
    let control = RunControl::without_checkpoints(&interrupted);
    experiment.measure_together(3, StopRule::Scenario, &mut queue, control);
    assert_eq!(queue.results, vec![None; 5]);
}

/// An experiment whose run with one run seed panics after it has begun.
#[derive(Debug)]
struct Panicking {
    inner: Arc<dyn Experiment>,
    run_seed: u64,
}

/// The queue of the inner experiment, which panics when the run with this run seed is finished.
struct PanickingQueue<'a> {
    inner: &'a mut dyn RunQueue,
    run_seed: u64,
}

impl RunQueue for PanickingQueue<'_> {
    fn next(&mut self) -> Option<RunRequest> {
        self.inner.next()
    }

    fn finish(&mut self, request: &RunRequest, outcome: Result<RunResult, String>) {
        assert_ne!(request.run_seed, self.run_seed, "together");
        self.inner.finish(request, outcome);
    }
}

impl Experiment for Panicking {
    fn memory(&self) -> u64 {
        self.inner.memory()
    }

    fn measure_once(
        &self,
        run_seed: u64,
        stop_rule: StopRule,
        windows: &[u32],
        control: RunControl<'_>,
    ) -> Result<Option<RunResult>, RunError> {
        assert_ne!(run_seed, self.run_seed, "alone");
        self.inner
            .measure_once(run_seed, stop_rule, windows, control)
    }

    fn measure_together(
        &self,
        places: usize,
        stop_rule: StopRule,
        queue: &mut dyn RunQueue,
        control: RunControl<'_>,
    ) {
        let mut queue = PanickingQueue {
            inner: queue,
            run_seed: self.run_seed,
        };
        self.inner
            .measure_together(places, stop_rule, &mut queue, control);
    }

    fn runs_together(&self) -> usize {
        self.inner.runs_together()
    }

    fn name(&self) -> &str {
        self.inner.name()
    }

    fn run_seed(&self) -> u64 {
        self.inner.run_seed()
    }

    fn spec(&self) -> &TaskSpec {
        self.inner.spec()
    }

    fn task_definition(&self) -> String {
        self.inner.task_definition()
    }

    fn agents(&self) -> u32 {
        self.inner.agents()
    }

    fn max_episodes(&self) -> u32 {
        self.inner.max_episodes()
    }

    fn settings(&self) -> Settings {
        self.inner.settings()
    }

    fn learning_cost(&self) -> f64 {
        self.inner.learning_cost()
    }

    fn measure_obstacle(&self, measure: Measure) -> Option<(&'static str, &'static str)> {
        self.inner.measure_obstacle(measure)
    }

    fn run_in_folder(
        &self,
        options: &Options,
        recording: Option<Box<dyn RecorderFactory>>,
        observer: &mut dyn Observer,
        interrupted: &AtomicBool,
    ) -> Result<RunEnding, RunError> {
        self.inner
            .run_in_folder(options, recording, observer, interrupted)
    }
}

/// A panic ends the run that causes it; the runs in the same world are repeated alone, and those
/// that wait begin as usual.
#[test]
fn a_panic_fails_one_run_only() {
    let folder = tempfile::tempdir().unwrap();
    let study = folder.path().join("panic.ron");
    let scenario = std::env::current_dir()
        .unwrap()
        .join("scenarios/cartpole_1.ron");
    let text = format!(
        r#"Study(title: "A panic", scenario: {scenario:?}, set: ["stop=Episodes(3)"], cells: [(name: "only")], repeats: 9)"#
    );
    std::fs::write(&study, text).unwrap();
    let mut plan = StudyPlan::load(&study, false).unwrap();
    let overrides = ["stop=Episodes(3)".to_owned()];
    let inner = load(&scenario, &overrides).unwrap().experiment;
    let run_seed = FIRST_RUN_SEED + 4;
    plan.cells[0].source = Arc::new(ScenarioRuns::new(Arc::new(Panicking { inner, run_seed })));
    let store = StudyFolder::new(folder.path().join("out"));
    store.write_manifest(&plan).unwrap();
    let failures = Mutex::new(Vec::new());
    let on_finished = |finished: &FinishedRun<'_>| {
        let failure = finished.failure.map(str::to_owned);
        failures
            .lock()
            .unwrap()
            .push((finished.run.run_seed, failure));
    };
    let runs = plan.runs();
    let never = AtomicBool::new(false);
    let control = RunControl::without_checkpoints(&never);
    runner::run(&runs, &store, 2, control, &on_finished).unwrap();
    let mut failures = failures.into_inner().unwrap();
    failures.sort();
    let seeds: Vec<u64> = failures.iter().map(|(run_seed, _)| *run_seed).collect();
    assert_eq!(
        seeds,
        (FIRST_RUN_SEED..FIRST_RUN_SEED + 9).collect::<Vec<_>>()
    );
    for (seed, failure) in &failures {
        let is_expected = match failure {
            Some(failure) => {
                *seed == run_seed && failure.starts_with("panicked") && failure.contains("alone")
            }
            None => *seed != run_seed,
        };
        assert!(is_expected, "{seed}: {failure:?}");
    }
    assert!(runs.iter().all(|run| store.stored_run(run).is_some()));
}
