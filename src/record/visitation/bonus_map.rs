//! The mean bonus in each cell of the panels of pairs of observations.

use serde::{Deserialize, Serialize};

use super::axes::VisitedState;
use super::pairs::{CELLS_PER_SIDE, Pairs};
use crate::run::ranks::Ranks;

/// Sum and number of bonuses in each cell: `[panels × cells × cells]` each.
#[derive(Clone, Debug, PartialEq)]
pub struct BonusMap {
    sums: Vec<f64>,
    counts: Vec<u32>,
}

/// The bonuses in one cell.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CellBonus {
    /// Index of the cell: by panel, then by row from the top, then by column.
    pub cell: u32,
    /// Number of bonuses.
    pub count: u32,
    /// Sum of the bonuses.
    pub sum: f64,
}

/// Sums the bonuses of each cell, and returns the cells in ascending order. Within a cell, bonuses
/// are added in the order of steps, so that repeated runs give the same bits.
#[must_use]
pub(super) fn sum_by_cell(mut bonuses: Vec<(u32, f32)>) -> Vec<CellBonus> {
    bonuses.sort_by_key(|(cell, _)| *cell);
    let sum_of_cell = |bonuses_in_cell: &[(u32, f32)]| CellBonus {
        cell: bonuses_in_cell[0].0,
        count: bonuses_in_cell.len() as u32,
        sum: bonuses_in_cell
            .iter()
            .map(|(_, bonus)| f64::from(*bonus))
            .sum(),
    };
    bonuses
        .chunk_by(|(one, _), (next, _)| one == next)
        .map(sum_of_cell)
        .collect()
}

impl BonusMap {
    /// A map without bonuses.
    #[must_use]
    pub fn new(pairs: &Pairs) -> Self {
        let cells = pairs.panels().len() * CELLS_PER_SIDE * CELLS_PER_SIDE;
        Self {
            sums: vec![0.0; cells],
            counts: vec![0; cells],
        }
    }

    /// Number of cells.
    #[must_use]
    pub fn cell_count(&self) -> usize {
        self.counts.len()
    }

    /// Indices of the cells in which a state lies: one per panel, except those where it has a NaN.
    pub fn cells_of(pairs: &Pairs, state: &VisitedState<'_>) -> impl Iterator<Item = u32> {
        let cell = |(panel, [column_fraction, row_fraction]): (usize, [f32; 2])| {
            (panel * CELLS_PER_SIDE + row(row_fraction)) * CELLS_PER_SIDE + column(column_fraction)
        };
        pairs
            .project(state)
            .enumerate()
            .filter(|(_, fractions)| !fractions.iter().any(|fraction| fraction.is_nan()))
            .map(move |place| cell(place) as u32)
    }

    /// Adds the bonuses of a cell.
    pub fn add(&mut self, CellBonus { cell, count, sum }: CellBonus) {
        self.sums[cell as usize] += sum;
        self.counts[cell as usize] += count;
    }

    /// The bonuses of all agents, on rank 0; an empty map on others. `agents`: the maps of the local agents
    #[must_use]
    pub fn of_all(agents: &[Self], pairs: &Pairs, ranks: Ranks) -> Self {
        let mut map = Self::new(pairs);
        let cells = map.cell_count();
        let passed = ranks.pass_along(1, |_, list| {
            list.resize(2 * cells, 0.0);
            let (sums, counts) = list.split_at_mut(cells);
            for agent in agents {
                for (sum, other) in sums.iter_mut().zip(&agent.sums) {
                    *sum += other;
                }
                for (count, other) in counts.iter_mut().zip(&agent.counts) {
                    *count += f64::from(*other);
                }
            }
        });
        // The last rank has the sums, and rank 0 draws them.
        let list: Vec<f64> = ranks.gather_lists(passed.into_iter().flatten().flatten().collect());
        if ranks.is_first() {
            let (sums, counts) = list.split_at(cells);
            map.sums = sums.to_vec();
            map.counts = counts.iter().map(|&count| count as u32).collect();
        }
        map
    }

    /// The mean bonus of each cell, `None` for cells without states: `[panels × cells × cells]`,
    /// from the top row down.
    pub fn means(&self) -> impl Iterator<Item = Option<f64>> {
        self.sums
            .iter()
            .zip(&self.counts)
            .map(|(sum, &count)| (count > 0).then(|| sum / f64::from(count)))
    }

    /// The largest mean of a cell; 0 if all cells are empty.
    #[must_use]
    pub fn max_mean(&self) -> f64 {
        self.means().flatten().fold(0.0, f64::max)
    }
}

fn column(fraction: f32) -> usize {
    ((fraction * CELLS_PER_SIDE as f32) as usize).min(CELLS_PER_SIDE - 1)
}

fn row(fraction: f32) -> usize {
    CELLS_PER_SIDE - 1 - column(fraction)
}

#[cfg(test)]
mod tests {
    use super::super::axes::tests::{spec, state_at};
    use super::*;
    use crate::scenario::recording::PairChoice;
    use seedbed_input::numbers::ranged_count;

    /// With bonuses of 1 and 3 in the lower left cell and of 5 in the upper right cell, the means
    /// are 2 and 5.
    #[test]
    fn bonuses_are_averaged_per_cell() {
        let pairs = Pairs::of(&spec(&[[0.0, 1.0]; 2]), &PairChoice::First(ranged_count(1)));
        let places: [(f32, &[f32]); 3] =
            [(1.0, &[0.0, 0.0]), (5.0, &[1.0, 1.0]), (3.0, &[0.01, 0.02])];
        let bonuses = places.iter().flat_map(|(bonus, place)| {
            let state = state_at(0, place);
            BonusMap::cells_of(&pairs, &state)
                .map(|cell| (cell, *bonus))
                .collect::<Vec<_>>()
        });
        let cell_bonuses = sum_by_cell(bonuses.collect());
        let (upper_right, lower_left) = (39, 39 * 40);
        let cell_bonus = |cell, count, sum| CellBonus { cell, count, sum };
        assert_eq!(
            cell_bonuses,
            [
                cell_bonus(upper_right, 1, 5.0),
                cell_bonus(lower_left, 2, 4.0)
            ]
        );
        let mut map = BonusMap::new(&pairs);
        for bonus in cell_bonuses {
            map.add(bonus);
        }
        let nonempty_cells = |map: &BonusMap| {
            map.means()
                .enumerate()
                .filter_map(|(cell, mean)| Some((cell as u32, mean?)))
                .collect::<Vec<_>>()
        };
        assert_eq!(
            nonempty_cells(&map),
            [(upper_right, 5.0), (lower_left, 2.0)]
        );
        assert_eq!(map.max_mean(), 5.0);
        let mut other = map.clone();
        other.add(cell_bonus(lower_left, 2, 12.0));
        let team = BonusMap::of_all(&[other, map], &pairs, Ranks::SINGLE);
        assert_eq!(
            nonempty_cells(&team),
            [(upper_right, 5.0), (lower_left, 20.0 / 6.0)]
        );
    }
}
