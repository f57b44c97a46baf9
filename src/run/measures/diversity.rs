//! Formulas: entropy of one agent's visit counts, and diversity of a team.
//!
//! Entropies are in nats. A cell without visits contributes nothing, as p ln p → 0.

use std::sync::LazyLock;

use libm::log;

/// Shannon entropy of visit counts c, H = −Σ p ln p with p = c / N and N = Σ c, computed as
/// ln N − (Σ c ln c) / N.
///
/// `counts: [cells]` → nats, from 0 (one visited cell) to ln cells (all counts equal). 0 without
/// visits.
#[must_use]
pub fn entropy(counts: &[u32]) -> f64 {
    let mut total = 0.0;
    let mut weighted = 0.0;
    for count in counts.iter().filter(|&&count| count > 1) {
        total += f64::from(*count);
        weighted += weighted_log(*count);
    }
    // Cells visited once contribute to the total only, since 1 ln 1 = 0.
    total += counts
        .iter()
        .map(|&count| f64::from(u8::from(count == 1)))
        .sum::<f64>();
    if total > 0.0 {
        log(total) - weighted / total
    } else {
        0.0
    }
}

/// c ln c, from a table for small counts, because the counts of all cells are summed in every round.
fn weighted_log(count: u32) -> f64 {
    static TABLE: LazyLock<Vec<f64>> = LazyLock::new(|| (0..TABLE_SIZE).map(count_log).collect());
    match TABLE.get(count as usize) {
        Some(value) => *value,
        None => count_log(count),
    }
}

/// Number of counts in the table.
const TABLE_SIZE: u32 = 4096;

fn count_log(count: u32) -> f64 {
    let count = f64::from(count);
    count * log(count)
}

/// Adds an agent's distribution to the mixture of the team: mixtureᵢ += share · countᵢ / Σ count.
/// → Σ count
///
/// `counts`, `mixture: [cells]`
pub fn add_to_mixture(counts: &[u32], share: f64, mixture: &mut [f64]) -> u64 {
    let total: u64 = counts.iter().map(|&count| u64::from(count)).sum();
    let weight = share / total.max(1) as f64;
    mixture
        .iter_mut()
        .zip(counts)
        .for_each(|(sum, &count)| *sum += weight * f64::from(count));
    total
}

/// Entropy of a distribution, H = −Σ p ln p.   `probabilities: [cells]` → nats
#[must_use]
pub fn distribution_entropy(probabilities: &[f64]) -> f64 {
    -probabilities
        .iter()
        .filter(|&&p| p > 0.0)
        .map(|p| p * log(*p))
        .sum::<f64>()
}

/// Generalized Jensen–Shannon divergence of equally weighted agents, JS = H(mean of pₖ) − mean of
/// H(pₖ), nats, from their visit counts.
///
/// `agents: K × [cells]`, at least one, each with a visit
#[must_use]
pub fn divergence<'a>(agents: impl ExactSizeIterator<Item = &'a [u32]> + Clone) -> f64 {
    let share = 1.0 / agents.len() as f64;
    let mut mixture = vec![0.0; agents.clone().next().map_or(0, <[u32]>::len)];
    for counts in agents.clone() {
        add_to_mixture(counts, share, &mut mixture);
    }
    distribution_entropy(&mixture) - share * agents.map(entropy).sum::<f64>()
}

/// How different the visited states of a team's agents are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Diversity {
    /// 1 − JS / ln K: 1 if all agents visited the same cells with the same frequencies, 0 if no two
    /// agents visited the same cell. 1 for a single agent.
    pub overlap: f64,
    /// exp JS, from 1 (all agents have the same visit frequencies) to K (no two agents visited the
    /// same cell).
    pub effective_agents: f64,
}

impl Diversity {
    /// Diversity from the generalized Jensen–Shannon divergence JS = H(mean of pₖ) − mean of H(pₖ),
    /// from 0 to ln K, of `agents` equally weighted agents (Lin 1991, "Divergence measures based on
    /// the Shannon entropy", eq. 5.1).
    ///
    /// In ecology, exp JS is called beta diversity: the effective number of distinct communities
    /// (Jost 2007, "Partitioning diversity into independent alpha and beta components", with equal
    /// weights).
    #[must_use]
    pub fn from_divergence(divergence: f64, agents: usize) -> Self {
        let max_divergence = log(agents.max(1) as f64);
        // Rounding may leave the range by a few units in the last place.
        let divergence = divergence.clamp(0.0, max_divergence);
        Self {
            overlap: if agents > 1 {
                1.0 - divergence / max_divergence
            } else {
                1.0
            },
            effective_agents: libm::exp(divergence),
        }
    }
}

/// Diversity of the agents in several grids: number of agents with visits, and their divergence, in each grid. JS and JS / ln K
/// are averaged over the grids with visits of at least two agents; `None` if there are none: agents can
/// only be compared where both were.
#[must_use]
pub fn diversity_of_grids(grids: impl Iterator<Item = (u64, f64)>) -> Option<Diversity> {
    let (mut count, mut divergences, mut shares) = (0.0, 0.0, 0.0);
    for (agents, divergence) in grids.filter(|(agents, _)| *agents > 1) {
        let divergence = divergence.max(0.0);
        count += 1.0;
        divergences += divergence;
        shares += divergence / log(agents as f64);
    }
    (count > 0.0).then(|| Diversity {
        overlap: (1.0 - shares / count).clamp(0.0, 1.0),
        effective_agents: libm::exp(divergences / count),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn divergence(agents: &[&[u32]]) -> f64 {
        super::divergence(agents.iter().copied())
    }

    /// Frequencies ½, ¼, ¼ have entropy ½ ln 2 + ½ ln 4 = 1.5 ln 2.
    #[test]
    fn entropy_of_counts_is_that_of_their_frequencies() {
        let ln2 = std::f64::consts::LN_2;
        assert!((entropy(&[2, 1, 0, 1]) - 1.5 * ln2).abs() < 1e-15);
        assert!((entropy(&[7; 4]) - 2.0 * ln2).abs() < 1e-15);
        assert_eq!(
            (entropy(&[0, 9]), entropy(&[0, 1]), entropy(&[0, 0])),
            (0.0, 0.0, 0.0)
        );
    }

    /// Agents with the same visit frequencies have JS = 0 for any number of visits. For three
    /// agents without a common cell, the entropy of the mixture exceeds the mean entropy of the
    /// agents by ln 3.
    #[test]
    fn equal_agents_count_as_one_and_disjoint_agents_fully() {
        let equal =
            Diversity::from_divergence(divergence(&[&[2, 6, 0], &[1, 3, 0], &[10, 30, 0]]), 3);
        assert!(
            (equal.effective_agents - 1.0).abs() < 1e-12 && (equal.overlap - 1.0).abs() < 1e-12,
            "{equal:?}"
        );
        let disjoint = Diversity::from_divergence(
            divergence(&[&[5, 0, 0, 0], &[0, 1, 1, 0], &[0, 0, 0, 2]]),
            3,
        );
        assert!(
            (disjoint.effective_agents - 3.0).abs() < 1e-12 && disjoint.overlap.abs() < 1e-12,
            "{disjoint:?}"
        );
    }

    /// Frequencies (1, 0) and (½, ½): the mixture (¾, ¼) has entropy 2 ln 2 − ¾ ln 3, the two
    /// agents have mean entropy ½ ln 2, hence JS = 1.5 ln 2 − ¾ ln 3, exp JS = 2^1.5 / 3^0.75 =
    /// 1.240806.
    #[test]
    fn partial_overlap_is_between_0_and_1() {
        let partly = Diversity::from_divergence(divergence(&[&[4, 0], &[3, 3]]), 2);
        assert!(
            (partly.effective_agents - 2_f64.powf(1.5) / 3_f64.powf(0.75)).abs() < 1e-12,
            "{partly:?}"
        );
        assert!(
            (partly.overlap - (0.75 * 3_f64.log2() - 0.5)).abs() < 1e-12,
            "1 − JS / ln 2 = ¾ log₂ 3 − ½: {partly:?}"
        );
    }

    /// Three agents in a grid where two of them are alike and the third is elsewhere, JS = H(⅔, ⅓); two
    /// in a grid where they are disjoint, JS = ln 2; one in a grid that says nothing.
    #[test]
    fn agents_are_compared_where_they_were() {
        let (left, right) = (&[1, 0][..], &[0, 5][..]);
        let grids = [
            (3, divergence(&[left, left, right])),
            (2, divergence(&[left, right])),
            (1, 0.0),
            (0, 0.0),
        ];
        let found = diversity_of_grids(grids.into_iter()).unwrap();
        let of_three = 3_f64.ln() - 2.0 / 3.0 * 2_f64.ln();
        let effective = f64::midpoint(of_three, 2_f64.ln()).exp();
        assert!((found.effective_agents - effective).abs() < 1e-12);
        assert!((found.overlap - (1.0 - f64::midpoint(of_three / 3_f64.ln(), 1.0))).abs() < 1e-12);
        assert_eq!(diversity_of_grids(grids[2..].iter().copied()), None);
    }

    #[test]
    fn a_single_agent_has_overlap_1() {
        assert_eq!(
            Diversity::from_divergence(1e-17, 1),
            Diversity {
                overlap: 1.0,
                effective_agents: 1.0
            }
        );
    }
}
