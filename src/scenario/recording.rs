//! The recording settings of a scenario.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use seedbed_env::TaskSpec;
use seedbed_input::numbers::{Count, FiniteNumber, ranged_count, ranged_number, readable};
use seedbed_input::{Located, ValidationError};

/// Contents of a recording, and how much of each is recorded.
#[derive(Clone, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RecordingSettings {
    /// Maximum number of lines and points per agent that are visible at once. Episodes of fewer than
    /// 160 states have proportionally fewer.
    pub lines: Count<10_000>,
    /// Number of latest rounds in one density image, and number of latest episodes whose lines and
    /// points are visible at once.
    pub window: Count<1000>,
    /// What the color of a line or point shows.
    pub color: Located<ColorBy>,
    /// The vertical axes of parallel coordinates, from left to right.
    pub axes: Located<Vec<AxisChoice>>,
    /// The pairs of observations that are drawn as scatter plots.
    pub pairs: PairChoice,
    /// The two agents whose densities are compared.
    pub difference: Difference,
    /// Rounds between two density images, after images of early rounds; the interval doubles after 200 images, and again each
    /// time the run has doubled in length. Rounds in which agents visit fewer than 300 states count
    /// proportionally less.
    pub density_every: Count,
    /// Interval between the episodes of each agent whose states and actions are recorded as
    /// columns; 1 records every episode. The first episode is always recorded.
    pub raw_every: Count,
    /// The agents whose bodies are recorded; `None` records no bodies.
    pub scene: Option<SceneSettings>,
}

/// What the color of a line or point shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum ColorBy {
    /// The agent; lines are dark at the start of an episode and bright at its end.
    #[default]
    Agent,
    /// The number of the episode, on a scale from the first to the last episode of the run.
    Episode,
    /// The return of the episode. The scale begins at the lowest return of the first round and ends
    /// at the reward threshold of the task or, if it has none, at the highest return of the first
    /// round. Returns outside the scale have the color of its nearer end.
    Return,
    /// The outcome of the episode: terminated or truncated.
    Outcome,
    /// The bonus of the step that starts in the state. Requires agents with a bonus.
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
    /// The environment's reward for the action. Values outside the axis are drawn at its ends.
    Reward {
        /// Value at the lower end.
        #[serde(default = "minus_one")]
        from: FiniteNumber,
        /// Value at the upper end.
        #[serde(default = "plus_one")]
        to: Located<FiniteNumber>,
    },
    /// The advantage of the action as estimated by the agent, before the update and before
    /// standardization. Values outside the axis are drawn at its ends. Requires `SeedPg` or
    /// `LeaderFollowers`.
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

/// The pairs of observations that are drawn as scatter plots.
#[derive(Clone, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum PairChoice {
    /// The first and second observation, the third and fourth, and so on; at most N pairs.
    First(Count<16>),
    /// The given pairs of names: horizontal and vertical observation.
    These(Vec<(Located<String>, Located<String>)>),
}

/// The two agents whose densities are compared.
#[derive(Clone, Debug, Default, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Difference {
    /// The two agents that differ most at the time of the image; in teams of more than 32 agents, the
    /// agent that differs most from the mean of the team, and the agent that differs most from it.
    #[default]
    MostDifferent,
    /// The two given agents.
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
            lines: ranged_count(1000),
            window: ranged_count(50),
            color: ColorBy::default().into(),
            axes: vec![AxisChoice::Observations, AxisChoice::IntrinsicReward].into(),
            pairs: PairChoice::First(ranged_count(4)),
            difference: Difference::default(),
            density_every: ranged_count(10),
            raw_every: ranged_count(1),
            scene: Some(SceneSettings::default()),
        }
    }
}

impl Default for SceneSettings {
    fn default() -> Self {
        Self {
            agents: vec![0.into()].into(),
            every: ranged_count(10),
        }
    }
}

fn minus_one() -> FiniteNumber {
    ranged_number(-1.0)
}

fn plus_one() -> Located<FiniteNumber> {
    ranged_number::<FiniteNumber>(1.0).into()
}

impl RecordingSettings {
    /// Checks that the settings are valid for a team of `agents` agents. The other parameters say
    /// whether the agents have bonuses and whether they estimate advantages.
    ///
    /// # Errors
    /// The invalid field, and the reason.
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
            let message = "only agents of `SeedPg` and `LeaderFollowers` estimate advantages; expected Observations, Action, Reward, IntrinsicReward or Step";
            return Err(self.axes.error(message));
        }
        self.check_axes()
    }

    /// Whether an axis shows advantages, in which case they are recorded.
    #[must_use]
    pub fn has_advantages(&self) -> bool {
        self.axes
            .iter()
            .any(|axis| matches!(axis, AxisChoice::Advantage { .. }))
    }

    /// The settings without axes of advantages, for agents that do not learn. If no axis remains,
    /// there is one axis per observation.
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
                    readable(from.get())
                )));
            }
        }
        Ok(())
    }

    /// Checks that all names in `pairs` are observations of the task.
    ///
    /// # Errors
    /// The first name that is not an observation.
    pub fn check_pairs(&self, spec: &TaskSpec) -> Result<(), ValidationError> {
        let PairChoice::These(pairs) = &self.pairs else {
            return Ok(());
        };
        let observations = spec
            .observations
            .iter()
            .map(|quantity| quantity.name.as_str());
        let is_unknown = |name: &&Located<String>| {
            !observations
                .clone()
                .any(|observation| observation == name.as_str())
        };
        let mut names_in_pairs = pairs
            .iter()
            .flat_map(|(horizontal, vertical)| [horizontal, vertical]);
        names_in_pairs.find(is_unknown).map_or(Ok(()), |name| {
            Err(name.unknown_name("observation", observations.clone()))
        })
    }
}

impl SceneSettings {
    fn check(&self, team_size: u32) -> Result<(), ValidationError> {
        if self.agents.is_empty() {
            return Err(self
                .agents
                .error("expected at least one agent; `scene: None` records no bodies"));
        }
        for (index, agent) in self.agents.iter().enumerate() {
            check_agent(agent, team_size)?;
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

fn check_agent(agent: &Located<u32>, team_size: u32) -> Result<(), ValidationError> {
    if **agent < team_size {
        return Ok(());
    }
    Err(agent.error(format!(
        "expected an agent from 0 to {}: the team has {team_size} agents",
        team_size - 1
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Stored scenarios have `colour`.
    #[test]
    fn both_spellings_of_color_are_read_and_color_is_written() {
        let read = |text: &str| {
            seedbed_input::parse::<RecordingSettings>("", text.to_owned())
                .unwrap()
                .value
        };
        let settings = read("(color: Episode)");
        assert_eq!(settings, read("(colour: Episode)"));
        assert_eq!(*settings.color, ColorBy::Episode);
        let written = ron::to_string(&settings).unwrap();
        assert!(written.contains("color:Episode"), "{written}");
    }

    /// The axis of advantages is removed, and the other axes keep their order. If it is the only
    /// axis, it is replaced by the observations.
    #[test]
    fn settings_without_advantages_have_no_axis_of_advantages() {
        let advantage = AxisChoice::Advantage {
            from: minus_one(),
            to: plus_one(),
        };
        let remaining_axes = |axes: Vec<AxisChoice>| {
            let settings = RecordingSettings {
                axes: axes.into(),
                ..RecordingSettings::default()
            };
            assert!(settings.has_advantages());
            settings.without_advantages().axes.to_vec()
        };
        assert_eq!(
            remaining_axes(vec![AxisChoice::Step, advantage, AxisChoice::Action]),
            [AxisChoice::Step, AxisChoice::Action]
        );
        assert_eq!(remaining_axes(vec![advantage]), [AxisChoice::Observations]);
        let settings_without_advantage = RecordingSettings {
            axes: vec![AxisChoice::IntrinsicReward].into(),
            ..RecordingSettings::default()
        };
        assert_eq!(
            settings_without_advantage.clone().without_advantages(),
            settings_without_advantage
        );
    }
}
