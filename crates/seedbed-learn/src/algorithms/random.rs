//! Random actions, which do not depend on what an agent sees: the baseline for learning algorithms, and what a task of
//! exploration must be hard for.

use rand::RngExt;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{AlgorithmConfig, RandomActions, ScheduleError, ScheduleKind};
use crate::agent::action_random::{ActionDraw, draw_duration};
use crate::agent::action_selection::ActionNoise;
use crate::agent::{ActScratch, ActionRandom, Agent, Update, UpdateReport};
use crate::experience::Experience;
use crate::math::ln;
use crate::nn::Tensor;
use crate::rl::correlated_noise::CorrelatedNoise;
use crate::rl::gaussian;
use crate::team::{IndependentLearners, Team, TeamContext};
use seedbed_env::{Action, Choice, TaskSpec};

/// Uniformly random actions: the baseline for learning algorithms.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub struct Random {}

impl Random {
    /// The only configuration: the algorithm has no parameters.
    pub const DEFAULT: Self = Self {};
}

/// Noise that does not depend on what an agent sees: what a task of exploration must be hard for. A continuous action is the
/// middle of its range plus half of the range times noise of mean 0 and variance 1, and is kept in its range. A discrete action is
/// drawn uniformly, and then repeated.
#[derive(Clone, Copy, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OpenLoopNoise {
    /// How the noise is correlated over the steps of an episode: `White`, `Pink`, `OrnsteinUhlenbeck(time: …)` with a time in s, or
    /// `Constant`. Choices are repeated for n steps with a probability in proportion to 1/n² (`Pink`; Dabney et al. 2021), are kept
    /// with probability exp(−step/time) (`OrnsteinUhlenbeck`), or for the whole episode.
    pub noise: ActionNoise,
}

impl Default for OpenLoopNoise {
    fn default() -> Self {
        Self {
            noise: ActionNoise::Pink,
        }
    }
}

impl AlgorithmConfig for OpenLoopNoise {
    fn build(&self, context: &TeamContext<'_>) -> Box<dyn Team> {
        let noise = Some(self.noise);
        IndependentLearners::build(context, |agent| RandomAgent::new(noise, agent.spec))
    }

    fn check_schedule(&self, _: ScheduleKind) -> Result<(), ScheduleError> {
        Ok(())
    }

    fn random_actions(&self) -> RandomActions {
        RandomActions {
            are_correlated: self.noise != ActionNoise::White,
            are_open_loop: true,
        }
    }

    fn cost_per_step(&self, _: u32) -> f64 {
        0.0
    }
}

impl AlgorithmConfig for Random {
    fn build(&self, context: &TeamContext<'_>) -> Box<dyn Team> {
        IndependentLearners::build(context, |agent| RandomAgent::new(None, agent.spec))
    }

    fn check_schedule(&self, _: ScheduleKind) -> Result<(), ScheduleError> {
        Ok(())
    }

    fn random_actions(&self) -> RandomActions {
        RandomActions {
            are_correlated: false,
            are_open_loop: true,
        }
    }

    fn cost_per_step(&self, _: u32) -> f64 {
        0.0
    }
}

/// An agent that chooses actions at random and does not learn.
pub struct RandomAgent {
    /// How the noise is correlated; `None`: actions are uniform.
    kind: Option<ActionNoise>,
    /// The noise of continuous actions.
    noise: Option<CorrelatedNoise>,
    actions: Vec<Action>,
    /// Time between two actions, s.
    control_step: f32,
}

impl RandomAgent {
    /// A random agent for a task. `kind`: how the noise is correlated; `None`: actions are uniform
    #[must_use]
    pub fn new(kind: Option<ActionNoise>, spec: &TaskSpec) -> Self {
        let mut actions = spec.actions.iter();
        let has_continuous = actions.any(|action| action.choice == Choice::Continuous);
        let noise = kind.filter(|_| has_continuous);
        Self {
            kind,
            noise: noise.map(|noise| noise.for_task(spec)),
            actions: spec.actions.clone(),
            control_step: spec.control_step as f32,
        }
    }

    /// The index of a choice, which may be repeated in the next steps.
    fn choose(&self, component: usize, choices: usize, random: &mut ActionRandom) -> usize {
        random.repeated_choice(component).unwrap_or_else(|| {
            let choice = random.stream.random_range(0..choices);
            let duration = self.duration(random);
            random.repeat(component, choice, duration - 1);
            choice
        })
    }

    /// For how many steps a new choice is made.
    fn duration(&self, random: &mut ActionRandom) -> u32 {
        match self.kind {
            None | Some(ActionNoise::White) => 1,
            Some(ActionNoise::Pink) => draw_duration(&mut random.stream),
            Some(ActionNoise::OrnsteinUhlenbeck { time }) => {
                // ln(u) / ln(exp(−step/time)) is exponential with mean time/step.
                let uniform: f32 = 1.0 - random.stream.random::<f32>();
                ((-ln(uniform) * time.get_f32() / self.control_step) as u32).saturating_add(1)
            }
            Some(ActionNoise::Constant) => u32::MAX,
        }
    }

    /// A continuous action and the logarithm of its density, before it is kept in its range.
    fn draw(&self, [low, high]: [f32; 2], draw: &mut ActionDraw<'_>) -> (f32, f32) {
        let half = 0.5 * (high - low);
        if self.kind.is_none() {
            let action = draw.stream().random_range(low..=high);
            return (action, -ln(high - low));
        }
        let normal = draw.normal();
        let action = (0.5 * (low + high) + half * normal).clamp(low, high);
        (action, gaussian::log_density(normal, 0.0, 0.0) - ln(half))
    }
}

impl Agent for RandomAgent {
    fn act(
        &self,
        _: &[f32],
        random: &mut ActionRandom,
        _: &mut ActScratch,
        action: &mut [f32],
        log_prob: &mut [f32],
    ) {
        for (index, component) in self.actions.iter().enumerate() {
            if let Choice::Discrete(values) = &component.choice {
                action[index] = self.choose(index, values.len(), random) as f32;
                log_prob[index] = -entropy(component);
            }
        }
        let mut draw = random.begin_action(self.noise.as_ref(), self.actions.len());
        for (index, component) in self.actions.iter().enumerate() {
            if component.choice == Choice::Continuous {
                (action[index], log_prob[index]) = self.draw(component.quantity.range, &mut draw);
            }
        }
    }

    fn update(&mut self, _: &Experience<'_>) -> Update {
        let is_uniform = self.kind.is_none();
        let entropy = is_uniform.then(|| self.actions.iter().map(entropy).sum());
        Update::from(UpdateReport {
            entropy,
            ..UpdateReport::default()
        })
    }

    fn is_finite(&self) -> bool {
        true
    }

    fn tensors(&self) -> Vec<Tensor<'_>> {
        Vec::new()
    }

    fn save(&self) -> Vec<u8> {
        Vec::new()
    }

    fn restore(&mut self, _: &[u8]) -> Result<(), String> {
        Ok(())
    }
}

/// Entropy of the uniform distribution of one component of an action, nats: the logarithm of the
/// number of choices, or of the length of the range.
fn entropy(component: &Action) -> f32 {
    match &component.choice {
        Choice::Discrete(values) => ln(values.len() as f32),
        Choice::Continuous => ln(component.quantity.range[1] - component.quantity.range[0]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_input::numbers::ranged_number;
    use seedbed_random::{Purpose, stream};

    /// The choices of `steps` steps of an episode, of two, 0.1 s apart.
    fn choices(kind: Option<ActionNoise>, episode: u32, steps: usize) -> Vec<f32> {
        let quantity = seedbed_env::Quantity {
            name: "push".to_owned(),
            unit: String::new(),
            range: [0.0, 1.0],
        };
        let choice = Choice::Discrete(vec![0.0, 1.0]);
        let actions = vec![Action { quantity, choice }];
        let mut spec = TaskSpec::new("test", Vec::new(), actions);
        spec.control_step = 0.1;
        let agent = RandomAgent::new(kind, &spec);
        let mut random = ActionRandom::from(stream(3, Purpose::Action, 0, episode));
        let mut chosen = Vec::new();
        for _ in 0..steps {
            let (mut action, mut log_prob) = ([0.0], [0.0]);
            let scratch = &mut ActScratch::default();
            agent.act(&[], &mut random, scratch, &mut action, &mut log_prob);
            assert!((log_prob[0] + std::f32::consts::LN_2).abs() < 1e-6);
            chosen.push(action[0]);
        }
        chosen
    }

    /// Half of the new choices differ from the one before. There is a new one in each step, and with noise of 1 s in a share of
    /// 1 − exp(−0.1) = 0.0952 of the steps. Tolerances are six standard errors of independent steps.
    #[test]
    fn choices_are_repeated_as_long_as_the_noise_lasts() {
        let time = ranged_number(1.0);
        for (kind, expected) in [
            (None, 0.5),
            (Some(ActionNoise::White), 0.5),
            (Some(ActionNoise::OrnsteinUhlenbeck { time }), 0.0476),
        ] {
            let chosen = choices(kind, 0, 20_000);
            let changes = chosen.windows(2).filter(|pair| pair[0] != pair[1]).count();
            let (share, error) = (changes as f64 / 2e4, (expected / 2e4_f64).sqrt());
            assert!((share - expected).abs() < 6.0 * error, "{kind:?}: {share}");
        }
    }

    #[test]
    fn one_choice_lasts_for_an_episode() {
        let of_episodes = [0, 1, 2, 3, 4, 5].map(|episode| {
            let chosen = choices(Some(ActionNoise::Constant), episode, 100);
            assert!(chosen.iter().all(|&choice| choice == chosen[0]));
            chosen[0]
        });
        assert!(of_episodes.contains(&0.0) && of_episodes.contains(&1.0));
    }

    /// A correlation time beyond all numbers of steps keeps a choice, too.
    #[test]
    fn noise_may_be_slower_than_every_episode() {
        let time = ranged_number(1e30);
        let chosen = choices(Some(ActionNoise::OrnsteinUhlenbeck { time }), 0, 100);
        assert!(chosen.iter().all(|&choice| choice == chosen[0]));
    }
}
