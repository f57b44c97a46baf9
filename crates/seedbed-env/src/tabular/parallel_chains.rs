//! Parallel chains (Dimakopoulou & Van Roy 2018, §4.2 of arXiv 1802.01282).

use serde::{Deserialize, Serialize};

use super::model::{Coordinate, Model, Outcome, Prior, Reward};
use seedbed_input::numbers::{Count, NonNegative, Positive, ranged_count, ranged_number};

/// C chains of H edges that start at one vertex. The first step chooses a chain; its last edge is
/// rewarded with N(θ, noise²), all others with 0. The prior of chain c = 1 … C is θ ~ N(0, variance
/// + c).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ParallelChains {
    /// Number of chains C.
    pub chains: Count<250>,
    /// Number of edges H of each chain.
    pub edges: Count<1000>,
    /// Prior variance of θ, to which each chain adds its number.
    pub variance: Positive,
    /// Standard deviation of a reward.
    pub noise: NonNegative,
}

impl Default for ParallelChains {
    fn default() -> Self {
        Self {
            chains: ranged_count(4),
            edges: ranged_count(4),
            variance: ranged_number(100.0),
            noise: ranged_number(1.0),
        }
    }
}

impl ParallelChains {
    /// State 0 is the vertex that all chains leave; then come the vertices of each chain.
    pub(super) fn model(&self) -> Model {
        let (chains, edges) = (self.chains.get(), self.edges.get());
        let state_coordinates = (0..chains).flat_map(|chain| {
            (1..=edges).flat_map(move |depth| [chain as f32 + 1.0, depth as f32])
        });
        Model {
            parameters: (1..=chains).map(|number| self.prior(number)).collect(),
            coordinates: vec![
                Coordinate {
                    name: "chain",
                    max: chains as f32,
                },
                Coordinate {
                    name: "depth",
                    max: edges as f32,
                },
            ],
            state_coordinates: [0.0, 0.0].into_iter().chain(state_coordinates).collect(),
            ..Model::new(0, edges, &self.actions())
        }
    }

    /// The outcomes of each action of each state: a choice of the chain in state 0, then one step
    /// per vertex, and no action at the end of a chain.
    fn actions(&self) -> Vec<Vec<Vec<Outcome>>> {
        let (chains, edges) = (self.chains.get(), self.edges.get());
        let first: Vec<_> = (0..chains).map(|chain| self.edge(chain, 1)).collect();
        let following = |chain: u32| {
            (1..=edges).map(move |depth| {
                if depth < edges {
                    vec![self.edge(chain, depth + 1)]
                } else {
                    vec![]
                }
            })
        };
        std::iter::once(first)
            .chain((0..chains).flat_map(following))
            .collect()
    }

    /// The outcome of the edge of a chain that ends at `depth`.
    fn edge(&self, chain: u32, depth: u32) -> Vec<Outcome> {
        let edges = self.edges.get();
        let reward = if depth == edges {
            Reward::unknown(chain, 1.0)
        } else {
            Reward::known(0.0)
        };
        vec![Outcome {
            state: 1 + chain * edges + depth - 1,
            reward,
        }]
    }

    /// Prior of the chain with this number, from 1.
    fn prior(&self, number: u32) -> Prior {
        let deviation = (self.variance.get() + f64::from(number)).sqrt();
        Prior::Normal {
            mean: 0.0,
            deviation,
            noise: self.noise.get(),
        }
    }
}
