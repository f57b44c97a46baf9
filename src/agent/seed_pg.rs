//! Seed-PG: K policies learn from shared experience, each with its own fixed seed (thesis §3.4).
//!
//! Each agent k has its own policy `π_k` and value function `v_k`. A trajectory of agent i is weighed by
//! ρₜ = `π_k(aₜ|sₜ)` / `π_i(aₜ|sₜ)`, and its rewards are perturbed by k's seeds: rₜ₊₁ + `z_{k,t+1}`, with t the step within the episode.
//! One trajectory is one minibatch and one Adam step of each network; ρ, G̃ and A are computed afresh at each.
//!
//! With `policy_data: Own`, `policy_loss: SimplePg` and one agent it is the simple policy gradient of §1.5.2.

use rand::seq::SliceRandom;
use serde::{Deserialize, Serialize};

use super::network::{Learned, Network};
use super::policy::{self, Policy};
use super::{ActScratch, Agent, Membership, Tensor, UpdateReport};
use crate::experience::{Episode, SharedBuffer};
use crate::input::numbers::{Count, Fraction, NonNegative, Positive, PositiveFraction, known, known_count};
use crate::nn::{AdamSettings, Mlp, PopArt};
use crate::random::{Purpose, Stream, stream};
use crate::rl::policy_loss::{self, Surrogate};
use crate::rl::{advantage, returns};
use crate::seed::Seed;

/// What it is for.
pub(super) const PURPOSE: &str =
    "Seed policy gradient (thesis §3.4): K policies learn from shared experience, each with its own fixed seed.";

/// What each parameter means, and what may stand there.
pub(super) const PARAMETERS: [(&str, &str); 13] = [
    ("value_data", "whose trajectories the value function learns from: Shared | Own"),
    ("policy_data", "whose trajectories the policy learns from: Shared | Own"),
    (
        "value_target",
        "what the value function is regressed on: MonteCarlo(importance: PerDecision | Ordinary, ratio_product_cap: Some(c) | None)",
    ),
    ("advantage", "how often the ratio of the action itself counts: MonteCarlo(importance: Single | Double)"),
    ("policy_loss", "what the policy descends: Ppo(clip: ε, clipping: Joint | DimensionWise) | SimplePg"),
    ("returns", "how targets are normalised: PopArt(beta: β) | Raw"),
    ("discount", "γ, 0 to 1"),
    ("hidden", "units of the hidden layers of both networks"),
    ("epochs", "passes over the data of a round"),
    ("regularisation", "λ, the pull of both networks back to their initial parameters"),
    ("initial_deviation", "spread of continuous actions at the start, as a part of half their range"),
    ("policy_optimiser", "Adam of the policy"),
    ("value_optimiser", "Adam of the value function"),
];

/// The configuration of Seed-PG. The defaults are those of §5 of the thesis where it states them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SeedPg {
    /// Whose trajectories the value function learns from.
    pub value_data: Data,
    /// Whose trajectories the policy learns from.
    pub policy_data: Data,
    /// What the value function is regressed on.
    pub value_target: ValueTarget,
    /// How much better than expected an action was.
    pub advantage: AdvantageEstimate,
    /// What the policy descends.
    pub policy_loss: PolicyLoss,
    /// How targets of the value function are normalised.
    pub returns: ReturnNormalisation,
    /// γ
    pub discount: Fraction,
    /// Units of the hidden layers, of both networks.
    pub hidden: Vec<Count<4096>>,
    /// Passes over the data of a round.
    pub epochs: Count<10_000>,
    /// λ, the pull of both networks back to their seeds θ̂ and φ̂.
    pub regularisation: NonNegative,
    /// Spread of continuous actions at the start, as a part of half their range.
    pub initial_deviation: Positive,
    /// The policy's optimiser.
    pub policy_optimiser: AdamSettings,
    /// The value function's optimiser.
    pub value_optimiser: AdamSettings,
}

/// Whose trajectories are learned from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Data {
    /// Those of the whole team.
    Shared,
    /// The agent's own.
    Own,
}

/// What the value function is regressed on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum ValueTarget {
    /// The importance-sampled return of the trajectory (thesis Eq. 17, 18).
    MonteCarlo {
        /// Which ratios weigh which rewards.
        #[serde(default)]
        importance: Importance,
        /// A bound on each product of ratios; `None` as printed.
        #[serde(default = "default_cap")]
        ratio_product_cap: Option<Positive>,
    },
}

/// Which ratios weigh which rewards.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Importance {
    /// Those up to the reward (thesis Eq. 12, 18).
    #[default]
    PerDecision,
    /// Those of the whole rest of the trajectory (thesis Eq. 11).
    Ordinary,
}

/// How much better than expected an action was.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum AdvantageEstimate {
    /// From the same return as the value target.
    MonteCarlo {
        /// How often the ratio of the action itself counts.
        #[serde(default)]
        importance: RatioCount,
    },
}

/// How often the ratio of the action itself counts in the policy's loss.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum RatioCount {
    /// Once, in the loss: A = rₜ₊₁ + `z_{k,t+1}` + γ G̃ₜ₊₁ − v(sₜ).
    #[default]
    Single,
    /// In the loss and in the return, as printed: A = G̃ₜ − v(sₜ).
    Double,
}

/// What the policy descends.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum PolicyLoss {
    /// −min(ρA, clip(ρ, 1−ε, 1+ε) A) (thesis Eq. 21, 23).
    Ppo {
        /// ε
        #[serde(default = "default_clip")]
        clip: NonNegative,
        /// What is clipped where an action has several components.
        #[serde(default)]
        clipping: Clipping,
    },
    /// −log π A (thesis Eq. 20). Sound on the agent's own newest episode only.
    SimplePg,
}

/// What is clipped where an action has several components.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Clipping {
    /// The ratio of the whole action.
    #[default]
    Joint,
    /// The ratio of each component, the losses being summed (Han & Sung 2019, the thesis's reference 16).
    DimensionWise,
}

/// How targets of the value function are normalised.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum ReturnNormalisation {
    /// By running moments (thesis Alg. 1).
    PopArt {
        /// β, how far the moments move at each minibatch.
        #[serde(default = "default_beta")]
        beta: PositiveFraction,
    },
    /// Not at all.
    Raw,
}

impl SeedPg {
    /// Says which parameters contradict each other.
    ///
    /// # Errors
    /// A sentence for the user.
    pub fn check(&self) -> Result<(), String> {
        let on_policy = self.policy_data == Data::Own && self.epochs.get() == 1;
        if self.policy_loss == PolicyLoss::SimplePg && !on_policy {
            return Err("`policy_loss: SimplePg` is sound only with `policy_data: Own` and `epochs: 1`: it does not weigh samples by how \
                        likely the policy is to act so"
                .to_owned());
        }
        if self.hidden.is_empty() {
            return Err("`hidden` names no layer; expected at least one, such as `hidden: [32, 32]`".to_owned());
        }
        Ok(())
    }
}

impl Default for SeedPg {
    fn default() -> Self {
        Self {
            value_data: Data::Shared,
            policy_data: Data::Shared,
            value_target: ValueTarget::MonteCarlo { importance: Importance::PerDecision, ratio_product_cap: default_cap() },
            advantage: AdvantageEstimate::MonteCarlo { importance: RatioCount::Single },
            policy_loss: PolicyLoss::Ppo { clip: default_clip(), clipping: Clipping::Joint },
            returns: ReturnNormalisation::PopArt { beta: default_beta() },
            discount: known(0.99),
            hidden: vec![known_count(32); 2],
            epochs: known_count(1),
            regularisation: known(0.0),
            initial_deviation: known(0.5),
            policy_optimiser: AdamSettings::default(),
            value_optimiser: AdamSettings::default(),
        }
    }
}

#[expect(clippy::unnecessary_wraps, reason = "serde wants the default in the field's own type")]
fn default_cap() -> Option<Positive> {
    Some(known(1.0))
}

fn default_clip() -> NonNegative {
    known(0.2)
}

fn default_beta() -> PositiveFraction {
    known(0.1)
}

/// One agent of Seed-PG.
pub struct SeedPgAgent {
    config: SeedPg,
    run_seed: u64,
    agent: u32,
    /// `z_{k,1} … z_{k,T}`
    reward_seeds: Vec<f32>,
    policy: Policy,
    value: Network,
    normaliser: PopArt,
    work: Workspace,
}

/// Columns over the steps of one trajectory, reused from one to the next: `[T]` each.
#[derive(Default)]
struct Workspace {
    order: Vec<usize>,
    /// `[T × C]`, for each component of an action.
    log_probs: Vec<f32>,
    /// Of whole actions.
    ratios: Vec<f32>,
    rewards: Vec<f32>,
    returns: Vec<f32>,
    products: Vec<f32>,
    values: Vec<f32>,
    advantages: Vec<f32>,
    /// `[T × C]`
    slopes: Vec<f32>,
    value_gradient: Vec<f32>,
}

/// What a checkpoint holds of an agent. The rest derives from the scenario.
#[derive(Serialize, Deserialize)]
struct Saved<L> {
    policy: L,
    value: L,
    normaliser: PopArt,
}

impl SeedPgAgent {
    /// An agent at its seed.
    #[must_use]
    pub fn new(config: &SeedPg, member: &Membership<'_>) -> Self {
        let &Membership { run_seed, agent, team, spec } = member;
        let hidden: Vec<usize> = config.hidden.iter().map(|units| units.get() as usize).collect();
        let policy_shape = policy::shape(spec, &hidden);
        let value_sizes: Vec<usize> = [spec.observation_width()].into_iter().chain(hidden).chain([1]).collect();
        let value_shape = Mlp::new(&value_sizes);
        let seed = Seed::draw(run_seed, agent, team.seeds, team.initial, (&policy_shape, &value_shape), spec.time_limit);
        Self {
            run_seed,
            agent,
            reward_seeds: seed.reward,
            policy: Policy::new(spec, policy_shape, seed.policy, config.policy_optimiser, config.initial_deviation.get_f32()),
            value: Network::new(value_shape, seed.value, config.value_optimiser),
            normaliser: match config.returns {
                ReturnNormalisation::PopArt { beta } => PopArt::new(beta.get()),
                ReturnNormalisation::Raw => PopArt::identity(),
            },
            config: config.clone(),
            work: Workspace::default(),
        }
    }

    /// One minibatch: each network takes at most one step on one trajectory.
    fn learn_from(&mut self, episode: &Episode, totals: &mut Totals) {
        let own = episode.agent == self.agent;
        let learns = |data| data == Data::Shared || own;
        let (value_learns, policy_learns) = (learns(self.config.value_data), learns(self.config.policy_data));
        if episode.length() == 0 || !(value_learns || policy_learns) {
            return;
        }
        self.weigh(episode);
        self.estimate_returns(episode);
        if value_learns {
            let (weight, bias) = self.value.output_layer();
            self.normaliser.update(&self.work.returns, weight, bias);
        }
        self.estimate_values(episode);
        if policy_learns {
            self.improve_policy(episode, totals);
        }
        if value_learns {
            self.improve_value(episode, totals);
        }
    }

    /// ρₜ = `π_k(aₜ|sₜ)` / `π_i(aₜ|sₜ)`.
    fn weigh(&mut self, episode: &Episode) {
        let work = &mut self.work;
        self.policy.evaluate(episode.states(), &episode.actions, &mut work.log_probs);
        let width = work.log_probs.len() / episode.length();
        let rows = work.log_probs.chunks_exact(width).zip(episode.log_probs.chunks_exact(width));
        work.ratios.clear();
        work.ratios.extend(rows.map(|(ours, theirs)| ratio(ours, theirs)));
    }

    /// G̃ₜ of the perturbed rewards rₜ₊₁ + `z_{k,t+1}`.
    fn estimate_returns(&mut self, episode: &Episode) {
        let work = &mut self.work;
        work.rewards.clear();
        work.rewards.extend(episode.rewards.iter().zip(&self.reward_seeds).map(|(reward, seed)| reward + seed));
        work.returns.resize(episode.length(), 0.0);
        let discount = self.config.discount.get_f32();
        let ValueTarget::MonteCarlo { importance, ratio_product_cap } = self.config.value_target;
        let cap = ratio_product_cap.map(Positive::get_f32);
        match importance {
            Importance::PerDecision => {
                returns::per_decision(&work.ratios, &work.rewards, discount, cap, &mut work.products, &mut work.returns);
            }
            Importance::Ordinary => returns::ordinary(&work.ratios, &work.rewards, discount, cap, &mut work.returns),
        }
    }

    /// v(sₜ) = σ Ŷₜ + μ.
    fn estimate_values(&mut self, episode: &Episode) {
        let (deviation, mean) = (self.normaliser.deviation(), self.normaliser.mean());
        let normalised = self.value.forward(episode.states());
        self.work.values.clear();
        self.work.values.extend(normalised.iter().map(|y| deviation.mul_add(*y, mean)));
    }

    fn improve_policy(&mut self, episode: &Episode, totals: &mut Totals) {
        let work = &mut self.work;
        work.advantages.resize(episode.length(), 0.0);
        let AdvantageEstimate::MonteCarlo { importance } = self.config.advantage;
        let discount = self.config.discount.get_f32();
        match importance {
            RatioCount::Single => {
                advantage::monte_carlo_single(&work.rewards, &work.returns, &work.values, discount, &mut work.advantages);
            }
            RatioCount::Double => advantage::monte_carlo_double(&work.returns, &work.values, &mut work.advantages),
        }
        work.slopes.clear();
        let width = work.log_probs.len() / episode.length();
        let rows = work.log_probs.chunks_exact(width).zip(episode.log_probs.chunks_exact(width));
        for ((ours, theirs), (&joint, &advantage)) in rows.zip(work.ratios.iter().zip(&work.advantages)) {
            let mut descend = |surrogate: Surrogate, components: usize| {
                work.slopes.extend(std::iter::repeat_n(surrogate.slope, components));
                totals.policy_sample(&surrogate, components);
            };
            match self.config.policy_loss {
                PolicyLoss::Ppo { clip, clipping: Clipping::Joint } => {
                    descend(policy_loss::ppo(joint, advantage, clip.get_f32()), width);
                }
                PolicyLoss::Ppo { clip, clipping: Clipping::DimensionWise } => {
                    for (ours, theirs) in ours.chunks_exact(1).zip(theirs.chunks_exact(1)) {
                        descend(policy_loss::ppo(ratio(ours, theirs), advantage, clip.get_f32()), 1);
                    }
                }
                PolicyLoss::SimplePg => descend(policy_loss::simple(ours.iter().sum(), advantage), width),
            }
            totals.deviation += f64::from((joint - 1.0).abs());
        }
        totals.policy_steps += episode.length() as u64;
        totals.entropy += f64::from(self.policy.mean_entropy()) * episode.length() as f64;
        let regularisation = self.config.regularisation.get_f32();
        self.policy.descend(episode.states(), &episode.actions, &work.slopes, regularisation);
    }

    /// Descends ½ mean (Ŷₜ − (G̃ₜ − μ)/σ)².
    fn improve_value(&mut self, episode: &Episode, totals: &mut Totals) {
        let work = &mut self.work;
        let (scale, weight) = (1.0 / self.normaliser.deviation(), 1.0 / episode.length() as f32);
        work.value_gradient.clear();
        for (value, target) in work.values.iter().zip(&work.returns) {
            let error = (value - target) * scale;
            totals.value_sample(error);
            work.value_gradient.push(weight * error);
        }
        self.value.descend(episode.states(), &work.value_gradient, self.config.regularisation.get_f32());
    }
}

/// π/μ of one action from the log-probabilities of its components, kept within e^±20.
fn ratio(ours: &[f32], theirs: &[f32]) -> f32 {
    let log_ratio: f32 = ours.iter().zip(theirs).map(|(ours, theirs)| ours - theirs).sum();
    log_ratio.clamp(-20.0, 20.0).exp()
}

impl Agent for SeedPgAgent {
    fn act(&self, observation: &[f32], random: &mut Stream, scratch: &mut ActScratch, action: &mut [f32], log_prob: &mut [f32]) {
        self.policy.sample(observation, random, scratch, action, log_prob);
    }

    fn update(&mut self, buffer: &SharedBuffer, round: u32) -> UpdateReport {
        let episodes = buffer.newest_round();
        let mut random = stream(self.run_seed, Purpose::Shuffle, self.agent, round);
        let mut order = std::mem::take(&mut self.work.order);
        let mut totals = Totals::default();
        for _ in 0..self.config.epochs.get() {
            order.clear();
            order.extend(0..episodes.len());
            order.shuffle(&mut random);
            for &index in &order {
                self.learn_from(&episodes[index], &mut totals);
            }
        }
        self.work.order = order;
        totals.report()
    }

    fn tensors(&self) -> Vec<Tensor<'_>> {
        let moments = [("mean", self.normaliser.mean()), ("deviation", self.normaliser.deviation())];
        let moments =
            moments.map(|(name, moment)| Tensor { name: format!("value.{name}"), shape: vec![1], values: vec![moment].into() });
        self.policy.tensors().chain(self.value.tensors("value")).chain(moments).collect()
    }

    fn save(&self) -> Vec<u8> {
        let (policy, value) = (self.policy.network().learned(), self.value.learned());
        postcard::to_stdvec(&Saved { policy, value, normaliser: self.normaliser }).expect("plain numbers always serialise")
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), String> {
        let saved: Saved<Learned> = postcard::from_bytes(bytes).map_err(|error| error.to_string())?;
        self.policy.network_mut().restore(saved.policy)?;
        self.value.restore(saved.value)?;
        self.normaliser = saved.normaliser;
        Ok(())
    }
}

/// Sums over the samples of one update.
#[derive(Default)]
struct Totals {
    value_steps: u64,
    value_loss: f64,
    policy_steps: u64,
    policy_loss: f64,
    deviation: f64,
    entropy: f64,
    /// Components of actions, and those of them that were clipped.
    components: u64,
    clipped: u64,
}

impl Totals {
    fn value_sample(&mut self, error: f32) {
        self.value_steps += 1;
        self.value_loss += 0.5 * f64::from(error).powi(2);
    }

    fn policy_sample(&mut self, surrogate: &Surrogate, components: usize) {
        self.policy_loss += f64::from(surrogate.loss);
        self.components += components as u64;
        self.clipped += if surrogate.clipped { components as u64 } else { 0 };
    }

    fn report(&self) -> UpdateReport {
        let over = |sum: f64, count: u64| (sum / count.max(1) as f64) as f32;
        UpdateReport {
            value_loss: over(self.value_loss, self.value_steps),
            policy_loss: over(self.policy_loss, self.policy_steps),
            ratio_deviation: 1.0 + over(self.deviation, self.policy_steps),
            clipped_fraction: over(self.clipped as f64, self.components),
            entropy: over(self.entropy, self.policy_steps),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::agent::Team;
    use crate::env::{Action, Choice, Quantity, Spec, Status};
    use crate::nn::Initial;
    use crate::seed::SeedDistribution;

    fn spec() -> Spec {
        let quantity = |name: &str| Quantity { name: name.to_owned(), unit: String::new(), range: [-1.0, 1.0] };
        Spec {
            name: "test".to_owned(),
            description: String::new(),
            observations: vec![quantity("x"), quantity("y")],
            actions: vec![Action { quantity: quantity("push"), choice: Choice::Discrete(vec![-1.0, 1.0]) }],
            control_step: 0.1,
            time_limit: 8,
            reward_threshold: None,
        }
    }

    fn agent(config: &SeedPg, number: u32, sigma: f64) -> SeedPgAgent {
        let seeds = SeedDistribution::Normal { sigma: known(sigma) };
        let team = Team { count: known_count(2), seeds, initial: Initial::Random };
        SeedPgAgent::new(config, &Membership { run_seed: 1, agent: number, team: &team, spec: &spec() })
    }

    /// Six steps; every behaviour probability is a half.
    fn episode(agent: u32) -> Episode {
        let wave = |count: usize, phase: f32| (0..count).map(|i| (i as f32 * 0.9 + phase).sin()).collect();
        Episode {
            observations: wave(14, agent as f32),
            actions: vec![0.0, 1.0, 1.0, 0.0, 1.0, 0.0],
            rewards: wave(6, 0.3),
            log_probs: vec![0.5_f32.ln(); 6],
            outcome: Status::Terminated,
            ..Episode::start(agent, 0, 0, &spec())
        }
    }

    fn buffer(agents: impl IntoIterator<Item = u32>) -> SharedBuffer {
        let mut buffer = SharedBuffer::new(1);
        buffer.push_round(agents.into_iter().map(episode).collect());
        buffer
    }

    fn parameters(agent: &SeedPgAgent) -> Vec<f32> {
        agent.tensors().iter().flat_map(|tensor| tensor.values.to_vec()).collect()
    }

    /// G̃ of another agent's trajectory is that of its rewards plus one's own seeds, by the step within the episode (Eq. 18).
    #[test]
    fn ones_own_seeds_perturb_anybodys_rewards() {
        let mut seeded = agent(&SeedPg::default(), 0, 0.5);
        let mut plain = agent(&SeedPg::default(), 0, 0.0);
        let mut shifted = episode(1);
        shifted.rewards.iter_mut().zip(&seeded.reward_seeds).for_each(|(reward, seed)| *reward += seed);
        for (learner, episode) in [(&mut seeded, &episode(1)), (&mut plain, &shifted)] {
            learner.weigh(episode);
            learner.estimate_returns(episode);
        }
        assert_eq!(seeded.work.returns, plain.work.returns);
        assert!(seeded.reward_seeds.iter().any(|seed| seed.abs() > 0.1), "{:?}", seeded.reward_seeds);
    }

    #[test]
    fn ratios_are_those_of_the_two_policies() {
        let mut learner = agent(&SeedPg::default(), 0, 0.0);
        learner.weigh(&episode(1));
        let expected: Vec<f32> = learner.work.log_probs.iter().map(|log_prob| log_prob.exp() / 0.5).collect();
        assert!(learner.work.ratios.iter().zip(&expected).all(|(ratio, expected)| (ratio - expected).abs() < 1e-5));
    }

    #[test]
    fn own_data_ignores_the_others() {
        let own = SeedPg { value_data: Data::Own, policy_data: Data::Own, ..SeedPg::default() };
        let (mut alone, mut among_others) = (agent(&own, 0, 0.1), agent(&own, 0, 0.1));
        alone.update(&buffer([0]), 0);
        among_others.update(&buffer([0, 1]), 0);
        assert_eq!(parameters(&alone), parameters(&among_others));

        let mut shared = agent(&SeedPg::default(), 0, 0.1);
        shared.update(&buffer([0, 1]), 0);
        assert_ne!(parameters(&alone), parameters(&shared));
    }

    /// On-policy Seed-PG (§3.4.1): the value function learns from all, the policy from its own.
    #[test]
    fn value_data_and_policy_data_are_told_apart() {
        let config = SeedPg { policy_data: Data::Own, ..SeedPg::default() };
        let mut learner = agent(&config, 0, 0.1);
        let before = (learner.policy.network().parameters().to_vec(), learner.value.parameters().to_vec());
        learner.update(&buffer([1]), 0);
        assert_eq!(learner.policy.network().parameters(), before.0);
        assert_ne!(learner.value.parameters(), before.1);
    }

    /// A strong pull keeps parameters nearer to the seed than none does.
    #[test]
    fn the_regulariser_pulls_to_the_seed() {
        let distance = |regularisation| {
            let config = SeedPg { regularisation: known(regularisation), ..SeedPg::default() };
            let mut learner = agent(&config, 0, 0.1);
            let seed = learner.policy.network().parameters().to_vec();
            for round in 0..50 {
                learner.update(&buffer([0, 1]), round);
            }
            seed.iter().zip(learner.policy.network().parameters()).map(|(a, b)| (a - b).powi(2)).sum::<f32>().sqrt()
        };
        assert!(distance(10.0) < 0.5 * distance(0.0), "{} {}", distance(10.0), distance(0.0));
    }

    /// A policy whose first action is rewarded comes to prefer it.
    #[test]
    fn rewarded_actions_become_likelier() {
        let mut config = SeedPg::default();
        config.policy_optimiser.step_size = known(0.01);
        let mut learner = agent(&config, 0, 0.0);
        let mut rewarded = episode(0);
        rewarded.rewards = rewarded.actions.iter().map(|&action| 1.0 - 2.0 * action).collect();
        let mut buffer = SharedBuffer::new(1);
        buffer.push_round(vec![rewarded.clone()]);
        learner.weigh(&rewarded);
        let before = learner.work.log_probs.clone();
        learner.update(&buffer, 0);
        learner.weigh(&rewarded);
        for (step, action) in rewarded.actions.iter().enumerate() {
            let gained = learner.work.log_probs[step] - before[step];
            assert!(if *action == 0.0 { gained > 0.0 } else { gained < 0.0 }, "step {step}: {gained}");
        }
    }

    #[test]
    fn a_restored_agent_goes_on_to_the_same_bits() {
        let (mut original, mut restored) = (agent(&SeedPg::default(), 0, 0.1), agent(&SeedPg::default(), 0, 0.1));
        original.update(&buffer([0, 1]), 0);
        restored.restore(&original.save()).unwrap();
        let reports = [&mut original, &mut restored].map(|learner| learner.update(&buffer([0, 1]), 1));
        assert_eq!(reports[0], reports[1]);
        assert_eq!(parameters(&original), parameters(&restored));
        assert!(restored.restore(&[1, 2, 3]).is_err());
    }
}
