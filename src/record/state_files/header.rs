//! The header of a file of visited states: what the numbers in it are.

use std::collections::BTreeSet;

use seedbed_env::Quantity;
use seedbed_input::limits::{MAX_RECORDED_AGENTS, MAX_RECORDED_AXES, MAX_RECORDED_NAME_BYTES};
use serde::Deserialize;

/// What the states of an agent are.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub(super) struct Header {
    /// Number of the agent, from 0.
    pub agent: u32,
    /// Name of the environment.
    pub environment: String,
    pub observations: Vec<HeaderAxis>,
    /// Components of an action.
    pub actions: Vec<HeaderAxis>,
    /// Number of steps after which episodes are truncated.
    pub time_limit: Option<u32>,
    /// Time between two actions, s.
    pub step_seconds: Option<f64>,
    /// Number of the learner that acts; `None` if the agent is a learner of its own.
    #[serde(default)]
    pub learner: Option<u32>,
}

/// One observation or one component of an action. An end that is `None` is the smallest or largest
/// finite value that any agent visited.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub(super) struct HeaderAxis {
    pub name: String,
    pub unit: String,
    pub low: Option<f32>,
    pub high: Option<f32>,
}

impl HeaderAxis {
    /// The quantity, if the header has both ends of its range.
    pub(super) fn declared(&self) -> Option<Quantity> {
        Some(Quantity {
            name: self.name.clone(),
            unit: self.unit.clone(),
            range: [self.low?, self.high?],
        })
    }
}

impl Header {
    /// Decodes a header.
    pub(super) fn from_json(payload: &[u8]) -> Result<Self, String> {
        let header: Self = serde_json::from_slice(payload)
            .map_err(|error| format!("the header is not as expected: {error}"))?;
        header.check()?;
        Ok(header)
    }

    fn check(&self) -> Result<(), String> {
        if self.agent >= MAX_RECORDED_AGENTS {
            return Err(format!(
                "agent {} is not below {MAX_RECORDED_AGENTS}",
                self.agent
            ));
        }
        if let Some(learner) = self.learner
            && learner >= MAX_RECORDED_AGENTS
        {
            return Err(format!(
                "learner {learner} is not below {MAX_RECORDED_AGENTS}"
            ));
        }
        check_length("the name of the environment", &self.environment)?;
        for (axes, kind) in [
            (&self.observations, "observations"),
            (&self.actions, "actions"),
        ] {
            if !(1..=MAX_RECORDED_AXES).contains(&axes.len()) {
                return Err(format!(
                    "{} {kind}, expected 1 to {MAX_RECORDED_AXES}",
                    axes.len()
                ));
            }
            let mut names = BTreeSet::new();
            for axis in axes {
                axis.check()?;
                if !names.insert(&axis.name) {
                    return Err(format!("{kind} have the name `{}` twice", axis.name));
                }
            }
        }
        match self.step_seconds {
            Some(seconds) if !(seconds > 0.0 && seconds.is_finite()) => {
                Err(format!("a step of {seconds} s"))
            }
            _ => Ok(()),
        }
    }

    /// What differs between the axes of two agents of a run.
    pub(super) fn difference(&self, other: &Self) -> Option<&'static str> {
        if self.observations != other.observations {
            return Some("observations");
        }
        (self.actions != other.actions).then_some("actions")
    }
}

fn check_length(what: &str, text: &str) -> Result<(), String> {
    if text.len() <= MAX_RECORDED_NAME_BYTES {
        return Ok(());
    }
    Err(format!(
        "{what} has {} bytes, expected at most {MAX_RECORDED_NAME_BYTES}",
        text.len()
    ))
}

impl HeaderAxis {
    fn check(&self) -> Result<(), String> {
        check_length("the name of an axis", &self.name)?;
        check_length("the unit of an axis", &self.unit)?;
        let ends = [self.low, self.high];
        let is_finite = ends.iter().flatten().all(|end| end.is_finite());
        let is_empty = matches!(ends, [Some(low), Some(high)] if low > high);
        if self.name.is_empty() || !is_finite || is_empty {
            return Err(format!(
                "the axis `{}` has the range {:?} to {:?}",
                self.name, self.low, self.high
            ));
        }
        Ok(())
    }
}
