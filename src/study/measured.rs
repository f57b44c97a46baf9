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

/// A round that no training reaches names the stream that thins states.
const THINNING: u32 = u32::MAX;

/// What one run came to.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// Returns of each agent, episode by episode: `[K][episodes]`.
    pub returns: Vec<Vec<f32>>,
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
pub fn train(plan: &Plan, until: Until, windows: &[u32], interrupted: &AtomicBool) -> Result<Option<Measured>, RunError> {
    let mut trainer = Trainer::new(&plan.scenario, &plan.description, 1)?;
    let mut measured = Measured::begin(&trainer, windows);
    let mut random = stream(plan.scenario.seed, Purpose::Recording, 0, THINNING);
    while !is_done(&trainer, plan, until) {
        if interrupted.load(Ordering::Relaxed) {
            return Ok(None);
        }
        let rows = trainer.advance()?.rows;
        measured.take_in(&trainer, &rows);
        measured.keep_states(&trainer.newest_episodes(), &mut random);
    }
    Ok(Some(measured))
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
    fn begin(trainer: &Trainer, windows: &[u32]) -> Self {
        let kept = |&episodes: &u32| VisitedStates { episodes, visited: 0, states: Vec::new() };
        Self {
            returns: vec![Vec::new(); trainer.agents().len()],
            threshold: trainer.threshold().map(|threshold| (threshold.r#return, threshold.window as u32)),
            curves: vec![Vec::new(); Curve::KEPT.len()],
            states: windows.iter().map(kept).collect(),
            ..Self::default()
        }
    }

    fn take_in(&mut self, trainer: &Trainer, rows: &RoundRows) {
        for row in &rows.episodes {
            self.returns[row.agent as usize].push(row.r#return as f32);
        }
        let now =
            Milestone { episodes: trainer.measures().episodes_per_agent() as u32, env_steps: trainer.measures().env_steps() };
        self.env_steps = now.env_steps;
        if self.solved.is_none() && trainer.is_solved() {
            self.solved = Some(now);
        }
        if !rows.updates.is_empty() {
            self.episodes.push(now.episodes);
            self.curves.iter_mut().zip(Curve::KEPT).for_each(|(values, curve)| values.push(of_round(curve, &rows.updates)));
        }
    }

    /// Reservoir sampling (Vitter 1985, algorithm R): every state of a window is kept with the same probability.
    fn keep_states(&mut self, episodes: &[&Episode], random: &mut Stream) {
        for kept in &mut self.states {
            let most = kept.episodes;
            for episode in episodes.iter().filter(|episode| episode.episode < most) {
                let width = episode.observations.len() / (episode.length() + 1);
                episode.states().chunks_exact(width).for_each(|state| kept.take_in(state, random));
            }
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
        let mean = |episode: usize| self.returns.iter().map(|returns| f64::from(returns[episode])).sum::<f64>();
        (0..self.episodes_per_agent()).map(|episode| mean(episode) / self.returns.len() as f64).collect()
    }

    /// Of each agent: its first episode that reached the task's return by itself, counted from 1.   → `[K]`
    #[must_use]
    pub fn first_goals(&self) -> Vec<Option<u32>> {
        let Some((wanted, _)) = self.threshold else { return vec![None; self.returns.len()] };
        let first = |returns: &Vec<f32>| returns.iter().position(|&got| f64::from(got) >= wanted);
        self.returns.iter().map(|returns| first(returns).map(|episode| episode as u32 + 1)).collect()
    }

    /// One value an episode for the return, one a round for all others.
    #[must_use]
    pub fn curve(&self, curve: Curve) -> Vec<f64> {
        let kept = Curve::KEPT.iter().position(|kept| *kept == curve).and_then(|index| self.curves.get(index));
        kept.map_or_else(|| self.team_returns(), |values| widened(values))
    }

    /// After how many episodes of each agent a curve has its values.
    #[must_use]
    pub fn curve_episodes(&self, curve: Curve) -> Vec<u32> {
        if curve == Curve::Return { (1..=self.episodes_per_agent() as u32).collect() } else { self.episodes.clone() }
    }

    /// A curve's newest value when each agent has finished so many episodes, or its last one if the run was shorter.
    #[must_use]
    pub fn curve_at(&self, curve: Curve, episode: u32) -> Option<f64> {
        let before = self.curve_episodes(curve).partition_point(|&episodes| episodes <= episode);
        self.curve(curve).get(before.checked_sub(1)?).copied()
    }

    /// The coverage of the team at the end.
    #[must_use]
    pub fn team_coverage(&self) -> f64 {
        self.curve(Curve::TeamCoverage).last().copied().unwrap_or(0.0)
    }
}

impl VisitedStates {
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
        Curve::Return => unreachable!("returns come episode by episode"),
        Curve::ValueLoss => row.value_loss.into(),
        Curve::PolicyLoss => row.policy_loss.into(),
        Curve::RatioDeviation => row.ratio_deviation.into(),
        Curve::LargestRatio => row.largest_ratio.into(),
        Curve::ClippedFraction => row.clipped_fraction.into(),
        Curve::Entropy => row.entropy.into(),
        Curve::IntrinsicReward => row.intrinsic_reward.into(),
        Curve::PredictionError => row.prediction_error.into(),
        Curve::BonusAgreement => row.bonus_agreement.into(),
        Curve::Coverage => row.coverage,
        Curve::VisitationEvenness => row.visitation_evenness,
        Curve::TeamCoverage => row.team_coverage,
        Curve::TeamOverlap => row.team_overlap,
        Curve::EffectiveAgents => row.effective_agents,
    }
}
