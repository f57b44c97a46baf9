//! What a scenario says about its recording.

use serde::{Deserialize, Serialize};

use crate::env::Spec;
use crate::input::numbers::{Count, Finite, known, known_count};
use crate::input::{Complaint, Located};

/// What a recording holds, and how much of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RecordingSettings {
    /// Lines and points visible at once, for each agent.
    pub lines: Count<10_000>,
    /// How many of the latest rounds are pictured together, and of how many of the latest episodes there are lines and points at once.
    pub window: Count<1000>,
    /// What the colour of a line or point tells.
    pub colour: Located<Colour>,
    /// The upright axes that lines cross, from left to right.
    pub axes: Located<Vec<AxisChoice>>,
    /// The observations that are plotted against each other.
    pub pairs: PairChoice,
    /// The two agents whose densities are compared.
    pub difference: Difference,
    /// Rounds between two pictures of density; twice as many from the 200th picture on, and again whenever the run has doubled.
    pub density_every: Count,
    /// Every how many episodes of each agent have their states and actions on record as columns. The first has.
    pub raw_every: Count,
    /// The scenes of some agents, or none.
    pub scene: Option<SceneSettings>,
}

/// What the colour of a line or point tells.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Colour {
    /// Who was there; darker at an episode's start, brighter at its end.
    #[default]
    Agent,
    /// In which episode, from the run's first to its last.
    Episode,
    /// The episode's return, from the lowest of the first round to what solves the task or, where nothing does, to the highest of the
    /// first round. What lies beyond has the colour of the end.
    Return,
    /// How the episode ended.
    Outcome,
    /// The bonus of the step that was taken from there. Only with a bonus.
    IntrinsicReward,
}

/// An upright axis, or several.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum AxisChoice {
    /// All observations, one axis each.
    Observations,
    /// What was done there: one axis for each component of an action.
    Action,
    /// What the environment gave for it; values beyond the ends are drawn at the ends.
    Reward {
        /// The lower end.
        #[serde(default = "minus_one")]
        from: Finite,
        /// The upper end.
        #[serde(default = "plus_one")]
        to: Located<Finite>,
    },
    /// How much better than expected the agent that took it thinks the action was, before it learned from it and before any
    /// standardisation; values beyond the ends are drawn at the ends. Only with `SeedPg`.
    Advantage {
        /// The lower end.
        #[serde(default = "minus_one")]
        from: Finite,
        /// The upper end.
        #[serde(default = "plus_one")]
        to: Located<Finite>,
    },
    /// The bonus; no axis without one.
    IntrinsicReward,
    /// Steps since the episode began.
    Step,
}

/// Which observations are plotted against each other.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum PairChoice {
    /// The first with the second, the third with the fourth, and so on: at most so many pairs.
    First(Count<16>),
    /// These, by name: to the right, upwards.
    These(Vec<(Located<String>, Located<String>)>),
}

/// Which two agents' densities are compared.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Difference {
    /// Those that differ most at the time.
    #[default]
    MostDifferent,
    /// These two.
    Between(Located<u32>, Located<u32>),
    /// None.
    Off,
}

/// Whose bodies are drawn, and how often.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SceneSettings {
    /// The agents whose bodies are drawn.
    pub agents: Located<Vec<Located<u32>>>,
    /// Every how many episodes of each of them are drawn. The first is.
    pub every: Count,
}

impl Default for RecordingSettings {
    fn default() -> Self {
        Self {
            lines: known_count(1000),
            window: known_count(50),
            colour: Colour::default().into(),
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

fn minus_one() -> Finite {
    known(-1.0)
}

fn plus_one() -> Located<Finite> {
    known::<Finite>(1.0).into()
}

impl RecordingSettings {
    /// What no single field can tell: whether it fits a team of `agents`, whether they are `curious`, and whether they
    /// estimate `advantages`.
    ///
    /// # Errors
    /// The field to blame, and why.
    pub fn check(&self, agents: u32, curious: bool, advantages: bool) -> Result<(), Complaint> {
        self.scene
            .as_ref()
            .map_or(Ok(()), |scene| scene.check(agents))?;
        if let Difference::Between(one, other) = &self.difference {
            one_of_the_team(one, agents)?;
            one_of_the_team(other, agents)?;
            if one == other {
                return Err(other.complain(format!(
                    "expected another agent than {}, with which it is compared",
                    **one
                )));
            }
        }
        if *self.colour == Colour::IntrinsicReward && !curious {
            let message = "without a bonus there is no intrinsic reward; expected Agent, Episode, Return or Outcome";
            return Err(self.colour.complain(message));
        }
        if self.has_advantages() && !advantages {
            let message = "only agents of `SeedPg` estimate advantages; expected Observations, Action, Reward, IntrinsicReward or Step";
            return Err(self.axes.complain(message));
        }
        self.check_axes()
    }

    /// Whether an axis tells advantages, so that they are on record.
    #[must_use]
    pub fn has_advantages(&self) -> bool {
        self.axes
            .iter()
            .any(|axis| matches!(axis, AxisChoice::Advantage { .. }))
    }

    /// The same for agents that do not learn, who estimate no advantages; where no axis is left, with the observations.
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

    fn check_axes(&self) -> Result<(), Complaint> {
        if self.axes.is_empty() {
            return Err(self
                .axes
                .complain("names no axis; expected at least one, such as `axes: [Observations]`"));
        }
        for axis in self.axes.iter() {
            if let AxisChoice::Reward { from, to } | AxisChoice::Advantage { from, to } = axis
                && *from >= **to
            {
                return Err(to.complain(format!(
                    "expected more than {}, where the axis begins",
                    from.get()
                )));
            }
        }
        Ok(())
    }

    /// Whether all pairs are of observations that the task has.
    ///
    /// # Errors
    /// The name that is none.
    pub fn check_task(&self, spec: &Spec) -> Result<(), Complaint> {
        let PairChoice::These(pairs) = &self.pairs else {
            return Ok(());
        };
        let known = spec
            .observations
            .iter()
            .map(|quantity| quantity.name.as_str());
        let unknown = |name: &&Located<String>| !known.clone().any(|known| known == name.as_str());
        let named = pairs.iter().flat_map(|(across, upwards)| [across, upwards]);
        named.into_iter().find(unknown).map_or(Ok(()), |name| {
            Err(name.complain_unknown("observation", known.clone()))
        })
    }
}

impl SceneSettings {
    fn check(&self, count: u32) -> Result<(), Complaint> {
        if self.agents.is_empty() {
            return Err(self
                .agents
                .complain("names no agent; `scene: None` draws none"));
        }
        for (index, agent) in self.agents.iter().enumerate() {
            one_of_the_team(agent, count)?;
            if self.agents[..index].iter().any(|other| **other == **agent) {
                return Err(agent.complain(format!("agent {} is named twice", **agent)));
            }
        }
        Ok(())
    }

    /// Whether an agent's episode is drawn.
    #[must_use]
    pub fn films(&self, agent: u32, episode: u32) -> bool {
        episode.is_multiple_of(self.every.get())
            && self.agents.iter().any(|filmed| **filmed == agent)
    }
}

fn one_of_the_team(agent: &Located<u32>, count: u32) -> Result<(), Complaint> {
    if **agent < count {
        return Ok(());
    }
    Err(agent.complain(format!(
        "expected an agent from 0 to {}, for the team has {count}",
        count - 1
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The axis goes, the others stay in their order; where it was the only one, there are the observations.
    #[test]
    fn who_does_not_learn_has_no_axis_of_advantages() {
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
