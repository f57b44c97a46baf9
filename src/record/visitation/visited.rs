//! Everything that pictures need to know about where one agent has been.

use serde::{Deserialize, Serialize};

use super::novelty::{Earned, earned};
use super::{Axes, Density, Gains, Latest, Novelty, Pairs, Seen};

/// Where one agent has been, so far and over the latest rounds. Does not grow with the length of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Visited {
    /// All states so far.
    pub density: Density,
    lately: Latest<Gains>,
    /// Of curious agents.
    bonuses: Option<Bonuses>,
}

/// Where bonuses came from.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Bonuses {
    /// Of the round that goes on, as they were earned: the cell of [`Novelty`] and the bonus.
    fresh: Vec<(u32, f32)>,
    lately: Latest<Vec<Earned>>,
}

impl Visited {
    /// Nothing visited yet.
    #[must_use]
    pub fn new(axes: &Axes, curious: bool) -> Self {
        Self {
            density: Density::new(axes),
            lately: Latest::default(),
            bonuses: curious.then(Bonuses::default),
        }
    }

    /// Whether this was made for such axes, panels and agents.
    #[must_use]
    pub fn fits(&self, axes: &Axes, pairs: &Pairs, curious: bool) -> bool {
        let cells = Novelty::new(pairs).cells();
        let bonus_fits = |bonuses: &Bonuses| {
            bonuses
                .lately
                .all()
                .flatten()
                .all(|earned| (earned.cell as usize) < cells)
        };
        let bonuses_fit = self.bonuses.as_ref().is_none_or(bonus_fits);
        let is_drawn =
            self.density.fits(axes) && self.lately.all().all(|gains| self.density.has(gains));
        is_drawn && bonuses_fit && self.bonuses.is_some() == curious
    }

    /// Counts a state, whose projection onto the axes is `fractions`.
    pub fn add(&mut self, fractions: &[f32], pairs: &Pairs, seen: &Seen<'_>) {
        self.density.add(fractions);
        if let Some(bonuses) = self.bonuses.as_mut().filter(|_| seen.acts()) {
            bonuses
                .fresh
                .extend(Novelty::cells_of(pairs, seen).map(|cell| (cell, seen.bonus)));
        }
    }

    /// Ends a round: what is older than the latest `window` rounds is not told apart any more.
    pub fn end_round(&mut self, round: u32, window: u32) {
        self.lately.add(round, self.density.end_round(), window);
        if let Some(Bonuses { fresh, lately }) = &mut self.bonuses {
            lately.add(round, earned(std::mem::take(fresh)), window);
        }
    }

    /// Lines over each pixel from the latest rounds: `[height × width]`.
    #[must_use]
    pub fn latest(&self) -> Vec<u32> {
        self.density.draw_alone(self.lately.all())
    }

    /// Where the bonuses of the latest rounds came from. None without curiosity.
    #[must_use]
    pub fn latest_bonuses(&self, pairs: &Pairs) -> Option<Novelty> {
        let bonuses = self.bonuses.as_ref()?;
        let mut novelty = Novelty::new(pairs);
        bonuses
            .lately
            .all()
            .flatten()
            .for_each(|earned| novelty.add(*earned));
        Some(novelty)
    }
}
