//! `seedbed inspect`: summary of a run.

mod json;
mod numbers;
mod text;

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::PathBuf;

use clap::Args;

use super::plot::{agents_in, parse_agents, parse_episodes};
use super::progress::ReadCounter;
use super::{CliError, open_run};
use seedbed::review::recording_stats::RecordingStats;
use seedbed::review::selection::EpisodeSelection;
use seedbed::review::{LoadRunError, LoadedRun};
use seedbed::run::facts::returns::{
    final_mean_of_learners, final_return, means_of_learners, returns_of_agents,
};
use seedbed::run::facts::{EpisodeRow, RoundRow};
use seedbed::run::measures::visitation::{Visitation, visiting_agents};
use seedbed_env::Status;

/// Maximum number of agents of which the overlap of each pair is computed.
const MAX_AGENTS_IN_OVERLAPS: usize = 1024;

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  seedbed inspect recordings/cartpole/seed-0    a run, finished or not
  seedbed inspect recordings/cartpole           the same, if it has one run
  seedbed inspect recordings/sample/run.rrd     a recording without its run directory
  seedbed inspect recordings/cartpole/seed-0 --episodes ..20
                                                how the agents differed in their first twenty episodes
  seedbed inspect recordings/cartpole/seed-0 --agents 0,3
                                                how two agents differed
  seedbed inspect recordings/cartpole/seed-0 --json | jq .effective_agents")]
pub(super) struct InspectArgs {
    /// Run directory, or a recording
    run: PathBuf,
    /// Only these agents, e.g. 0,3 or 0..4, 4 excluded [default: all]
    #[arg(long, value_delimiter = ',', value_name = "N,N…", value_parser = parse_agents)]
    agents: Vec<Range<u32>>,
    /// Only these episodes of each agent, B excluded, e.g. 0..50, 150.. or ..50 [default: all]
    #[arg(long, value_name = "A..B", value_parser = parse_episodes)]
    episodes: Option<Range<u32>>,
    /// Print a JSON object
    #[arg(long)]
    json: bool,
}

/// A run, and statistics of its recording.
struct Inspected {
    run: LoadedRun,
    selection: EpisodeSelection,
    /// Numbers of the selected agents.
    agents: Vec<u32>,
    /// Statistics of the recording, if there is one.
    stats: Option<RecordingStats>,
    /// Share of the state space that each agent was the first to visit, from the recording: `[K]`.
    first_coverage: Vec<f64>,
}

pub(super) fn inspect(args: &InspectArgs) -> Result<(), CliError> {
    let mut run = open_run(&args.run)?;
    let selection = EpisodeSelection {
        agents: agents_in(&args.agents),
        episodes: args.episodes.clone().unwrap_or(0..u32::MAX),
    };
    let counter = ReadCounter::new("episodes read");
    let stats = run
        .compute_stats(&selection, |_| counter.count())
        .map_err(LoadRunError::from)?;
    drop(counter);
    if !selection.is_all() {
        keep_selected_rows(&mut run, &selection, stats.is_some())?;
    }
    let inspected = Inspected {
        agents: selected_agents(&run, &selection),
        run,
        selection,
        first_coverage: stats
            .as_ref()
            .map_or_else(Vec::new, RecordingStats::first_coverage),
        stats,
    };
    if args.json {
        say!("{}", json::text(&inspected));
    } else {
        say!("{}", text::text(&inspected));
    }
    Ok(())
}

/// Numbers of the selected agents, in ascending order.
fn selected_agents(run: &LoadedRun, selection: &EpisodeSelection) -> Vec<u32> {
    if selection.agents.is_empty() {
        return (0..run.agent_count() as u32).collect();
    }
    let agents: BTreeSet<u32> = selection.agents.iter().copied().collect();
    agents.into_iter().collect()
}

/// Drops the rows of all other episodes, and those of other agents' updates and of later rounds.
fn keep_selected_rows(
    run: &mut LoadedRun,
    selection: &EpisodeSelection,
    has_recording: bool,
) -> Result<(), CliError> {
    if !has_recording {
        let message =
            "--agents, --episodes: the run has no recording, from which visits are counted";
        return Err(CliError::Usage(message.to_owned()));
    }
    run.episodes
        .retain(|row| selection.includes(row.agent, row.episode));
    let found = |agent: &u32| run.episodes.iter().any(|row| row.agent == *agent);
    if let Some(agent) = selection.agents.iter().find(|agent| !found(agent)) {
        let message = format!(
            "{} has no such episodes of agent {agent}",
            run.path.display()
        );
        return Err(CliError::Usage(format!("--agents: {message}")));
    }
    let Some(last_round) = run.episodes.iter().map(|row| row.round).max() else {
        let message = format!("{} has no such episodes", run.path.display());
        return Err(CliError::Usage(format!("--episodes: {message}")));
    };
    run.rounds
        .retain(|row| row.round <= last_round && selection.includes_agent(row.agent));
    Ok(())
}

/// How the episodes of a run ended.
struct Endings {
    /// Mean number of steps in the first and in the last tenth of the episodes.
    first_length: f64,
    last_length: f64,
    /// Share of episodes that ended before the time limit.
    terminated: f64,
    all_returns_equal: bool,
}

impl Inspected {
    /// Mean over the selected agents of the return of each selected episode that all of them have
    /// finished.
    fn team_returns(&self) -> Vec<f64> {
        if let Some(returns) = self.returns_of_learners() {
            return means_of_learners(&returns);
        }
        let mut sums: BTreeMap<u32, (f64, usize)> = BTreeMap::new();
        for row in &self.run.episodes {
            let (sum, count) = sums.entry(row.episode).or_default();
            *sum += row.r#return;
            *count += 1;
        }
        let of_all = sums
            .into_values()
            .filter(|(_, count)| *count == self.agents.len());
        of_all.map(|(sum, count)| sum / count as f64).collect()
    }

    /// Returns of each learner in the selected episodes of a run that another program recorded; `None`
    /// of a run of seedbed.
    fn returns_of_learners(&self) -> Option<Vec<Vec<f64>>> {
        Some(self.selected(self.run.learners()?.returns(&self.run.episodes)))
    }

    /// Returns of each learner or, in a run of seedbed, of each agent in the selected episodes.
    fn returns(&self) -> Vec<Vec<f64>> {
        let of_agents = || returns_of_agents(&self.run.episodes, self.run.agent_count());
        let of_learners = self.returns_of_learners();
        of_learners.unwrap_or_else(|| self.selected(of_agents()))
    }

    /// Without the agents or learners that are not selected.
    fn selected(&self, mut returns: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
        if !self.selection.agents.is_empty() {
            returns.retain(|learner| !learner.is_empty());
        }
        returns
    }

    /// Mean over the selected agents, or learners, of the returns of their last episodes; `None` if one
    /// has none.
    fn final_return(&self) -> Option<f64> {
        if let Some(returns) = self.returns_of_learners() {
            return final_mean_of_learners(&returns);
        }
        let returns = self.returns();
        let counts = returns.iter().map(Vec::len);
        final_return(counts, &self.team_returns(), &returns)
    }

    /// Number of steps of the selected episodes.
    fn env_steps(&self) -> u64 {
        let lengths = self.run.episodes.iter().map(|row| u64::from(row.length));
        lengths.sum()
    }

    /// Overlap of each pair of the selected agents' visited states, `None` of agents without visits:
    /// `[agents][agents]`. `None` without a recording, or if there are too many agents.
    fn overlaps(&self) -> Option<Vec<Vec<Option<f64>>>> {
        let stats = self.stats.as_ref();
        let stats = stats.filter(|stats| stats.visitation.len() <= MAX_AGENTS_IN_OVERLAPS)?;
        let (overlaps, count) = (stats.overlaps(), stats.visitation.len());
        let overlap = |one: u32, other: u32| overlaps.get(one as usize * count + other as usize);
        let row = |&one: &u32| -> Option<Vec<Option<f64>>> {
            self.agents
                .iter()
                .map(|&other| overlap(one, other).copied())
                .collect()
        };
        self.agents.iter().map(row).collect()
    }

    /// Number of selected episodes whose return is NaN.
    fn nan_returns(&self) -> usize {
        let returns = self.run.episodes.iter().map(|row| row.r#return);
        returns.filter(|value| value.is_nan()).count()
    }

    /// How the episodes ended. There is at least one.
    fn endings(&self) -> Endings {
        let rows = &self.run.episodes;
        let tenth = rows.len().div_ceil(10);
        let mean_length = |rows: &[EpisodeRow]| {
            let steps: f64 = rows.iter().map(|row| f64::from(row.length)).sum();
            steps / rows.len() as f64
        };
        let is_terminated = |row: &&EpisodeRow| row.outcome == Status::Terminated;
        let first_return = rows.first().map(|row| row.r#return);
        Endings {
            first_length: mean_length(&rows[..tenth]),
            last_length: mean_length(&rows[rows.len() - tenth..]),
            terminated: rows.iter().filter(is_terminated).count() as f64 / rows.len() as f64,
            all_returns_equal: rows.len() > 1
                && rows.iter().all(|row| Some(row.r#return) == first_return),
        }
    }

    /// Row of the last update of an agent.
    fn last_update(&self, agent: u32) -> Option<&RoundRow> {
        self.run.rounds.iter().rev().find(|row| row.agent == agent)
    }

    /// Mean intrinsic reward in the last update of an agent.
    fn intrinsic_reward(&self, agent: u32) -> Option<f64> {
        self.last_update(agent)?.intrinsic_reward.map(f64::from)
    }

    /// Whether an agent had an intrinsic reward.
    fn has_bonus(&self) -> bool {
        let mut rounds = self.run.rounds.iter();
        rounds.any(|row| row.intrinsic_reward.is_some_and(|bonus| bonus != 0.0))
    }

    /// Share of the state space that an agent was the first to visit, from the recording or else from
    /// the row of the agent's last update.
    fn first_coverage(&self, agent: u32) -> Option<f64> {
        let from_recording = self.first_coverage.get(agent as usize).copied();
        from_recording.or(self.last_update(agent).and_then(|row| row.first_coverage))
    }

    /// Effective number of agents by their visits in the latest rounds.
    fn recent_effective_agents(&self) -> Option<f64> {
        match &self.stats {
            Some(stats) => stats
                .recent_diversity()
                .map(|diversity| diversity.effective_agents),
            None => self.run.rounds.last()?.recent_effective_agents,
        }
    }

    /// Coverage of an agent, from the recording or else from the row of the agent's last update.
    fn coverage(&self, agent: u32) -> Option<f64> {
        self.visitation(agent)
            .map(Visitation::coverage)
            .or(self.last_update(agent).map(|row| row.coverage))
    }

    /// Visitation evenness of an agent, from the recording or else from the row of the agent's last
    /// update.
    fn evenness(&self, agent: u32) -> Option<f64> {
        self.visitation(agent)
            .map(|visits| visits.evenness(visits.entropy()))
            .or(self.last_update(agent).map(|row| row.visitation_evenness))
    }

    /// Visit counts of an agent, from the recording.
    fn visitation(&self, agent: u32) -> Option<&Visitation> {
        self.stats.as_ref()?.visitation.get(agent as usize)
    }

    /// Overlap of the agents' visited states, and the effective number of agents.
    fn diversity(&self) -> Option<(f64, f64)> {
        if let Some(stats) = &self.stats {
            let diversity = stats.diversity()?;
            return Some((diversity.overlap, diversity.effective_agents));
        }
        let last_round = self.run.rounds.last()?;
        Some((last_round.team_overlap, last_round.effective_agents))
    }

    /// Number of agents with visits; without a recording, of all agents.
    fn visiting_agents(&self) -> usize {
        let stats = self.stats.as_ref();
        stats.map_or(self.agents.len(), |stats| {
            visiting_agents(&stats.visitation)
        })
    }
}
