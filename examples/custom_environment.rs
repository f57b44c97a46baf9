//! A custom environment, and a team that learns in it with an algorithm of the library.
//!
//! A walker on a line starts at 0 and goes left or right. It gets the reward 1 when it reaches +5.
//!
//! Run with `cargo run --release --example custom_environment`.

use std::error::Error;

use seedbed::env::{Action, Choice, Environment, Quantity, Status, TaskSpec};
use seedbed::learn::agent::TeamConfig;
use seedbed::learn::algorithms::Algorithm;
use seedbed::learn::team::{LearningTiming, TeamContext};
use seedbed::random::Stream;
use seedbed::run::training::{Trainer, TrainingSettings};

/// Copies of the environment, each a line with one walker.
struct Line {
    spec: TaskSpec,
    positions: Vec<f32>,
    /// Steps since the reset, per copy.
    steps: Vec<u32>,
    rewards: Vec<f32>,
    statuses: Vec<Status>,
}

impl Line {
    fn new(copies: usize) -> Self {
        let quantity = |name: &str, range| Quantity {
            name: name.to_owned(),
            unit: String::new(),
            range,
        };
        let step = Action {
            quantity: quantity("step", [-1.0, 1.0]),
            choice: Choice::Discrete(vec![-1.0, 1.0]),
        };
        let mut spec = TaskSpec::new("line", vec![quantity("x", [-10.0, 10.0])], vec![step]);
        spec.time_limit = 20;
        Self {
            spec,
            positions: vec![0.0; copies],
            steps: vec![0; copies],
            rewards: vec![0.0; copies],
            statuses: vec![Status::Idle; copies],
        }
    }
}

impl Environment for Line {
    fn spec(&self) -> &TaskSpec {
        &self.spec
    }

    fn copies(&self) -> usize {
        self.positions.len()
    }

    fn reset(&mut self, copy: usize, _: &mut Stream) {
        self.positions[copy] = 0.0;
        self.steps[copy] = 0;
        self.statuses[copy] = Status::Running;
    }

    fn step(&mut self, actions: &[f32]) {
        for (copy, &action) in actions.iter().enumerate() {
            if self.statuses[copy] != Status::Running {
                continue;
            }
            self.positions[copy] += if action == 1.0 { 1.0 } else { -1.0 };
            self.steps[copy] += 1;
            let is_at_goal = self.positions[copy] == 5.0;
            self.rewards[copy] = if is_at_goal { 1.0 } else { 0.0 };
            self.statuses[copy] = if is_at_goal {
                Status::Terminated
            } else if self.steps[copy] == self.spec.time_limit {
                Status::Truncated
            } else {
                Status::Running
            };
        }
    }

    fn observations(&self) -> &[f32] {
        &self.positions
    }

    fn rewards(&self) -> &[f32] {
        &self.rewards
    }

    fn statuses(&self) -> &[Status] {
        &self.statuses
    }

    // Each round begins with a reset of all copies, so a checkpoint needs no state of them.
    fn save(&self, _: usize) -> Vec<u8> {
        Vec::new()
    }

    fn restore(&mut self, _: usize, _: &[u8]) -> Result<(), String> {
        Ok(())
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let environment = Line::new(4);
    let algorithm = Algorithm::SeedPg(Box::default());
    let team = algorithm.config().build(&TeamContext {
        run_seed: 0,
        config: &TeamConfig::default(),
        local_agents: None,
        spec: environment.spec(),
        timing: LearningTiming::AfterEpisodes,
        record_advantages: false,
    });
    let settings = TrainingSettings::default();
    let mut trainer = Trainer::new(Box::new(environment), team, settings);
    while !trainer.is_done() {
        trainer.advance()?;
    }
    let success_rate = trainer.measures().final_return().unwrap_or_default();
    println!("share of the last 25 episodes that reach the goal: {success_rate:.2}");
    assert!(
        success_rate > 0.9,
        "the team has not learned to reach the goal"
    );
    Ok(())
}
