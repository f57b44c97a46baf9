//! Seed-PG: K policies learn from shared experience, each with its own fixed seed (thesis §3.4).
//!
//! Each agent k has its own policy `π_k` and value function `v_k`. A trajectory of agent i is
//! weighed by ρₜ = `π_k(aₜ|sₜ)` / `π_i(aₜ|sₜ)`, and its rewards are perturbed by k's seeds: rₜ₊₁ +
//! `z_{k,t+1}`, with t the step within the episode.
//!
//! [`config`] says what can be chosen: with own data and no seeds the same agent is REINFORCE, the
//! simple policy gradient (§1.5), Off-PAC (§3.3.1), or PPO as others know it. `estimates` joins a
//! choice to its formula in [`rl`](crate::rl).

pub mod config;
mod estimates;
mod samples;
#[cfg(test)]
mod tests;
mod totals;

use rand::seq::{SliceRandom, index};
use serde::{Deserialize, Serialize};

use self::config::{
    Clipping, Data, Minibatch, PolicyLoss, ReturnNormalisation, SeedPg, Sharing, Standardization,
    TimeLimit,
};
use self::estimates::{Scratch, Trajectory};
use self::samples::Samples;
use self::totals::Totals;
use crate::agent::curiosity::Curiosity;
use crate::agent::network::{Descent, Learned, Network};
use crate::agent::policy::{self, Policy};
use crate::agent::scaling::Scaling;
use crate::agent::{ActScratch, Agent, AgentContext, Tensor, Update};
use crate::experience::{Episode, Experience, StepData};
use crate::nn::{Mlp, PopArt, Standardizer};
use crate::rl::advantage;
use crate::rl::policy_loss::{self, Surrogate};
use crate::seed::Seed;
use seedbed_env::Status;
use seedbed_env::input::numbers::Positive;
use seedbed_env::random::{Purpose, Stream, stream};

/// One agent of Seed-PG.
pub struct SeedPgAgent {
    config: SeedPg,
    run_seed: u64,
    agent: u32,
    /// `z_{k,1} … z_{k,T}`
    reward_seeds: Vec<f32>,
    scaling: Scaling,
    policy: Policy,
    value: Network,
    normalizer: PopArt,
    curiosity: Option<Curiosity>,
    /// Whether updates return [advantages](StepData::advantages).
    record_advantages: bool,
    work: Workspace,
}

/// Room that is reused from one trajectory to the next.
#[derive(Default)]
struct Workspace {
    /// Episodes to learn from.
    order: Vec<usize>,
    /// Bonuses of the steps of each fresh episode; none without curiosity.
    bonuses: Vec<Vec<f32>>,
    /// What the next gradient step sees.
    samples: Samples,
    /// What minibatches are drawn from, for the policy and for the value function.
    policy_pool: Samples,
    value_pool: Samples,
    rows: Vec<usize>,
    /// log π of the components of `samples`' actions: `[N × C]`
    log_probs: Vec<f32>,
    /// Of whole actions: `[N]`
    ratios: Vec<f32>,
    /// Perturbed: `[T]`
    rewards: Vec<f32>,
    /// v of `samples`' states: `[N]`
    values: Vec<f32>,
    estimates: Scratch,
    /// The state after the last step, as the networks see it.
    last_state: Vec<f32>,
    /// `[N × C]`
    slopes: Vec<f32>,
    value_gradient: Vec<f32>,
}

/// What a checkpoint holds of an agent. The rest derives from the scenario.
#[derive(Serialize, Deserialize)]
struct Saved<L, S> {
    policy: L,
    value: L,
    normalizer: PopArt,
    observations: Option<S>,
    curiosity: Option<Vec<u8>>,
}

impl SeedPgAgent {
    /// An agent at its seed.
    #[must_use]
    pub fn new(config: &SeedPg, member: &AgentContext<'_>) -> Self {
        let &AgentContext {
            run_seed,
            agent,
            team,
            spec,
            record_advantages,
        } = member;
        let hidden: Vec<usize> = config
            .hidden
            .iter()
            .map(|units| units.get() as usize)
            .collect();
        let policy_shape = policy::shape(spec, &hidden);
        let value_sizes: Vec<usize> = [spec.observation_width()]
            .into_iter()
            .chain(hidden)
            .chain([1])
            .collect();
        let value_shape = Mlp::new(&value_sizes);
        let mut seed = Seed::draw(
            run_seed,
            agent,
            team.seeds,
            team.initial,
            (&policy_shape, &value_shape),
            spec.time_limit,
        );
        scale_output_layer(
            &policy_shape,
            &mut seed.policy,
            config.policy_scale.get_f32(),
        );
        scale_output_layer(&value_shape, &mut seed.value, config.value_scale.get_f32());
        let policy = Network::new(policy_shape, seed.policy, config.policy_optimiser);
        Self {
            run_seed,
            agent,
            reward_seeds: seed.reward,
            scaling: Scaling::new(config.observations, spec),
            policy: Policy::new(
                spec,
                policy,
                *config.actions,
                config.initial_deviation.get_f32(),
            ),
            value: Network::new(value_shape, seed.value, config.value_optimiser),
            normalizer: match config.returns {
                ReturnNormalisation::PopArt { beta } => PopArt::new(beta.get()),
                ReturnNormalisation::Raw => PopArt::identity(),
            },
            curiosity: Curiosity::new(&config.bonus, member),
            record_advantages,
            config: config.clone(),
            work: Workspace::default(),
        }
    }

    /// The fresh episodes that this agent learns from, by their place: its own, and those of others
    /// that reach it.
    fn choose_episodes(&mut self, fresh: &[Episode], random: &mut Stream) {
        let Self {
            agent,
            config,
            work,
            ..
        } = self;
        let shares = config.value_data == Data::Shared || config.policy_data == Data::Shared;
        let (own, others): (Vec<usize>, Vec<usize>) = (0..fresh.len())
            .filter(|&index| fresh[index].length() > 0)
            .partition(|&index| fresh[index].agent == *agent);
        work.order = own;
        match config.sharing {
            _ if !shares => {}
            Sharing::All => work.order.extend(others),
            Sharing::Sampled { trajectories } => {
                let count = others.len().min(trajectories.get() as usize);
                work.order.extend(
                    index::sample(random, others.len(), count)
                        .into_iter()
                        .map(|place| others[place]),
                );
            }
        }
        work.order.sort_unstable();
    }

    /// Intrinsic rewards and, if they are recorded, advantages of the agent's own steps, before it
    /// learns from them. Estimates draw no random numbers and change only what the next estimate
    /// overwrites, so learning continues with the same bits.
    fn own_step_data(&mut self, fresh: &[Episode]) -> Vec<StepData> {
        let mut step_data = Vec::new();
        if self.curiosity.is_none() && !self.record_advantages {
            return step_data;
        }
        for index in 0..self.work.order.len() {
            let place = self.work.order[index];
            let episode = &fresh[place];
            if episode.agent != self.agent {
                continue;
            }
            let mut data = StepData::of(episode);
            if let Some(bonuses) = self.work.bonuses.get(place) {
                data.intrinsic_rewards.clone_from(bonuses);
            }
            if self.record_advantages {
                self.estimate(episode, place);
                data.advantages.clone_from(&self.work.samples.advantages);
            }
            step_data.push(data);
        }
        step_data
    }

    /// Whether the value function and the policy learn from an episode.
    fn learners(&self, episode: &Episode) -> [bool; 2] {
        let learns = |data| data == Data::Shared || episode.agent == self.agent;
        [
            learns(self.config.value_data),
            learns(self.config.policy_data),
        ]
    }

    /// One trajectory is one minibatch: each network takes at most one step on it.
    fn learn_from_trajectory(
        &mut self,
        fresh: &[Episode],
        place: usize,
        descent: &Descent,
        totals: &mut Totals,
    ) {
        let [value_learns, policy_learns] = self.learners(&fresh[place]);
        self.load_trajectory(&fresh[place], place);
        if value_learns {
            let (weight, bias) = self.value.output_layer();
            self.normalizer
                .update(&self.work.samples.targets, weight, bias);
        }
        if policy_learns {
            self.improve_policy(descent, totals);
        }
        if value_learns {
            self.improve_value(descent, totals);
        }
    }

    /// Minibatches of `size` steps from all chosen trajectories; each network takes a step on each.
    fn learn_from_steps(
        &mut self,
        fresh: &[Episode],
        size: usize,
        descent: &Descent,
        random: &mut Stream,
        totals: &mut Totals,
    ) {
        self.fill_pools(fresh);
        let (weight, bias) = self.value.output_layer();
        self.normalizer
            .update(&self.work.value_pool.targets, weight, bias);
        let mut rows = std::mem::take(&mut self.work.rows);
        shuffled(&mut rows, self.work.policy_pool.len(), random);
        for rows in rows.chunks(size) {
            self.work.samples.gather(&self.work.policy_pool, rows);
            self.compute_ratios();
            self.improve_policy(descent, totals);
        }
        shuffled(&mut rows, self.work.value_pool.len(), random);
        for rows in rows.chunks(size) {
            self.work.samples.gather(&self.work.value_pool, rows);
            self.estimate_values();
            self.improve_value(descent, totals);
        }
        self.work.rows = rows;
    }

    fn fill_pools(&mut self, fresh: &[Episode]) {
        self.work.policy_pool.clear();
        self.work.value_pool.clear();
        for index in 0..self.work.order.len() {
            let place = self.work.order[index];
            let [value_learns, policy_learns] = self.learners(&fresh[place]);
            self.load_trajectory(&fresh[place], place);
            let Workspace {
                samples,
                policy_pool,
                value_pool,
                ..
            } = &mut self.work;
            if value_learns {
                value_pool.append(samples);
            }
            if policy_learns {
                policy_pool.append(samples);
            }
        }
    }

    /// A trajectory becomes samples to learn from.
    fn load_trajectory(&mut self, episode: &Episode, place: usize) {
        self.estimate(episode, place);
        if self.config.standardise == Standardization::PerTrajectory {
            advantage::standardize(&mut self.work.samples.advantages);
        }
    }

    /// A trajectory becomes samples: targets and advantages under the present policy and value
    /// function. `place` is its index among the fresh ones.
    fn estimate(&mut self, episode: &Episode, place: usize) {
        let samples = &mut self.work.samples;
        self.scaling.apply(episode.states(), &mut samples.states);
        samples.actions.clone_from(&episode.actions);
        samples.behaviour.clone_from(&episode.log_probs);
        self.perturb_rewards(episode, place);
        self.compute_ratios();
        self.estimate_values();

        let config = &self.config;
        let Workspace {
            samples,
            rewards,
            ratios,
            values,
            estimates,
            ..
        } = &mut self.work;
        let trajectory = Trajectory {
            rewards,
            ratios,
            values,
            discount: config.discount.get_f32(),
        };
        let Samples {
            targets,
            weights,
            advantages,
            ..
        } = samples;
        trajectory.value_targets(*config.value_target, estimates, targets, weights);
        trajectory.advantages(
            *config.advantage,
            *config.value_target,
            targets,
            estimates,
            advantages,
        );
    }

    /// rₜ₊₁ + `z_{k,t+1}`, and the bonus if there is one; where a time limit is not an end, γ
    /// v(`s_T`) is added to the last reward for all that would follow.
    fn perturb_rewards(&mut self, episode: &Episode, place: usize) {
        let Workspace {
            rewards,
            last_state,
            bonuses,
            ..
        } = &mut self.work;
        rewards.clear();
        rewards.extend(
            episode
                .rewards
                .iter()
                .zip(&self.reward_seeds)
                .map(|(reward, seed)| reward + seed),
        );
        if let Some(bonuses) = bonuses.get(place) {
            rewards
                .iter_mut()
                .zip(bonuses)
                .for_each(|(reward, bonus)| *reward += bonus);
        }
        if self.config.time_limit == TimeLimit::Bootstraps && episode.outcome == Status::Truncated {
            self.scaling.apply(episode.last_observation(), last_state);
            let normalized = self.value.forward(last_state)[0];
            let value = self
                .normalizer
                .deviation()
                .mul_add(normalized, self.normalizer.mean());
            rewards[episode.length() - 1] += self.config.discount.get_f32() * value;
        }
    }

    /// ρₜ = `π_k(aₜ|sₜ)` / μ(aₜ|sₜ) of the samples at hand.
    fn compute_ratios(&mut self) {
        let Workspace {
            samples,
            log_probs,
            ratios,
            ..
        } = &mut self.work;
        self.policy
            .evaluate(&samples.states, &samples.actions, log_probs);
        let width = self.policy.components();
        let rows = log_probs
            .chunks_exact(width)
            .zip(samples.behaviour.chunks_exact(width));
        ratios.clear();
        ratios.extend(rows.map(|(ours, theirs)| ratio(ours, theirs)));
    }

    /// v(sₜ) = σ Ŷₜ + μ of the samples at hand.
    fn estimate_values(&mut self) {
        let (deviation, mean) = (self.normalizer.deviation(), self.normalizer.mean());
        let normalized = self.value.forward(&self.work.samples.states);
        self.work.values.clear();
        self.work
            .values
            .extend(normalized.iter().map(|y| deviation.mul_add(*y, mean)));
    }

    /// One step of the policy on the samples at hand, which it has just [weighed](Self::weigh).
    fn improve_policy(&mut self, descent: &Descent, totals: &mut Totals) {
        let work = &mut self.work;
        if self.config.standardise == Standardization::PerMinibatch {
            advantage::standardize(&mut work.samples.advantages);
        }
        let samples = &work.samples;
        let width = samples.components();
        let rows = work
            .log_probs
            .chunks_exact(width)
            .zip(samples.behaviour.chunks_exact(width));
        work.slopes.clear();
        for ((ours, theirs), (&joint, &advantage)) in
            rows.zip(work.ratios.iter().zip(&samples.advantages))
        {
            surrogates(
                *self.config.policy_loss,
                (ours, theirs),
                joint,
                advantage,
                |surrogate, components| {
                    work.slopes
                        .extend(std::iter::repeat_n(surrogate.slope, components));
                    totals.surrogate(&surrogate, components);
                },
            );
        }
        totals.minibatch(&work.ratios, self.policy.mean_entropy());
        let entropy_bonus = self.config.entropy_bonus.get_f32();
        self.policy.descend(
            &samples.states,
            &samples.actions,
            &work.slopes,
            entropy_bonus,
            descent,
        );
    }

    /// Descends ½ mean wₜ (Ŷₜ − (Yₜ − μ)/σ)² on the samples at hand, whose values were just
    /// [estimated](Self::estimate_values).
    fn improve_value(&mut self, descent: &Descent, totals: &mut Totals) {
        let Workspace {
            samples,
            values,
            value_gradient,
            ..
        } = &mut self.work;
        let (scale, share) = (
            1.0 / self.normalizer.deviation(),
            1.0 / samples.len() as f32,
        );
        value_gradient.clear();
        for ((value, target), weight) in values.iter().zip(&samples.targets).zip(&samples.weights) {
            let error = (value - target) * scale;
            totals.value_sample(error);
            value_gradient.push(share * weight * error);
        }
        self.value.descend(&samples.states, value_gradient, descent);
    }

    fn descent(&self, round: u32) -> Descent {
        Descent {
            regularisation: self.config.regularisation.get_f32(),
            gradient_clip: self.config.gradient_clip.map(Positive::get_f32),
            step_size_factor: self.config.step_size_schedule.factor(round),
        }
    }
}

/// The surrogate of a whole action, or one for each component; `take` is told how many components
/// it stands for.
fn surrogates(
    loss: PolicyLoss,
    (ours, theirs): (&[f32], &[f32]),
    joint: f32,
    advantage: f32,
    mut take: impl FnMut(Surrogate, usize),
) {
    let width = ours.len();
    match loss {
        PolicyLoss::Ppo {
            clip,
            clipping: Clipping::Joint,
        } => take(policy_loss::ppo(joint, advantage, clip.get_f32()), width),
        PolicyLoss::Ppo {
            clip,
            clipping: Clipping::DimensionWise,
        } => {
            for (ours, theirs) in ours.chunks_exact(1).zip(theirs.chunks_exact(1)) {
                take(
                    policy_loss::ppo(ratio(ours, theirs), advantage, clip.get_f32()),
                    1,
                );
            }
        }
        PolicyLoss::SimplePg => take(policy_loss::simple(ours.iter().sum(), advantage), width),
        PolicyLoss::OffPac { ratio_cap } => {
            take(
                policy_loss::off_pac(
                    ours.iter().sum(),
                    joint,
                    advantage,
                    ratio_cap.map(Positive::get_f32),
                ),
                width,
            );
        }
    }
}

/// π/μ of one action from the log-probabilities of its components, kept within e^±20.
fn ratio(ours: &[f32], theirs: &[f32]) -> f32 {
    let log_ratio: f32 = ours
        .iter()
        .zip(theirs)
        .map(|(ours, theirs)| ours - theirs)
        .sum();
    log_ratio.clamp(-20.0, 20.0).exp()
}

/// 0 … `count` − 1 in random order.
fn shuffled(rows: &mut Vec<usize>, count: usize, random: &mut Stream) {
    rows.clear();
    rows.extend(0..count);
    rows.shuffle(random);
}

fn scale_output_layer(shape: &Mlp, parameters: &mut [f32], scale: f32) {
    let (weight, bias) = shape.output_layer(parameters);
    weight
        .iter_mut()
        .chain(bias)
        .for_each(|parameter| *parameter *= scale);
}

impl Agent for SeedPgAgent {
    fn act(
        &self,
        observation: &[f32],
        random: &mut Stream,
        scratch: &mut ActScratch,
        action: &mut [f32],
        log_prob: &mut [f32],
    ) {
        let mut state = std::mem::take(&mut scratch.state);
        self.scaling.apply(observation, &mut state);
        self.policy
            .sample(&state, random, scratch, action, log_prob);
        scratch.state = state;
    }

    fn update(&mut self, experience: &Experience<'_>) -> Update {
        let &Experience { fresh, round, .. } = experience;
        let mut random = stream(self.run_seed, Purpose::Shuffle, self.agent, round);
        let (descent, mut totals) = (self.descent(round), Totals::default());
        self.choose_episodes(fresh, &mut random);
        if let Some(curiosity) = &mut self.curiosity {
            curiosity.reward(experience, &self.work.order, &mut self.work.bonuses);
            totals.curiosity(
                self.agent,
                fresh,
                &self.work.bonuses,
                curiosity.learn(experience),
            );
        }
        let step_data = self.own_step_data(fresh);
        for _ in 0..self.config.epochs.get() {
            match self.config.minibatch {
                Minibatch::Trajectory => {
                    let mut order = std::mem::take(&mut self.work.order);
                    order.shuffle(&mut random);
                    for &index in &order {
                        self.learn_from_trajectory(fresh, index, &descent, &mut totals);
                    }
                    self.work.order = order;
                }
                Minibatch::Steps(size) => {
                    self.learn_from_steps(
                        fresh,
                        size.get() as usize,
                        &descent,
                        &mut random,
                        &mut totals,
                    );
                }
            }
        }
        self.work
            .order
            .iter()
            .for_each(|&index| self.scaling.update(fresh[index].states()));
        Update {
            report: totals.report(),
            step_data,
        }
    }

    fn probe_bonuses(&mut self, episode: &Episode, round: u32) -> Vec<f32> {
        self.curiosity.as_mut().map_or_else(Vec::new, |curiosity| {
            curiosity.probe_bonuses(episode, round)
        })
    }

    fn is_finite(&self) -> bool {
        let curiosity = self.curiosity.as_ref().is_none_or(Curiosity::is_finite);
        curiosity
            && self.policy.network().is_finite()
            && self.value.is_finite()
            && self.normalizer.is_finite()
    }

    fn tensors(&self) -> Vec<Tensor<'_>> {
        let moments = [
            ("mean", self.normalizer.mean()),
            ("deviation", self.normalizer.deviation()),
        ];
        let moments = moments.map(|(name, moment)| Tensor {
            name: format!("value.{name}"),
            shape: vec![1],
            values: vec![moment].into(),
        });
        self.policy
            .tensors()
            .chain(self.value.tensors("value"))
            .chain(moments)
            .chain(self.scaling.tensors())
            .collect()
    }

    fn save(&self) -> Vec<u8> {
        let (policy, value) = (self.policy.network().learned(), self.value.learned());
        let (observations, curiosity) = (
            self.scaling.learned(),
            self.curiosity.as_ref().map(Curiosity::save),
        );
        let saved = Saved {
            policy,
            value,
            normalizer: self.normalizer,
            observations,
            curiosity,
        };
        postcard::to_stdvec(&saved).expect("plain numbers always serialise")
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), String> {
        let saved: Saved<Learned, Standardizer> =
            postcard::from_bytes(bytes).map_err(|error| error.to_string())?;
        self.policy.network_mut().restore(saved.policy)?;
        self.value.restore(saved.value)?;
        self.scaling.restore(saved.observations)?;
        self.normalizer = saved.normalizer;
        match (&mut self.curiosity, saved.curiosity) {
            (Some(curiosity), Some(bytes)) => curiosity.restore(&bytes),
            (None, None) => Ok(()),
            _ => Err("stored for a run with another `bonus`".to_owned()),
        }
    }
}
