//! `seedbed inspect`: summary of a run.

mod json;
mod text;

use std::ops::Range;
use std::path::PathBuf;

use clap::Args;

use super::CliError;
use super::plot::parse_episodes;
use super::progress::ReadCounter;
use seedbed::record::{EpisodeRow, RoundRow};
use seedbed::run::measures::visitation::Visitation;
use seedbed::run::review::recording_stats::RecordingStats;
use seedbed::run::review::{LoadRunError, LoadedRun};
use seedbed_env::Status;

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  seedbed inspect recordings/cartpole/seed-0    a run, finished or not
  seedbed inspect recordings/cartpole           the same, if it has one run
  seedbed inspect recordings/sample/run.rrd     a recording without its run directory
  seedbed inspect recordings/cartpole/seed-0 --episodes ..20
                                                how the agents differed in their first twenty episodes
  seedbed inspect recordings/cartpole/seed-0 --json | jq .effective_agents")]
pub(super) struct InspectArgs {
    /// Run directory, or a recording
    run: PathBuf,
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
    /// Episodes of each agent, if not all.
    episodes: Option<Range<u32>>,
    /// Statistics of the recording, if there is one.
    stats: Option<RecordingStats>,
}

pub(super) fn inspect(args: &InspectArgs) -> Result<(), CliError> {
    let mut run = LoadedRun::open(&args.run)?;
    let counter = ReadCounter::new("episodes read");
    let stats = run
        .compute_stats(&args.episodes.clone().unwrap_or(0..u32::MAX), |_| {
            counter.count();
        })
        .map_err(LoadRunError::from)?;
    drop(counter);
    if let Some(episodes) = &args.episodes {
        keep_episodes(&mut run, episodes, stats.is_some())?;
    }
    let inspected = Inspected {
        run,
        episodes: args.episodes.clone(),
        stats,
    };
    if args.json {
        say!("{}", json::text(&inspected));
    } else {
        say!("{}", text::text(&inspected));
    }
    Ok(())
}

/// Drops the rows of all other episodes, and those of rounds after them.
fn keep_episodes(
    run: &mut LoadedRun,
    episodes: &Range<u32>,
    has_recording: bool,
) -> Result<(), CliError> {
    if !has_recording {
        let message = "--episodes: the run has no recording, from which visits are counted";
        return Err(CliError::Usage(message.to_owned()));
    }
    run.episodes.retain(|row| episodes.contains(&row.episode));
    let Some(last_round) = run.episodes.iter().map(|row| row.round).max() else {
        let message = format!("{} has no such episodes", run.path.display());
        return Err(CliError::Usage(format!("--episodes: {message}")));
    };
    run.rounds.retain(|row| row.round <= last_round);
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
        let from_recording =
            |stats: &RecordingStats| stats.first_coverage().get(agent as usize).copied();
        let stats = self.stats.as_ref();
        stats
            .and_then(from_recording)
            .or(self.last_update(agent).and_then(|row| row.first_coverage))
    }

    /// Effective number of agents by their visits in the latest rounds.
    fn recent_effective_agents(&self) -> Option<f64> {
        let stats = self.stats.as_ref();
        let from_recording = stats.map(|stats| stats.recent_diversity().effective_agents);
        let last_round = self.run.rounds.last();
        from_recording.or(last_round.and_then(|row| row.recent_effective_agents))
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
            .map(|visitation| visitation.entropy() / visitation.max_entropy())
            .or(self.last_update(agent).map(|row| row.visitation_evenness))
    }

    /// Visit counts of an agent, from the recording.
    fn visitation(&self, agent: u32) -> Option<&Visitation> {
        self.stats.as_ref()?.visitation.get(agent as usize)
    }

    /// Overlap of the agents' visited states, and the effective number of agents.
    fn diversity(&self) -> Option<(f64, f64)> {
        let from_recording = self
            .stats
            .as_ref()
            .map(RecordingStats::diversity)
            .map(|diversity| (diversity.overlap, diversity.effective_agents));
        let last_round = self.run.rounds.last();
        from_recording.or(last_round.map(|row| (row.team_overlap, row.effective_agents)))
    }
}
