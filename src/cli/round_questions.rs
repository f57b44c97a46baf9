//! `seedbed run --ask-after-rounds`: a program that drives this one gets each round as a line of JSON, and says
//! whether the run goes on. The Python package does so.

use std::io::{self, BufRead, Write};
use std::path::PathBuf;

use serde::Serialize;

use super::interruption;
use seedbed::run::facts::EpisodeRow;
use seedbed::run::facts::metrics::RoundRow;
use seedbed::run::measures::RoundRows;
use seedbed::run::{Observer, Progress};

/// Prints each round and waits for the answer. Any answer but `continue`, or none because the other program has
/// ended, stops the run after this round.
pub(super) struct RoundQuestions {
    pub(super) name: String,
    pub(super) agents: u32,
    pub(super) folder: PathBuf,
}

/// A line that is printed. Numbers that are not finite are `null`.
#[derive(Serialize)]
#[serde(rename_all = "lowercase")]
enum Line<'a> {
    /// The run begins or is resumed; no answer is expected.
    Begun {
        scenario: &'a str,
        agents: u32,
        folder: &'a str,
        #[serde(flatten)]
        progress: &'a Progress,
    },
    /// A round is finished.
    Round {
        #[serde(flatten)]
        progress: &'a Progress,
        finished: &'a [EpisodeRow],
        updates: &'a [RoundRow],
    },
}

impl Observer for RoundQuestions {
    fn begun(&mut self, progress: &Progress) {
        let line = Line::Begun {
            scenario: &self.name,
            agents: self.agents,
            folder: &self.folder.to_string_lossy(),
            progress,
        };
        if print(&line).is_err() {
            interruption::request();
        }
    }

    fn round_finished(&mut self, progress: &Progress, rows: &RoundRows) {
        let line = Line::Round {
            progress,
            finished: &rows.episodes,
            updates: &rows.updates,
        };
        if !print(&line).and_then(|()| goes_on()).unwrap_or(false) {
            interruption::request();
        }
    }
}

fn print(line: &Line<'_>) -> io::Result<()> {
    let mut text = serde_json::to_string(line)?;
    text.push('\n');
    let mut out = io::stdout().lock();
    out.write_all(text.as_bytes())?;
    out.flush()
}

/// Reads the answer.
fn goes_on() -> io::Result<bool> {
    let mut answer = String::new();
    io::stdin().lock().read_line(&mut answer)?;
    Ok(answer.trim_end() == "continue")
}
