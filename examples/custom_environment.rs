//! An environment of one's own, and a team of the library that learns it.
//!
//! A walker on a line starts at 0, goes left or right, and is paid when it stands at +5.
//!
//! Run with `cargo run --release --example custom_environment`.

use std::error::Error;

use seedbed::env::random::Stream;
use seedbed::env::{Action, Choice, Environment, Quantity, Spec, Status};
use seedbed::learn::agent::TeamConfig;
use seedbed::learn::algorithms::Algorithm;
use seedbed::learn::team::{LearningTiming, TeamContext};
use seedbed::run::trainer::{Trainer, TrainingSettings};

/// Copies of the line.
struct Line {
    spec: Spec,
    positions: Vec<f32>,
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
        let mut spec = Spec::new("line", vec![quantity("x", [-10.0, 10.0])], vec![step]);
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
    fn spec(&self) -> &Spec {
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
            let arrived = self.positions[copy] == 5.0;
            self.rewards[copy] = if arrived { 1.0 } else { 0.0 };
            self.statuses[copy] = if arrived {
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

    // Nothing of this environment outlives a round, so a checkpoint needs nothing of it.
    fn save(&self) -> Vec<u8> {
        Vec::new()
    }

    fn restore(&mut self, _: &[u8]) -> Result<(), String> {
        Ok(())
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let environment = Line::new(4);
    let algorithm = Algorithm::SeedPg(Box::default());
    let team = algorithm.config().build(&TeamContext {
        run_seed: 0,
        config: &TeamConfig::default(),
        spec: environment.spec(),
        timing: LearningTiming::AfterEpisodes,
        record_advantages: false,
    });
    let settings = TrainingSettings::default();
    let mut trainer = Trainer::new(Box::new(environment), team, settings);
    while !trainer.is_done() {
        trainer.advance()?;
    }
    let reached = trainer.measures().recent_return(25).unwrap_or_default();
    println!("share of the last 25 episodes that reach the goal: {reached:.2}");
    assert!(reached > 0.9, "a team that learns finds the goal");
    Ok(())
}
