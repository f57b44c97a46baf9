//! Statistics of a whole recording, read once: returns, coverage, visitation entropy, overlap, and
//! the distribution of each observation.

use std::collections::BTreeSet;

use super::LoadedRun;
use super::distribution::ValueDistribution;
use super::selection::EpisodeSelection;
use crate::record::{ReadError, RecordedEpisode, RecordedStates};
use crate::run::facts::{EpisodeRow, StateQuantity};
use crate::run::measures::Division;
use crate::run::measures::diversity::Diversity;
use crate::run::measures::first_visits::FirstRounds;
use crate::run::measures::recent::LatestVisits;
use crate::run::measures::visitation::{StateBins, Visitation, diversity_of_team, known_diversity};
use seedbed_env::Quantity;

/// Maximum number of numbers that are kept in memory between both passes over the values: 128 MB.
const MAX_KEPT_NUMBERS: usize = 1 << 25;

/// Statistics of a recording. While they are computed, the values of small recordings are kept in memory; those of
/// larger ones are read again for the medians.
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
    /// Distribution of each entry of `info` that is recorded beside the observations: `[info]`.
    pub info: Vec<ValueDistribution>,
    /// Distribution of each action's values: `[components of an action]`.
    pub actions: Vec<ValueDistribution>,
    /// Distribution of rewards.
    pub rewards: ValueDistribution,
    /// Distribution of intrinsic rewards; `None` without a bonus.
    pub intrinsic_rewards: Option<ValueDistribution>,
}

fn distributions(quantities: &[Quantity]) -> Vec<ValueDistribution> {
    quantities.iter().map(ValueDistribution::new).collect()
}

/// The distribution of an entry of `info`: only observations and actions have ranges.
fn without_range(quantity: &Quantity) -> ValueDistribution {
    ValueDistribution::new(&Quantity {
        range: [f32::NEG_INFINITY, f32::INFINITY],
        ..quantity.clone()
    })
}

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
        let intrinsic_reward = recording.bonus().scale_end();
        let intrinsic_reward =
            intrinsic_reward.map(|end| StateQuantity::IntrinsicReward.with_range([0.0, end]));
        let mut stats = Self {
            episodes: Vec::new(),
            visitation: Vec::new(),
            first_rounds: FirstRounds::default(),
            latest: LatestVisits::default(),
            rounds_are_shared: recording.state_files().is_none(),
            distributions: distributions(observations),
            info: recording.info().iter().map(without_range).collect(),
            actions: distributions(recording.actions()),
            rewards: ValueDistribution::new(
                &StateQuantity::Reward.with_range([f32::NEG_INFINITY, f32::INFINITY]),
            ),
            intrinsic_rewards: intrinsic_reward.as_ref().map(ValueDistribution::new),
        };
        let mut kept = Vec::new();
        let mut numbers = 0_usize;
        for episode in recording.episodes()? {
            let episode = episode?;
            if !selection.includes(episode.agent, episode.episode) {
                continue;
            }
            on_episode(&episode);
            stats.add_episode(observations, &episode);
            numbers += episode.numbers();
            if numbers <= MAX_KEPT_NUMBERS {
                kept.push(episode);
            } else {
                kept = Vec::new();
            }
        }
        stats.find_medians(recording, (numbers <= MAX_KEPT_NUMBERS).then_some(kept))?;
        stats.sort_episodes();
        Ok(stats)
    }

    /// Counts the values again, for the medians: those of the episodes that were kept, or else of the file.
    fn find_medians(
        &mut self,
        recording: &RecordedStates,
        kept: Option<Vec<RecordedEpisode>>,
    ) -> Result<(), ReadError> {
        let of_rewards = std::iter::once(&mut self.rewards).chain(&mut self.intrinsic_rewards);
        let of_states = self.distributions.iter_mut().chain(&mut self.info);
        let of_task = of_states.chain(&mut self.actions);
        of_task
            .chain(of_rewards)
            .for_each(ValueDistribution::find_middle);
        if let Some(episodes) = kept {
            for episode in &episodes {
                self.for_each_value(episode, ValueDistribution::add_again);
            }
            return Ok(());
        }
        let rows = self.episodes.iter();
        let read: BTreeSet<(u32, u32)> = rows.map(|row| (row.agent, row.episode)).collect();
        for episode in recording.episodes()? {
            let episode = episode?;
            if read.contains(&(episode.agent, episode.episode)) {
                self.for_each_value(&episode, ValueDistribution::add_again);
            }
        }
        Ok(())
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
        self.for_each_value(episode, ValueDistribution::add);
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

    /// Adds each value of an episode to its distribution.
    fn for_each_value(&mut self, episode: &RecordedEpisode, add: fn(&mut ValueDistribution, f32)) {
        let [of_reward, of_bonus] = [
            std::slice::from_mut(&mut self.rewards),
            self.intrinsic_rewards.as_mut_slice(),
        ];
        for (distributions, rows) in [
            (&mut self.distributions[..], &episode.observations),
            (&mut self.info[..], &episode.info),
            (&mut self.actions[..], &episode.actions),
            (of_reward, &episode.rewards),
            (of_bonus, &episode.intrinsic_rewards),
        ] {
            for row in rows.chunks_exact(distributions.len().max(1)) {
                for (distribution, &value) in distributions.iter_mut().zip(row) {
                    add(distribution, value);
                }
            }
        }
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

    /// Overlap of each pair of agents' visits, 0 to 1; `None` if they cannot be compared, because one has
    /// no visits: `[K × K]`.
    #[must_use]
    pub fn overlaps(&self) -> Vec<Option<f64>> {
        let agents = &self.visitation;
        let entropy: Vec<f64> = agents.iter().map(Visitation::entropy).collect();
        let overlap = |one: usize, other: usize| {
            let pair = [&agents[one], &agents[other]];
            let entropies = [entropy[one], entropy[other]];
            let diversity = known_diversity(&pair, &entropies, Division::NONE);
            diversity.map(|diversity| diversity.overlap)
        };
        let mut overlaps = vec![Some(1.0); agents.len() * agents.len()];
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
    pub fn recent_diversity(&self) -> Option<Diversity> {
        let quantities = self
            .distributions
            .iter()
            .map(|distribution| distribution.quantity.clone());
        let no_visits = Visitation::for_observations(&quantities.collect::<Vec<_>>());
        self.latest.diversity(&no_visits, self.rounds_are_shared)
    }

    /// Diversity of the whole team's visits; `None` if no two agents with visits can be compared.
    #[must_use]
    pub fn diversity(&self) -> Option<Diversity> {
        diversity_of_team(&self.visitation)
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

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    /// Values of large recordings are read again, with the same result.
    #[test]
    fn medians_of_kept_episodes_are_those_of_the_file() {
        let recording = RecordedStates::open(Path::new("recordings/sample/run.rrd")).unwrap();
        let stats = RecordingStats::of(&recording, &EpisodeSelection::all(), |_| {}).unwrap();
        let mut again = stats.clone();
        again.find_medians(&recording, None).unwrap();
        let medians = |stats: &RecordingStats| {
            let distributions = stats.distributions.iter().chain(&stats.actions);
            let medians: Vec<Option<f64>> = distributions.map(ValueDistribution::median).collect();
            medians
        };
        assert!(medians(&stats).iter().all(Option::is_some));
        assert_eq!(medians(&stats), medians(&again));
    }
}
