//! A custom algorithm: hill climbing.
//!
//! Each agent has a linear policy. It tries a random change of its weights for an episode, and
//! keeps the change if the return is not lower than the best return so far. An algorithm only has
//! to implement [`Agent`].
//!
//! Run with `cargo run --release --example custom_algorithm`, and its test with
//! `cargo test --example custom_algorithm`.

use std::error::Error;
use std::path::Path;

use rand_distr::{Distribution, StandardNormal};
use seedbed::env::{Physics, TaskSpec};
use seedbed::learn::agent::UpdateReport;
use seedbed::learn::agent::{ActScratch, ActionRandom, Agent, AgentContext, TeamConfig, Update};
use seedbed::learn::experience::{Episode, Experience};
use seedbed::learn::nn::Tensor;
use seedbed::learn::team::{IndependentLearners, LearningTiming, TeamContext};
use seedbed::random::{Purpose, stream};
use seedbed::run::training::{Trainer, TrainingSettings};

/// An agent with a linear policy for two actions, and the best weights that it has found so far.
struct HillClimber {
    run_seed: u64,
    agent: u32,
    weights: Vec<f32>,
    best_weights: Vec<f32>,
    best_return: f64,
}

impl HillClimber {
    fn new(context: &AgentContext<'_>) -> Self {
        let width = context.spec.observation_width();
        Self {
            run_seed: context.run_seed,
            agent: context.agent,
            weights: vec![0.0; width],
            best_weights: vec![0.0; width],
            best_return: f64::NEG_INFINITY,
        }
    }
}

impl Agent for HillClimber {
    fn act(
        &self,
        observation: &[f32],
        _: &mut ActionRandom,
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
        let mut own_episodes = experience
            .new_episodes
            .iter()
            .filter(|episode| episode.agent == self.agent);
        let episode_return = own_episodes.next().map_or(0.0, Episode::total_reward);
        if episode_return >= self.best_return {
            self.best_return = episode_return;
            self.best_weights.clone_from(&self.weights);
        }
        // Run seed, purpose, agent and round determine the stream of random numbers, so a run gives
        // the same bits for any number of threads.
        let mut random = stream(
            self.run_seed,
            Purpose::Shuffle,
            self.agent,
            experience.earlier_updates,
        );
        for (weight, best_weight) in self.weights.iter_mut().zip(&self.best_weights) {
            let change: f32 = StandardNormal.sample(&mut random);
            *weight = best_weight + 0.5 * change;
        }
        UpdateReport::default().into()
    }

    fn is_finite(&self) -> bool {
        self.weights.iter().all(|weight| weight.is_finite())
    }

    fn tensors(&self) -> Vec<Tensor<'_>> {
        vec![Tensor {
            name: "policy.weight".to_owned(),
            shape: vec![self.best_weights.len(), 1],
            values: self.best_weights.as_slice().into(),
        }]
    }

    // This example never resumes a run, so its checkpoints are empty.
    fn save(&self) -> Vec<u8> {
        Vec::new()
    }

    fn restore(&mut self, _: &[u8]) -> Result<(), String> {
        Ok(())
    }
}

/// Trains a team on the cart-pole task, and returns the mean return over all agents and their last
/// 25 episodes.
fn final_return(agents: u32, run_seed: u64) -> Result<f64, Box<dyn Error>> {
    let task = seedbed::env::load(Path::new("envs/cartpole.ron"))?;
    let environment = seedbed::env::build(&task, Physics::Analytic, agents as usize)?;
    let config = TeamConfig {
        count: u64::from(agents).try_into()?,
        ..TeamConfig::default()
    };
    let spec: &TaskSpec = environment.spec();
    let context = TeamContext {
        run_seed,
        config: &config,
        local_agents: None,
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
    Ok(trainer.measures().final_return().unwrap_or_default())
}

fn main() -> Result<(), Box<dyn Error>> {
    println!("mean return: {:.1}", final_return(8, 0)?);
    Ok(())
}

#[cfg(test)]
mod tests {
    /// Random actions have a mean return of about 22; the maximum is 200.
    #[test]
    fn hill_climbing_learns() {
        let mean_return = super::final_return(8, 1).expect("the task file is valid");
        assert!(mean_return > 100.0, "{mean_return}");
    }
}
