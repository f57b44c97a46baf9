//! The summary of a run in training.

use super::TrainerOnRanks;
use crate::run::facts::{SolvedAt, Summary};

impl Summary {
    /// The summary of a run so far.
    #[must_use]
    pub fn of(scenario: &str, seed: u64, trainer: &TrainerOnRanks<'_>) -> Self {
        let visits = trainer.visit_statistics();
        let trainer = trainer.local();
        let (measures, threshold) = (trainer.measures(), trainer.threshold());
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
            coverage: visits.coverage,
            team_coverage: Some(visits.team_coverage),
            visitation_entropy: visits.entropy,
            visitation_evenness: visits.evenness,
            team_overlap: Some(visits.diversity.overlap),
            effective_agents: Some(visits.diversity.effective_agents),
            repeatability_warning: None,
            physics_warning: trainer.physics_warning().map(ToString::to_string),
        }
    }
}
