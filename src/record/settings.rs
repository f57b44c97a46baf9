//! The recording settings of a scenario.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use seedbed_env::Spec;
use seedbed_env::input::numbers::{Count, FiniteNumber, known, known_count};
use seedbed_env::input::{Located, ValidationError};

/// What a recording holds, and how much of it.
#[derive(Clone, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RecordingSettings {
    /// Maximum number of lines and points visible at once, per agent.
    pub lines: Count<10_000>,
    /// Number of latest rounds in one density image, and of latest episodes whose lines and points
    /// are visible at once.
    pub window: Count<1000>,
    /// What the color of a line or point shows. Scenarios call it `colour`, which stored digests of
    /// runs depend on; `color` is accepted as well.
    #[serde(rename = "colour", alias = "color")]
    pub color: Located<ColorBy>,
    /// The vertical axes that lines cross, from left to right.
    pub axes: Located<Vec<AxisChoice>>,
    /// The pairs of observations that are plotted against each other.
    pub pairs: PairChoice,
    /// The two agents whose densities are compared.
    pub difference: Difference,
    /// Rounds between two density images; the interval doubles after 200 images, and again each
    /// time the run has doubled in length.
    pub density_every: Count,
    /// Interval between the episodes of each agent whose states and actions are recorded as columns;
    /// 1 records every episode. The first episode is always recorded.
    pub raw_every: Count,
    /// The agents whose bodies are recorded; none records no bodies.
    pub scene: Option<SceneSettings>,
}

/// What the color of a line or point shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum ColorBy {
    /// The agent; darker at an episode's start, brighter at its end.
    #[default]
    Agent,
    /// The number of the episode, from the run's first to its last.
    Episode,
    /// The episode's return, from the lowest of the first round to the task's reward threshold or,
    /// without one, to the highest of the first round. Returns outside have the color of the end.
    Return,
    /// The outcome of the episode: terminated or truncated.
    Outcome,
    /// The bonus of the step taken from the state. Only for agents with a bonus.
    IntrinsicReward,
}

/// One vertical axis, or several.
#[derive(Clone, Copy, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum AxisChoice {
    /// All observations, one axis per observation.
    Observations,
    /// The action, one axis per component.
    Action,
    /// The environment's reward for the action; values outside the axis are drawn at its ends.
    Reward {
        /// Value at the lower end.
        #[serde(default = "minus_one")]
        from: FiniteNumber,
        /// Value at the upper end.
        #[serde(default = "plus_one")]
        to: Located<FiniteNumber>,
    },
    /// The agent's estimate of the action's advantage, before learning from it and before any
    /// standardization; values outside the axis are drawn at its ends. Only with `SeedPg`.
    Advantage {
        /// Value at the lower end.
        #[serde(default = "minus_one")]
        from: FiniteNumber,
        /// Value at the upper end.
        #[serde(default = "plus_one")]
        to: Located<FiniteNumber>,
    },
    /// The bonus of the step; no axis if agents have no bonus.
    IntrinsicReward,
    /// Number of steps since the start of the episode.
    Step,
}

/// The pairs of observations that are plotted against each other.
#[derive(Clone, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum PairChoice {
    /// The first with the second, the third with the fourth, and so on; at most N pairs.
    First(Count<16>),
    /// The named pairs: horizontal and vertical observation.
    These(Vec<(Located<String>, Located<String>)>),
}

/// The two agents whose densities are compared.
#[derive(Clone, Debug, Default, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Difference {
    /// The two that differ most at the time.
    #[default]
    MostDifferent,
    /// The given two.
    Between(Located<u32>, Located<u32>),
    /// No comparison.
    Off,
}

/// The agents whose bodies are recorded, and how often.
#[derive(Clone, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SceneSettings {
    /// The agents whose bodies are recorded.
    pub agents: Located<Vec<Located<u32>>>,
    /// Interval between recorded episodes of each of these agents. The first episode is always
    /// recorded.
    pub every: Count,
}

impl Default for RecordingSettings {
    fn default() -> Self {
        Self {
            lines: known_count(1000),
            window: known_count(50),
            color: ColorBy::default().into(),
            axes: vec![AxisChoice::Observations, AxisChoice::IntrinsicReward].into(),
            pairs: PairChoice::First(known_count(4)),
            difference: Difference::default(),
            density_every: known_count(10),
            raw_every: known_count(1),
            scene: Some(SceneSettings::default()),
        }
    }
}

impl Default for SceneSettings {
    fn default() -> Self {
        Self {
            agents: vec![0.into()].into(),
            every: known_count(10),
        }
    }
}

fn minus_one() -> FiniteNumber {
    known(-1.0)
}

fn plus_one() -> Located<FiniteNumber> {
    known::<FiniteNumber>(1.0).into()
}

impl RecordingSettings {
    /// Checks that the settings fit a team of `agents`, and whether these have a bonus and estimate
    /// advantages.
    ///
    /// # Errors
    /// The field that does not fit, and why.
    pub fn check(
        &self,
        agents: u32,
        has_bonus: bool,
        has_advantages: bool,
    ) -> Result<(), ValidationError> {
        self.scene
            .as_ref()
            .map_or(Ok(()), |scene| scene.check(agents))?;
        if let Difference::Between(one, other) = &self.difference {
            check_agent(one, agents)?;
            check_agent(other, agents)?;
            if one == other {
                return Err(other.error(format!("expected an agent other than {}", **one)));
            }
        }
        if *self.color == ColorBy::IntrinsicReward && !has_bonus {
            let message = "the agents have no bonus; expected Agent, Episode, Return or Outcome";
            return Err(self.color.error(message));
        }
        if self.has_advantages() && !has_advantages {
            let message = "only agents of `SeedPg` estimate advantages; expected Observations, Action, Reward, IntrinsicReward or Step";
            return Err(self.axes.error(message));
        }
        self.check_axes()
    }

    /// Whether an axis shows advantages, so that they must be recorded.
    #[must_use]
    pub fn has_advantages(&self) -> bool {
        self.axes
            .iter()
            .any(|axis| matches!(axis, AxisChoice::Advantage { .. }))
    }

    /// The same settings for agents that do not learn and so estimate no advantages. If no axis is
    /// left, observations are the axes.
    #[must_use]
    pub fn without_advantages(mut self) -> Self {
        if self.has_advantages() {
            let mut axes = self.axes.to_vec();
            axes.retain(|axis| !matches!(axis, AxisChoice::Advantage { .. }));
            self.axes = if axes.is_empty() {
                vec![AxisChoice::Observations]
            } else {
                axes
            }
            .into();
        }
        self
    }

    fn check_axes(&self) -> Result<(), ValidationError> {
        if self.axes.is_empty() {
            return Err(self
                .axes
                .error("expected at least one axis, such as `axes: [Observations]`"));
        }
        for axis in self.axes.iter() {
            if let AxisChoice::Reward { from, to } | AxisChoice::Advantage { from, to } = axis
                && *from >= **to
            {
                return Err(to.error(format!(
                    "expected a value above {}, the lower end of the axis",
                    from.get()
                )));
            }
        }
        Ok(())
    }

    /// Checks that all pairs name observations of the task.
    ///
    /// # Errors
    /// The first name that is not an observation.
    pub fn check_task(&self, spec: &Spec) -> Result<(), ValidationError> {
        let PairChoice::These(pairs) = &self.pairs else {
            return Ok(());
        };
        let known = spec
            .observations
            .iter()
            .map(|quantity| quantity.name.as_str());
        let unknown = |name: &&Located<String>| !known.clone().any(|known| known == name.as_str());
        let named = pairs
            .iter()
            .flat_map(|(horizontal, vertical)| [horizontal, vertical]);
        named.into_iter().find(unknown).map_or(Ok(()), |name| {
            Err(name.unknown_name("observation", known.clone()))
        })
    }
}

impl SceneSettings {
    fn check(&self, count: u32) -> Result<(), ValidationError> {
        if self.agents.is_empty() {
            return Err(self
                .agents
                .error("expected at least one agent; `scene: None` records no bodies"));
        }
        for (index, agent) in self.agents.iter().enumerate() {
            check_agent(agent, count)?;
            if self.agents[..index].iter().any(|other| **other == **agent) {
                return Err(agent.error(format!("duplicate agent {}", **agent)));
            }
        }
        Ok(())
    }

    /// Whether the bodies of an agent's episode are recorded.
    #[must_use]
    pub fn records(&self, agent: u32, episode: u32) -> bool {
        episode.is_multiple_of(self.every.get())
            && self.agents.iter().any(|recorded| **recorded == agent)
    }
}

fn check_agent(agent: &Located<u32>, count: u32) -> Result<(), ValidationError> {
    if **agent < count {
        return Ok(());
    }
    Err(agent.error(format!(
        "expected an agent from 0 to {}: the team has {count} agents",
        count - 1
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Stored scenarios, and digests of runs with them, have `colour`.
    #[test]
    fn both_spellings_of_color_are_read_and_one_is_written() {
        let read = |text| ron::from_str::<RecordingSettings>(text).unwrap();
        let settings = read("(color: Episode)");
        assert_eq!(settings, read("(colour: Episode)"));
        assert_eq!(*settings.color, ColorBy::Episode);
        let written = ron::to_string(&settings).unwrap();
        assert!(written.contains("colour:Episode"), "{written}");
    }

    /// The axis of advantages is removed and the others keep their order; if it was the only one,
    /// observations replace it.
    #[test]
    fn agents_that_do_not_learn_have_no_axis_of_advantages() {
        let advantage = AxisChoice::Advantage {
            from: minus_one(),
            to: plus_one(),
        };
        let left = |axes: Vec<AxisChoice>| {
            let settings = RecordingSettings {
                axes: axes.into(),
                ..RecordingSettings::default()
            };
            assert!(settings.has_advantages());
            settings.without_advantages().axes.to_vec()
        };
        assert_eq!(
            left(vec![AxisChoice::Step, advantage, AxisChoice::Action]),
            [AxisChoice::Step, AxisChoice::Action]
        );
        assert_eq!(left(vec![advantage]), [AxisChoice::Observations]);
        let others = RecordingSettings {
            axes: vec![AxisChoice::IntrinsicReward].into(),
            ..RecordingSettings::default()
        };
        assert_eq!(others.clone().without_advantages(), others);
    }
}
