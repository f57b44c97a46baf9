//! Where bonuses come from: the mean bonus over the cells of each panel.

use serde::{Deserialize, Serialize};

use super::axes::Seen;
use super::pairs::{CELLS, Pairs};

/// Sums and numbers of bonuses: `[panels × cells × cells]` each.
#[derive(Clone, Debug, PartialEq)]
pub struct Novelty {
    sums: Vec<f64>,
    counts: Vec<u32>,
}

/// What was earned in one cell.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Earned {
    /// Counts panels, rows from the uppermost down, and columns.
    pub cell: u32,
    /// Bonuses.
    pub count: u32,
    /// Of these.
    pub sum: f64,
}

/// Bonuses by their cells, in ascending order; those of a cell are added up in the order in which they were earned.
#[must_use]
pub(super) fn earned(mut bonuses: Vec<(u32, f32)>) -> Vec<Earned> {
    bonuses.sort_by_key(|(cell, _)| *cell);
    let of_cell = |same: &[(u32, f32)]| Earned {
        cell: same[0].0,
        count: same.len() as u32,
        sum: same.iter().map(|(_, bonus)| f64::from(*bonus)).sum(),
    };
    bonuses
        .chunk_by(|(one, _), (next, _)| one == next)
        .map(of_cell)
        .collect()
}

impl Novelty {
    /// Nothing earned yet.
    #[must_use]
    pub fn new(pairs: &Pairs) -> Self {
        let cells = pairs.panels().len() * CELLS * CELLS;
        Self {
            sums: vec![0.0; cells],
            counts: vec![0; cells],
        }
    }

    /// How many cells there are.
    #[must_use]
    pub fn cells(&self) -> usize {
        self.counts.len()
    }

    /// The cell of each panel in which a state is.
    pub fn cells_of(pairs: &Pairs, seen: &Seen<'_>) -> impl Iterator<Item = u32> {
        let cell = |(panel, [across, upwards]): (usize, [f32; 2])| {
            (panel * CELLS + row(upwards)) * CELLS + column(across)
        };
        pairs
            .project(seen)
            .enumerate()
            .map(move |place| cell(place) as u32)
    }

    /// Adds what was earned in a cell.
    pub fn add(&mut self, Earned { cell, count, sum }: Earned) {
        self.sums[cell as usize] += sum;
        self.counts[cell as usize] += count;
    }

    /// Adds what others earned.
    pub fn add_all(&mut self, others: &Self) {
        self.sums
            .iter_mut()
            .zip(&others.sums)
            .for_each(|(sum, other)| *sum += other);
        self.counts
            .iter_mut()
            .zip(&others.counts)
            .for_each(|(count, other)| *count += other);
    }

    /// The mean bonus of each cell, none where nobody was: `[panels × cells × cells]`, from the uppermost row down.
    pub fn means(&self) -> impl Iterator<Item = Option<f64>> {
        self.sums
            .iter()
            .zip(&self.counts)
            .map(|(sum, &count)| (count > 0).then(|| sum / f64::from(count)))
    }

    /// The largest mean of a cell; 0 if nobody was anywhere.
    #[must_use]
    pub fn largest(&self) -> f64 {
        self.means().flatten().fold(0.0, f64::max)
    }
}

fn column(fraction: f32) -> usize {
    ((fraction * CELLS as f32) as usize).min(CELLS - 1)
}

fn row(fraction: f32) -> usize {
    CELLS - 1 - column(fraction)
}

#[cfg(test)]
mod tests {
    use super::super::axes::tests::{seen, spec};
    use super::*;
    use crate::input::numbers::known_count;
    use crate::record::PairChoice;

    /// Bonuses of 1 and 3 in the lower left cell and of 5 in the upper right one: means of 2 and 5.
    #[test]
    fn bonuses_are_averaged_where_they_were_earned() {
        let pairs = Pairs::of(&spec(&[[0.0, 1.0]; 2]), &PairChoice::First(known_count(1)));
        let places: [(f32, &[f32]); 3] =
            [(1.0, &[0.0, 0.0]), (5.0, &[1.0, 1.0]), (3.0, &[0.01, 0.02])];
        let bonuses = places.iter().flat_map(|(bonus, place)| {
            let seen = seen(0, place);
            Novelty::cells_of(&pairs, &seen)
                .map(|cell| (cell, *bonus))
                .collect::<Vec<_>>()
        });
        let earned = earned(bonuses.collect());
        let (upper_right, lower_left) = (39, 39 * 40);
        let of = |cell, count, sum| Earned { cell, count, sum };
        assert_eq!(earned, [of(upper_right, 1, 5.0), of(lower_left, 2, 4.0)]);
        let mut novelty = Novelty::new(&pairs);
        for earned in earned {
            novelty.add(earned);
        }
        let found = |novelty: &Novelty| {
            novelty
                .means()
                .enumerate()
                .filter_map(|(cell, mean)| Some((cell as u32, mean?)))
                .collect::<Vec<_>>()
        };
        assert_eq!(found(&novelty), [(upper_right, 5.0), (lower_left, 2.0)]);
        assert_eq!(novelty.largest(), 5.0);
        let mut team = novelty.clone();
        team.add(of(lower_left, 2, 12.0));
        team.add_all(&novelty);
        assert_eq!(found(&team), [(upper_right, 5.0), (lower_left, 20.0 / 6.0)]);
    }
}
