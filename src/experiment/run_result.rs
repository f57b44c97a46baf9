//! Result of one run: what figures and tables need, and nothing that depends on the speed of the
//! machine.

use rand::RngExt;
use serde::{Deserialize, Serialize};

use crate::run::facts::metrics::Curve;
use crate::run::measures::RoundRows;
use crate::run::training::Trainer;
use crate::scenario::{Rounding, Threshold};
use seedbed_learn::experience::Episode;
use seedbed_random::{Purpose, Stream, stream};

/// Maximum number of numbers in a sample of states of one run, and limits of the number of states.
/// Figures pool the samples of all runs of a cell.
const SAMPLED_NUMBERS: usize = 4000;
const SAMPLED_STATES: std::ops::RangeInclusive<usize> = 10..=500;

/// Maximum number of sampled states of one run, of a task with `width` observations.
#[must_use]
pub fn max_sampled_states(width: usize) -> usize {
    (SAMPLED_NUMBERS / width.max(1)).clamp(*SAMPLED_STATES.start(), *SAMPLED_STATES.end())
}

/// Smallest regret that is not a rounding error.
const MIN_REGRET: f64 = 1e-6;

/// Number of the random stream that samples states. It is used in place of the number of a round,
/// and no run has so many rounds.
const SAMPLING_STREAM: u32 = u32::MAX;

/// Result of one run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RunResult {
    /// Returns of each agent, episode by episode: `[K][episodes]`. Those of runs of seedbed are in
    /// single precision, and are stored so.
    #[serde(with = "single_precision")]
    pub returns: Vec<Vec<f64>>,
    /// Environment steps of the team when each episode had ended: `[K][episodes]`. In runs of seedbed, an episode
    /// ends with its round. Empty if unknown, as of runs that earlier versions stored. Stored beside the other
    /// results.
    #[serde(skip)]
    pub episode_ends: Vec<Vec<u64>>,
    /// Number of the team's steps during the longest episode, of runs of others in which it does not follow from
    /// `episode_ends`. Not stored.
    #[serde(skip)]
    pub longest_episode: u64,
    /// How returns were rounded. It is not stored for runs of seedbed.
    #[serde(skip)]
    pub rounding: Rounding,
    /// Regrets of each agent, episode by episode, in tabular tasks: `[K][episodes]`; empty in other
    /// tasks.
    pub regrets: Vec<Vec<f32>>,
    /// Mean return at which the task counts as solved, and number of latest episodes of each agent
    /// over which the mean is taken; `None` if no threshold is set.
    pub threshold: Option<(f64, u32)>,
    /// When the task was solved for the first time.
    pub solved: Option<Milestone>,
    /// Number of steps of the team.
    pub env_steps: u64,
    /// Number of episodes per agent after each round in which any agent learned: `[rounds]`.
    pub episodes: Vec<u32>,
    /// One row per curve, in the order of [`Curve::WITH_ROUND_VALUES`]: `[curves][rounds]`. A
    /// value is NaN if the curve was not measured in this round; a row is empty if the curve was
    /// never measured.
    pub curves: Vec<Vec<f32>>,
    /// Visited states, for each requested window of episodes.
    pub states: Vec<VisitedStates>,
}

/// Progress of a run at a moment, such as the moment when the task was solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Milestone {
    /// Number of episodes of each agent.
    pub episodes: u32,
    /// Number of steps of the team.
    pub env_steps: u64,
}

/// A uniform sample of the states that a team visited in its first episodes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct VisitedStates {
    /// Number of first episodes of each agent in which the states were visited. For samples of the
    /// whole run, it is larger than the number of episodes.
    pub episodes: u32,
    /// Number of states that were visited.
    pub visited: u64,
    /// Sampled states, row by row: `[at most max_sampled_states × observation width]`.
    pub states: Vec<f32>,
    /// Agent and episode in which each sampled state was visited.
    pub visits: Vec<(u32, u32)>,
}

impl RunResult {
    /// The result of a training run that begins.
    fn begin(trainer: &Trainer) -> Self {
        Self {
            returns: vec![Vec::new(); trainer.agent_count()],
            threshold: trainer
                .threshold()
                .map(|threshold| (threshold.r#return, threshold.window as u32)),
            curves: vec![Vec::new(); Curve::WITH_ROUND_VALUES.len()],
            ..Self::default()
        }
    }

    /// Adds a round that the trainer has just finished.
    fn add_round(&mut self, trainer: &Trainer, rows: &RoundRows) {
        for row in &rows.episodes {
            self.add_return(row.agent as usize, row.r#return);
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
            for (values, curve) in self.curves.iter_mut().zip(Curve::WITH_ROUND_VALUES) {
                let value = curve.metric().team_value_of_round(&rows.updates);
                values.push(value.map_or(f32::NAN, |value| value as f32));
            }
        }
    }

    /// Adds to `ends`, which are to be the [`episode_ends`](Self::episode_ends), that the newest episodes ended at
    /// the present number of environment steps.
    pub(crate) fn end_episodes(&self, ends: &mut Vec<Vec<u64>>) {
        ends.resize(self.returns.len(), Vec::new());
        for (ends, returns) in ends.iter_mut().zip(&self.returns) {
            ends.resize(returns.len(), self.env_steps);
        }
    }

    /// Adds the return of an episode of a run of seedbed.
    pub(crate) fn add_return(&mut self, agent: usize, r#return: f64) {
        self.returns[agent].push(f64::from(r#return as f32));
    }

    /// Number of episodes that every agent had finished when the team had made this number of environment steps;
    /// `None` if it is unknown when episodes ended.
    #[must_use]
    pub fn episodes_at(&self, env_steps: u64) -> Option<u32> {
        let finished = |ends: &Vec<u64>| ends.partition_point(|&end| end <= env_steps);
        self.episode_ends
            .iter()
            .map(finished)
            .min()
            .map(|episodes| episodes as u32)
    }

    /// Environment steps of the team when every agent had finished its first, second … episode: `[episodes]`;
    /// empty if unknown.
    #[must_use]
    pub fn steps_of_episodes(&self) -> Vec<u64> {
        let episodes = self.episode_ends.iter().map(Vec::len).min().unwrap_or(0);
        let last_of = |episode: usize| self.episode_ends.iter().map(|ends| ends[episode]).max();
        (0..episodes).filter_map(last_of).collect()
    }

    /// The returns of this run, without those of episodes that ended after this number of environment steps of
    /// the team; `None` if it is unknown when they ended.
    #[must_use]
    pub fn until(&self, env_steps: u64) -> Option<Self> {
        let is_known = self
            .episode_ends
            .iter()
            .map(Vec::len)
            .eq(self.returns.iter().map(Vec::len));
        is_known.then(|| {
            let agents = self.returns.iter().zip(&self.episode_ends);
            let until = |(returns, ends): (&Vec<f64>, &Vec<u64>)| {
                returns[..ends.partition_point(|&end| end <= env_steps)].to_vec()
            };
            Self {
                returns: agents.map(until).collect(),
                rounding: self.rounding,
                ..Self::default()
            }
        })
    }

    /// Whether the team has made this number of environment steps. The last episodes of a run are not finished,
    /// and may have made as many steps as the longest episode took.
    #[must_use]
    pub fn reaches_step(&self, env_steps: u64) -> bool {
        let longest = self.episode_ends.iter().flat_map(|ends| {
            let begins = std::iter::once(&0).chain(ends);
            ends.iter().zip(begins).map(|(end, begin)| end - begin)
        });
        let longest = longest.max().unwrap_or(0).max(self.longest_episode);
        self.env_steps.saturating_add(longest) >= env_steps
    }

    /// Share of the episodes of all agents that have no regret; `None` if regrets are not known.
    #[must_use]
    pub fn share_of_episodes_without_regret(&self) -> Option<f64> {
        let regrets = || self.regrets.iter().flatten();
        let without_regret = regrets().filter(|&&regret| f64::from(regret) < MIN_REGRET);
        (regrets().count() > 0).then(|| without_regret.count() as f64 / regrets().count() as f64)
    }

    /// Number of episodes that every agent has finished.
    #[must_use]
    pub fn episodes_per_agent(&self) -> usize {
        self.returns.iter().map(Vec::len).min().unwrap_or(0)
    }

    /// Whether agents finished different numbers of episodes.
    #[must_use]
    pub fn has_different_lengths(&self) -> bool {
        let mut lengths = self.returns.iter().map(Vec::len);
        lengths.any(|length| length != self.returns[0].len())
    }

    /// Mean return over agents of each episode number that every agent has finished: `[episodes]`.
    #[must_use]
    pub fn team_returns(&self) -> Vec<f64> {
        team_means(&self.returns)
    }

    /// Whether agents have a goal: a threshold of the return or, in tabular tasks, a regret of 0.
    #[must_use]
    pub fn has_goal(&self) -> bool {
        self.threshold.is_some() || !self.regrets.is_empty()
    }

    /// First episode of each agent, counted from 1, whose return reached the threshold or, in
    /// tabular tasks, that had no regret; `None` if there was none.   → `[K]`
    #[must_use]
    pub fn first_goals(&self) -> Vec<Option<u32>> {
        match self.threshold {
            Some((r#return, _)) => {
                let threshold = Threshold {
                    r#return,
                    window: 1,
                };
                first_episodes(&self.returns, |&value| {
                    threshold.is_reached_by(&[value], self.rounding)
                })
            }
            None if !self.regrets.is_empty() => {
                first_episodes(&self.regrets, |&regret| f64::from(regret) < MIN_REGRET)
            }
            None => vec![None; self.returns.len()],
        }
    }

    /// Values of a curve. Returns and regrets have one value per episode; other curves have one
    /// value for each round in which they were measured.
    #[must_use]
    pub fn curve(&self, curve: Curve) -> Vec<f64> {
        match curve {
            Curve::Return => self.team_returns(),
            Curve::Regret => team_means(&self.regrets),
            _ => self
                .measured_rounds(curve)
                .map(|(_, value)| value)
                .collect(),
        }
    }

    /// Number of episodes per agent after which each value of a curve was measured.
    #[must_use]
    pub fn episodes_of_curve(&self, curve: Curve) -> Vec<u32> {
        match curve {
            Curve::Return | Curve::Regret => (1..=self.episodes_per_agent() as u32).collect(),
            _ => self
                .measured_rounds(curve)
                .map(|(episodes, _)| episodes)
                .collect(),
        }
    }

    /// For each round in which a curve was measured, the number of episodes per agent so far and
    /// the value.
    fn measured_rounds(&self, curve: Curve) -> impl Iterator<Item = (u32, f64)> {
        let index = Curve::WITH_ROUND_VALUES
            .iter()
            .position(|other| *other == curve);
        let values = index.and_then(|index| self.curves.get(index));
        let rounds = self.episodes.iter().zip(values.into_iter().flatten());
        rounds
            .filter(|(_, value)| !value.is_nan())
            .map(|(&episodes, &value)| (episodes, f64::from(value)))
    }

    /// Newest value of a curve when each agent has finished `episode` episodes, or the last value
    /// if the run ended before.
    #[must_use]
    pub fn curve_at(&self, curve: Curve, episode: u32) -> Option<f64> {
        let value_count = self
            .episodes_of_curve(curve)
            .partition_point(|&episodes| episodes <= episode);
        self.curve(curve).get(value_count.checked_sub(1)?).copied()
    }

    /// Coverage of the team at the end.
    #[must_use]
    pub fn team_coverage(&self) -> f64 {
        self.curve(Curve::TeamCoverage)
            .last()
            .copied()
            .unwrap_or(0.0)
    }
}

/// What is measured of a training run that is not finished.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct MeasuredRun {
    result: RunResult,
    /// See [`RunResult::episode_ends`], which is not stored with the result.
    episode_ends: Vec<Vec<u64>>,
    reservoir: Reservoir,
}

impl MeasuredRun {
    /// The measures of a run that begins. `windows`: see [`Reservoir::new`].
    pub(crate) fn begin(trainer: &Trainer, run_seed: u64, windows: &[u32]) -> Self {
        Self {
            result: RunResult::begin(trainer),
            episode_ends: Vec::new(),
            reservoir: Reservoir::new(run_seed, windows),
        }
    }

    /// Adds a round that the trainer has just finished.
    pub(crate) fn add_round(&mut self, trainer: &Trainer, rows: &RoundRows) {
        self.result.add_round(trainer, rows);
        self.result.end_episodes(&mut self.episode_ends);
        for episode in trainer.newest_episodes() {
            self.reservoir.add_episode(episode);
        }
    }

    /// The result of the run, which has ended.
    pub(crate) fn finish(self) -> RunResult {
        RunResult {
            states: self.reservoir.into_samples(),
            episode_ends: self.episode_ends,
            ..self.result
        }
    }
}

/// Keeps uniform samples of states during a run.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Reservoir {
    /// The sample of each window. Each has its own random stream, so that it does not depend on the
    /// other windows.
    samples: Vec<(VisitedStates, Stream)>,
}

impl Reservoir {
    /// Begins a sample of the states in the first n episodes of each agent, for each number n in
    /// `windows`.
    #[must_use]
    pub fn new(run_seed: u64, windows: &[u32]) -> Self {
        let empty_sample = |&episodes: &u32| {
            let random = stream(run_seed, Purpose::Recording, episodes, SAMPLING_STREAM);
            (
                VisitedStates {
                    episodes,
                    visited: 0,
                    states: Vec::new(),
                    visits: Vec::new(),
                },
                random,
            )
        };
        Self {
            samples: windows.iter().map(empty_sample).collect(),
        }
    }

    /// Adds a state that an agent visited in this episode, both counted from 0.
    pub fn add(&mut self, agent: u32, episode: u32, state: &[f32]) {
        for (sample, random) in self
            .samples
            .iter_mut()
            .filter(|(sample, _)| episode < sample.episodes)
        {
            sample.add((agent, episode), state, random);
        }
    }

    /// Adds the states of an episode, with the one in which it ended.
    fn add_episode(&mut self, episode: &Episode) {
        let width = episode.observations.len() / (episode.length() + 1);
        for state in episode.observations.chunks_exact(width) {
            self.add(episode.agent, episode.episode, state);
        }
    }

    /// The samples.
    #[must_use]
    pub fn into_samples(self) -> Vec<VisitedStates> {
        self.samples.into_iter().map(|(sample, _)| sample).collect()
    }
}

impl VisitedStates {
    /// Adds a visited state by reservoir sampling (Vitter 1985, algorithm R): every state of a
    /// window is in the sample with the same probability.
    fn add(&mut self, visit: (u32, u32), state: &[f32], random: &mut Stream) {
        let max_states = max_sampled_states(state.len());
        if self.visits.len() < max_states {
            self.states.extend_from_slice(state);
            self.visits.push(visit);
        } else {
            let index = random.random_range(0..=self.visited) as usize;
            if index < max_states {
                self.visits[index] = visit;
                self.states[index * state.len()..(index + 1) * state.len()].copy_from_slice(state);
            }
        }
        self.visited += 1;
    }
}

/// First episode of each agent, counted from 1, whose value is a goal.   `values: [K][episodes]` →
/// `[K]`
fn first_episodes<T>(values: &[Vec<T>], is_goal: impl Fn(&T) -> bool) -> Vec<Option<u32>> {
    let mut first_episodes = Vec::with_capacity(values.len());
    for values_of_agent in values {
        let index = values_of_agent.iter().position(&is_goal);
        first_episodes.push(index.map(|index| index as u32 + 1));
    }
    first_episodes
}

/// Mean over agents of the values of each episode number: `[K][episodes]` → `[min episodes]`
fn team_means<T: Copy + Into<f64>>(values: &[Vec<T>]) -> Vec<f64> {
    let episodes = values.iter().map(Vec::len).min().unwrap_or(0);
    let mut means = Vec::with_capacity(episodes);
    for episode in 0..episodes {
        let values_of_agents = values.iter().map(|values| values[episode].into());
        means.push(values_of_agents.sum::<f64>() / values.len() as f64);
    }
    means
}

/// Numbers of double precision that are stored in single precision.
mod single_precision {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(crate) fn serialize<S: Serializer>(
        returns: &[Vec<f64>],
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        let single = |agent: &Vec<f64>| agent.iter().map(|&value| value as f32).collect();
        let returns: Vec<Vec<f32>> = returns.iter().map(single).collect();
        returns.serialize(serializer)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Vec<Vec<f64>>, D::Error> {
        let returns = Vec::<Vec<f32>>::deserialize(deserializer)?;
        let double = |agent: Vec<f32>| agent.into_iter().map(f64::from).collect();
        Ok(returns.into_iter().map(double).collect())
    }
}
