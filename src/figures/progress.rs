//! What returns and curves are drawn over.

use std::collections::BTreeMap;

use super::runs::PlottedRun;
use crate::record::state_files::Learners;

/// What returns and curves are drawn over.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Over {
    /// Episodes of each agent, and rounds.
    #[default]
    Episodes,
    /// Environment steps of the whole team.
    EnvSteps,
}

/// Name of the axis of steps.
const ENV_STEPS: &str = "environment steps of the team";

impl Over {
    /// Name of the axis of returns. `noun`: `agent` or `learner`
    pub(super) fn label_of_returns(self, noun: &str) -> String {
        match self {
            Self::Episodes => format!("episode of each {noun}"),
            Self::EnvSteps => ENV_STEPS.to_owned(),
        }
    }

    /// Name of the axis of curves.
    pub(super) fn label_of_rounds(self) -> &'static str {
        match self {
            Self::Episodes => "round",
            Self::EnvSteps => ENV_STEPS,
        }
    }

    /// The position of each episode of an agent.
    pub(super) fn of_agent(self, run: &PlottedRun, agent: u32) -> Vec<f64> {
        let rows = run.loaded_run.episodes.iter();
        let rows = rows.filter(|row| row.agent == agent).zip(0..);
        rows.map(|(row, number)| match self {
            Self::Episodes => f64::from(number),
            Self::EnvSteps => row.env_steps as f64,
        })
        .collect()
    }

    /// The position of each episode of each learner. All copies of all learners step together.
    pub(super) fn of_learners(self, run: &PlottedRun, learners: &Learners) -> Vec<Vec<f64>> {
        let copies = learners.agents() as f64;
        let ended = learners.end_steps(&run.loaded_run.episodes);
        let positions = |steps: Vec<u64>| {
            let numbered = (0..).zip(steps);
            numbered
                .map(|(number, steps)| match self {
                    Self::Episodes => f64::from(number),
                    Self::EnvSteps => steps as f64 * copies,
                })
                .collect()
        };
        ended.into_iter().map(positions).collect()
    }

    /// The position of the n-th episode of the team, which ends with the last agent's.
    /// `positions`: those of each agent or learner
    pub(super) fn of_team(positions: &[Vec<f64>]) -> Vec<f64> {
        let episodes = positions.iter().map(Vec::len).min().unwrap_or(0);
        let last = |number: usize| {
            let of_all = positions.iter().map(|of_one| of_one[number]);
            of_all.fold(0.0, f64::max)
        };
        (0..episodes).map(last).collect()
    }

    /// The position of each round.
    pub(super) fn of_rounds(self, run: &PlottedRun) -> BTreeMap<u32, f64> {
        if self == Self::Episodes {
            let rounds = run.loaded_run.rounds.iter();
            return rounds.map(|row| (row.round, row.round.into())).collect();
        }
        let mut positions = BTreeMap::new();
        let mut steps = 0.0_f64;
        for row in &run.loaded_run.episodes {
            steps = steps.max(row.env_steps as f64);
            positions.insert(row.round, steps);
        }
        positions
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The second agent's first episode ends last, and its second one is not finished.
    #[test]
    fn episodes_of_a_team_end_with_the_last_agent() {
        let positions = [vec![10.0, 50.0, 90.0], vec![30.0, 45.0]];
        assert_eq!(Over::of_team(&positions), [30.0, 50.0]);
    }
}
