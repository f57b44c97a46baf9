//! The bipolar chain (Dimakopoulou & Van Roy 2018, §4.1 of arXiv 1802.01282).

use serde::{Deserialize, Serialize};

use super::model::{Coordinate, Model, Outcome, Prior, Reward};
use seedbed_input::numbers::{Count, ranged_count};

/// Vertices 0 to N − 1 in a row. Episodes start in the middle and end at either end, or after 3N/2
/// steps. The step to one end is rewarded with N, the step to the other with −N, any other with −1.
/// Which end is the rewarded one is unknown.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BipolarChain {
    /// Number of vertices N.
    pub vertices: Count<10_000, 3>,
}

impl Default for BipolarChain {
    fn default() -> Self {
        Self {
            vertices: ranged_count(100),
        }
    }
}

impl BipolarChain {
    pub(super) fn model(&self) -> Model {
        let count = self.vertices.get();
        let actions: Vec<Vec<Vec<Outcome>>> = (0..count)
            .map(|vertex| vertex_actions(vertex, count))
            .collect();
        Model {
            parameters: vec![Prior::Sign],
            coordinates: vec![Coordinate {
                name: "vertex",
                max: (count - 1) as f32,
            }],
            state_coordinates: (0..count).map(|vertex| vertex as f32).collect(),
            ..Model::new(count / 2, 3 * count / 2, &actions)
        }
    }
}

/// The actions of a vertex: to the left and to the right. θ is 1 if the right end is the rewarded
/// one, else −1.
fn vertex_actions(vertex: u32, count: u32) -> Vec<Vec<Outcome>> {
    if vertex == 0 || vertex == count - 1 {
        return Vec::new();
    }
    let reward_at_end = f64::from(count);
    let reward = |state| match state {
        0 => Reward::unknown(0, -reward_at_end),
        state if state == count - 1 => Reward::unknown(0, reward_at_end),
        _ => Reward::known(-1.0),
    };
    [vertex - 1, vertex + 1]
        .map(|state| {
            vec![Outcome {
                state,
                reward: reward(state),
            }]
        })
        .into()
}
