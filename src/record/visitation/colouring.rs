//! What the colour of a line or point tells.

use super::axes::Seen;
use super::fraction;
use crate::env::{Spec, Status};
use crate::experience::Episode;
use crate::record::Colour;
use crate::record::palette::{OUTCOMES, sequential};

/// Gives states their colours, on one scale throughout a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Colouring {
    /// What the colour tells.
    pub by: Colour,
    /// The values at the ends of the scale; of no meaning where there is none.
    pub range: [f32; 2],
}

impl Colouring {
    /// The scale that holds for the whole run. Returns are known once `first`, the episodes of the first round, are; the run has
    /// `episodes` at most, and no bonus is above `largest_bonus`.
    #[must_use]
    pub fn range(
        by: Colour,
        spec: &Spec,
        episodes: u32,
        largest_bonus: Option<f32>,
        first: &[&Episode],
    ) -> [f32; 2] {
        match by {
            Colour::Agent | Colour::Outcome => [0.0, 1.0],
            Colour::Episode => [0.0, episodes.saturating_sub(1).max(1) as f32],
            Colour::IntrinsicReward => [
                0.0,
                largest_bonus
                    .filter(|largest| *largest > 0.0)
                    .unwrap_or(1.0),
            ],
            Colour::Return => returns(first, spec.reward_threshold),
        }
    }

    /// The colour of a state; none where agents have theirs.
    #[must_use]
    pub fn color(&self, episode: &Episode, seen: &Seen<'_>) -> Option<[u8; 3]> {
        let scaled = |value: f32| Some(sequential(fraction(value, self.range)));
        match self.by {
            Colour::Agent => None,
            Colour::Episode => scaled(episode.episode as f32),
            Colour::Return => scaled(episode.total_reward() as f32),
            Colour::Outcome => Some(OUTCOMES[usize::from(episode.outcome == Status::Terminated)]),
            Colour::IntrinsicReward => scaled(seen.bonus),
        }
    }

    /// What stands beside the scale.
    #[must_use]
    pub fn title(&self) -> &'static str {
        match self.by {
            Colour::Agent => "agent",
            Colour::Episode => "episode",
            Colour::Return => "return",
            Colour::Outcome => "ended",
            Colour::IntrinsicReward => "bonus",
        }
    }

    /// Whether values lie between the ends of a scale.
    #[must_use]
    pub fn has_scale(&self) -> bool {
        !matches!(self.by, Colour::Agent | Colour::Outcome)
    }
}

/// From the lowest of the first round to the threshold or else to the highest; where they are the same, one more.
fn returns(first: &[&Episode], threshold: Option<f32>) -> [f32; 2] {
    let totals = || first.iter().map(|episode| episode.total_reward() as f32);
    let low = totals().fold(f32::INFINITY, f32::min);
    let high = totals().fold(f32::NEG_INFINITY, f32::max);
    let low = if low.is_finite() { low } else { 0.0 };
    let high = threshold
        .filter(|threshold| *threshold > low)
        .unwrap_or(high);
    [low, if high > low { high } else { low + 1.0 }]
}

#[cfg(test)]
mod tests {
    use super::super::axes::tests::{seen, spec};
    use super::*;

    fn episode(reward: f32) -> Episode {
        Episode {
            rewards: vec![reward],
            outcome: Status::Truncated,
            ..Episode::start(2, 30, 30, &spec(&[[0.0, 1.0]]))
        }
    }

    #[test]
    fn returns_are_scaled_from_the_first_round_to_what_solves_the_task() {
        let (low, high) = (episode(8.0), episode(20.0));
        assert_eq!(returns(&[&low, &high], Some(195.0)), [8.0, 195.0]);
        assert_eq!(returns(&[&low, &high], None), [8.0, 20.0]);
        assert_eq!(
            returns(&[&high], Some(10.0)),
            [20.0, 21.0],
            "the task was solved at once"
        );
        assert_eq!(returns(&[], None), [0.0, 1.0]);
    }

    #[test]
    fn each_colour_tells_something_else() {
        let (episode, seen) = (
            episode(8.0),
            Seen {
                bonus: 0.5,
                ..seen(0, &[0.3])
            },
        );
        let color = |by, range| Colouring { by, range }.color(&episode, &seen);
        assert_eq!(color(Colour::Agent, [0.0, 1.0]), None);
        assert_eq!(color(Colour::Episode, [0.0, 60.0]), Some(sequential(0.5)));
        assert_eq!(color(Colour::Return, [8.0, 195.0]), Some(sequential(0.0)));
        assert_eq!(
            color(Colour::IntrinsicReward, [0.0, 2.0]),
            Some(sequential(0.25))
        );
        assert_eq!(color(Colour::Outcome, [0.0, 1.0]), Some(OUTCOMES[0]));
    }
}
