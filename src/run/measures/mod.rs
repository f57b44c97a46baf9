//! Measures of a run: returns, visited states, and whether the task counts as solved.

pub mod diversity;
pub mod first_visits;
pub mod recent;
pub mod visitation;

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use self::diversity::Diversity;
use self::first_visits::FirstVisits;
use self::recent::RecentVisits;
use self::visitation::{StateBins, Visitation, without_rounding_error};
use super::facts::FINAL_WINDOW;
use crate::run::facts::returns::final_return;
use crate::run::facts::{EpisodeRow, RoundRow};
use crate::scenario::{Rounding, Threshold};
use seedbed_env::TaskSpec;
use seedbed_learn::agent::UpdateReport;
use seedbed_learn::experience::Episode;
use seedbed_learn::team::Workers;

/// The measures of one run so far.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measures {
    env_steps: u64,
    /// `[K]`
    visitation: Vec<Visitation>,
    recent: RecentVisits,
    first_visits: FirstVisits,
    /// Entry n is the mean over agents of the return of their episode n.
    team_returns: Vec<f64>,
    /// For each agent, the returns of episodes that not all agents have finished: `[K]`
    unmatched_returns: Vec<VecDeque<f64>>,
    /// For each agent, the returns of its last [`FINAL_WINDOW`] episodes: `[K]`
    last_returns: Vec<VecDeque<f64>>,
}

/// The rows that a round adds to the tables.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RoundRows {
    /// One row per episode, in (agent, episode) order.
    pub episodes: Vec<EpisodeRow>,
    /// One row per update, in the order in which agents learned.
    pub updates: Vec<RoundRow>,
}

/// Statistics of the states that a team has visited so far.
#[derive(Clone, Debug, PartialEq)]
pub struct VisitStatistics {
    /// Entropy of each agent's visited states on the grids of [`Visitation`], nats: `[K]`
    pub entropy: Vec<f64>,
    /// `entropy` divided by its maximum, 0 to 1 (Pielou's evenness): `[K]`
    pub evenness: Vec<f64>,
    /// Share of cells that at least one agent has visited, 0 to 1.
    pub team_coverage: f64,
    /// How different the agents' visited states are.
    pub diversity: Diversity,
}

impl VisitStatistics {
    /// Fills in the columns of an episode's row that are known only at the end of its round.
    fn complete_row(&self, row: &mut EpisodeRow) {
        row.visitation_entropy = self.entropy[row.agent as usize];
        row.team_overlap = self.diversity.overlap;
        row.effective_agents = self.diversity.effective_agents;
    }
}

impl Measures {
    /// Measures of a team of `agents` agents before its first episode.
    #[must_use]
    pub fn new(spec: &TaskSpec, agents: usize) -> Self {
        Self {
            env_steps: 0,
            visitation: vec![Visitation::new(spec); agents],
            recent: RecentVisits::new(spec, agents),
            first_visits: FirstVisits::new(spec, agents),
            team_returns: Vec::new(),
            unmatched_returns: vec![VecDeque::new(); agents],
            last_returns: vec![VecDeque::new(); agents],
        }
    }

    /// Adds a finished round and returns its rows. `episodes` are in (agent, episode) order,
    /// `reports` in the order in which agents learned. Large teams are divided over `workers`, on which no bit
    /// depends.
    pub fn add_round(
        &mut self,
        spec: &TaskSpec,
        round: u32,
        episodes: &[&Episode],
        reports: &[(u32, UpdateReport)],
        workers: Workers<'_>,
    ) -> RoundRows {
        let workers = self.workers_for(episodes, workers);
        let visited = workers.map(episodes.to_vec(), |episode| {
            let states = StateBins::of(&spec.observations, &episode.observations);
            (episode.agent, states)
        });
        let steps_before = self.env_steps;
        let coverage = self.add_visits(&visited, workers);
        let mut episode_rows = Vec::with_capacity(episodes.len());
        for (episode, coverage) in episodes.iter().zip(coverage) {
            episode_rows.push(self.add_episode(episode, coverage));
        }
        self.extend_team_returns(episodes);
        let new_coverage = self.first_visits.add_round(&visited, workers);
        self.recent.add_round(visited, workers);
        let new_coverage_rate = new_coverage.iter().sum::<f64>() * 1000.0
            / (self.env_steps - steps_before).max(1) as f64;
        let recent = self.recent.diversity(workers);
        let visits = self.visit_statistics(workers);
        for row in &mut episode_rows {
            visits.complete_row(row);
        }
        let updates = reports.iter().map(|&(agent, report)| RoundRow {
            agent,
            round,
            gradient_steps: report.gradient_steps.map(|steps| steps as f32),
            value_loss: report.value_loss,
            policy_loss: report.policy_loss,
            ratio_deviation: report.ratio_deviation,
            largest_ratio: report.largest_ratio,
            clipped_fraction: report.clipped_fraction,
            entropy: report.entropy,
            intrinsic_reward: report.intrinsic_reward,
            prediction_error: report.prediction_error,
            bonus_agreement: report.bonus_agreement,
            coverage: self.visitation[agent as usize].coverage(),
            visitation_entropy: visits.entropy[agent as usize],
            visitation_evenness: visits.evenness[agent as usize],
            team_coverage: visits.team_coverage,
            team_overlap: visits.diversity.overlap,
            effective_agents: visits.diversity.effective_agents,
            recent_overlap: Some(recent.overlap),
            recent_effective_agents: Some(recent.effective_agents),
            first_coverage: Some(self.first_visits.coverage()[agent as usize]),
            new_coverage: Some(new_coverage[agent as usize]),
            new_coverage_rate: Some(new_coverage_rate),
        });
        RoundRows {
            episodes: episode_rows,
            updates: updates.collect(),
        }
    }

    /// Number of environment steps of the whole team.
    #[must_use]
    pub fn env_steps(&self) -> u64 {
        self.env_steps
    }

    /// Number of episodes that every agent has finished.
    #[must_use]
    pub fn episodes_per_agent(&self) -> usize {
        self.team_returns.len()
    }

    /// Mean return over all agents and over the last [`FINAL_WINDOW`] episodes of each agent, or over all
    /// its episodes if there are fewer. `None` before every agent has finished an episode.
    #[must_use]
    pub fn final_return(&self) -> Option<f64> {
        let matched = self.team_returns.len();
        let counts = self.unmatched_returns.iter();
        let counts = counts.map(|unmatched| matched + unmatched.len());
        let last = self.last_returns.iter();
        let last = last.map(|returns| returns.iter().copied().collect::<Vec<f64>>());
        final_return(counts, &self.team_returns, last)
    }

    /// Whether the mean return over the latest full window reaches the threshold.
    #[must_use]
    pub fn reaches(&self, threshold: Threshold) -> bool {
        let start = self.team_returns.len().checked_sub(threshold.window);
        start.is_some_and(|start| {
            threshold.is_reached_by(&self.team_returns[start..], Rounding::SingleRewards)
        })
    }

    /// Number of episodes per agent after which the mean return over the trailing window first
    /// reached the threshold.
    #[must_use]
    pub fn episodes_until(&self, threshold: Threshold) -> Option<usize> {
        threshold.first_window(&self.team_returns, Rounding::SingleRewards)
    }

    /// Share of cells that each agent has visited, from 0 to 1: `[K]`
    pub fn coverage(&self) -> impl Iterator<Item = f64> {
        self.visitation.iter().map(Visitation::coverage)
    }

    /// Share of cells that at least one agent has visited, from 0 to 1.
    #[must_use]
    pub fn team_coverage(&self) -> f64 {
        visitation::team_coverage(&self.visitation)
    }

    /// Statistics of the states that the team has visited so far.
    #[must_use]
    pub fn visit_statistics(&self, workers: Workers<'_>) -> VisitStatistics {
        let agents = &self.visitation;
        let entropy = workers.map(agents.iter().collect(), Visitation::entropy);
        let evenness = agents.iter().zip(&entropy);
        let evenness = evenness.map(|(agent, entropy)| agent.evenness(*entropy));
        VisitStatistics {
            evenness: evenness.collect(),
            team_coverage: self.team_coverage(),
            diversity: visitation::diversity(agents, &entropy, workers),
            entropy: entropy.into_iter().map(without_rounding_error).collect(),
        }
    }

    /// The workers, unless the measures of a round take less time than passing them on.
    fn workers_for<'a>(&self, episodes: &[&Episode], workers: Workers<'a>) -> Workers<'a> {
        let cells: usize = self.visitation.iter().map(Visitation::cell_count).sum();
        let states: usize = episodes.iter().map(|episode| episode.length() + 1).sum();
        if cells + states < MIN_SHARED_WORK {
            Workers::CURRENT_THREAD
        } else {
            workers
        }
    }

    /// Counts the states of a round. Returns the coverage of its agent after each episode.
    fn add_visits(&mut self, visited: &[(u32, StateBins)], workers: Workers<'_>) -> Vec<f64> {
        let of_agents = visits_of_agents(visited, self.visitation.len());
        let agents = self.visitation.iter_mut().zip(of_agents).collect();
        let coverage = workers.map(agents, |(visitation, visits): (&mut Visitation, _)| {
            let mut coverage = Vec::new();
            for (_, states) in visits {
                visitation.add(states);
                coverage.push(visitation.coverage());
            }
            coverage
        });
        coverage.concat()
    }

    fn add_episode(&mut self, episode: &Episode, coverage: f64) -> EpisodeRow {
        self.env_steps += episode.length() as u64;
        EpisodeRow {
            agent: episode.agent,
            episode: episode.episode,
            round: episode.round,
            env_steps: self.env_steps,
            r#return: episode.total_reward(),
            length: episode.length() as u32,
            outcome: episode.outcome,
            coverage,
            // Placeholders: `VisitStatistics::complete_row` replaces them at the end of the round.
            visitation_entropy: 0.0,
            team_overlap: 1.0,
            effective_agents: 1.0,
        }
    }

    fn extend_team_returns(&mut self, episodes: &[&Episode]) {
        for episode in episodes {
            let (agent, total_reward) = (episode.agent as usize, episode.total_reward());
            self.unmatched_returns[agent].push_back(total_reward);
            let last = &mut self.last_returns[agent];
            last.push_back(total_reward);
            if last.len() > FINAL_WINDOW {
                last.pop_front();
            }
        }
        while self
            .unmatched_returns
            .iter()
            .all(|returns| !returns.is_empty())
        {
            let returns: Vec<f64> = self
                .unmatched_returns
                .iter_mut()
                .filter_map(VecDeque::pop_front)
                .collect();
            self.team_returns.push(mean(&returns));
        }
    }
}

/// What each agent visited in a round. `visits` are in the order of agents. → `[K]`
fn visits_of_agents(visits: &[(u32, StateBins)], agents: usize) -> Vec<&[(u32, StateBins)]> {
    let mut of_agents = vec![&[][..]; agents];
    for visits in visits.chunk_by(|one, next| one.0 == next.0) {
        of_agents[visits[0].0 as usize] = visits;
    }
    of_agents
}

/// Number of cells of all agents and of states in a round from which threads share the work of measuring it: a tenth
/// of a millisecond.
const MIN_SHARED_WORK: usize = 100_000;

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_env::{Quantity, Status};

    const ONE: Workers<'static> = Workers::CURRENT_THREAD;

    pub(super) fn spec(axes: usize) -> TaskSpec {
        let quantity = |index| Quantity {
            name: format!("o{index}"),
            unit: String::new(),
            range: [0.0, 20.0],
        };
        TaskSpec {
            observations: (0..axes).map(quantity).collect(),
            ..TaskSpec::new("test", Vec::new(), Vec::new())
        }
    }

    fn episode(agent: u32, episode: u32, rewards: &[f32]) -> Episode {
        let observations = vec![agent as f32; 2 * (rewards.len() + 1)];
        Episode {
            rewards: rewards.to_vec(),
            observations,
            outcome: Status::Terminated,
            ..Episode::start(agent, episode, episode, &spec(2))
        }
    }

    /// Two agents, returns (1, 3), (2, 4), (6, 6): team means 2, 3, 6. The mean over a window of
    /// two episodes first reaches 4 after three episodes.
    #[test]
    fn a_threshold_needs_a_full_window() {
        let mut measures = Measures::new(&spec(2), 2);
        for (round, [a, b]) in [[1.0, 3.0], [2.0, 4.0], [6.0, 6.0]].into_iter().enumerate() {
            let episodes = [
                episode(0, round as u32, &[a]),
                episode(1, round as u32, &[b]),
            ];
            measures.add_round(&spec(2), round as u32, &episodes.each_ref(), &[], ONE);
        }
        assert_eq!(
            measures.episodes_until(Threshold {
                r#return: 4.0,
                window: 2
            }),
            Some(3)
        );
        assert_eq!(
            measures.episodes_until(Threshold {
                r#return: 2.0,
                window: 1
            }),
            Some(1)
        );
        assert_eq!(
            measures.episodes_until(Threshold {
                r#return: 2.0,
                window: 4
            }),
            None
        );
        assert_eq!(measures.final_return(), Some(11.0 / 3.0));
        assert_eq!(measures.env_steps(), 6);
    }

    /// Agent 0 is one episode ahead: its second return, 8, is that of the team after the second episode
    /// of agent 1. The final return has the episodes that each agent has finished.
    #[test]
    fn a_team_return_waits_for_every_agent() {
        let mut measures = Measures::new(&spec(2), 2);
        let mut add_round = |episodes: &[Episode]| {
            measures.add_round(&spec(2), 0, &episodes.iter().collect::<Vec<_>>(), &[], ONE);
            (measures.episodes_per_agent(), measures.final_return())
        };
        let first = [episode(0, 0, &[2.0]), episode(0, 0, &[8.0])];
        assert_eq!(add_round(&first), (0, None));
        assert_eq!(add_round(&[episode(1, 0, &[4.0])]), (1, Some(4.5)));
        assert_eq!(add_round(&[episode(1, 0, &[0.0])]), (2, Some(3.5)));
    }

    /// Agent 0 has 30 episodes with returns 0 to 29, agent 1 has 40 with returns 0 to 39. The last 25
    /// are 5 to 29, of mean 17, and 15 to 39, of mean 27.
    #[test]
    fn the_final_return_has_the_last_episodes_of_each_agent() {
        let mut measures = Measures::new(&spec(2), 2);
        for number in 0..40_u8 {
            let reward = [f32::from(number)];
            let both = [
                episode(0, number.into(), &reward),
                episode(1, number.into(), &reward),
            ];
            let played = if number < 30 { &both[..] } else { &both[1..] };
            measures.add_round(&spec(2), 0, &played.iter().collect::<Vec<_>>(), &[], ONE);
        }
        assert_eq!(measures.final_return(), Some(22.0));
        assert_eq!(measures.episodes_per_agent(), 30);
    }

    /// Agent 0 visits (0, 0) and agent 1 visits (1, 1): one of 400 cells each, two cells together.
    #[test]
    fn team_coverage_counts_cells_that_any_agent_visited() {
        let mut measures = Measures::new(&spec(2), 2);
        let episodes = [episode(0, 0, &[1.0, 1.0]), episode(1, 0, &[1.0])];
        let rows = measures.add_round(
            &spec(2),
            0,
            &episodes.each_ref(),
            &[0, 1].map(|agent| (agent, UpdateReport::default())),
            ONE,
        );
        assert_eq!(
            rows.episodes
                .iter()
                .map(|row| row.env_steps)
                .collect::<Vec<_>>(),
            [2, 3]
        );
        assert!((rows.updates[1].coverage - 1.0 / 400.0).abs() < 1e-12);
        assert!((measures.team_coverage() - 2.0 / 400.0).abs() < 1e-12);
        assert_eq!(rows.updates[0].team_coverage, measures.team_coverage());
        assert!(
            (rows.updates[0].effective_agents - 2.0).abs() < 1e-12
                && rows.updates[1].team_overlap.abs() < 1e-12
        );
        assert!(
            (rows.episodes[1].effective_agents - 2.0).abs() < 1e-12
                && rows.episodes[0].team_overlap.abs() < 1e-12
        );
        assert_eq!(
            (
                rows.updates[0].visitation_entropy,
                rows.updates[0].visitation_evenness
            ),
            (0.0, 0.0)
        );
    }

    /// 20 agents in 8 dimensions (28 grids), more than are divided over threads, in more rounds than
    /// are recent. One agent never has its last observation.
    #[test]
    fn threads_do_not_change_a_bit() {
        const AGENTS: u32 = 20;
        let spec = spec(8);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build();
        let pool = pool.unwrap();
        let measured = [ONE, Workers::new(Some(&pool))].map(|workers| {
            let mut measures = Measures::new(&spec, AGENTS as usize);
            let mut random = 1_u32;
            let mut rows = Vec::new();
            for round in 0..recent::RECENT_ROUNDS as u32 + 3 {
                let played = |agent: u32| {
                    let mut value = |axis: usize| {
                        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                        let is_missing = agent == 7 && axis == 7 && round < 12;
                        let value = (random >> 16) as f32 / 65_536.0 * (agent + 1) as f32;
                        if is_missing { f32::NAN } else { value }
                    };
                    Episode {
                        rewards: vec![0.5; 9],
                        observations: (0..80).map(|index| value(index % 8)).collect(),
                        ..Episode::start(agent, round, round, &spec)
                    }
                };
                let episodes: Vec<Episode> = (0..AGENTS).map(played).collect();
                let episodes: Vec<&Episode> = episodes.iter().collect();
                let reports: Vec<_> = (0..AGENTS)
                    .map(|agent| (agent, UpdateReport::default()))
                    .collect();
                rows.push(measures.add_round(&spec, round, &episodes, &reports, workers));
            }
            let cells = 28 * 400 * AGENTS as usize;
            assert!(cells > MIN_SHARED_WORK);
            (measures, rows)
        });
        assert_eq!(measured[0], measured[1]);
        let rows = &measured[0].1[12].updates;
        assert!(rows[3].team_overlap < 0.99 && rows[3].recent_effective_agents > Some(1.01));
    }
}
