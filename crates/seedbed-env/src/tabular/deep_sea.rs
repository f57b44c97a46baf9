//! Deep sea (Osband et al. 2019, arXiv 1908.03568, `deep_sea` of bsuite).

use rand::RngExt;
use serde::{Deserialize, Serialize};

use super::model::{Coordinate, Mdp, Model, Outcome, Prior, Reward};
use seedbed_input::numbers::{
    Count, FractionBelowOne, NonNegative, Positive, ranged_count, ranged_number,
};
use seedbed_random::Stream;

/// A grid of N × N cells. An episode starts in the upper left corner. Each step moves one row down
/// and one column to the left or right; a move to the right costs `move_cost` / N. The episode ends
/// after the last row, where only a move to the right in the last column is rewarded, with 1. A
/// move to the left in the first column stays in it.
///
/// Agents do not know which action moves in which direction (Dirichlet prior of concentration
/// `outcome_weight` on both), nor the reward of a move to the right in each column of the last row
/// (prior N(0, `deviation`²)).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DeepSea {
    /// Number of rows and columns N.
    pub size: Count<50, 2>,
    /// Total cost of N moves to the right.
    pub move_cost: NonNegative,
    /// Whether the action that moves to the right is drawn for each cell, once per MDP; if not, it is
    /// the second action. It is bsuite's `randomize_actions`.
    pub randomized: bool,
    /// Probability that a move to the right goes to the left instead.
    pub slip: FractionBelowOne,
    /// Prior concentration α₀ of each direction of an action.
    pub outcome_weight: Positive,
    /// Prior standard deviation of the rewards in the last row.
    pub deviation: Positive,
}

impl Default for DeepSea {
    fn default() -> Self {
        Self {
            size: ranged_count(10),
            move_cost: ranged_number(0.01),
            randomized: true,
            slip: ranged_number(0.0),
            outcome_weight: ranged_number(1.0),
            deviation: ranged_number(1.0),
        }
    }
}

impl DeepSea {
    /// The states are the cells that can be reached, row by row, then the terminal state. Both
    /// actions of a cell have two outcomes: left and right.
    pub(super) fn model(&self) -> Model {
        let size = self.size.get();
        let cells = || (0..size).flat_map(|row| (0..=row).map(move |column| (row, column)));
        let actions: Vec<_> = cells()
            .map(|(row, column)| vec![self.outcomes(row, column); 2])
            .chain([vec![]])
            .collect();
        let last = (size - 1) as f32;
        let terminal = [size as f32, 0.0];
        Model {
            parameters: vec![
                Prior::Normal {
                    mean: 0.0,
                    deviation: self.deviation.get(),
                    noise: 0.0
                };
                size as usize
            ],
            coordinates: vec![
                Coordinate {
                    name: "row",
                    max: size as f32,
                },
                Coordinate {
                    name: "column",
                    max: last,
                },
            ],
            state_coordinates: cells()
                .flat_map(|(row, column)| [row as f32, column as f32])
                .chain(terminal)
                .collect(),
            outcome_weight: self.outcome_weight.get(),
            ..Model::new(0, size, &actions)
        }
    }

    fn outcomes(&self, row: u32, column: u32) -> Vec<Outcome> {
        let in_last_row = row + 1 == self.size.get();
        let cell = |column: u32| {
            if in_last_row {
                first_cell_below(row)
            } else {
                first_cell_below(row) + column
            }
        };
        let cost = -self.move_cost.get() / f64::from(self.size.get());
        let right = Reward {
            known: cost,
            unknown: in_last_row.then_some((column, 1.0)),
        };
        vec![
            Outcome {
                state: cell(column.saturating_sub(1)),
                reward: Reward::known(0.0),
            },
            Outcome {
                state: cell(column + 1),
                reward: right,
            },
        ]
    }

    /// Draws which action moves to the right in each cell. Only the last column is rewarded.
    pub(super) fn draw_mdp(&self, model: &Model, random: &mut Stream) -> Mdp {
        let size = self.size.get() as usize;
        let left = [1.0, 0.0];
        let right = [self.slip.get(), 1.0 - self.slip.get()];
        let action_probabilities = |_| {
            let is_swapped = self.randomized && random.random();
            if is_swapped {
                [right, left]
            } else {
                [left, right]
            }
        };
        let probabilities: Vec<f64> = (0..model.state_count() - 1)
            .flat_map(action_probabilities)
            .flatten()
            .collect();
        let values = (0..size)
            .map(|column| f64::from(column + 1 == size))
            .collect();
        Mdp {
            values,
            probabilities,
        }
    }
}

/// The first cell of the row below `row`.
fn first_cell_below(row: u32) -> u32 {
    (row + 1) * (row + 2) / 2
}
