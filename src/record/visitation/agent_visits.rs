//! Counts of the visited states of one agent, from which images are drawn.

use serde::{Deserialize, Serialize};

use super::bonus_map::{CellBonus, sum_by_cell};
use super::{Axes, BonusMap, Density, DensityDelta, Pairs, RoundWindow, VisitedState};

/// Counts of the visited states of one agent, over the whole run and over the latest rounds. The
/// size in memory does not depend on the length of the run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AgentVisits {
    /// Density of all states so far.
    pub density: Density,
    recent: RoundWindow<DensityDelta>,
    /// `None` for agents without a bonus.
    bonuses: Option<Bonuses>,
}

/// The bonuses of the latest rounds, by cell.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Bonuses {
    /// Bonuses of the current round in the order of steps: the cell of [`BonusMap`] and the bonus.
    current_round: Vec<(u32, f32)>,
    recent: RoundWindow<Vec<CellBonus>>,
}

impl AgentVisits {
    /// An agent that has not visited any state.
    #[must_use]
    pub fn new(axes: &Axes, has_bonus: bool) -> Self {
        Self {
            density: Density::new(axes),
            recent: RoundWindow::default(),
            bonuses: has_bonus.then(Bonuses::default),
        }
    }

    /// Whether these counts were made with the given axes and pairs, and with the same `has_bonus`.
    #[must_use]
    pub fn was_made_for(&self, axes: &Axes, pairs: &Pairs, has_bonus: bool) -> bool {
        let cell_count = BonusMap::new(pairs).cell_count();
        let are_cells_in_map = |bonuses: &Bonuses| {
            bonuses
                .recent
                .values()
                .flatten()
                .all(|cell| (cell.cell as usize) < cell_count)
        };
        let has_same_axes = self.density.was_made_for(axes)
            && self
                .recent
                .values()
                .all(|delta| self.density.has_cells_of(delta));
        let has_same_pairs = self.bonuses.as_ref().is_none_or(are_cells_in_map);
        has_same_axes && has_same_pairs && self.bonuses.is_some() == has_bonus
    }

    /// Counts a state that is at these `axis_positions`.
    pub fn add(&mut self, axis_positions: &[f32], pairs: &Pairs, state: &VisitedState<'_>) {
        self.density.add(axis_positions);
        if let Some(bonuses) = self.bonuses.as_mut().filter(|_| state.has_action()) {
            bonuses
                .current_round
                .extend(BonusMap::cells_of(pairs, state).map(|cell| (cell, state.bonus)));
        }
    }

    /// Ends a round, and drops the counts of single rounds before the latest `window` rounds.
    pub fn end_round(&mut self, round: u32, window: u32) {
        self.recent.add(round, self.density.end_round(), window);
        if let Some(Bonuses {
            current_round,
            recent,
        }) = &mut self.bonuses
        {
            recent.add(round, sum_by_cell(std::mem::take(current_round)), window);
        }
    }

    /// Number of lines of the latest rounds over each pixel: `[height × width]`.
    #[must_use]
    pub fn latest_density(&self) -> Vec<u32> {
        self.density.pixels_of_rounds(self.recent.values())
    }

    /// The bonuses of the latest rounds; `None` for agents without a bonus.
    #[must_use]
    pub fn latest_bonuses(&self, pairs: &Pairs) -> Option<BonusMap> {
        let bonuses = self.bonuses.as_ref()?;
        let mut map = BonusMap::new(pairs);
        bonuses
            .recent
            .values()
            .flatten()
            .for_each(|cell| map.add(*cell));
        Some(map)
    }
}
