//! An algorithm of one's own: hill climbing, from nothing.
//!
//! Each agent has a linear policy. It tries a random change of its weights for an episode, and keeps
//! the change if the return is not lower than the best so far. Everything that training needs
//! is in the implementation of [`Agent`].
//!
//! Run with `cargo run --release --example custom_algorithm`, and its test with
//! `cargo test --example custom_algorithm`.

use std::error::Error;
use std::path::Path;

use rand_distr::{Distribution, StandardNormal};
use seedbed::env::random::{Purpose, Stream, stream};
use seedbed::env::{Physics, Spec};
use seedbed::learn::agent::UpdateReport;
use seedbed::learn::agent::{ActScratch, Agent, AgentContext, TeamConfig, Tensor, Update};
use seedbed::learn::experience::{Episode, Experience};
use seedbed::learn::team::{IndependentLearners, LearningTiming, TeamContext};
use seedbed::run::trainer::{Trainer, TrainingSettings};

/// A linear policy over two actions, and the best one so far.
struct HillClimber {
    run_seed: u64,
    agent: u32,
    weights: Vec<f32>,
    best: Vec<f32>,
    best_return: f64,
}

impl HillClimber {
    fn new(context: &AgentContext<'_>) -> Self {
        let width = context.spec.observation_width();
        Self {
            run_seed: context.run_seed,
            agent: context.agent,
            weights: vec![0.0; width],
            best: vec![0.0; width],
            best_return: f64::NEG_INFINITY,
        }
    }
}

impl Agent for HillClimber {
    fn act(
        &self,
        observation: &[f32],
        _: &mut Stream,
        _: &mut ActScratch,
        action: &mut [f32],
        log_prob: &mut [f32],
    ) {
        let products = observation.iter().zip(&self.weights).map(|(x, w)| x * w);
        action[0] = if products.sum::<f32>() > 0.0 {
            1.0
        } else {
            0.0
        };
        log_prob[0] = 0.0;
    }

    fn update(&mut self, experience: &Experience<'_>) -> Update {
        let mut own = experience
            .new_episodes
            .iter()
            .filter(|episode| episode.agent == self.agent);
        let total = own.next().map_or(0.0, Episode::total_reward);
        if total >= self.best_return {
            self.best_return = total;
            self.best.clone_from(&self.weights);
        }
        // Randomness comes from a stream named by run seed, purpose, agent and round, so that a
        // run gives the same bits on any number of threads.
        let mut random = stream(
            self.run_seed,
            Purpose::Shuffle,
            self.agent,
            experience.earlier_updates,
        );
        for (weight, best) in self.weights.iter_mut().zip(&self.best) {
            let change: f32 = StandardNormal.sample(&mut random);
            *weight = best + 0.5 * change;
        }
        UpdateReport::default().into()
    }

    fn is_finite(&self) -> bool {
        self.weights.iter().all(|weight| weight.is_finite())
    }

    fn tensors(&self) -> Vec<Tensor<'_>> {
        vec![Tensor {
            name: "policy.weight".to_owned(),
            shape: vec![self.best.len(), 1],
            values: self.best.as_slice().into(),
        }]
    }

    // A run of this example is never interrupted.
    fn save(&self) -> Vec<u8> {
        Vec::new()
    }

    fn restore(&mut self, _: &[u8]) -> Result<(), String> {
        Ok(())
    }
}

/// The mean over agents of the last 25 returns, on CartPole.
fn final_return(agents: u32, run_seed: u64) -> Result<f64, Box<dyn Error>> {
    let task = seedbed::env::load(Path::new("envs/cartpole.ron"))?;
    let environment = seedbed::env::build(&task, Physics::Analytic, agents as usize)?;
    let config = TeamConfig {
        count: u64::from(agents).try_into()?,
        ..TeamConfig::default()
    };
    let spec: &Spec = environment.spec();
    let context = TeamContext {
        run_seed,
        config: &config,
        spec,
        timing: LearningTiming::AfterEpisodes,
        record_advantages: false,
    };
    let team = IndependentLearners::build(&context, HillClimber::new);
    let settings = TrainingSettings {
        run_seed,
        ..TrainingSettings::default()
    };
    let mut trainer = Trainer::new(environment, team, settings);
    while !trainer.is_done() {
        trainer.advance()?;
    }
    Ok(trainer.measures().recent_return(25).unwrap_or_default())
}

fn main() -> Result<(), Box<dyn Error>> {
    println!("mean return: {:.1}", final_return(8, 0)?);
    Ok(())
}

#[cfg(test)]
mod tests {
    /// A random policy earns about 22 per episode, at most 200 are possible.
    #[test]
    fn hill_climbing_learns() {
        let found = super::final_return(8, 1).expect("the task is there");
        assert!(found > 100.0, "{found}");
    }
}
