//! The maximum-reward path (Dimakopoulou & Van Roy 2018, §4.3 of arXiv 1802.01282).

use rand::RngExt;
use serde::{Deserialize, Serialize};

use super::model::{Coordinate, Model, Outcome, Prior, Reward};
use seedbed_input::numbers::{
    Count, FiniteNumber, NonNegative, Positive, ranged_count, ranged_number,
};
use seedbed_random::Stream;

/// A connected random graph of N vertices, in which any two are neighbors with probability 2 ln N /
/// N (Erdős–Rényi). A walk of H steps starts at vertex 0. Each edge has a reward of mean θ, whose
/// logarithm is N(ln θ − noise²/2, noise²); the prior is ln θ ~ N(mean, deviation²). The graph is
/// known, θ is not.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MaximumRewardPath {
    /// Number of vertices N.
    pub vertices: Count<1000, 2>,
    /// Number of steps H.
    pub steps: Count<1000>,
    /// Prior mean of ln θ.
    pub mean: FiniteNumber,
    /// Prior standard deviation of ln θ.
    pub deviation: Positive,
    /// Standard deviation of the logarithm of a reward.
    pub noise: NonNegative,
}

impl Default for MaximumRewardPath {
    fn default() -> Self {
        let (mean, deviation, noise) = (ranged_number(0.0), ranged_number(0.5), ranged_number(0.5));
        Self {
            vertices: ranged_count(100),
            steps: ranged_count(10),
            mean,
            deviation,
            noise,
        }
    }
}

impl MaximumRewardPath {
    pub(super) fn model(&self, random: &mut Stream) -> Model {
        let count = self.vertices.get();
        let edges = self.connected_edges(random);
        let mut actions = vec![Vec::new(); count as usize];
        for (&(one, other), parameter) in edges.iter().zip(0..) {
            let reward = Reward::unknown(parameter, 1.0);
            actions[one as usize].push(vec![Outcome {
                state: other,
                reward,
            }]);
            actions[other as usize].push(vec![Outcome { state: one, reward }]);
        }
        let prior = Prior::LogNormal {
            mean: self.mean.get(),
            deviation: self.deviation.get(),
            noise: self.noise.get(),
        };
        Model {
            parameters: vec![prior; edges.len()],
            coordinates: vec![Coordinate {
                name: "vertex",
                max: (count - 1) as f32,
            }],
            state_coordinates: (0..count).map(|vertex| vertex as f32).collect(),
            ..Model::new(0, self.steps.get(), &actions)
        }
    }

    /// Draws graphs until one is connected. A few draws are enough: 2 ln N / N is twice the
    /// threshold above which large random graphs are connected.
    fn connected_edges(&self, random: &mut Stream) -> Vec<(u32, u32)> {
        let count = self.vertices.get();
        let probability = 2.0 * libm::log(f64::from(count)) / f64::from(count);
        loop {
            let pairs = (0..count).flat_map(|one| (one + 1..count).map(move |other| (one, other)));
            let edges: Vec<(u32, u32)> = pairs
                .filter(|_| random.random::<f64>() < probability)
                .collect();
            if is_connected(count, &edges) {
                return edges;
            }
        }
    }
}

/// Whether the graph is connected: merges the groups of vertices that each edge joins.
fn is_connected(count: u32, edges: &[(u32, u32)]) -> bool {
    let mut group: Vec<u32> = (0..count).collect();
    for &(one, other) in edges {
        let (kept, merged) = (group[one as usize], group[other as usize]);
        group
            .iter_mut()
            .filter(|group| **group == merged)
            .for_each(|group| *group = kept);
    }
    group.iter().all(|&vertex| vertex == group[0])
}
