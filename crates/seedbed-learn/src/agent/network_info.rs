//! How the tensors of a team are used: which networks an agent acts by, what their outputs mean, and
//! how observations are scaled. Readers of stored tensors need nothing else to compute actions.
//!
//! Names of tensors are templates: `{agent}` stands for the number of an agent, `{model}` for that of
//! the model that the agent acts by. [`NetworkInfo`] serializes to plain JSON.

use serde::Serialize;

use crate::nn::{Activation, STANDARDIZED_LIMIT};
use crate::scaling::ObservationScaling;
use seedbed_env::TaskSpec;

/// How the networks of a team are evaluated.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NetworkInfo {
    /// The models that agents act by; `None` if each agent has networks of its own.
    pub models: Option<ModelInfo>,
    /// Networks whose weighted outputs are added. The sum is what [`heads`](Self::heads) describe.
    pub outputs: Vec<OutputTerm>,
    /// The function between the layers of these networks.
    pub activation: Activation,
    /// The meaning of the outputs: one head per component of an action.
    pub heads: Vec<Head>,
    /// How actions were chosen in training, as in a scenario.
    pub action_selection: String,
    /// How observations are scaled before they enter a network.
    pub observation_scaling: ScalingInfo,
    /// Formula of the value function of a policy; `None` if there is none.
    pub value: Option<&'static str>,
    /// The model of the exploration bonus; `None` if there is none.
    pub bonus: Option<BonusInfo>,
}

/// The models that agents act by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct ModelInfo {
    /// Number of models.
    pub count: usize,
    /// The number of the model of an agent, as a formula in `agent` and `models`, or in words.
    pub model_of_agent: &'static str,
}

/// One network whose outputs are added.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct OutputTerm {
    /// Names of its tensors up to `.layer_0.weight`.
    pub network: &'static str,
    /// Factor on its outputs.
    pub factor: f32,
    /// Whether the scaled observations are appended to the inputs of its last layer.
    pub skip_connection: bool,
}

/// The outputs that belong to one component of an action.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Head {
    /// Name of the component.
    pub name: String,
    /// Its unit; empty for a pure number.
    pub unit: String,
    /// Index of its first output.
    pub first_output: usize,
    /// Number of its outputs.
    pub outputs: usize,
    /// What the outputs mean.
    #[serde(flatten)]
    pub kind: HeadKind,
}

/// What the outputs o of a head mean.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum HeadKind {
    /// Logits of a choice among values.
    Categorical {
        /// The values, in the order of the outputs.
        values: Vec<f32>,
        /// How the distribution is computed.
        formula: &'static str,
    },
    /// Mean and logarithm of the standard deviation of a Gaussian, relative to half the range.
    Gaussian {
        /// Center of the range, in the component's unit.
        center: f32,
        /// Half the range, in the component's unit.
        half_range: f32,
        /// Number that is added to the second output.
        log_deviation_offset: f32,
        /// Bounds of the sum, before it is scaled by half the range.
        log_deviation_clamp: [f32; 2],
        /// How the distribution is computed.
        formula: &'static str,
    },
    /// Mean and logarithm of the standard deviation of a Gaussian whose samples are squashed by tanh.
    SquashedGaussian {
        /// Center of the range, in the component's unit.
        center: f32,
        /// Half the range, in the component's unit.
        half_range: f32,
        /// Bounds of the second output.
        log_deviation_clamp: [f32; 2],
        /// How the distribution is computed.
        formula: &'static str,
    },
    /// Values Q(s, a) of a choice among values.
    ActionValues {
        /// The values of the action, in the order of the outputs.
        values: Vec<f32>,
        /// How the action values are computed.
        formula: &'static str,
    },
}

impl HeadKind {
    pub(super) const CATEGORICAL: &'static str =
        "p = softmax(o); the action is values[i] with probability p[i]";
    pub(super) const GAUSSIAN: &'static str = "mean = center + half_range * o[0]; log_deviation = \
        clip(o[1] + log_deviation_offset, *log_deviation_clamp) + log(half_range)";
    pub(super) const SQUASHED_GAUSSIAN: &'static str = "u has mean o[0] and log_deviation clip(o[1], \
        *log_deviation_clamp); the action is center + half_range * tanh(u)";
    pub(crate) const ACTION_VALUES: &'static str = "Q(s, values[i]) = o[i]";
}

/// How observations x are scaled: clip((x − offset) / scale, −limit, limit).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ScalingInfo {
    /// The kind of scaling, as in a scenario.
    pub kind: ObservationScaling,
    /// The formula of the scaling.
    pub formula: &'static str,
    /// Name of the tensor with the offsets: `[width]`; `None` if observations are not scaled.
    pub offset: Option<String>,
    /// Name of the tensor with the scales: `[width]`; `None` if observations are not scaled.
    pub scale: Option<String>,
    /// Maximal absolute value; `None` if there is none.
    pub limit: Option<f64>,
}

impl ScalingInfo {
    /// The scaling of observations. `owner` is the first part of the tensors' names, such as
    /// `agent_{agent}.`; empty if the team has one scaling.
    pub(crate) fn new(kind: ObservationScaling, owner: &str) -> Self {
        let (formula, names, limit) = match kind {
            ObservationScaling::Raw => ("x", None, None),
            ObservationScaling::Range => {
                ("(x - offset) / scale", Some(["center", "half_range"]), None)
            }
            ObservationScaling::Running => (
                "clip((x - offset) / scale, -limit, limit)",
                Some(["mean", "deviation"]),
                Some(STANDARDIZED_LIMIT),
            ),
        };
        let name =
            |index: usize| names.map(|names| format!("{owner}observations.{}", names[index]));
        Self {
            kind,
            formula,
            offset: name(0),
            scale: name(1),
            limit,
        }
    }
}

/// The model of the exploration bonus.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BonusInfo {
    /// The kind of bonus, as in a scenario.
    pub kind: &'static str,
    /// Names of the model's tensors up to e.g. `.inputs.mean`.
    pub model: String,
    /// Names of the inputs in order: observations, then the action of the step, if it is an input.
    /// Choices are written `name = value` and are 1 or 0.
    pub inputs: Vec<String>,
    /// How inputs are scaled, and what is computed from them.
    pub formula: String,
    /// Name of the mean of the latest median gains; `None` if bonuses are not scaled by it.
    pub median_scale: Option<String>,
    /// How gains are scaled to bonuses, as in a scenario.
    pub scale: String,
}

/// The model in which agents plan.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlannerInfo {
    /// Names of the model's tensors up to e.g. `.inputs.mean`.
    pub model: &'static str,
    /// Names of the inputs in order: observations, then the action. Choices are written `name = value`
    /// and are 1 or 0.
    pub inputs: Vec<String>,
    /// Names of the outputs in order: changes of observations, the reward, and the end.
    pub outputs: Vec<String>,
    /// How inputs are scaled, and what the outputs predict.
    pub formula: &'static str,
    /// The parameters of the search, as in a scenario.
    pub settings: String,
}

/// A setting as it is written in a scenario.
pub(crate) fn setting_text(setting: &impl Serialize) -> String {
    ron::to_string(setting).expect("settings are plain data")
}

/// The head of a task's only action, whose outputs are action values.
pub(crate) fn action_value_heads(spec: &TaskSpec) -> Vec<Head> {
    let head = |action: &seedbed_env::Action| {
        let values = match &action.choice {
            seedbed_env::Choice::Discrete(values) => values.clone(),
            seedbed_env::Choice::Continuous => Vec::new(),
        };
        Head {
            name: action.quantity.name.clone(),
            unit: action.quantity.unit.clone(),
            first_output: 0,
            outputs: values.len(),
            kind: HeadKind::ActionValues {
                values,
                formula: HeadKind::ACTION_VALUES,
            },
        }
    };
    spec.actions.iter().map(head).collect()
}
