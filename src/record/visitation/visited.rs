//! Everything that pictures need to know about where one agent has been.

use serde::{Deserialize, Serialize};

use super::{Axes, Density, Latest, Novelty, Pairs, Seen};

/// Where one agent has been, so far and over the latest rounds. Does not grow with the length of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Visited {
    /// All states so far.
    pub density: Density,
    earlier: Latest<Vec<u32>>,
    /// Of curious agents.
    bonuses: Option<(Novelty, Latest<Novelty>)>,
}

impl Visited {
    /// Nothing visited yet.
    #[must_use]
    pub fn new(axes: &Axes, pairs: &Pairs, curious: bool) -> Self {
        let bonuses = curious.then(|| (Novelty::new(pairs), Latest::default()));
        Self { density: Density::new(axes), earlier: Latest::default(), bonuses }
    }

    /// Whether this was made for such axes, panels and agents.
    #[must_use]
    pub fn fits(&self, axes: &Axes, pairs: &Pairs, curious: bool) -> bool {
        let bonuses_fit = self.bonuses.as_ref().is_none_or(|(novelty, _)| novelty.fits(pairs));
        self.density.fits(axes) && bonuses_fit && self.bonuses.is_some() == curious
    }

    /// Counts a state, whose projection onto the axes is `fractions`.
    pub fn add(&mut self, fractions: &[f32], pairs: &Pairs, seen: &Seen<'_>) {
        self.density.add(fractions);
        if let Some((novelty, _)) = self.bonuses.as_mut().filter(|_| seen.acts()) {
            novelty.add(pairs, seen);
        }
    }

    /// Lines over each pixel from the latest rounds, up to the end of `round`: `[height × width]`; and the first of these rounds.
    pub fn latest(&mut self, round: u32) -> (Vec<u32>, u32) {
        let now = self.density.draw_all();
        let (before, first) = self.earlier.before(round, now);
        let gained = before.map(|before| now.iter().zip(before).map(|(now, before)| now - before).collect());
        (gained.unwrap_or_else(|| now.clone()), first)
    }

    /// Where the bonuses of the latest rounds, up to the end of `round`, came from; and the first of these rounds. None without curiosity.
    pub fn latest_bonuses(&mut self, round: u32) -> Option<(Novelty, u32)> {
        let (novelty, earlier) = self.bonuses.as_mut()?;
        let (before, first) = earlier.before(round, novelty);
        Some((novelty.since(before), first))
    }
}
