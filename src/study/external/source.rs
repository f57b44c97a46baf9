//! Results of others in study files: where the files are, and what in them is what.

use serde::{Deserialize, Serialize};

use crate::scenario::Threshold;
use seedbed_input::Located;
use seedbed_input::numbers::{Count, FiniteNumber, ranged_count};

/// Where the runs of a cell are that were not made by this study. Patterns are paths relative to the
/// folder of the study, with `*` for any text within a name, `?` for any character and `**` for
/// any folders.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum ResultsSource {
    /// Run directories of seedbed, or others with an `episodes.csv` that has its columns `agent`,
    /// `episode`, `round`, `env_steps` and `return`. Curves are from `rounds.csv`, if all have one.
    Runs(Located<String>),
    /// Stable-Baselines3's `monitor.csv`. A directory is one run: each `*.monitor.csv` in it is one
    /// agent or, with `agents: 1`, one copy of the environment of the only agent. A file is one run of one agent.
    Monitor(Located<String>),
    /// Event files of TensorBoard. A directory is one run of one agent.
    TensorBoard {
        /// The directories.
        runs: Located<String>,
        /// Tag of the returns, such as `charts/episodic_return`. Its steps are environment steps.
        tag: Located<String>,
        /// What a value is.
        #[serde(default)]
        values: Values,
    },
    /// CSV files with a header. A file is one run, unless `columns` names a column of the run, or one column for
    /// each run.
    Csv {
        /// The files.
        files: Located<String>,
        /// Names of the columns.
        #[serde(default)]
        columns: Columns,
        /// What a value is.
        #[serde(default, skip_serializing_if = "Values::are_returns")]
        values: Values,
    },
}

/// What a value of a curve of returns is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Values {
    /// The return of one episode; every episode has a value.
    #[default]
    Returns,
    /// A mean over several episodes, such as `rollout/ep_rew_mean`. Such runs have no number of
    /// episodes. Rows without a value are left out.
    Means,
}

impl Values {
    #[expect(
        clippy::trivially_copy_pass_by_ref,
        reason = "Serde passes a reference"
    )]
    fn are_returns(&self) -> bool {
        *self == Self::Returns
    }
}

/// Names of the columns of a CSV file. Rows are episodes, in the order in which they ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Columns {
    /// Return of the episode. With `*` for any text, such as in `* - charts/episodic_return` of a table exported
    /// from Weights & Biases, each matching column is one run, and rows without a value are of other runs.
    pub r#return: Located<String>,
    /// Environment steps of the team up to the end of the episode.
    pub env_steps: Option<Located<String>>,
    /// Number of steps of the episode, for files without `env_steps`. Agents of a team step together.
    pub length: Option<Located<String>>,
    /// Number of the agent's episode, from 0 or 1; if given, no number may be missing.
    pub episode: Option<Located<String>>,
    /// Name or number of the agent, for files with several agents.
    pub agent: Option<Located<String>>,
    /// Name or number of the run, for files with several runs.
    pub run: Option<Located<String>>,
}

impl Default for Columns {
    fn default() -> Self {
        Self {
            r#return: "return".to_owned().into(),
            env_steps: None,
            length: None,
            episode: None,
            agent: None,
            run: None,
        }
    }
}

/// When results of others count as solved: the mean return of all agents over their last episodes
/// reaches a threshold.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SolvedAt {
    /// Mean return.
    pub r#return: FiniteNumber,
    /// Number of episodes of each agent.
    #[serde(default = "default_window")]
    pub window: Count,
}

impl SolvedAt {
    /// The threshold.
    #[must_use]
    pub fn threshold(self) -> Threshold {
        Threshold {
            r#return: self.r#return.get(),
            window: self.window.get() as usize,
        }
    }
}

fn default_window() -> Count {
    ranged_count(25)
}

impl ResultsSource {
    /// What a value is.
    #[must_use]
    pub fn values(&self) -> Values {
        match self {
            Self::TensorBoard { values, .. } | Self::Csv { values, .. } => *values,
            Self::Runs(_) | Self::Monitor(_) => Values::Returns,
        }
    }

    /// The pattern of paths.
    #[must_use]
    pub fn pattern(&self) -> &Located<String> {
        match self {
            Self::Runs(pattern) | Self::Monitor(pattern) => pattern,
            Self::TensorBoard { runs, .. } => runs,
            Self::Csv { files, .. } => files,
        }
    }

    /// What the pattern must match, with an article.
    #[must_use]
    pub fn noun(&self) -> &'static str {
        match self {
            Self::Runs(_) => "a run directory with `episodes.csv`",
            Self::Monitor(_) => "a directory with `monitor.csv` or `*.monitor.csv`, or such a file",
            Self::TensorBoard { .. } => "a directory with an event file of TensorBoard",
            Self::Csv { .. } => "a CSV file",
        }
    }

    /// The source as in study files, such as `Monitor("sb3/ppo-*/")`.
    ///
    /// # Panics
    /// Never: plain data always serializes.
    #[must_use]
    pub fn text(&self) -> String {
        ron::to_string(self).expect("plain data always serializes")
    }
}
