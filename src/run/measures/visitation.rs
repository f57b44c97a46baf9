//! Which part of the state space was visited, and how often.

use serde::{Deserialize, Serialize};

use super::diversity::{Diversity, distribution_entropy, entropy, mix};
use seedbed_env::{Quantity, Spec};

/// Cells along one axis.
const CELLS: usize = 20;

/// More observations than these are features.
const MAX_AXES: usize = 30;

/// How often each cell of the state space was visited.
///
/// For each pair of observations, a fixed grid of 20 × 20 cells spans their display ranges; values
/// beyond count in the outermost cells. All measures are averaged over pairs, so they mean the same
/// in any dimension. A single observation has a grid of 20 cells. More observations than 30 are no
/// axes but features, such as one for each cell of a maze: each has one cell, and a state counts in
/// that of its largest observation.
///
/// Counts take four bytes a cell and agent: 9.6 kB an agent for four observations, 218 kB for
/// seventeen. A count stops at 2³² − 1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Visitation {
    /// `[grids × cells of a grid]`
    #[serde(with = "sparse")]
    counts: Vec<u32>,
    cells_of_grid: usize,
    /// Cells visited at least once.
    visited: usize,
}

impl Visitation {
    /// Nothing visited yet.
    #[must_use]
    pub fn new(spec: &Spec) -> Self {
        Self::of(&spec.observations)
    }

    /// Likewise, where only what is observed is known.
    #[must_use]
    pub fn of(observations: &[Quantity]) -> Self {
        let axes = observations.len();
        let (grids, cells_of_grid) = match axes {
            1 => (1, CELLS),
            2..=MAX_AXES => (axes * (axes - 1) / 2, CELLS * CELLS),
            _ => (1, axes),
        };
        Self {
            counts: vec![0; grids * cells_of_grid],
            cells_of_grid,
            visited: 0,
        }
    }

    /// Visits states.   `observations: [N × observation width]`
    pub fn visit(&mut self, spec: &Spec, observations: &[f32]) {
        self.visit_states(&spec.observations, observations);
    }

    /// Likewise, where only what is observed is known.   `states: [N × quantities]`
    pub fn visit_states(&mut self, quantities: &[Quantity], states: &[f32]) {
        if quantities.len() > MAX_AXES {
            return states
                .chunks_exact(quantities.len())
                .for_each(|row| self.count_largest(row));
        }
        let mut bins = vec![0; quantities.len()];
        for row in states.chunks_exact(bins.len()) {
            for ((bin, value), quantity) in bins.iter_mut().zip(row).zip(quantities) {
                let [low, high] = quantity.range;
                *bin = ((value - low) / (high - low) * CELLS as f32).clamp(0.0, CELLS as f32 - 1.0)
                    as usize;
            }
            self.mark(&bins);
        }
    }

    /// Observations that are all 0 are no state of their own, as after the end of a tabular task.
    fn count_largest(&mut self, observations: &[f32]) {
        let largest = observations
            .iter()
            .enumerate()
            .max_by(|one, other| one.1.total_cmp(other.1).then(other.0.cmp(&one.0)));
        if let Some((feature, _)) = largest.filter(|(_, value)| **value != 0.0) {
            self.count(feature);
        }
    }

    fn mark(&mut self, bins: &[usize]) {
        if let [bin] = bins {
            self.count(*bin);
        }
        let mut grid = 0;
        for (index, first) in bins.iter().enumerate() {
            for second in &bins[index + 1..] {
                self.count(grid + first * CELLS + second);
                grid += CELLS * CELLS;
            }
        }
    }

    fn count(&mut self, cell: usize) {
        self.visited += usize::from(self.counts[cell] == 0);
        self.counts[cell] = self.counts[cell].saturating_add(1);
    }

    /// Visited share of cells, from 0 to 1.
    #[must_use]
    pub fn coverage(&self) -> f64 {
        self.visited as f64 / self.counts.len() as f64
    }

    /// Entropy of the visits, in nats, from 0 to [`largest_entropy`](Self::largest_entropy).
    #[must_use]
    pub fn entropy(&self) -> f64 {
        self.grids().map(entropy).sum::<f64>() / self.grids().len() as f64
    }

    /// The entropy of visits that are alike in all cells: ln 400, or ln 20 for a single
    /// observation.
    #[must_use]
    pub fn largest_entropy(&self) -> f64 {
        (self.cells_of_grid as f64).ln()
    }

    fn grids(&self) -> std::slice::ChunksExact<'_, u32> {
        self.counts.chunks_exact(self.cells_of_grid)
    }
}

/// The share of cells that any of the agents visited, from 0 to 1.   `agents: [K]`, at least one
#[must_use]
pub fn united_coverage(agents: &[Visitation]) -> f64 {
    let visited = |cell: &usize| agents.iter().any(|agent| agent.counts[*cell] > 0);
    let cells = agents[0].counts.len();
    (0..cells).filter(visited).count() as f64 / cells as f64
}

/// How far the agents that have visited anything differ, each of them weighing the same.
/// `agents: [K]`; `entropies: [K]`
///
/// O(K · cells): the divergence of all from their mixture, not of each pair.
#[must_use]
pub fn diversity(agents: &[Visitation], entropies: &[f64]) -> Diversity {
    let moved = || {
        agents
            .iter()
            .zip(entropies)
            .filter(|(agent, _)| agent.visited > 0)
    };
    let count = moved().count();
    if count < 2 {
        return Diversity::of(0.0, count);
    }
    let share = 1.0 / count as f64;
    let grids = agents[0].grids().len();
    let mut mixture = vec![0.0; agents[0].cells_of_grid];
    let mut mixed = 0.0;
    for grid in 0..grids {
        let cells = grid * mixture.len()..(grid + 1) * mixture.len();
        mixture.fill(0.0);
        moved().for_each(|(agent, _)| mix(&agent.counts[cells.clone()], share, &mut mixture));
        mixed += distribution_entropy(&mixture);
    }
    Diversity::of(
        mixed / grids as f64 - share * moved().map(|(_, entropy)| entropy).sum::<f64>(),
        count,
    )
}

/// Counts in checkpoints: the number of cells, then for each visited cell its distance from the one
/// before, and its count.
mod sparse {
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    /// Far beyond any task: a damaged file must not claim all memory.
    const MAX_CELLS: u64 = 1 << 28;

    pub(super) fn serialize<S: Serializer>(
        counts: &[u32],
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        let mut next = 0;
        let visited = counts
            .iter()
            .enumerate()
            .filter(|(_, count)| **count > 0)
            .map(|(cell, &count)| {
                let skipped = cell - next;
                next = cell + 1;
                (skipped as u64, count)
            });
        (counts.len() as u64, visited.collect::<Vec<(u64, u32)>>()).serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Vec<u32>, D::Error> {
        let (cells, visited) = <(u64, Vec<(u64, u32)>)>::deserialize(deserializer)?;
        if cells > MAX_CELLS {
            return Err(D::Error::custom("too many cells"));
        }
        let mut counts = vec![0; cells as usize];
        let mut next = 0_usize;
        for (skipped, count) in visited {
            let cell = next.saturating_add(skipped as usize);
            *counts
                .get_mut(cell)
                .ok_or_else(|| D::Error::custom("a cell beyond the grid"))? = count;
            next = cell + 1;
        }
        Ok(counts)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::spec;
    use super::*;

    fn visited(axes: usize, observations: &[f32]) -> Visitation {
        let mut visitation = Visitation::new(&spec(axes));
        visitation.visit(&spec(axes), observations);
        visitation
    }

    /// Three axes make three grids of 400 cells; the states (0.5, 1.5, 2.5) and (0.5, 1.5, 19.5)
    /// share a cell in the first.
    #[test]
    fn coverage_counts_cells_of_pairs() {
        let mut visitation = visited(3, &[0.5, 1.5, 2.5, 0.5, 1.5, 19.5]);
        assert!((visitation.coverage() - 5.0 / 1200.0).abs() < 1e-12);
        visitation.visit(&spec(3), &[0.5, 1.5, 99.0]);
        assert!(
            (visitation.coverage() - 5.0 / 1200.0).abs() < 1e-12,
            "beyond the range counts in the outermost cell"
        );
    }

    #[test]
    fn one_axis_has_twenty_cells() {
        let visitation = visited(1, &[0.5, 0.6, 7.0, -3.0]);
        assert!((visitation.coverage() - 2.0 / 20.0).abs() < 1e-12);
        assert_eq!(visitation.largest_entropy(), 20_f64.ln());
    }

    /// The same states: in the first grid both are in one cell, 0 nats; in the two others in two
    /// cells, ln 2 each.
    #[test]
    fn entropy_is_averaged_over_pairs() {
        let visitation = visited(3, &[0.5, 1.5, 2.5, 0.5, 1.5, 19.5]);
        assert!((visitation.entropy() - 2.0 / 3.0 * std::f64::consts::LN_2).abs() < 1e-12);
        let everywhere: Vec<f32> = (0..400)
            .flat_map(|cell| [(cell / 20) as f32, (cell % 20) as f32])
            .collect();
        let visitation = visited(2, &everywhere);
        assert!((visitation.entropy() - visitation.largest_entropy()).abs() < 1e-12);
    }

    /// Of 40 features the states have 3, 3 and 7 largest; a row of zeros is no state.
    #[test]
    fn many_observations_are_features() {
        let mut rows = vec![0.0; 4 * 40];
        (rows[3], rows[40 + 3], rows[80 + 7]) = (1.0, 1.0, 1.0);
        let visitation = visited(40, &rows);
        assert!((visitation.coverage() - 2.0 / 40.0).abs() < 1e-12);
        // Visits ⅔ and ⅓: ln 3 − ⅔ ln 2.
        assert!(
            (visitation.entropy() - (3_f64.ln() - 2.0 / 3.0 * std::f64::consts::LN_2)).abs()
                < 1e-12
        );
        assert_eq!(visitation.largest_entropy(), 40_f64.ln());
    }

    fn diversity_of(agents: &[Visitation]) -> Diversity {
        diversity(
            agents,
            &agents.iter().map(Visitation::entropy).collect::<Vec<_>>(),
        )
    }

    /// Agents at (0, 0, 0) and (0, 0, 9) are in one cell of the first of three grids and apart in
    /// two: JS = ⅔ ln 2. A third that has not moved yet does not count.
    #[test]
    fn diversity_is_averaged_over_pairs() {
        let mut agents = vec![visited(3, &[0.0; 3]), visited(3, &[0.0, 0.0, 9.0])];
        let expected = 2_f64.powf(2.0 / 3.0);
        assert!((diversity_of(&agents).effective_agents - expected).abs() < 1e-12);
        assert!((diversity_of(&agents).overlap - 1.0 / 3.0).abs() < 1e-12);
        agents.insert(1, visited(3, &[]));
        assert!((diversity_of(&agents).effective_agents - expected).abs() < 1e-12);
        assert_eq!(
            diversity_of(&agents[..2]),
            Diversity {
                overlap: 1.0,
                effective_agents: 1.0
            }
        );
    }

    #[test]
    fn a_large_team_of_disjoint_agents_counts_fully() {
        let agents: Vec<Visitation> = (0..256)
            .map(|agent| visited(2, &[(agent / 20) as f32, (agent % 20) as f32]))
            .collect();
        assert!((diversity_of(&agents).effective_agents - 256.0).abs() < 1e-9);
        assert!((united_coverage(&agents) - 256.0 / 400.0).abs() < 1e-12);
    }

    #[test]
    fn a_checkpoint_holds_the_visited_cells_alone() {
        let visitation = visited(3, &[0.5, 1.5, 2.5, 0.5, 1.5, 19.5]);
        let bytes = postcard::to_stdvec(&visitation).unwrap();
        assert!(
            bytes.len() < 32,
            "{} bytes for 5 visited cells of 1200",
            bytes.len()
        );
        assert_eq!(
            postcard::from_bytes::<Visitation>(&bytes).unwrap(),
            visitation
        );
        let beyond =
            postcard::to_stdvec(&((3_u64, vec![(7_u64, 1_u32)]), 3_usize, 1_usize)).unwrap();
        assert!(postcard::from_bytes::<Visitation>(&beyond).is_err());
    }
}
