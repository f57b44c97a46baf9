//! The summary of a run in training.

use super::Trainer;
use crate::run::facts::{SolvedAt, Summary};
use seedbed_learn::team::Workers;

impl Summary {
    /// The summary of a run so far.
    #[must_use]
    pub fn of(scenario: &str, seed: u64, trainer: &Trainer) -> Self {
        let measures = trainer.measures();
        let (threshold, visits) = (
            trainer.threshold(),
            measures.visit_statistics(Workers::CURRENT_THREAD),
        );
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
            repeatability_warning: None,
            physics_warning: trainer.physics_warning().map(ToString::to_string),
        }
    }
}
