//! The colors of lines and points of visited states.

use super::axes::VisitedState;
use super::fraction;
use crate::run::facts::EpisodeRow;
use crate::run::recorder::BonusRange;
use crate::scenario::recording::ColorBy;
use seedbed_env::{Status, TaskSpec};
use seedbed_figure::color::dark::{categorical_color, sequential_color};
use seedbed_learn::experience::Episode;

/// How lines and points of states are colored. The scale is the same throughout a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coloring {
    /// What the color shows.
    pub color_by: ColorBy,
    /// The values at the ends of the scale; not used if [`has_scale`](Self::has_scale) is false.
    pub range: [f32; 2],
}

impl Coloring {
    /// The range of the scale for the whole run. `max_episodes` is the maximum number of episodes
    /// per agent. The range of returns depends on those of the first round.
    #[must_use]
    pub fn range_for_run(
        color_by: ColorBy,
        spec: &TaskSpec,
        max_episodes: u32,
        bonus: BonusRange,
        first_round: &[EpisodeRow],
    ) -> [f32; 2] {
        match color_by {
            ColorBy::Agent | ColorBy::Outcome => [0.0, 1.0],
            ColorBy::Episode => [0.0, max_episodes.saturating_sub(1).max(1) as f32],
            ColorBy::IntrinsicReward => [0.0, bonus.scale_end().unwrap_or(1.0)],
            ColorBy::Return => {
                let returns: Vec<f32> = first_round.iter().map(|row| row.r#return as f32).collect();
                range_of_returns(&returns, spec.reward_threshold)
            }
        }
    }

    /// The color of a state; `None` if states have the color of their agent.
    #[must_use]
    pub fn color(&self, episode: &Episode, state: &VisitedState<'_>) -> Option<[u8; 3]> {
        let scaled = |value: f32| Some(sequential_color(fraction(value, self.range).max(0.0)));
        match self.color_by {
            ColorBy::Agent => None,
            ColorBy::Episode => scaled(episode.episode as f32),
            ColorBy::Return => scaled(episode.total_reward() as f32),
            ColorBy::Outcome => Some(outcome_color(episode.outcome == Status::Terminated)),
            ColorBy::IntrinsicReward => scaled(state.bonus),
        }
    }

    /// The title of the color scale.
    #[must_use]
    pub fn title(&self) -> &'static str {
        match self.color_by {
            ColorBy::Agent => "agent",
            ColorBy::Episode => "episode",
            ColorBy::Return => "return",
            ColorBy::Outcome => "ended",
            ColorBy::IntrinsicReward => "bonus",
        }
    }

    /// Whether colors represent values on a continuous scale.
    #[must_use]
    pub fn has_scale(&self) -> bool {
        !matches!(self.color_by, ColorBy::Agent | ColorBy::Outcome)
    }
}

/// The color of an outcome on a dark background.
#[must_use]
pub fn outcome_color(terminated: bool) -> [u8; 3] {
    categorical_color(if terminated { 0 } else { 3 })
}

/// The range of the scale of returns: from the lowest return of the first round to the reward
/// threshold or, if no threshold is above the lowest return, to the highest return. If both ends
/// are equal, the range has the length 1.
fn range_of_returns(returns: &[f32], threshold: Option<f32>) -> [f32; 2] {
    let returns = || returns.iter().copied();
    let low = returns().fold(f32::INFINITY, f32::min);
    let high = returns().fold(f32::NEG_INFINITY, f32::max);
    let low = if low.is_finite() { low } else { 0.0 };
    let high = threshold
        .filter(|threshold| *threshold > low)
        .unwrap_or(high);
    [low, if high > low { high } else { low + 1.0 }]
}

#[cfg(test)]
mod tests {
    use super::super::axes::tests::{spec, state_at};
    use super::*;

    fn episode(reward: f32) -> Episode {
        Episode {
            rewards: vec![reward],
            outcome: Status::Truncated,
            ..Episode::start(2, 30, 30, &spec(&[[0.0, 1.0]]))
        }
    }

    #[test]
    fn the_scale_of_returns_ends_at_the_reward_threshold() {
        assert_eq!(range_of_returns(&[8.0, 20.0], Some(195.0)), [8.0, 195.0]);
        assert_eq!(range_of_returns(&[8.0, 20.0], None), [8.0, 20.0]);
        assert_eq!(
            range_of_returns(&[20.0], Some(10.0)),
            [20.0, 21.0],
            "all returns of the first round are above the threshold"
        );
        assert_eq!(range_of_returns(&[], None), [0.0, 1.0]);
    }

    #[test]
    fn the_color_of_a_state_follows_the_color_setting() {
        let (episode, state) = (
            episode(8.0),
            VisitedState {
                bonus: 0.5,
                ..state_at(0, &[0.3])
            },
        );
        let color = |color_by, range| Coloring { color_by, range }.color(&episode, &state);
        assert_eq!(color(ColorBy::Agent, [0.0, 1.0]), None);
        assert_eq!(
            color(ColorBy::Episode, [0.0, 60.0]),
            Some(sequential_color(0.5))
        );
        assert_eq!(
            color(ColorBy::Return, [8.0, 195.0]),
            Some(sequential_color(0.0))
        );
        assert_eq!(
            color(ColorBy::IntrinsicReward, [0.0, 2.0]),
            Some(sequential_color(0.25))
        );
        assert_eq!(
            color(ColorBy::Outcome, [0.0, 1.0]),
            Some(outcome_color(false))
        );
    }
}
