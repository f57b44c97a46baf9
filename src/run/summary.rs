//! The results of a run in a few numbers: `summary.json`.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::checksums::{Checksums, DamagedFile};
use super::folder::RunFolder;
use super::trainer::Trainer;
use seedbed_input::limits::{MAX_SMALL_FILE_BYTES, read_bytes};

/// The results of a run in a few numbers. What is not known of a run that another program recorded
/// is `None` or empty.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// The scenario's name.
    pub scenario: String,
    /// The task's name.
    pub environment: String,
    /// The run seed.
    #[serde(default)]
    pub seed: Option<u64>,
    /// Number of agents K.
    pub agents: usize,
    /// Number of rounds.
    pub rounds: u32,
    /// Number of episodes per agent.
    pub episodes_per_agent: usize,
    /// Number of environment steps of the whole team.
    pub env_steps: u64,
    /// The threshold at which the task counts as solved, if there is one.
    pub solved_at: Option<SolvedAt>,
    /// Number of episodes per agent until the threshold was reached; `None` if it was not.
    pub episodes_until_solved: Option<usize>,
    /// Mean return over agents and over the last [`FINAL_WINDOW`] episodes of each agent; `None` if an
    /// agent has finished none.
    pub final_return: Option<f64>,
    /// Share of the state space that each agent visited, 0 to 1: `[K]`.
    #[serde(default)]
    pub coverage: Vec<f64>,
    /// Share of the state space that the team visited, 0 to 1.
    #[serde(default)]
    pub team_coverage: Option<f64>,
    /// Entropy of each agent's visits, nats: `[K]`.
    #[serde(default)]
    pub visitation_entropy: Vec<f64>,
    /// `visitation_entropy` divided by its maximum, 0 to 1: `[K]`.
    #[serde(default)]
    pub visitation_evenness: Vec<f64>,
    /// Overlap of the agents' visited states, 0 to 1.
    #[serde(default)]
    pub team_overlap: Option<f64>,
    /// Effective number of agents, 1 to K: the number of agents without overlap that would be as
    /// diverse as the team.
    #[serde(default)]
    pub effective_agents: Option<f64>,
    /// What the physics of the task could not compute well: the first place.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub physics_warning: Option<String>,
}

/// The threshold at which a task counts as solved.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SolvedAt {
    /// Mean return over all agents and the window.
    pub r#return: f64,
    /// Number of episodes per agent.
    pub window: usize,
}

/// Number of episodes per agent over which the final return is averaged.
pub const FINAL_WINDOW: usize = 25;

impl Summary {
    /// The summary of the run in a folder; `None` if the run is not finished.
    ///
    /// # Errors
    /// The file is damaged or was changed after it was written, or cannot be read.
    pub fn read(folder: &RunFolder) -> Result<Option<Self>, DamagedFile> {
        read_verified(folder)
    }

    /// The summary of a run so far.
    #[must_use]
    pub fn of(scenario: &str, seed: u64, trainer: &Trainer) -> Self {
        let measures = trainer.measures();
        let (threshold, visits) = (trainer.threshold(), measures.visit_statistics());
        Self {
            scenario: scenario.to_owned(),
            environment: trainer.spec().name.clone(),
            seed: Some(seed),
            agents: trainer.agent_count(),
            rounds: trainer.rounds(),
            episodes_per_agent: measures.episodes_per_agent(),
            env_steps: measures.env_steps(),
            solved_at: threshold.map(|threshold| SolvedAt {
                r#return: threshold.r#return,
                window: threshold.window,
            }),
            episodes_until_solved: threshold
                .and_then(|threshold| measures.episodes_until(threshold)),
            final_return: measures.final_return(),
            coverage: measures.coverage().collect(),
            team_coverage: Some(visits.team_coverage),
            visitation_entropy: visits.entropy,
            visitation_evenness: visits.evenness,
            team_overlap: Some(visits.diversity.overlap),
            effective_agents: Some(visits.diversity.effective_agents),
            physics_warning: trainer.physics_warning().map(ToString::to_string),
        }
    }
}

/// Reads `summary.json` of the run in a folder, as far as `T` describes it. `None` if the run is not
/// finished.
///
/// # Errors
/// The file is damaged or was changed after it was written, or cannot be read.
pub(super) fn read_verified<T: DeserializeOwned>(
    folder: &RunFolder,
) -> Result<Option<T>, DamagedFile> {
    let path = folder.summary_file();
    let checksums = Checksums::read(folder)?;
    checksums.check_presence(&path)?;
    if !path.is_file() {
        return Ok(None);
    }
    checksums.verify(&path)?;
    let bytes = read_bytes(&path, MAX_SMALL_FILE_BYTES).map_err(|error| error.to_string());
    let read =
        bytes.and_then(|bytes| serde_json::from_slice(&bytes).map_err(|error| error.to_string()));
    read.map(Some)
        .map_err(|reason| DamagedFile { path, reason })
}
