//! Where bonuses come from: the mean bonus over the cells of each panel.

use serde::{Deserialize, Serialize};

use super::axes::Seen;
use super::pairs::{CELLS, Pairs};

/// Sums and numbers of bonuses, so that means over any span of time are a difference away: `[panels × cells × cells]` each.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Novelty {
    sums: Vec<f64>,
    counts: Vec<u32>,
}

impl Novelty {
    /// Nothing earned yet.
    #[must_use]
    pub fn new(pairs: &Pairs) -> Self {
        let cells = pairs.panels().len() * CELLS * CELLS;
        Self { sums: vec![0.0; cells], counts: vec![0; cells] }
    }

    /// Whether this was made for such panels.
    #[must_use]
    pub fn fits(&self, pairs: &Pairs) -> bool {
        let cells = pairs.panels().len() * CELLS * CELLS;
        self.sums.len() == cells && self.counts.len() == cells
    }

    /// Adds the bonus of the step that was taken from a state.
    pub fn add(&mut self, pairs: &Pairs, seen: &Seen<'_>) {
        for (panel, [across, upwards]) in pairs.project(seen).enumerate() {
            let cell = (panel * CELLS + row(upwards)) * CELLS + column(across);
            self.sums[cell] += f64::from(seen.bonus);
            self.counts[cell] += 1;
        }
    }

    /// Adds what others earned.
    pub fn add_all(&mut self, others: &Self) {
        self.sums.iter_mut().zip(&others.sums).for_each(|(sum, other)| *sum += other);
        self.counts.iter_mut().zip(&others.counts).for_each(|(count, other)| *count += other);
    }

    /// What was earned since it was as `before`.
    #[must_use]
    pub fn since(&self, before: Option<&Self>) -> Self {
        let Some(before) = before else { return self.clone() };
        let sums = self.sums.iter().zip(&before.sums).map(|(now, before)| now - before).collect();
        let counts = self.counts.iter().zip(&before.counts).map(|(now, before)| now - before).collect();
        Self { sums, counts }
    }

    /// The mean bonus of each cell, none where nobody was: `[panels × cells × cells]`, from the uppermost row down.
    pub fn means(&self) -> impl Iterator<Item = Option<f64>> {
        self.sums.iter().zip(&self.counts).map(|(sum, &count)| (count > 0).then(|| sum / f64::from(count)))
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

    /// Bonuses of 1 and 3 in the lower left cell, then 8 there and 5 in the upper right one: means of 2, then, of the later ones, 8 and 5.
    #[test]
    fn bonuses_are_averaged_where_they_were_earned() {
        let pairs = Pairs::of(&spec(&[[0.0, 1.0]; 2]), &PairChoice::First(known_count(1)));
        let mut novelty = Novelty::new(&pairs);
        let mut earn = |bonus, place: &[f32]| novelty.add(&pairs, &Seen { bonus, ..seen(0, place) });
        earn(1.0, &[0.0, 0.0]);
        earn(3.0, &[0.01, 0.02]);
        let before = novelty.clone();
        let mut earn = |bonus, place: &[f32]| novelty.add(&pairs, &Seen { bonus, ..seen(0, place) });
        earn(8.0, &[0.0, 0.0]);
        earn(5.0, &[1.0, 1.0]);
        let found =
            |novelty: &Novelty| novelty.means().enumerate().filter_map(|(cell, mean)| Some((cell, mean?))).collect::<Vec<_>>();
        let (upper_right, lower_left) = (39, 39 * 40);
        assert_eq!(found(&before), [(lower_left, 2.0)]);
        assert_eq!(found(&novelty.since(Some(&before))), [(upper_right, 5.0), (lower_left, 8.0)]);
        assert_eq!(found(&novelty.since(None)), [(upper_right, 5.0), (lower_left, 4.0)]);
        assert_eq!(novelty.since(Some(&before)).largest(), 8.0);
        let mut team = before.clone();
        team.add_all(&before);
        assert_eq!(found(&team), [(lower_left, 2.0)]);
    }
}
