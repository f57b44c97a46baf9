//! Episodes of a run that was read from files, and what studies need of it.

use super::source::SolvedAt;
use crate::experiment::measure::Curve;
use crate::experiment::run_result::{Milestone, RunResult};
use crate::scenario::Rounding;
use seedbed_stats::aggregate::mean;

/// Episodes of one agent, in their order.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct AgentEpisodes {
    /// Return of each episode.
    pub(super) returns: Vec<f64>,
    /// Environment steps of the team when each episode ended; empty if they are unknown.
    pub(super) env_steps: Vec<u64>,
    /// Number of the team's steps during the longest episode, if it does not follow from the ends of episodes: several copies
    /// of the environment play at the same time.
    pub(super) longest: u64,
}

/// Data up to which runs are used.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Limits {
    /// Maximum number of episodes per agent.
    pub(super) max_episodes: Option<u32>,
    /// Maximum number of environment steps of the team.
    pub(super) max_steps: Option<u64>,
}

/// Environment steps of a team whose agents step together, such as the copies of a vector
/// environment: when an agent has done n steps, the team has done K · n. Turns the numbers of steps of
/// an agent so far into those of the team.
pub(super) fn team_steps(agents: &mut [AgentEpisodes]) {
    let count = agents.len() as u64;
    for steps in agents.iter_mut().flat_map(|agent| &mut agent.env_steps) {
        // Numbers near the largest possible one stay in order.
        *steps = steps.saturating_mul(count);
    }
}

impl AgentEpisodes {
    /// Episodes of a learner that acts in several copies of the environment, in the order in which they ended.
    pub(super) fn of_copies(copies: &[Self]) -> Self {
        let mut ended: Vec<(u64, f64)> = Vec::new();
        let mut merged = Self::default();
        for copy in copies {
            let begins = std::iter::once(&0).chain(&copy.env_steps);
            let lengths = copy
                .env_steps
                .iter()
                .zip(begins)
                .map(|(end, begin)| end - begin);
            merged.longest = merged.longest.max(lengths.max().unwrap_or(0));
            ended.extend(
                copy.env_steps
                    .iter()
                    .copied()
                    .zip(copy.returns.iter().copied()),
            );
        }
        ended.sort_by_key(|(env_steps, _)| *env_steps);
        (merged.env_steps, merged.returns) = ended.into_iter().unzip();
        merged
    }

    fn cut(&mut self, limits: Limits) {
        if let Some(max_episodes) = limits.max_episodes {
            self.returns.truncate(max_episodes as usize);
        }
        if let (Some(max_steps), false) = (limits.max_steps, self.env_steps.is_empty()) {
            let within = self.env_steps.partition_point(|&steps| steps <= max_steps);
            self.returns.truncate(within);
        }
        self.env_steps.truncate(self.returns.len());
    }
}

/// The result of a run with these agents, up to the limits.
pub(super) fn result(
    mut agents: Vec<AgentEpisodes>,
    solved: Option<SolvedAt>,
    limits: Limits,
    rounding: Rounding,
) -> RunResult {
    for agent in &mut agents {
        agent.cut(limits);
    }
    let team_returns = team_means(&agents);
    let episodes_until_solved =
        solved.and_then(|solved| solved.threshold().first_window(&team_returns, rounding));
    let all_steps = agents.iter().filter_map(|agent| agent.env_steps.last());
    let env_steps = all_steps.copied().max().unwrap_or(0);
    RunResult {
        threshold: solved.map(|solved| (solved.r#return.get(), solved.window.get())),
        solved: episodes_until_solved.map(|episodes| Milestone {
            episodes: episodes as u32,
            env_steps: steps_at(&agents, episodes),
        }),
        env_steps,
        episode_ends: known_ends(&agents),
        longest_episode: agents.iter().map(|agent| agent.longest).max().unwrap_or(0),
        returns: agents.into_iter().map(|agent| agent.returns).collect(),
        rounding,
        curves: vec![Vec::new(); Curve::WITH_ROUND_VALUES.len()],
        ..RunResult::default()
    }
}

/// When the episodes of each agent ended; empty if the steps of some are unknown.
fn known_ends(agents: &[AgentEpisodes]) -> Vec<Vec<u64>> {
    let is_known = |agent: &AgentEpisodes| agent.env_steps.len() == agent.returns.len();
    let ends = agents.iter().map(|agent| agent.env_steps.clone());
    if agents.iter().all(is_known) {
        ends.collect()
    } else {
        Vec::new()
    }
}

/// Environment steps of the team when each agent has finished this number of episodes; 0 if unknown.
fn steps_at(agents: &[AgentEpisodes], episodes: usize) -> u64 {
    let steps = agents
        .iter()
        .filter_map(|agent| agent.env_steps.get(episodes - 1));
    steps.copied().max().unwrap_or(0)
}

fn team_means(agents: &[AgentEpisodes]) -> Vec<f64> {
    let episodes = agents.iter().map(|agent| agent.returns.len()).min();
    let mean_of = |episode: usize| {
        let returns = agents.iter().map(|agent| agent.returns[episode]);
        mean(&returns.collect::<Vec<f64>>())
    };
    (0..episodes.unwrap_or(0)).map(mean_of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_input::numbers::{ranged_count, ranged_number};

    fn agent(returns: &[f64], env_steps: &[u64]) -> AgentEpisodes {
        AgentEpisodes {
            returns: returns.to_vec(),
            env_steps: env_steps.to_vec(),
            longest: 0,
        }
    }

    fn solved(r#return: f64, window: u32) -> SolvedAt {
        SolvedAt {
            r#return: ranged_number(r#return),
            window: ranged_count(window),
        }
    }

    /// Team returns 2, 4, 6, 8 (the second agent has a fifth episode): means of windows of two are
    /// 3, 5, 7. So 5 is reached after three episodes, when the slower agent has done so at step 90.
    #[test]
    fn a_task_is_solved_when_all_agents_have_finished_the_window() {
        let team = vec![
            agent(&[1.0, 3.0, 5.0, 7.0], &[10, 30, 90, 95]),
            agent(&[3.0, 5.0, 7.0, 9.0, 50.0], &[20, 40, 60, 80, 100]),
        ];
        let run = result(
            team.clone(),
            Some(solved(5.0, 2)),
            Limits::default(),
            Rounding::Double,
        );
        let milestone = Milestone {
            episodes: 3,
            env_steps: 90,
        };
        assert_eq!((run.solved, run.env_steps), (Some(milestone), 100));
        assert_eq!(run.episodes_per_agent(), 4);
        assert_eq!(run.threshold, Some((5.0, 2)));
        assert_eq!(
            result(
                team.clone(),
                Some(solved(7.1, 2)),
                Limits::default(),
                Rounding::Double
            )
            .solved,
            None
        );
        assert_eq!(
            result(team, None, Limits::default(), Rounding::Double).threshold,
            None
        );
    }

    #[test]
    fn data_after_a_limit_are_not_used() {
        let team = vec![agent(&[1.0, 2.0, 3.0, 9.0], &[10, 20, 30, 40])];
        let up_to = |max_episodes, max_steps| {
            let limits = Limits {
                max_episodes,
                max_steps,
            };
            let run = result(team.clone(), Some(solved(9.0, 1)), limits, Rounding::Double);
            (run.returns[0].len(), run.env_steps, run.solved.is_some())
        };
        assert_eq!(up_to(None, None), (4, 40, true));
        assert_eq!(up_to(Some(3), None), (3, 30, false));
        assert_eq!(up_to(None, Some(39)), (3, 30, false));
        assert_eq!(up_to(Some(2), Some(40)), (2, 20, false));
        assert_eq!(up_to(None, Some(40)), (4, 40, true));
    }

    /// Two copies that step together: after steps 3 and 8 of the first one and 4 of the second one, the team of two has made 6,
    /// 16 and 8. The longest episode took 5 steps of its copy, in which the team made 10.
    #[test]
    fn episodes_of_copies_are_those_of_one_learner() {
        let mut copies = [agent(&[1.0, 2.0], &[3, 8]), agent(&[3.0], &[4])];
        team_steps(&mut copies);
        let learner = AgentEpisodes::of_copies(&copies);
        assert_eq!(learner.returns, [1.0, 3.0, 2.0]);
        assert_eq!(
            (learner.env_steps.as_slice(), learner.longest),
            ([6, 8, 16].as_slice(), 10)
        );
        let run = result(vec![learner], None, Limits::default(), Rounding::Double);
        // Unfinished episodes may have made ten more steps.
        assert!(run.reaches_step(26) && !run.reaches_step(27));
    }
}
