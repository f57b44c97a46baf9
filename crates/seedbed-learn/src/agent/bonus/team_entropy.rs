//! Entropy of the states that a team visits: the bonus of a step is large if few states of the newest
//! round are near the state that it leads to (Seo et al. 2021; Liu & Abbeel 2021; for parallel agents
//! De Paola et al. 2025).

use rand::seq::index;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::scaled_states::{self, ScaledStates};
use super::{BonusConfig, BonusScale, GainModel, ModelSharing, Steps, same_kind};
use crate::agent::AgentContext;
use crate::experience::Episode;
use crate::experience::replay::Origin;
use crate::nn::Tensor;
use crate::rl::state_entropy::{self, NeighborScratch};
use seedbed_env::TaskSpec;
use seedbed_input::numbers::{Count, ranged_count};
use seedbed_random::Stream;

/// Distance from the state that a step leads to, to other states of the newest round: k-nearest-
/// neighbor entropy (RE3, Seo et al. 2021; APT, Liu & Abbeel 2021) of the states of a team (De Paola
/// et al. 2025).
///
/// Distances are those of observations whose display ranges are scaled to −1 to 1; in the papers, those
/// of encoded images.
#[derive(Clone, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TeamEntropy {
    /// Whose states of the newest round a state is compared with: those of the team (`Shared`) or the
    /// agent's own (`Independent`: a control without the team). `Frozen` is not possible.
    pub model: ModelSharing,
    /// How the logarithms of distances are scaled to bonuses.
    pub scale: BonusScale,
    /// Number k of the neighbor whose distance counts: 1 for the nearest one.
    pub neighbors: Count<1000>,
    /// Maximal number of states that a state is compared with, drawn without replacement from those
    /// of the round.
    pub references: Count<100_000>,
}

impl Default for TeamEntropy {
    fn default() -> Self {
        Self {
            model: ModelSharing::Shared,
            scale: BonusScale::default(),
            neighbors: ranged_count(3),
            references: ranged_count(1024),
        }
    }
}

impl BonusConfig for TeamEntropy {
    fn sharing(&self) -> ModelSharing {
        self.model
    }

    fn scale(&self) -> BonusScale {
        self.scale
    }

    fn build(&self, _owner: u32, context: &AgentContext<'_>) -> Box<dyn GainModel> {
        Box::new(TeamEntropyModel::new(self, context))
    }

    fn memory(&self, spec: &TaskSpec) -> u64 {
        let numbers = spec.observation_width() as u64 + 3;
        4 * numbers * u64::from(self.references.get())
    }

    fn formula(&self) -> String {
        format!(
            "{} Gain: log(1 + d), where d is the Euclidean distance from x to the row of \
             references at position {} by distance, not counting the row of the same step.",
            scaled_states::formula(),
            self.neighbors.get()
        )
    }

    fn inputs(&self, spec: &TaskSpec) -> Vec<String> {
        scaled_states::names(spec)
    }

    fn fault(&self) -> Option<&'static str> {
        if self.model == ModelSharing::Frozen {
            Some(
                "`TeamEntropy` has no model that could be frozen; expected `model: Shared` or \
                 `Independent`",
            )
        } else if self.neighbors.get() > self.references.get() {
            Some("`TeamEntropy` has more `neighbors` than `references`; expected at most as many")
        } else {
            None
        }
    }

    fn is_deterministic(&self) -> bool {
        true
    }

    fn can_be_frozen(&self) -> bool {
        false
    }
}

/// The states of the newest round that states are compared with.
struct TeamEntropyModel {
    config: TeamEntropy,
    states: ScaledStates,
    references: References,
    scratch: NeighborScratch,
}

/// Scaled states, in the order of the steps that led to them.
#[derive(Clone, Default, Serialize, Deserialize)]
struct References {
    /// One column per observation: `[width × N]`.
    columns: Vec<f32>,
    /// The steps: `[N]`.
    steps: Vec<Origin>,
}

impl TeamEntropyModel {
    fn new(config: &TeamEntropy, context: &AgentContext<'_>) -> Self {
        Self {
            config: config.clone(),
            states: ScaledStates::new(context.spec),
            references: References::default(),
            scratch: NeighborScratch::default(),
        }
    }
}

impl GainModel for TeamEntropyModel {
    /// Replaces the references by states of `episodes`. Start states are none of them, because no
    /// step leads there.
    fn begin_round(&mut self, episodes: &[&Episode], random: &mut Stream) {
        let ends = episodes.iter().scan(0, |end, episode| {
            *end += episode.length();
            Some(*end)
        });
        let ends: Vec<usize> = ends.collect();
        let steps = ends.last().copied().unwrap_or(0);
        let count = steps.min(self.config.references.get() as usize);
        let drawn = index::sample(random, steps, count).into_iter();
        let mut drawn: Vec<(Origin, &[f32])> = drawn
            .map(|position| {
                let index = ends.partition_point(|&end| end <= position);
                let episode = episodes[index];
                let step = position + episode.length() - ends[index];
                let state = &episode.observations[(step + 1) * self.states.width()..]
                    [..self.states.width()];
                (episode.origin(step), state)
            })
            .collect();
        drawn.sort_unstable_by_key(|(origin, _)| *origin);
        let rows: Vec<f32> = drawn
            .iter()
            .flat_map(|(_, state)| *state)
            .copied()
            .collect();
        self.states.scale(&rows);
        let columns = (0..self.states.width()).flat_map(|column| {
            let rows = self.states.iter();
            rows.map(move |row| row[column])
        });
        self.references = References {
            columns: columns.collect(),
            steps: drawn.into_iter().map(|(origin, _)| origin).collect(),
        };
    }

    /// log(1 + d) of each step, 0 without references. If a step is one of the references, its own
    /// state does not count.
    fn compute_gains(&mut self, steps: &Steps<'_>, _: &mut Stream, gains: &mut Vec<f32>) {
        let episode = steps.episode;
        self.states.scale_next(&episode.observations);
        let (neighbors, width) = (self.config.neighbors.get() as usize, self.states.width());
        gains.clear();
        for step in (0..episode.length()).step_by(steps.stride) {
            let distance = state_entropy::distance_to_neighbor(
                &self.states.all()[step * width..][..width],
                &self.references.columns,
                self.references
                    .steps
                    .binary_search(&(steps.origin)(step))
                    .ok(),
                neighbors,
                &mut self.scratch,
            );
            gains.push(distance.map_or(0.0, state_entropy::bonus));
        }
    }

    fn copy_learned(&mut self, trained: &dyn GainModel) {
        let trained: &Self = same_kind(trained);
        self.references.clone_from(&trained.references);
    }

    fn compares_new_episodes(&self) -> bool {
        true
    }

    fn is_finite(&self) -> bool {
        true
    }

    fn tensors(&self) -> Vec<Tensor<'_>> {
        let mut tensors = self.states.tensors();
        let count = self.references.steps.len();
        if count > 0 {
            let columns = &self.references.columns;
            let row =
                |row| (0..self.states.width()).map(move |column| columns[column * count + row]);
            tensors.push(Tensor {
                name: "references".to_owned(),
                shape: vec![count, self.states.width()],
                values: (0..count).flat_map(row).collect(),
            });
        }
        tensors
    }

    fn save(&self) -> Vec<u8> {
        postcard::to_stdvec(&self.references).expect("plain numbers always serialize")
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), String> {
        let references: References =
            postcard::from_bytes(bytes).map_err(|error| error.to_string())?;
        let (stored, expected) = (
            references.columns.len(),
            references.steps.len() * self.states.width(),
        );
        if stored != expected {
            return Err(format!(
                "the checkpoint has {stored} coordinates of reference states; expected {expected}"
            ));
        }
        self.references = references;
        Ok(())
    }
}
