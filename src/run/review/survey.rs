//! Goes through all recorded states once and counts: returns, coverage, entropy, overlap, and how values are distributed.

use super::Review;
use crate::env::Quantity;
use crate::record::EpisodeRow;
use crate::record::rerun::read::{ReadError, RecordedEpisode, Recording};
use crate::run::measures::diversity::Diversity;
use crate::run::measures::visitation::{Visitation, diversity};

/// What a recording holds, counted. Memory does not grow with the number of states, save one row an episode.
#[derive(Clone, Debug)]
pub struct Survey {
    /// In (round, agent) order, as in `episodes.csv`.
    pub episodes: Vec<EpisodeRow>,
    /// Where each agent has been: `[K]`.
    pub visitation: Vec<Visitation>,
    /// How the values of each observation are distributed: `[observations]`.
    pub spreads: Vec<Spread>,
    /// How the intrinsic rewards are distributed; none without curiosity.
    pub bonus: Option<Spread>,
}

/// How the values of one quantity are distributed.
#[derive(Clone, Debug, PartialEq)]
pub struct Spread {
    /// Name, unit, range.
    pub quantity: Quantity,
    /// The least value.
    pub least: f32,
    /// The largest value.
    pub most: f32,
    /// How many values there are.
    pub count: u64,
    /// Values beyond the range.
    pub outside: u64,
    sum: f64,
    /// Over equal parts of the range; those beyond in the outermost.
    histogram: Vec<u64>,
}

/// Parts of a range for which values are counted: the median is known to a thousandth of the range.
const PARTS: usize = 1000;

impl Survey {
    /// Reads all of a recording.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn of(
        recording: &Recording,
        mut seen: impl FnMut(&RecordedEpisode),
    ) -> Result<Self, ReadError> {
        let observations = recording.observations();
        let bonus = recording.largest_bonus().map(|largest| Quantity {
            name: "intrinsic reward".to_owned(),
            unit: String::new(),
            range: [0.0, if largest > 0.0 { largest } else { 1.0 }],
        });
        let mut survey = Self {
            episodes: Vec::new(),
            visitation: Vec::new(),
            spreads: observations.iter().map(Spread::new).collect(),
            bonus: bonus.as_ref().map(Spread::new),
        };
        for episode in recording.episodes()? {
            let episode = episode?;
            seen(&episode);
            survey.take_in(observations, &episode);
        }
        survey.put_in_order();
        Ok(survey)
    }

    fn take_in(&mut self, observations: &[Quantity], episode: &RecordedEpisode) {
        let agent = episode.agent as usize;
        if self.visitation.len() <= agent {
            self.visitation
                .resize(agent + 1, Visitation::of(observations));
        }
        self.visitation[agent].visit_states(observations, &episode.observations);
        for state in episode.states() {
            self.spreads
                .iter_mut()
                .zip(state)
                .for_each(|(spread, &value)| spread.add(value));
        }
        if let Some(bonus) = &mut self.bonus {
            episode
                .intrinsic_rewards
                .iter()
                .for_each(|&value| bonus.add(value));
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
            // A recording is not read round by round, and these are of a round's end.
            visitation_entropy: f64::NAN,
            team_overlap: f64::NAN,
            effective_agents: f64::NAN,
        });
    }

    /// A recording has the episodes of each agent in their order; the tables have those of all agents, round by round.
    fn put_in_order(&mut self) {
        self.episodes
            .sort_by_key(|row| (row.round, row.agent, row.episode));
        let mut env_steps = 0;
        for row in &mut self.episodes {
            env_steps += u64::from(row.length);
            row.env_steps = env_steps;
        }
    }

    /// How much each pair of agents overlaps, 0 to 1: `[K × K]`.
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
                let shared = overlap(one, other);
                overlaps[one * agents.len() + other] = shared;
                overlaps[other * agents.len() + one] = shared;
            }
        }
        overlaps
    }

    /// How far the whole team differs.
    #[must_use]
    pub fn diversity(&self) -> Diversity {
        let entropy: Vec<f64> = self.visitation.iter().map(Visitation::entropy).collect();
        diversity(&self.visitation, &entropy)
    }
}

impl Review {
    /// Surveys the recording, if there is one, and fills in the rows of episodes where there are no tables.   `seen` is told each episode
    ///
    /// # Errors
    /// The recording cannot be read.
    pub fn survey(
        &mut self,
        seen: impl FnMut(&RecordedEpisode),
    ) -> Result<Option<Survey>, ReadError> {
        let Some(recording) = &self.recording else {
            return Ok(None);
        };
        let survey = Survey::of(recording, seen)?;
        if self.folder.is_none() {
            self.episodes.clone_from(&survey.episodes);
        }
        Ok(Some(survey))
    }
}

impl Spread {
    fn new(quantity: &Quantity) -> Self {
        let (least, most) = (f32::INFINITY, f32::NEG_INFINITY);
        Self {
            quantity: quantity.clone(),
            least,
            most,
            count: 0,
            outside: 0,
            sum: 0.0,
            histogram: vec![0; PARTS],
        }
    }

    fn add(&mut self, value: f32) {
        let [low, high] = self.quantity.range;
        self.least = self.least.min(value);
        self.most = self.most.max(value);
        self.count += 1;
        self.sum += f64::from(value);
        self.outside += u64::from(value < low || value > high);
        let part = (value - low) / (high - low) * PARTS as f32;
        self.histogram[part.clamp(0.0, PARTS as f32 - 1.0) as usize] += 1;
    }

    /// The mean, if there are values.
    #[must_use]
    pub fn mean(&self) -> Option<f64> {
        (self.count > 0).then(|| self.sum / self.count as f64)
    }

    /// The median, to a thousandth of the range; a median beyond the range counts as at its end.
    #[must_use]
    pub fn median(&self) -> Option<f32> {
        let mut below = 0;
        let part = self.histogram.iter().position(|count| {
            below += count;
            2 * below >= self.count && below > 0
        })?;
        let [low, high] = self.quantity.range;
        Some(low + (high - low) * (part as f32 + 0.5) / PARTS as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_counted() {
        let mut spread = Spread::new(&Quantity {
            name: "x".to_owned(),
            unit: String::new(),
            range: [0.0, 1000.0],
        });
        assert_eq!((spread.mean(), spread.median()), (None, None));
        for value in [-5.0, 10.2, 20.2, 30.2, 1200.0] {
            spread.add(value);
        }
        assert_eq!(
            (spread.least, spread.most, spread.count, spread.outside),
            (-5.0, 1200.0, 5, 2)
        );
        assert!(
            (spread.median().unwrap() - 20.5).abs() < 1e-3,
            "the part from 20 to 21: {:?}",
            spread.median()
        );
        assert!((spread.mean().unwrap() - 1255.6 / 5.0).abs() < 1e-4);
    }
}
