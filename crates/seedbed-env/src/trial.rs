//! Tries a task: a few episodes with extreme and with random actions, which show what its physics cannot
//! compute before a run does.

use rand::RngExt;

use super::description::{BodyTask, TaskDescription};
use super::{Choice, Environment, Physics, Status, TaskSpec, build, caught_panic, parameters};
use seedbed_random::{Purpose, Stream, stream};

/// Maximum number of steps of the trial, each of all copies.
const MAX_STEPS: u64 = 200;

/// Maximum work of the trial: constraints that are solved.
const MAX_WORK: u64 = 4_000_000;

/// How a copy acts in the trial.
#[derive(Clone, Copy)]
enum Actions {
    /// All actions have their lowest or first value.
    Lowest,
    /// All actions have their highest or last value.
    Highest,
    /// Each action has its lowest or highest value, drawn again after this number of steps.
    Extremes(u64),
    /// Each action is drawn in each step.
    Random,
}

const TRIED: [Actions; 6] = [
    Actions::Lowest,
    Actions::Highest,
    Actions::Extremes(1),
    Actions::Extremes(10),
    Actions::Random,
    Actions::Random,
];

/// What the physics of a task cannot compute well, as far as its numbers and a short trial show; empty if
/// all is well. The same task has the same warnings everywhere.
#[must_use]
pub fn physics_warnings(description: &TaskDescription, physics: Physics) -> Vec<String> {
    let Some(task) = description.body_task() else {
        return Vec::new();
    };
    let mut warnings = parameters::warnings(task);
    let tried = caught_panic(|| try_task(description, physics, task));
    warnings.extend(tried.unwrap_or_else(|reason| {
        Some(format!(
            "the physics engine fails in a short trial: {reason}"
        ))
    }));
    warnings
}

/// The first warning of a trial.
fn try_task(description: &TaskDescription, physics: Physics, task: &BodyTask) -> Option<String> {
    let steps = (MAX_WORK / work_of_step(task)).min(MAX_STEPS);
    let mut environment = build(description, physics, TRIED.len()).ok()?;
    let mut random = stream(0, Purpose::Trial, 0, 0);
    let spec = environment.spec().clone();
    let mut actions = vec![0.0; TRIED.len() * spec.action_width()];
    for step in 0..steps {
        for copy in 0..TRIED.len() {
            if environment.statuses()[copy] != Status::Running {
                environment.reset(copy, &mut random);
            }
        }
        let rows = actions.chunks_exact_mut(spec.action_width().max(1));
        for (kind, row) in TRIED.iter().zip(rows) {
            kind.choose(step, &spec, row, &mut random);
        }
        environment.step(&actions);
        let found = TRIED.iter().enumerate();
        let mut found = found.filter_map(|(copy, kind)| {
            warning_of(&*environment, copy).map(|found| format!("with {}, {found}", kind.name()))
        });
        if let Some(warning) = found.next() {
            return Some(warning);
        }
    }
    None
}

/// What is wrong in the latest step of a copy.
fn warning_of(environment: &dyn Environment, copy: usize) -> Option<String> {
    if let Some(warning) = environment.physics_warning(copy) {
        return Some(format!("in step {}, {}", warning.step, warning.message));
    }
    let reward = environment.rewards()[copy];
    (!reward.is_finite()).then(|| {
        format!(
            "the reward is {reward}: check for divisions by 0, roots and logarithms in its formula"
        )
    })
}

/// An estimate of the constraints that are solved in a step of all copies.
fn work_of_step(task: &BodyTask) -> u64 {
    let solver = task.solver;
    let solved = [
        solver.substeps,
        solver.solver_iterations,
        solver.contact_updates,
    ]
    .map(u64::from)
    .iter()
    .product::<u64>();
    let parts = 1 + task.bodies.len() + task.joints.len() + task.colliders.len();
    solved * (parts * TRIED.len()) as u64
}

impl Actions {
    fn name(self) -> &'static str {
        match self {
            Self::Lowest => "all actions at their minimum",
            Self::Highest => "all actions at their maximum",
            Self::Extremes(_) => "random actions at their minimum or maximum",
            Self::Random => "random actions",
        }
    }

    fn choose(self, step: u64, spec: &TaskSpec, row: &mut [f32], random: &mut Stream) {
        for (action, chosen) in spec.actions.iter().zip(row) {
            let [low, high] = match &action.choice {
                Choice::Discrete(values) => [0.0, (values.len() - 1) as f32],
                Choice::Continuous => action.quantity.range,
            };
            let is_high = random.random_bool(0.5);
            let number = match &action.choice {
                Choice::Discrete(values) => random.random_range(0..values.len()) as f32,
                Choice::Continuous => random.random_range(low..=high),
            };
            *chosen = match self {
                Self::Lowest => low,
                Self::Highest => high,
                Self::Extremes(held) if !step.is_multiple_of(held) => *chosen,
                Self::Extremes(_) => [low, high][usize::from(is_high)],
                Self::Random => number,
            };
        }
    }
}
