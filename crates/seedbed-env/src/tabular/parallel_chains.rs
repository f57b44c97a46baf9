//! Parallel chains (Dimakopoulou & Van Roy 2018, §4.2 of arXiv 1802.01282).

use serde::{Deserialize, Serialize};

use super::model::{Coordinate, Model, Outcome, Prior, Reward};
use crate::input::numbers::{Count, NonNegative, Positive, known, known_count};

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
            chains: known_count(4),
            edges: known_count(4),
            variance: known(100.0),
            noise: known(1.0),
        }
    }
}

impl ParallelChains {
    /// State 0 is the vertex that all chains leave; then come the vertices of each chain.
    pub(super) fn model(&self) -> Model {
        let (chains, edges) = (self.chains.get(), self.edges.get());
        let vertex = |chain: u32, depth: u32| 1 + chain * edges + depth - 1;
        let edge = |chain: u32, depth: u32| {
            let reward = if depth == edges {
                Reward::unknown(chain, 1.0)
            } else {
                Reward::known(0.0)
            };
            vec![Outcome {
                state: vertex(chain, depth),
                reward,
            }]
        };
        let following = |chain: u32| {
            (1..=edges).map(move |depth| {
                if depth < edges {
                    vec![edge(chain, depth + 1)]
                } else {
                    vec![]
                }
            })
        };
        let first: Vec<_> = (0..chains).map(|chain| edge(chain, 1)).collect();
        let actions: Vec<_> = std::iter::once(first)
            .chain((0..chains).flat_map(following))
            .collect();
        let places = (0..chains).flat_map(|chain| {
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
            places: [0.0, 0.0].into_iter().chain(places).collect(),
            ..Model::new(0, edges, &actions)
        }
    }

    fn prior(&self, number: u32) -> Prior {
        let deviation = (self.variance.get() + f64::from(number)).sqrt();
        Prior::Normal {
            mean: 0.0,
            deviation,
            noise: self.noise.get(),
        }
    }
}
