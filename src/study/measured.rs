//! What is kept of one run: enough for every figure and table, and nothing that depends on the machine's speed.

use std::sync::atomic::{AtomicBool, Ordering};

use rand::RngExt;
use serde::{Deserialize, Serialize};

use super::measure::{Curve, widened};
use crate::experience::Episode;
use crate::random::{Purpose, Stream, stream};
use crate::record::RoundRow;
use crate::run::measures::RoundRows;
use crate::run::trainer::Trainer;
use crate::run::{Plan, RunError};

/// States kept of each window of episodes.
pub const STATES: usize = 2000;

/// Regrets below this are rounding.
const NO_REGRET: f64 = 1e-6;

/// A round that no training reaches names the stream that thins states.
const THINNING: u32 = u32::MAX;

/// What one run came to.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// Returns of each agent, episode by episode: `[K][episodes]`.
    pub returns: Vec<Vec<f32>>,
    /// Regrets likewise, in finite tasks; empty in others.
    pub regrets: Vec<Vec<f32>>,
    /// The mean return at which the task counts as solved, and over how many episodes of each agent; none if nothing says so.
    pub threshold: Option<(f64, u32)>,
    /// When it was solved first.
    pub solved: Option<Milestone>,
    /// Steps of the team.
    pub env_steps: u64,
    /// Episodes of each agent after each round in which somebody learned: `[rounds]`.
    pub episodes: Vec<u32>,
    /// One row a curve, in the order of [`Curve::KEPT`]: `[curves][rounds]`.
    pub curves: Vec<Vec<f32>>,
    /// Where agents have been, for each window of episodes that was asked for.
    pub states: Vec<VisitedStates>,
}

/// How far a run was when something happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Milestone {
    /// Episodes of each agent.
    pub episodes: u32,
    /// Steps of the team.
    pub env_steps: u64,
}

/// A fair sample of the states that a team visited in its first episodes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct VisitedStates {
    /// Episodes of each agent; more than there were for all of them.
    pub episodes: u32,
    /// How many there were.
    pub visited: u64,
    /// Row by row: `[at most STATES × observation width]`.
    pub states: Vec<f32>,
}

/// When a training run ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Until {
    /// As the scenario says.
    ItsStop,
    /// After as many episodes as the scenario allows, solved or not.
    MostEpisodes,
    /// As soon as the task is solved, or then.
    Solved,
}

/// Trains once, on one thread and without a recording. `windows`: of which first episodes states are kept. `None` if interrupted.
///
/// # Errors
/// The task cannot be built, or numbers ceased to be finite.
pub fn train(
    plan: &Plan,
    until: Until,
    windows: &[u32],
    interrupted: &AtomicBool,
) -> Result<Option<Measured>, RunError> {
    let mut trainer = Trainer::new(&plan.scenario, &plan.description, 1)?;
    let mut measured = Measured::begin(&trainer);
    let mut reservoir = Reservoir::new(plan.scenario.seed, windows);
    while !is_done(&trainer, plan, until) {
        if interrupted.load(Ordering::Relaxed) {
            return Ok(None);
        }
        let rows = trainer.advance()?.rows;
        measured.take_in(&trainer, &rows);
        trainer
            .newest_episodes()
            .iter()
            .for_each(|episode| reservoir.take_in_all(episode));
    }
    Ok(Some(Measured {
        states: reservoir.states(),
        ..measured
    }))
}

fn is_done(trainer: &Trainer, plan: &Plan, until: Until) -> bool {
    let all = trainer.measures().episodes_per_agent() >= plan.scenario.most_episodes() as usize;
    match until {
        Until::ItsStop => trainer.is_done(),
        Until::MostEpisodes => all,
        Until::Solved => all || trainer.is_solved(),
    }
}

impl Measured {
    fn begin(trainer: &Trainer) -> Self {
        Self {
            returns: vec![Vec::new(); trainer.agent_count()],
            threshold: trainer
                .threshold()
                .map(|threshold| (threshold.r#return, threshold.window as u32)),
            curves: vec![Vec::new(); Curve::KEPT.len()],
            ..Self::default()
        }
    }

    fn take_in(&mut self, trainer: &Trainer, rows: &RoundRows) {
        for row in &rows.episodes {
            self.returns[row.agent as usize].push(row.r#return as f32);
        }
        let now = Milestone {
            episodes: trainer.measures().episodes_per_agent() as u32,
            env_steps: trainer.measures().env_steps(),
        };
        self.env_steps = now.env_steps;
        if self.solved.is_none() && trainer.is_solved() {
            self.solved = Some(now);
        }
        if !rows.updates.is_empty() {
            self.episodes.push(now.episodes);
            self.curves
                .iter_mut()
                .zip(Curve::KEPT)
                .for_each(|(values, curve)| values.push(of_round(curve, &rows.updates)));
        }
    }

    /// Episodes that every agent has finished.
    #[must_use]
    pub fn episodes_per_agent(&self) -> usize {
        self.returns.iter().map(Vec::len).min().unwrap_or(0)
    }

    /// The mean over agents of their n-th returns: `[episodes]`.
    #[must_use]
    pub fn team_returns(&self) -> Vec<f64> {
        team_means(&self.returns)
    }

    /// Whether the run says what a goal is.
    #[must_use]
    pub fn has_goal(&self) -> bool {
        self.threshold.is_some() || !self.regrets.is_empty()
    }

    /// Of each agent: its first episode, counted from 1, that reached the task's return by itself or, in finite tasks, had no
    /// regret.   → `[K]`
    #[must_use]
    pub fn first_goals(&self) -> Vec<Option<u32>> {
        let first = |values: &[Vec<f32>], is_goal: &dyn Fn(f64) -> bool| -> Vec<Option<u32>> {
            let of_agent =
                |values: &Vec<f32>| values.iter().position(|&value| is_goal(value.into()));
            values
                .iter()
                .map(|values| of_agent(values).map(|episode| episode as u32 + 1))
                .collect()
        };
        match self.threshold {
            Some((wanted, _)) => first(&self.returns, &|got| got >= wanted),
            None if !self.regrets.is_empty() => first(&self.regrets, &|regret| regret < NO_REGRET),
            None => vec![None; self.returns.len()],
        }
    }

    /// One value an episode for the return, one a round for all others.
    #[must_use]
    pub fn curve(&self, curve: Curve) -> Vec<f64> {
        let kept = Curve::KEPT
            .iter()
            .position(|kept| *kept == curve)
            .and_then(|index| self.curves.get(index));
        match (curve, kept) {
            (_, Some(values)) => widened(values),
            (Curve::Regret, None) => team_means(&self.regrets),
            _ => self.team_returns(),
        }
    }

    /// After how many episodes of each agent a curve has its values.
    #[must_use]
    pub fn curve_episodes(&self, curve: Curve) -> Vec<u32> {
        match curve {
            Curve::Return | Curve::Regret => (1..=self.episodes_per_agent() as u32).collect(),
            _ => self.episodes.clone(),
        }
    }

    /// A curve's newest value when each agent has finished so many episodes, or its last one if the run was shorter.
    #[must_use]
    pub fn curve_at(&self, curve: Curve, episode: u32) -> Option<f64> {
        let before = self
            .curve_episodes(curve)
            .partition_point(|&episodes| episodes <= episode);
        self.curve(curve).get(before.checked_sub(1)?).copied()
    }

    /// The coverage of the team at the end.
    #[must_use]
    pub fn team_coverage(&self) -> f64 {
        self.curve(Curve::TeamCoverage)
            .last()
            .copied()
            .unwrap_or(0.0)
    }
}

/// Keeps fair samples of states while a run goes on.
pub struct Reservoir {
    /// With a stream each, so that no window's sample depends on which others there are.
    kept: Vec<(VisitedStates, Stream)>,
}

impl Reservoir {
    /// One for each of `windows`: of which first episodes.
    #[must_use]
    pub fn new(seed: u64, windows: &[u32]) -> Self {
        let kept = |&episodes: &u32| {
            let random = stream(seed, Purpose::Recording, episodes, THINNING);
            (
                VisitedStates {
                    episodes,
                    visited: 0,
                    states: Vec::new(),
                },
                random,
            )
        };
        Self {
            kept: windows.iter().map(kept).collect(),
        }
    }

    /// A state that an agent visited in this episode of its own.
    pub fn take_in(&mut self, episode: u32, state: &[f32]) {
        for (kept, random) in self
            .kept
            .iter_mut()
            .filter(|(kept, _)| episode < kept.episodes)
        {
            kept.take_in(state, random);
        }
    }

    fn take_in_all(&mut self, episode: &Episode) {
        let width = episode.observations.len() / (episode.length() + 1);
        episode
            .states()
            .chunks_exact(width)
            .for_each(|state| self.take_in(episode.episode, state));
    }

    /// What was kept.
    #[must_use]
    pub fn states(self) -> Vec<VisitedStates> {
        self.kept.into_iter().map(|(kept, _)| kept).collect()
    }
}

impl VisitedStates {
    /// Reservoir sampling (Vitter 1985, algorithm R): every state of a window is kept with the same probability.
    fn take_in(&mut self, state: &[f32], random: &mut Stream) {
        if self.states.len() < STATES * state.len() {
            self.states.extend_from_slice(state);
        } else {
            let place = random.random_range(0..=self.visited) as usize;
            if place < STATES {
                self.states[place * state.len()..(place + 1) * state.len()].copy_from_slice(state);
            }
        }
        self.visited += 1;
    }
}

/// The mean over agents of their n-th values: `[K][episodes]` → `[episodes of all]`
fn team_means(values: &[Vec<f32>]) -> Vec<f64> {
    let episodes = values.iter().map(Vec::len).min().unwrap_or(0);
    let sum = |episode: usize| {
        values
            .iter()
            .map(|values| f64::from(values[episode]))
            .sum::<f64>()
    };
    (0..episodes)
        .map(|episode| sum(episode) / values.len() as f64)
        .collect()
}

/// The mean over agents, or the largest ratio of all.
fn of_round(curve: Curve, updates: &[RoundRow]) -> f32 {
    let values = updates.iter().map(|row| of_update(curve, row));
    if curve == Curve::LargestRatio {
        return values.fold(0.0, f64::max) as f32;
    }
    (values.sum::<f64>() / updates.len() as f64) as f32
}

fn of_update(curve: Curve, row: &RoundRow) -> f64 {
    match curve {
        Curve::Return | Curve::Regret => unreachable!("these come episode by episode"),
        Curve::ValueLoss => row.value_loss.into(),
        Curve::PolicyLoss => row.policy_loss.into(),
        Curve::RatioDeviation => row.ratio_deviation.into(),
        Curve::LargestRatio => row.largest_ratio.into(),
        Curve::ClippedFraction => row.clipped_fraction.into(),
        Curve::Entropy => row.entropy.into(),
        Curve::IntrinsicReward => row.intrinsic_reward.into(),
        Curve::PredictionError => row.prediction_error.into(),
        Curve::BonusAgreement => row.bonus_agreement.map_or(0.0, f64::from),
        Curve::Coverage => row.coverage,
        Curve::VisitationEvenness => row.visitation_evenness,
        Curve::TeamCoverage => row.team_coverage,
        Curve::TeamOverlap => row.team_overlap,
        Curve::EffectiveAgents => row.effective_agents,
    }
}
