//! Counts of visited states on grids over the state space.

use serde::{Deserialize, Serialize};

use super::Division;
use super::diversity::{
    Diversity, add_to_mixture, distribution_entropy, diversity_of_grids, entropy,
};
use seedbed_env::{Quantity, TaskSpec};

/// Number of cells of a grid along one observation.
const CELLS_PER_AXIS: usize = 20;

/// Maximum number of observations for which grids over pairs are used. Tasks with more observations
/// have one cell per observation instead.
const MAX_GRID_OBSERVATIONS: usize = 30;

/// The bin of NaN, which is in no cell.
const NO_BIN: u16 = u16::MAX;

/// How often each cell of the state space was visited.
///
/// For each pair of observations, a fixed grid of 20 × 20 cells spans their display ranges; values
/// beyond a range count in its outermost cell. All measures are averaged over pairs, so they mean
/// the same in any dimension. A single observation has a grid of 20 cells. Tasks with more than 30
/// observations, such as a one-hot vector, have one cell per observation instead: a state counts in
/// the cell of its largest observation.
///
/// Counts take four bytes per cell and agent: 9.6 kB per agent for four observations, 218 kB for
/// seventeen. A count saturates at 2³² − 1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Visitation {
    /// `[grids × cells of a grid]`
    #[serde(with = "sparse")]
    counts: Vec<u32>,
    cells_per_grid: usize,
    /// Number of cells visited at least once.
    visited: usize,
}

impl Visitation {
    /// Counts of zero for the observations of a task.
    #[must_use]
    pub fn new(spec: &TaskSpec) -> Self {
        Self::for_observations(&spec.observations)
    }

    /// Counts of zero for the given observations.
    #[must_use]
    pub fn for_observations(observations: &[Quantity]) -> Self {
        let axes = observations.len();
        let (grids, cells_per_grid) = match axes {
            1 => (1, CELLS_PER_AXIS),
            2..=MAX_GRID_OBSERVATIONS => (axes * (axes - 1) / 2, CELLS_PER_AXIS * CELLS_PER_AXIS),
            _ => (1, axes),
        };
        Self {
            counts: vec![0; grids * cells_per_grid],
            cells_per_grid,
            visited: 0,
        }
    }

    /// Counts visited states.
    pub fn add(&mut self, states: &StateBins) {
        states.for_each_cell(|cell| {
            self.visited += usize::from(self.counts[cell] == 0);
            self.counts[cell] = self.counts[cell].saturating_add(1);
        });
    }

    /// Takes back states that were counted before.
    pub fn remove(&mut self, states: &StateBins) {
        states.for_each_cell(|cell| {
            self.counts[cell] = self.counts[cell].saturating_sub(1);
            self.visited -= usize::from(self.counts[cell] == 0);
        });
    }

    /// Number of cells of all grids.
    #[must_use]
    pub fn cell_count(&self) -> usize {
        self.counts.len()
    }

    /// Counts N visited states, given the observations that they consist of.
    /// `states: [N × quantities]`
    pub fn visit_states(&mut self, quantities: &[Quantity], states: &[f32]) {
        self.add(&StateBins::of(quantities, states));
    }

    /// Visited share of cells, from 0 to 1.
    #[must_use]
    pub fn coverage(&self) -> f64 {
        self.visited as f64 / self.counts.len() as f64
    }

    /// Entropy of the visited states, averaged over grids with visits, in nats, from 0 to
    /// [`max_entropy`](Self::max_entropy), except for rounding: see [`without_rounding_error`]. A grid has no
    /// visits if an observation was always NaN.
    #[must_use]
    pub fn entropy(&self) -> f64 {
        let grids = self.grids().filter(|grid| has_visits(grid));
        let (sum, count) = grids.fold((0.0, 0_u32), |(sum, count), grid| {
            (sum + entropy(grid), count + 1)
        });
        sum / f64::from(count.max(1))
    }

    /// The [`entropy`](Self::entropy) as a share of the largest possible one, from 0 to 1 (Pielou's evenness).
    #[must_use]
    pub fn evenness(&self, entropy: f64) -> f64 {
        without_rounding_error(entropy) / self.max_entropy()
    }

    /// The entropy if all cells were visited equally often: ln 400, or ln 20 for a single
    /// observation.
    #[must_use]
    pub fn max_entropy(&self) -> f64 {
        libm::log(self.cells_per_grid as f64)
    }

    fn grids(&self) -> std::slice::ChunksExact<'_, u32> {
        self.counts.chunks_exact(self.cells_per_grid)
    }

    fn grid(&self, number: usize) -> &[u32] {
        &self.counts[number * self.cells_per_grid..][..self.cells_per_grid]
    }
}

fn has_visits(grid: &[u32]) -> bool {
    grid.iter().any(|&count| count > 0)
}

/// An entropy that is not below 0: that of a single visited cell may be computed as −2.2e-16. Sums of
/// entropies are made before, so that their bits do not change.
#[must_use]
pub fn without_rounding_error(entropy: f64) -> f64 {
    entropy.max(0.0)
}

/// The bins of visited states, from which the cells follow in which they count.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StateBins {
    /// Number of bins per state: one per observation, or one for the only cell of a state.
    width: usize,
    /// `[states × width]`
    bins: Vec<u16>,
}

impl StateBins {
    /// The bins of N states. `states: [N × quantities]`
    #[must_use]
    pub fn of(quantities: &[Quantity], states: &[f32]) -> Self {
        let rows = states.chunks_exact(quantities.len());
        if quantities.len() > MAX_GRID_OBSERVATIONS {
            return Self {
                width: 1,
                bins: rows.filter_map(largest_observation).collect(),
            };
        }
        let mut bins = Vec::with_capacity(states.len());
        for row in rows {
            for (value, quantity) in row.iter().zip(quantities) {
                let [low, high] = quantity.range;
                let bin = (value - low) / (high - low) * CELLS_PER_AXIS as f32;
                bins.push(if bin.is_nan() {
                    NO_BIN
                } else {
                    bin.clamp(0.0, CELLS_PER_AXIS as f32 - 1.0) as u16
                });
            }
        }
        Self {
            width: quantities.len(),
            bins,
        }
    }

    /// Calls `visit` with each cell of each state: one in the grid of each pair of observations, except pairs
    /// in which an observation is NaN.
    pub fn for_each_cell(&self, mut visit: impl FnMut(usize)) {
        if self.width == 1 {
            let bins = self.bins.iter().filter(|bin| **bin != NO_BIN);
            return bins.for_each(|bin| visit(usize::from(*bin)));
        }
        for row in self.bins.chunks_exact(self.width.max(1)) {
            let mut grid_start = 0;
            for (index, first) in row.iter().enumerate() {
                for second in &row[index + 1..] {
                    if *first != NO_BIN && *second != NO_BIN {
                        visit(
                            grid_start
                                + usize::from(*first) * CELLS_PER_AXIS
                                + usize::from(*second),
                        );
                    }
                    grid_start += CELLS_PER_AXIS * CELLS_PER_AXIS;
                }
            }
        }
    }
}

/// Index of the largest observation. `None` if all are 0, as in tabular tasks after the end of an
/// episode.
fn largest_observation(observations: &[f32]) -> Option<u16> {
    let largest = observations
        .iter()
        .enumerate()
        .filter(|(_, value)| !value.is_nan())
        .max_by(|one, other| one.1.total_cmp(other.1).then(other.0.cmp(&one.0)));
    let (index, _) = largest.filter(|(_, value)| **value != 0.0)?;
    u16::try_from(index).ok()
}

/// How different the visited states of the agents are, as [`known_diversity`]; without two agents with
/// visits, that of a single agent.
#[must_use]
pub fn diversity(agents: &[&Visitation], entropies: &[f64], division: Division<'_>) -> Diversity {
    let known = known_diversity(agents, entropies, division);
    known.unwrap_or_else(|| Diversity::from_divergence(0.0, 1))
}

/// Diversity of the visits of a team as a reader is told it: 1 if only one agent has visits, and `None`
/// if none has or if no two can be compared. `agents: [K]`
#[must_use]
pub fn diversity_of_team(agents: &[Visitation]) -> Option<Diversity> {
    let entropies: Vec<f64> = agents.iter().map(Visitation::entropy).collect();
    let visits: Vec<&Visitation> = agents.iter().collect();
    match visiting_agents(agents) {
        1 => Some(diversity(&visits, &entropies, Division::NONE)),
        _ => known_diversity(&visits, &entropies, Division::NONE),
    }
}

/// Number of agents with visits.
#[must_use]
pub fn visiting_agents(agents: &[Visitation]) -> usize {
    agents.iter().filter(|agent| agent.visited > 0).count()
}

/// How different the visited states of the agents are, on rank 0. In each grid, agents without visits are
/// ignored, all other agents have equal weights. `None` if no grid has visits of two agents.
/// `agents, entropies: [local agents]`
///
/// Takes O(K · cells): it is the divergence of the agents from their mixture, not of each pair. No bit depends on the
/// division: each sum is over agents, or over grids, in their order.
#[must_use]
pub fn known_diversity(
    agents: &[&Visitation],
    entropies: &[f64],
    division: Division<'_>,
) -> Option<Diversity> {
    let ranks = division.ranks;
    let with_visits = agents.iter().zip(entropies);
    let with_visits = with_visits.filter(|(agent, _)| agent.visited > 0);
    let (visiting, entropies): (Vec<&Visitation>, Vec<f64>) = with_visits.unzip();
    let grids = agents.first().map_or(0, |agent| agent.grids().len());
    let visitors = ranks.sum(visitors_of_grids(&visiting, grids));
    let (&count, visitors) = visitors.split_last()?;
    if count < 2 {
        return None;
    }
    let are_same_in_all_grids = visitors.iter().all(|visitors| *visitors == count);
    let mixtures = mixtures(&visiting, visitors, !are_same_in_all_grids, division);
    let entropies = ranks.gather_lists(entropies);
    if !ranks.is_first() {
        return None;
    }
    if !are_same_in_all_grids {
        let divergence = |(&visitors, mixture): (&u64, &Mixture)| {
            let share = 1.0 / visitors as f64;
            (visitors, mixture.entropy - share * mixture.sum_of_entropies)
        };
        return diversity_of_grids(visitors.iter().zip(&mixtures).map(divergence));
    }
    let mut mixture_entropies = 0.0;
    for mixture in &mixtures {
        mixture_entropies += mixture.entropy;
    }
    let mean = 1.0 / count as f64 * entropies.iter().sum::<f64>();
    let divergence = mixture_entropies / grids as f64 - mean;
    Some(Diversity::from_divergence(divergence, count as usize))
}

/// Number of agents with visits in each grid, and at the end that of all agents.
fn visitors_of_grids(agents: &[&Visitation], grids: usize) -> Vec<u64> {
    let mut visitors = vec![0; grids + 1];
    for agent in agents {
        for (visitors, grid) in visitors.iter_mut().zip(agent.grids()) {
            *visitors += u64::from(has_visits(grid));
        }
    }
    visitors[grids] = agents.len() as u64;
    visitors
}

/// The equally weighted mixture of the agents' visits in a grid.
#[derive(Clone, Copy, Serialize, Deserialize)]
struct Mixture {
    /// Its entropy, nats.
    entropy: f64,
    /// Sum of the entropies of the agents, nats; 0 if it was not asked for.
    sum_of_entropies: f64,
}

/// The mixture of each grid, on rank 0. `agents`: local agents with visits; `visitors`: number of agents of all ranks with visits
/// in each grid
fn mixtures(
    agents: &[&Visitation],
    visitors: &[u64],
    with_entropies: bool,
    Division { workers, ranks }: Division<'_>,
) -> Vec<Mixture> {
    // The sums of all cells, and behind them that of entropies.
    let add = |grid: usize, sums: &mut Vec<f64>| {
        let share = 1.0 / visitors[grid].max(1) as f64;
        for counts in agents.iter().map(|agent| agent.grid(grid)) {
            sums.resize(counts.len() + 1, 0.0);
            let (of_entropies, mixture) = sums.split_last_mut().expect("one number or more");
            if add_to_mixture(counts, share, mixture) > 0 && with_entropies {
                *of_entropies += entropy(counts);
            }
        }
    };
    let mixture_of = |sums: Vec<f64>| Mixture {
        entropy: distribution_entropy(&sums[..sums.len().saturating_sub(1)]),
        sum_of_entropies: sums.last().copied().unwrap_or_default(),
    };
    let grids = visitors.len();
    if ranks.is_single() {
        return workers.map((0..grids).collect(), |grid| {
            let mut sums = Vec::new();
            add(grid, &mut sums);
            mixture_of(sums)
        });
    }
    let sums = ranks.pass_along(grids, add);
    let of_last = sums.into_iter().flatten().map(mixture_of).collect();
    ranks.gather_lists(of_last)
}

/// The format of counts in checkpoints: the number of cells, then two numbers for each visited
/// cell, the number of unvisited cells since the previous visited cell and the count of the cell.
mod sparse {
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    /// More cells than any task has: a damaged file must not make the process allocate all memory.
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
        visitation.visit_states(&spec(axes).observations, observations);
        visitation
    }

    /// Three axes make three grids of 400 cells; the states (0.5, 1.5, 2.5) and (0.5, 1.5, 19.5)
    /// share a cell in the first grid.
    #[test]
    fn coverage_counts_cells_of_pairs() {
        let mut visitation = visited(3, &[0.5, 1.5, 2.5, 0.5, 1.5, 19.5]);
        assert!((visitation.coverage() - 5.0 / 1200.0).abs() < 1e-12);
        visitation.visit_states(&spec(3).observations, &[0.5, 1.5, 99.0]);
        assert!(
            (visitation.coverage() - 5.0 / 1200.0).abs() < 1e-12,
            "a value beyond the range counts in the outermost cell"
        );
    }

    /// Of three grids, only that of the first and the last axis has a cell of a state that is NaN on the
    /// second axis.
    #[test]
    fn nan_is_in_no_cell() {
        let visitation = visited(3, &[0.5, f32::NAN, 2.5]);
        assert!((visitation.coverage() - 1.0 / 1200.0).abs() < 1e-12);
        assert!((visited(1, &[f32::NAN, 0.5]).coverage() - 1.0 / 20.0).abs() < 1e-12);
        let mut one_hot = vec![0.0; 40];
        (one_hot[3], one_hot[5]) = (f32::NAN, 1.0);
        assert!((visited(40, &one_hot).coverage() - 1.0 / 40.0).abs() < 1e-12);
    }

    /// ln 41 − (41 ln 41) / 41 is −4.4e-16 or 0 in double precision, depending on the count.
    /// All cells of the first two observations are visited once, and the third is always NaN: nothing is known of its
    /// grids.
    #[test]
    fn an_observation_that_is_always_nan_does_not_change_the_evenness() {
        let quantity = |name| Quantity::new(name, "", [0.0, 20.0]);
        let observations = ["x", "y", "z"].map(quantity);
        let mut states = Vec::new();
        for x in 0..20_u8 {
            for y in 0..20_u8 {
                states.extend([f32::from(x) + 0.5, f32::from(y) + 0.5, f32::NAN]);
            }
        }
        let mut visitation = Visitation::for_observations(&observations);
        assert_eq!(visitation.evenness(visitation.entropy()), 0.0);
        visitation.visit_states(&observations, &states);
        assert!((visitation.evenness(visitation.entropy()) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_single_visited_cell_has_no_evenness() {
        for count in 1..2000 {
            let visitation = visited(2, &[0.5, 0.5].repeat(count));
            assert!(
                visitation.evenness(visitation.entropy()) >= 0.0,
                "{count} visits"
            );
            assert!(without_rounding_error(visitation.entropy()) >= 0.0);
        }
    }

    #[test]
    fn one_axis_has_twenty_cells() {
        let visitation = visited(1, &[0.5, 0.6, 7.0, -3.0]);
        assert!((visitation.coverage() - 2.0 / 20.0).abs() < 1e-12);
        assert_eq!(visitation.max_entropy(), 20_f64.ln());
    }

    /// The states (0.5, 1.5, 2.5) and (0.5, 1.5, 19.5) share a cell in the first grid (entropy 0),
    /// and are in different cells in the two other grids (entropy ln 2 each).
    #[test]
    fn entropy_is_averaged_over_pairs() {
        let visitation = visited(3, &[0.5, 1.5, 2.5, 0.5, 1.5, 19.5]);
        assert!((visitation.entropy() - 2.0 / 3.0 * std::f64::consts::LN_2).abs() < 1e-12);
        let everywhere: Vec<f32> = (0..400)
            .flat_map(|cell| [(cell / 20) as f32, (cell % 20) as f32])
            .collect();
        let visitation = visited(2, &everywhere);
        assert!((visitation.entropy() - visitation.max_entropy()).abs() < 1e-12);
    }

    /// Three states count in the cells of their largest observations, 3, 3 and 7 of 40; a state of
    /// zeros is not counted.
    #[test]
    fn more_than_thirty_observations_have_one_cell_each() {
        let mut rows = vec![0.0; 4 * 40];
        (rows[3], rows[40 + 3], rows[80 + 7]) = (1.0, 1.0, 1.0);
        let visitation = visited(40, &rows);
        assert!((visitation.coverage() - 2.0 / 40.0).abs() < 1e-12);
        // Frequencies ⅔ and ⅓: entropy ln 3 − ⅔ ln 2.
        assert!(
            (visitation.entropy() - (3_f64.ln() - 2.0 / 3.0 * std::f64::consts::LN_2)).abs()
                < 1e-12
        );
        assert_eq!(visitation.max_entropy(), 40_f64.ln());
    }

    fn diversity_of(agents: &[Visitation]) -> Diversity {
        let visits: Vec<&Visitation> = agents.iter().collect();
        let entropies: Vec<f64> = agents.iter().map(Visitation::entropy).collect();
        diversity(&visits, &entropies, Division::NONE)
    }

    /// Agents at (0, 0, 0) and (0, 0, 9) share a cell in the first of three grids, and are in
    /// different cells in the two other grids: JS = ⅔ ln 2. An agent without visits does not change
    /// it.
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

    /// Two agents visit the same cells, but the third observation of one is NaN: in the only grid that
    /// both visited they are alike. An agent at NaN only cannot be compared with another.
    #[test]
    fn agents_are_compared_in_grids_that_both_visited() {
        let nan = f32::NAN;
        let (whole, part) = (visited(3, &[1.0, 2.0, 3.0]), visited(3, &[1.0, 2.0, nan]));
        let nowhere = visited(3, &[nan; 3]);
        let alike = Diversity::from_divergence(0.0, 2);
        assert_eq!(
            diversity_of_team(&[part.clone(), whole.clone()]),
            Some(alike)
        );
        let three = [part.clone(), whole.clone(), nowhere.clone()];
        assert_eq!(
            (diversity_of_team(&three), visiting_agents(&three)),
            (Some(alike), 2)
        );
        assert_eq!(
            known_diversity(&[&whole, &nowhere], &[0.0; 2], Division::NONE),
            None
        );
        assert_eq!(diversity_of_team(&[nowhere.clone(), nowhere]), None);
    }

    #[test]
    fn agents_without_overlap_count_fully() {
        let agents: Vec<Visitation> = (0..256)
            .map(|agent| visited(2, &[(agent / 20) as f32, (agent % 20) as f32]))
            .collect();
        assert!((diversity_of(&agents).effective_agents - 256.0).abs() < 1e-9);
    }

    #[test]
    fn checkpoints_store_visited_cells_only() {
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
        let cell_beyond_grid =
            postcard::to_stdvec(&((3_u64, vec![(7_u64, 1_u32)]), 3_usize, 1_usize)).unwrap();
        assert!(postcard::from_bytes::<Visitation>(&cell_beyond_grid).is_err());
    }
}
