//! Statistics of a whole recording, read once: returns, coverage, visitation entropy, overlap, and
//! the distribution of each observation.

use super::LoadedRun;
use super::selection::EpisodeSelection;
use crate::record::{EpisodeRow, ReadError, RecordedEpisode, RecordedStates};
use crate::run::measures::diversity::Diversity;
use crate::run::measures::first_visits::FirstRounds;
use crate::run::measures::recent::LatestVisits;
use crate::run::measures::visitation::{StateBins, Visitation, diversity};
use seedbed_env::Quantity;

/// Statistics of a recording. Memory grows by one row per episode, not with the number of states.
#[derive(Clone, Debug)]
pub struct RecordingStats {
    /// One row per episode, in (round, agent) order as in `episodes.csv`.
    pub episodes: Vec<EpisodeRow>,
    /// Visit counts of each agent: `[K]`.
    pub visitation: Vec<Visitation>,
    first_rounds: FirstRounds,
    latest: LatestVisits,
    /// Whether episodes of the same round were played at about the same time.
    rounds_are_shared: bool,
    /// Distribution of each observation's values: `[observations]`.
    pub distributions: Vec<ValueDistribution>,
    /// Distribution of intrinsic rewards; `None` without a bonus.
    pub intrinsic_rewards: Option<ValueDistribution>,
}

/// Distribution of the values of one quantity.
#[derive(Clone, Debug, PartialEq)]
pub struct ValueDistribution {
    /// Name, unit and display range of the quantity.
    pub quantity: Quantity,
    /// Smallest value.
    pub min: f32,
    /// Largest value.
    pub max: f32,
    /// Number of values.
    pub count: u64,
    /// Number of values outside the range.
    pub outside: u64,
    sum: f64,
    /// Number of values in each of `BINS` equal bins of the range; values outside the range count
    /// in the first or last bin.
    histogram: Vec<u64>,
}

/// Number of histogram bins: the median is exact to a thousandth of the range.
const BINS: usize = 1000;

impl RecordingStats {
    /// Reads the selected episodes; calls `on_episode` for each.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn of(
        recording: &RecordedStates,
        selection: &EpisodeSelection,
        mut on_episode: impl FnMut(&RecordedEpisode),
    ) -> Result<Self, ReadError> {
        let observations = recording.observations();
        let intrinsic_reward = recording.bonus().max().map(|largest| Quantity {
            name: "intrinsic reward".to_owned(),
            unit: String::new(),
            range: [0.0, if largest > 0.0 { largest } else { 1.0 }],
        });
        let mut stats = Self {
            episodes: Vec::new(),
            visitation: Vec::new(),
            first_rounds: FirstRounds::default(),
            latest: LatestVisits::default(),
            rounds_are_shared: recording.state_files().is_none(),
            distributions: observations.iter().map(ValueDistribution::new).collect(),
            intrinsic_rewards: intrinsic_reward.as_ref().map(ValueDistribution::new),
        };
        for episode in recording.episodes()? {
            let episode = episode?;
            if !selection.includes(episode.agent, episode.episode) {
                continue;
            }
            on_episode(&episode);
            stats.add_episode(observations, &episode);
        }
        stats.sort_episodes();
        Ok(stats)
    }

    fn add_episode(&mut self, observations: &[Quantity], episode: &RecordedEpisode) {
        let agent = episode.agent as usize;
        if self.visitation.len() <= agent {
            self.visitation
                .resize(agent + 1, Visitation::for_observations(observations));
        }
        let (round, states) = (
            episode.round,
            StateBins::of(observations, &episode.observations),
        );
        let visitation = &mut self.visitation[agent];
        visitation.add(&states);
        self.first_rounds
            .add(agent, round, &states, visitation.cell_count());
        self.latest.add(agent, round, states);
        for state in episode.states() {
            self.distributions
                .iter_mut()
                .zip(state)
                .for_each(|(distribution, &value)| distribution.add(value));
        }
        if let Some(distribution) = &mut self.intrinsic_rewards {
            episode
                .intrinsic_rewards
                .iter()
                .for_each(|&value| distribution.add(value));
        }
        self.episodes.push(EpisodeRow {
            agent: episode.agent,
            episode: episode.episode,
            round: episode.round,
            env_steps: 0,
            r#return: episode.total_reward(),
            length: episode.length() as u32,
            outcome: episode.outcome,
            coverage: self.visitation[agent].coverage(),
            // These measures are known only at the end of a round, and a recording is not read
            // round by round.
            visitation_entropy: f64::NAN,
            team_overlap: f64::NAN,
            effective_agents: f64::NAN,
        });
    }

    /// Sorts the rows of episodes as in `episodes.csv`, and sets their `env_steps`. A recording
    /// stores the episodes agent by agent; the table stores them round by round.
    fn sort_episodes(&mut self) {
        self.episodes
            .sort_by_key(|row| (row.round, row.agent, row.episode));
        let mut env_steps = 0;
        for row in &mut self.episodes {
            env_steps += u64::from(row.length);
            row.env_steps = env_steps;
        }
    }

    /// Overlap of each pair of agents' visits, 0 to 1: `[K × K]`.
    #[must_use]
    pub fn overlaps(&self) -> Vec<f64> {
        let agents = &self.visitation;
        let entropy: Vec<f64> = agents.iter().map(Visitation::entropy).collect();
        let overlap = |one: usize, other: usize| {
            let pair = [agents[one].clone(), agents[other].clone()];
            diversity(&pair, &[entropy[one], entropy[other]]).overlap
        };
        let mut overlaps = vec![1.0; agents.len() * agents.len()];
        for one in 0..agents.len() {
            for other in one + 1..agents.len() {
                let overlap = overlap(one, other);
                overlaps[one * agents.len() + other] = overlap;
                overlaps[other * agents.len() + one] = overlap;
            }
        }
        overlaps
    }

    /// Share of the state space that each agent was the first to visit: `[K]`.
    #[must_use]
    pub fn first_coverage(&self) -> Vec<f64> {
        self.first_rounds.coverage()
    }

    /// Diversity of the whole team's visits in the latest rounds. Agents that another program trained
    /// need not have played as many episodes as the others: of each, the latest episodes count.
    #[must_use]
    pub fn recent_diversity(&self) -> Diversity {
        let quantities = self
            .distributions
            .iter()
            .map(|distribution| distribution.quantity.clone());
        let no_visits = Visitation::for_observations(&quantities.collect::<Vec<_>>());
        self.latest.diversity(&no_visits, self.rounds_are_shared)
    }

    /// Diversity of the whole team's visits.
    #[must_use]
    pub fn diversity(&self) -> Diversity {
        let entropy: Vec<f64> = self.visitation.iter().map(Visitation::entropy).collect();
        diversity(&self.visitation, &entropy)
    }
}

impl LoadedRun {
    /// Computes the statistics of the selected episodes, if there is a recording. If `episodes.csv` or
    /// `rounds.csv` is missing, sets `self.episodes` to the rows of these statistics. Calls `on_episode`
    /// for each episode.
    ///
    /// # Errors
    /// The recording cannot be read.
    pub fn compute_stats(
        &mut self,
        selection: &EpisodeSelection,
        on_episode: impl FnMut(&RecordedEpisode),
    ) -> Result<Option<RecordingStats>, ReadError> {
        let Some(recording) = &self.recording else {
            return Ok(None);
        };
        let stats = RecordingStats::of(recording, selection, on_episode)?;
        if self.folder.is_none() {
            self.episodes.clone_from(&stats.episodes);
        }
        Ok(Some(stats))
    }
}

impl ValueDistribution {
    fn new(quantity: &Quantity) -> Self {
        Self {
            quantity: quantity.clone(),
            min: f32::INFINITY,
            max: f32::NEG_INFINITY,
            count: 0,
            outside: 0,
            sum: 0.0,
            histogram: vec![0; BINS],
        }
    }

    fn add(&mut self, value: f32) {
        let [low, high] = self.quantity.range;
        self.min = self.min.min(value);
        self.max = self.max.max(value);
        self.count += 1;
        self.sum += f64::from(value);
        self.outside += u64::from(value < low || value > high);
        let bin = (value - low) / (high - low) * BINS as f32;
        self.histogram[bin.clamp(0.0, BINS as f32 - 1.0) as usize] += 1;
    }

    /// Mean; `None` without values.
    #[must_use]
    pub fn mean(&self) -> Option<f64> {
        (self.count > 0).then(|| self.sum / self.count as f64)
    }

    /// Median, exact to a thousandth of the range. A median outside the range is reported at the
    /// range's end.
    #[must_use]
    pub fn median(&self) -> Option<f32> {
        let mut below = 0;
        let bin = self.histogram.iter().position(|count| {
            below += count;
            2 * below >= self.count && below > 0
        })?;
        let [low, high] = self.quantity.range;
        Some(low + (high - low) * (bin as f32 + 0.5) / BINS as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn min_max_mean_and_median_are_those_of_the_values() {
        let mut distribution = ValueDistribution::new(&Quantity {
            name: "x".to_owned(),
            unit: String::new(),
            range: [0.0, 1000.0],
        });
        assert_eq!((distribution.mean(), distribution.median()), (None, None));
        for value in [-5.0, 10.2, 20.2, 30.2, 1200.0] {
            distribution.add(value);
        }
        assert_eq!(
            (
                distribution.min,
                distribution.max,
                distribution.count,
                distribution.outside
            ),
            (-5.0, 1200.0, 5, 2)
        );
        assert!(
            (distribution.median().unwrap() - 20.5).abs() < 1e-3,
            "the bin from 20 to 21: {:?}",
            distribution.median()
        );
        assert!((distribution.mean().unwrap() - 1255.6 / 5.0).abs() < 1e-4);
    }
}
