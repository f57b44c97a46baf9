//! Division of the state space among the agents of a team: each is rewarded for states in its own regions, the more the
//! less often the team has been there.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::scaled_states::{self, ScaledStates};
use super::{BonusConfig, BonusScale, GainModel, ModelSharing, Steps, TrainingData, same_kind};
use crate::agent::AgentContext;
use crate::cancellation::cancellation_point;
use crate::nn::Tensor;
use crate::rl::state_regions::{StateRegions, novelty};
use seedbed_env::TaskSpec;
use seedbed_input::numbers::{Count, Fraction, Positive, ranged_count, ranged_number};
use seedbed_random::Stream;

/// Divide and conquer: visited states are divided into regions, each of which belongs to one agent of the team. The gain
/// of a step is 1/√(1 + n) if the state that it leads to is in the agent's own region, which the team has visited n
/// times.
///
/// A state that is farther than `radius` from the centers of all regions makes a new one. It belongs to the agent with
/// the nearest region, unless that agent has more than its share. Distances are those of observations whose display
/// ranges are scaled to −1 to 1.
#[derive(Clone, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Regions {
    /// Whose visits make regions: those of the team (`Shared`), or the agent's own, all of whose regions are its own
    /// (`Independent`: a control without the team). `Frozen` is not possible.
    pub model: ModelSharing,
    /// How gains are scaled to bonuses.
    pub scale: BonusScale,
    /// Share of the gain in regions of other agents. 0: they are worth nothing; 1: all regions are worth the same, a
    /// control that does not divide.
    pub others: Fraction,
    /// Maximal number of regions. If there are more, the radius doubles, and near ones are merged.
    pub regions: Count<100_000>,
    /// Distance up to which a state belongs to the region of a center, at first.
    pub radius: Positive,
}

impl Default for Regions {
    fn default() -> Self {
        Self {
            model: ModelSharing::Shared,
            scale: BonusScale::Raw {
                weight: ranged_number(0.1),
                shown: ranged_number(0.1),
                lowest: ranged_number(1.0),
            },
            others: ranged_number(0.0),
            regions: ranged_count(256),
            radius: ranged_number(0.1),
        }
    }
}

impl BonusConfig for Regions {
    fn sharing(&self) -> ModelSharing {
        self.model
    }

    fn scale(&self) -> BonusScale {
        self.scale
    }

    fn build(&self, _owner: u32, context: &AgentContext<'_>) -> Box<dyn GainModel> {
        Box::new(RegionsModel::new(self, context))
    }

    fn memory(&self, spec: &TaskSpec) -> u64 {
        let numbers = spec.observation_width() as u64 + 2;
        4 * numbers * u64::from(self.regions.get())
    }

    fn formula(&self) -> String {
        format!(
            "{} Of the row of centers that is nearest to x, n is the number in visits, or 0 if the distance is \
             larger than radius. Gain: 1 / sqrt(1 + n), times {} if another agent is its owner.",
            scaled_states::formula(),
            self.others.get()
        )
    }

    fn inputs(&self, spec: &TaskSpec) -> Vec<String> {
        scaled_states::names(spec)
    }

    fn fault(&self) -> Option<&'static str> {
        (self.model == ModelSharing::Frozen).then_some(
            "`Regions` has no model that could be frozen; expected `model: Shared` or \
             `Independent`",
        )
    }

    /// Agents differ in what they own.
    fn is_deterministic(&self) -> bool {
        self.others.get() == 1.0
    }

    fn can_be_frozen(&self) -> bool {
        false
    }
}

/// The regions, and which of them are the agent's own.
struct RegionsModel {
    /// The owner number of the agent.
    agent: u32,
    others: f32,
    states: ScaledStates,
    regions: StateRegions,
}

impl RegionsModel {
    fn new(config: &Regions, context: &AgentContext<'_>) -> Self {
        let states = ScaledStates::new(context.spec);
        let [agents, agent] = if config.model == ModelSharing::Shared {
            [context.team.count.get(), context.agent]
        } else {
            [1, 0]
        };
        let (max, radius) = (config.regions.get() as usize, config.radius.get_f32());
        Self {
            agent,
            others: config.others.get_f32(),
            regions: StateRegions::new(states.width(), max, agents, radius),
            states,
        }
    }
}

impl GainModel for RegionsModel {
    fn compute_gains(&mut self, steps: &Steps<'_>, _: &mut Stream, gains: &mut Vec<f32>) {
        self.states.scale_next(&steps.episode.observations);
        gains.clear();
        for state in self.states.iter().step_by(steps.stride) {
            let place = self.regions.place(state);
            let is_own = place.owner.is_none_or(|owner| owner == self.agent);
            let share = if is_own { 1.0 } else { self.others };
            gains.push(share * novelty(place.visits));
        }
    }

    /// Counts the states of the new episodes.
    fn learn(&mut self, data: &TrainingData<'_>, _: &mut Stream) -> Option<f32> {
        for episode in data.new_episodes {
            cancellation_point();
            self.states.scale_next(&episode.observations);
            for state in self.states.iter() {
                self.regions.visit(state);
            }
        }
        None
    }

    fn copy_learned(&mut self, trained: &dyn GainModel) {
        let trained: &Self = same_kind(trained);
        self.regions.clone_from(&trained.regions);
    }

    fn is_finite(&self) -> bool {
        true
    }

    fn tensors(&self) -> Vec<Tensor<'_>> {
        let mut tensors = self.states.tensors();
        tensors.push(Tensor::list("radius", vec![self.regions.radius()]));
        let count = self.regions.visits().len();
        if count > 0 {
            tensors.push(Tensor {
                name: "centers".to_owned(),
                shape: vec![count, self.states.width()],
                values: self.regions.centers().into(),
            });
            let as_list = |numbers: &[u32]| -> Vec<f32> {
                numbers.iter().map(|number| *number as f32).collect()
            };
            tensors.push(Tensor::list("visits", as_list(self.regions.visits())));
            tensors.push(Tensor::list("owners", as_list(self.regions.owners())));
        }
        tensors
    }

    fn save(&self) -> Vec<u8> {
        postcard::to_stdvec(&self.regions).expect("plain numbers always serialize")
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), String> {
        let regions: StateRegions =
            postcard::from_bytes(bytes).map_err(|error| error.to_string())?;
        if !regions.could_follow(&self.regions) {
            return Err("the checkpoint has regions of another team or task".to_owned());
        }
        self.regions = regions;
        Ok(())
    }
}
