//! Whether files of visited states have the episodes that `summary.json` of their finished run says.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use crate::record::ReadError;
use crate::run::facts::EpisodeRow;
use seedbed_input::limits::{MAX_SMALL_FILE_BYTES, read_bytes};

/// The file that a recorder writes when all agents of a folder are closed, and removes before it
/// continues.
const SUMMARY: &str = "summary.json";

/// What a summary says of the episodes of its run.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
pub struct NotedEpisodes {
    /// Number of finished episodes of each agent that has a file. Summaries of earlier versions have
    /// none.
    #[serde(default)]
    episodes_of_agents: Option<BTreeMap<u32, u64>>,
    /// Number of steps of all episodes.
    #[serde(default)]
    env_steps: Option<u64>,
}

impl NotedEpisodes {
    /// What the summary in the folder of a run says; `None` if the run is not finished.
    ///
    /// # Errors
    /// The file is no summary.
    pub(super) fn read(run_folder: &Path) -> Result<Option<Self>, ReadError> {
        let path = run_folder.join(SUMMARY);
        if !path.is_file() {
            return Ok(None);
        }
        let bytes = read_bytes(&path, MAX_SMALL_FILE_BYTES).map_err(|error| error.to_string());
        let noted = bytes.and_then(|bytes| {
            serde_json::from_slice(&bytes).map_err(|error| format!("it is no summary: {error}"))
        });
        noted
            .map(Some)
            .map_err(|reason| ReadError::Unreadable { path, reason })
    }

    /// Compares the summary in the folder of a run with the episodes that were found after it was read.
    ///
    /// # Errors
    /// They differ, and the summary is still there.
    pub(super) fn check(&self, run_folder: &Path, rows: &[EpisodeRow]) -> Result<(), ReadError> {
        let found = rows.iter().map(|row| (row.agent, u64::from(row.length)));
        match self.difference(found) {
            Some(difference) if Self::read(run_folder)?.as_ref() == Some(self) => {
                Err(ReadError::Unreadable {
                    path: run_folder.to_owned(),
                    reason: format!(
                        "{difference}: a file has lost its end, or was replaced; to read what is there, delete \
                         {SUMMARY}"
                    ),
                })
            }
            _ => Ok(()),
        }
    }

    /// How the episodes with these agents and lengths differ from those of the summary, for people;
    /// `None` if they do not.
    #[must_use]
    pub fn difference(&self, found: impl Iterator<Item = (u32, u64)>) -> Option<String> {
        let (mut episodes, mut env_steps) = (BTreeMap::<u32, u64>::new(), 0_u64);
        for (agent, length) in found {
            *episodes.entry(agent).or_default() += 1;
            env_steps = env_steps.saturating_add(length);
        }
        if let Some(noted) = &self.episodes_of_agents {
            for agent in noted.keys().chain(episodes.keys()) {
                let count = |counts: &BTreeMap<u32, u64>| counts.get(agent).copied().unwrap_or(0);
                let [found, expected] = [count(&episodes), count(noted)];
                if found != expected {
                    return Some(format!(
                        "the number of episodes of agent {agent} is {found}, expected {expected} as in {SUMMARY}"
                    ));
                }
            }
        }
        let noted = self.env_steps.filter(|noted| *noted != env_steps)?;
        Some(format!(
            "the number of steps of all episodes is {env_steps}, expected {noted} as in {SUMMARY}"
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noted(json: &str) -> NotedEpisodes {
        serde_json::from_str(json).unwrap()
    }

    /// Agent 0 has two episodes of 3 steps, agent 2 has one of 4 steps.
    #[test]
    fn episodes_are_those_of_the_summary() {
        let found = [(0, 3), (0, 3), (2, 4)];
        let whole = noted(r#"{"episodes_of_agents": {"0": 2, "2": 1, "5": 0}, "env_steps": 10}"#);
        assert_eq!(whole.difference(found.into_iter()), None);
        assert_eq!(
            whole.difference(found[1..].iter().copied()).unwrap(),
            "the number of episodes of agent 0 is 1, expected 2 as in summary.json"
        );
        let further = [(0, 3), (0, 3), (2, 4), (1, 1)];
        assert_eq!(
            whole.difference(further.into_iter()).unwrap(),
            "the number of episodes of agent 1 is 1, expected 0 as in summary.json"
        );
        // Of an earlier version, and of others.
        assert_eq!(
            noted(r#"{"env_steps": 11}"#)
                .difference(found.into_iter())
                .unwrap(),
            "the number of steps of all episodes is 10, expected 11 as in summary.json"
        );
        assert_eq!(noted("{}").difference(found.into_iter()), None);
    }
}
