//! Measures of a run: returns, visited states, and whether the task counts as solved.
//!
//! The visits of an agent are measured on its rank; what all agents have in common is put together on
//! rank 0.

pub mod diversity;
pub mod first_visits;
pub mod recent;
mod returns;
pub mod visitation;

use serde::{Deserialize, Serialize};

use self::diversity::Diversity;
use self::first_visits::VisitedCells;
use self::recent::RecentVisits;
use self::returns::TeamReturns;
use self::visitation::{StateBins, Visitation, without_rounding_error};
use crate::run::facts::{EpisodeRow, RoundRow};
use crate::run::ranks::Ranks;
use crate::scenario::Threshold;
use seedbed_env::TaskSpec;
use seedbed_learn::agent::UpdateReport;
use seedbed_learn::experience::Episode;
use seedbed_learn::team::Workers;

/// The measures of one run so far, for the agents of this rank. Rank 0 also has those of the team.
#[derive(Clone, Debug, PartialEq)]
pub struct Measures {
    /// Number of the first local agent.
    first_agent: u32,
    /// `[local agents]`
    agents: Vec<VisitsOfAgent>,
    cells: VisitedCells,
    /// Of the whole team, on rank 0 only.
    returns: TeamReturns,
}

/// The visits of one agent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct VisitsOfAgent {
    all: Visitation,
    recent: RecentVisits,
    /// Share of cells that it was the first to visit.
    first_coverage: f64,
}

/// The measures of a whole run, for a checkpoint.
#[derive(Debug, Serialize, Deserialize)]
pub struct SavedMeasures {
    cells: VisitedCells,
    returns: TeamReturns,
    /// Visits of each agent: `[K]`
    agents: Vec<Vec<u8>>,
}

/// Among whom the measures of a round are divided: ranks, by agents, and threads of this rank. No bit depends on it.
#[derive(Clone, Copy, Debug)]
pub struct Division<'a> {
    /// The threads of this rank.
    pub workers: Workers<'a>,
    /// This rank and the others, all of which must make the same calls.
    pub ranks: Ranks,
}

impl Division<'_> {
    /// One thread of one process.
    pub const NONE: Division<'static> = Division {
        workers: Workers::CURRENT_THREAD,
        ranks: Ranks::SINGLE,
    };
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
    /// Share of cells that each agent has visited, 0 to 1: `[K]`
    pub coverage: Vec<f64>,
    /// Entropy of each agent's visited states on the grids of [`Visitation`], nats: `[K]`
    pub entropy: Vec<f64>,
    /// `entropy` divided by its maximum, 0 to 1 (Pielou's evenness): `[K]`
    pub evenness: Vec<f64>,
    /// Share of cells that at least one agent has visited, 0 to 1.
    pub team_coverage: f64,
    /// How different the agents' visited states are.
    pub diversity: Diversity,
}

/// What the rows of a round have in common.
struct TeamColumns {
    team_coverage: f64,
    all: Diversity,
    recent: Diversity,
    /// Share of cells that the team visited first in the round, per 1,000 steps.
    new_coverage_rate: f64,
}

impl TeamColumns {
    /// Fills in the columns that are known only when all agents have been measured.
    fn complete(&self, rows: &mut RoundRows) {
        for row in &mut rows.episodes {
            row.team_overlap = self.all.overlap;
            row.effective_agents = self.all.effective_agents;
        }
        for row in &mut rows.updates {
            row.team_coverage = self.team_coverage;
            row.team_overlap = self.all.overlap;
            row.effective_agents = self.all.effective_agents;
            row.recent_overlap = Some(self.recent.overlap);
            row.recent_effective_agents = Some(self.recent.effective_agents);
            row.new_coverage_rate = Some(self.new_coverage_rate);
        }
    }
}

impl Measures {
    /// Measures of a team of `agents` agents before its first episode.
    #[must_use]
    pub fn new(spec: &TaskSpec, agents: usize) -> Self {
        Self::on_ranks(spec, agents, Ranks::SINGLE)
    }

    /// Like [`new`](Self::new), with the visits of the agents of this rank.
    #[must_use]
    pub fn on_ranks(spec: &TaskSpec, agents: usize, ranks: Ranks) -> Self {
        let local = ranks.local_agents(agents as u32);
        let no_visits = VisitsOfAgent {
            all: Visitation::new(spec),
            recent: RecentVisits::new(spec),
            first_coverage: 0.0,
        };
        Self {
            first_agent: local.start,
            agents: vec![no_visits; local.len()],
            cells: VisitedCells::new(spec),
            returns: TeamReturns::new(if ranks.is_first() { agents } else { 0 }),
        }
    }

    /// Adds a finished round. `episodes` are those of the local agents, in (agent, episode) order, `reports`
    /// of their updates, in the order in which agents learned. Returns the rows of all agents, on rank 0.
    pub fn add_round(
        &mut self,
        spec: &TaskSpec,
        round: u32,
        episodes: &[&Episode],
        reports: &[(u32, UpdateReport)],
        division: Division<'_>,
    ) -> RoundRows {
        let division = self.useful_division(episodes, division);
        let visits = self.visits_of_agents(spec, episodes, division.workers);
        let coverage = self.add_visits(&visits, division.workers);
        let new_coverage = self.cells.add_round(&visits, division);
        self.add_recent(visits, &new_coverage, division.workers);
        let recent = self.recent_diversity(division);
        let statistics = self.local_statistics(division);
        let episode_rows = episodes.iter().zip(coverage);
        let episode_rows = episode_rows.map(|(episode, coverage)| EpisodeRow {
            coverage,
            visitation_entropy: statistics.entropy[self.local(episode.agent)],
            ..row_of_episode(episode)
        });
        let update_rows = reports.iter().map(|&(agent, report)| {
            let local = self.local(agent);
            RoundRow {
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
                coverage: statistics.coverage[local],
                visitation_entropy: statistics.entropy[local],
                visitation_evenness: statistics.evenness[local],
                first_coverage: Some(self.agents[local].first_coverage),
                new_coverage: Some(new_coverage[local]),
                // The same for all agents: `TeamColumns::complete` replaces them.
                team_coverage: 0.0,
                team_overlap: 1.0,
                effective_agents: 1.0,
                recent_overlap: None,
                recent_effective_agents: None,
                new_coverage_rate: None,
            }
        });
        let mut rows = RoundRows {
            episodes: division.ranks.gather_lists(episode_rows.collect()),
            updates: division.ranks.gather_lists(update_rows.collect()),
        };
        let new_coverage = division.ranks.gather_lists(new_coverage);
        if division.ranks.is_first() {
            let steps_before = self.returns.env_steps;
            self.returns.add(&mut rows.episodes);
            let steps = (self.returns.env_steps - steps_before).max(1);
            let columns = TeamColumns {
                team_coverage: statistics.team_coverage,
                all: statistics.diversity,
                recent,
                new_coverage_rate: new_coverage.iter().sum::<f64>() * 1000.0 / steps as f64,
            };
            columns.complete(&mut rows);
        }
        rows
    }

    /// Number of environment steps of the whole team.
    #[must_use]
    pub fn env_steps(&self) -> u64 {
        self.returns.env_steps
    }

    /// Number of episodes that every agent has finished.
    #[must_use]
    pub fn episodes_per_agent(&self) -> usize {
        self.returns.episodes_per_agent()
    }

    /// Mean return over all agents and over the last [`FINAL_WINDOW`](super::facts::FINAL_WINDOW) episodes of each agent, or
    /// over all its episodes if there are fewer. `None` before every agent has finished an episode.
    #[must_use]
    pub fn final_return(&self) -> Option<f64> {
        self.returns.final_return()
    }

    /// Whether the mean return over the latest full window reaches the threshold.
    #[must_use]
    pub fn reaches(&self, threshold: Threshold) -> bool {
        self.returns.reach(threshold)
    }

    /// Number of episodes per agent after which the mean return over the trailing window first
    /// reached the threshold.
    #[must_use]
    pub fn episodes_until(&self, threshold: Threshold) -> Option<usize> {
        self.returns.episodes_until(threshold)
    }

    /// Statistics of the states that the team has visited so far, on rank 0.
    #[must_use]
    pub fn visit_statistics(&self, division: Division<'_>) -> VisitStatistics {
        let ranks = division.ranks;
        let local = self.local_statistics(division);
        VisitStatistics {
            coverage: ranks.gather_lists(local.coverage),
            entropy: ranks.gather_lists(local.entropy),
            evenness: ranks.gather_lists(local.evenness),
            ..local
        }
    }

    /// Everything that is needed to go on later, on rank 0.
    ///
    /// # Panics
    /// Never: plain data always serializes.
    #[must_use]
    pub fn save(&self, ranks: Ranks) -> SavedMeasures {
        let bytes = |agent| postcard::to_stdvec(agent).expect("plain data always serializes");
        SavedMeasures {
            cells: self.cells.clone(),
            returns: self.returns.clone(),
            agents: ranks.gather_lists(self.agents.iter().map(bytes).collect()),
        }
    }

    /// Continues from saved measures.
    ///
    /// # Errors
    /// They are damaged, or those of another team or task.
    pub fn restore(&mut self, saved: SavedMeasures) -> Result<(), String> {
        let first = self.first_agent as usize;
        let local = saved.agents.get(first..first + self.agents.len());
        let local = local.ok_or("it has measures of fewer agents")?;
        for (agent, bytes) in self.agents.iter_mut().zip(local) {
            let restored: VisitsOfAgent =
                postcard::from_bytes(bytes).map_err(|error| error.to_string())?;
            *agent = restored;
        }
        self.cells = saved.cells;
        self.returns = saved.returns;
        Ok(())
    }

    /// The index of a local agent.
    fn local(&self, agent: u32) -> usize {
        (agent - self.first_agent) as usize
    }

    /// The threads, unless the measures of a round take less time than passing them on.
    fn useful_division<'a>(&self, episodes: &[&Episode], division: Division<'a>) -> Division<'a> {
        let cells: usize = self.agents.iter().map(|agent| agent.all.cell_count()).sum();
        let states: usize = episodes.iter().map(|episode| episode.length() + 1).sum();
        if cells + states < MIN_SHARED_WORK {
            Division {
                workers: Workers::CURRENT_THREAD,
                ..division
            }
        } else {
            division
        }
    }

    /// The states that each local agent visited in a round, episode by episode: `[local agents]`
    fn visits_of_agents(
        &self,
        spec: &TaskSpec,
        episodes: &[&Episode],
        workers: Workers<'_>,
    ) -> Vec<Vec<StateBins>> {
        let visits = workers.map(episodes.to_vec(), |episode| {
            let states = StateBins::of(&spec.observations, &episode.observations);
            (self.local(episode.agent), states)
        });
        let mut of_agents = vec![Vec::new(); self.agents.len()];
        for (agent, states) in visits {
            of_agents[agent].push(states);
        }
        of_agents
    }

    /// Counts the states of a round. Returns the coverage of its agent after each episode.
    fn add_visits(&mut self, visits: &[Vec<StateBins>], workers: Workers<'_>) -> Vec<f64> {
        let agents = self.agents.iter_mut().zip(visits).collect();
        let coverage = workers.map(agents, |(agent, visits): (&mut VisitsOfAgent, _)| {
            let mut coverage = Vec::new();
            for states in visits {
                agent.all.add(states);
                coverage.push(agent.all.coverage());
            }
            coverage
        });
        coverage.concat()
    }

    /// Counts the states of a round among the recent ones, and the cells that agents were the first to visit.
    fn add_recent(
        &mut self,
        visits: Vec<Vec<StateBins>>,
        new_coverage: &[f64],
        workers: Workers<'_>,
    ) {
        let agents = self.agents.iter_mut().zip(visits).zip(new_coverage);
        workers.for_each(&mut agents.collect::<Vec<_>>(), |((agent, visits), new)| {
            agent.recent.add_round(std::mem::take(visits));
            agent.first_coverage += **new;
        });
    }

    /// How different the agents' recent visits are, on rank 0.
    fn recent_diversity(&self, division: Division<'_>) -> Diversity {
        let recent = self.agents.iter().map(|agent| agent.recent.visitation());
        let recent: Vec<&Visitation> = recent.collect();
        let entropies = division.workers.map(recent.clone(), Visitation::entropy);
        visitation::diversity(&recent, &entropies, division)
    }

    /// Statistics of the local agents, and on rank 0 the diversity of the team.
    fn local_statistics(&self, division: Division<'_>) -> VisitStatistics {
        let agents: Vec<&Visitation> = self.agents.iter().map(|agent| &agent.all).collect();
        let entropy = division.workers.map(agents.clone(), Visitation::entropy);
        let evenness = agents.iter().zip(&entropy);
        let evenness = evenness.map(|(agent, entropy)| agent.evenness(*entropy));
        VisitStatistics {
            coverage: agents.iter().map(|agent| agent.coverage()).collect(),
            evenness: evenness.collect(),
            team_coverage: self.cells.coverage(),
            diversity: visitation::diversity(&agents, &entropy, division),
            entropy: entropy.into_iter().map(without_rounding_error).collect(),
        }
    }
}

/// The row of an episode, without measures of visits and of the team.
fn row_of_episode(episode: &Episode) -> EpisodeRow {
    EpisodeRow {
        agent: episode.agent,
        episode: episode.episode,
        round: episode.round,
        env_steps: 0,
        r#return: episode.total_reward(),
        length: episode.length() as u32,
        outcome: episode.outcome,
        coverage: 0.0,
        visitation_entropy: 0.0,
        team_overlap: 1.0,
        effective_agents: 1.0,
    }
}

/// Number of cells of all agents and of states in a round from which threads share the work of measuring it: a tenth
/// of a millisecond.
const MIN_SHARED_WORK: usize = 100_000;

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_env::{Quantity, Status};

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
            measures.add_round(
                &spec(2),
                round as u32,
                &episodes.each_ref(),
                &[],
                Division::NONE,
            );
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
            measures.add_round(
                &spec(2),
                0,
                &episodes.iter().collect::<Vec<_>>(),
                &[],
                Division::NONE,
            );
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
            measures.add_round(
                &spec(2),
                0,
                &played.iter().collect::<Vec<_>>(),
                &[],
                Division::NONE,
            );
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
            Division::NONE,
        );
        assert_eq!(
            rows.episodes
                .iter()
                .map(|row| row.env_steps)
                .collect::<Vec<_>>(),
            [2, 3]
        );
        assert!((rows.updates[1].coverage - 1.0 / 400.0).abs() < 1e-12);
        let statistics = measures.visit_statistics(Division::NONE);
        assert_eq!(statistics.coverage, [1.0 / 400.0; 2]);
        assert_eq!(statistics.team_coverage, 2.0 / 400.0);
        assert_eq!(rows.updates[0].team_coverage, statistics.team_coverage);
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
        let measured = [Workers::CURRENT_THREAD, Workers::new(Some(&pool))].map(|workers| {
            let ranks = Ranks::SINGLE;
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
                let division = Division { workers, ranks };
                rows.push(measures.add_round(&spec, round, &episodes, &reports, division));
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
