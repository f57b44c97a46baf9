//! One run of a team in a finite task, measured as training is.

use std::sync::atomic::{AtomicBool, Ordering};

use super::measure::Curve;
use super::run_result::{Reservoir, RunResult};
use crate::run::measures::diversity::{Diversity, divergence};
use crate::tabular::TabularScenario;
use crate::tabular::team::{Step, TabularTeam};

/// Of teams with more counts than this, 64 MB, nothing is said about how their agents differ.
const MAX_COUNTS: usize = 1 << 24;

/// Plays once. `windows`: of which first episodes states are kept. `None` if interrupted.
#[must_use]
pub fn play(
    scenario: &TabularScenario,
    windows: &[u32],
    interrupted: &AtomicBool,
) -> Option<RunResult> {
    let mut team = TabularTeam::new(scenario);
    let mut played = Played::begin(scenario, &team, windows);
    while let Some(step) = team.advance() {
        if interrupted.load(Ordering::Relaxed) {
            return None;
        }
        played.take_in(&step, &team);
    }
    Some(played.finish(&team))
}

/// A run so far.
struct Played {
    measured: RunResult,
    reservoir: Reservoir,
    /// Visits of each state by each agent, unless these are too many: `[K × states]`.
    counts: Vec<u32>,
}

impl Played {
    fn begin(scenario: &TabularScenario, team: &TabularTeam, windows: &[u32]) -> Self {
        let agents = scenario.agents.count.get() as usize;
        let counts = agents * team.model().states();
        let measured = RunResult {
            returns: vec![Vec::new(); agents],
            regrets: vec![Vec::new(); agents],
            ..RunResult::default()
        };
        let counts = if counts <= MAX_COUNTS {
            vec![0; counts]
        } else {
            Vec::new()
        };
        Self {
            measured,
            reservoir: Reservoir::new(scenario.seed, windows),
            counts,
        }
    }

    /// An episode visits the states in which its agent acts, and the last one.
    fn take_in(&mut self, step: &Step, team: &TabularTeam) {
        self.visit(step, step.from, team);
        if let Some(episode) = step.ended {
            self.visit(step, step.to, team);
            self.measured.returns[step.agent as usize].push(episode.r#return as f32);
            self.measured.regrets[step.agent as usize].push(episode.regret as f32);
        }
    }

    fn visit(&mut self, step: &Step, state: u32, team: &TabularTeam) {
        if let Some(count) = self
            .counts
            .get_mut(step.agent as usize * team.model().states() + state as usize)
        {
            *count += 1;
        }
        self.reservoir.add(step.episode, team.model().place(state));
    }

    fn finish(mut self, team: &TabularTeam) -> RunResult {
        let states = team.model().states() as f64;
        let by_agents: f64 = team
            .visits()
            .iter()
            .map(|visits| f64::from(visits.agents))
            .sum();
        let agents = self.measured.returns.len();
        let diversity = (!self.counts.is_empty()).then(|| {
            Diversity::of(
                divergence(self.counts.chunks_exact(team.model().states())),
                agents,
            )
        });
        let at_the_end = |curve: Curve| match curve {
            Curve::Coverage => Some(by_agents / agents as f64 / states),
            Curve::TeamCoverage => Some(team.states_visited() as f64 / states),
            Curve::TeamOverlap => diversity.map(|diversity| diversity.overlap),
            Curve::EffectiveAgents => diversity.map(|diversity| diversity.effective_agents),
            _ => None,
        };
        self.measured.curves = Curve::WITH_ROUND_VALUES
            .iter()
            .map(|&curve| {
                at_the_end(curve)
                    .map(|value| value as f32)
                    .into_iter()
                    .collect()
            })
            .collect();
        self.measured.episodes = vec![self.measured.episodes_per_agent() as u32];
        self.measured.env_steps = team.steps();
        self.measured.states = self.reservoir.states();
        self.measured
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::measure::Measure;
    use seedbed_env::input;

    fn played(text: &str) -> RunResult {
        let scenario: TabularScenario = input::parse("test", text.to_owned()).unwrap().value;
        play(&scenario, &[u32::MAX], &AtomicBool::new(false)).unwrap()
    }

    /// Three agents with the same seed that begin at once, in a task of two rows without chance.
    #[test]
    fn a_run_tells_regret_goals_and_coverage() {
        let run = played(
            "TabularScenario(task: DeepSea(size: 2), agents: (count: 3), algorithm: SeedSampling(), episodes: 20)",
        );
        let of = |measure: Measure| measure.of(&run).unwrap();
        assert_eq!((run.returns.len(), run.episodes_per_agent()), (3, 20));
        assert!(
            of(Measure::Regret) > 0.0 && of(Measure::Regret) < 20.0,
            "{run:?}"
        );
        assert_eq!(of(Measure::Reach), 1.0);
        assert!((1.0..20.0).contains(&of(Measure::FirstGoal)));
        assert!((1.0..=3.0).contains(&of(Measure::Last {
            of: Curve::EffectiveAgents
        })));
        let total: f64 = run
            .regrets
            .iter()
            .flatten()
            .map(|&regret| f64::from(regret))
            .sum();
        assert!((of(Measure::Regret) - total / 3.0).abs() < 1e-6);
        assert_eq!(of(Measure::Coverage), 1.0, "all of so small a sea");
        assert_eq!(
            Measure::Mean {
                of: Curve::ValueLoss
            }
            .of(&run),
            None
        );
        assert_eq!(Measure::EpisodesToSolve.of(&run), None);
        // Two steps of each of 60 episodes, and the state after.
        assert_eq!((run.env_steps, run.states[0].visited), (120, 180));
    }

    #[test]
    fn an_interrupted_run_comes_to_nothing() {
        let scenario: TabularScenario =
            input::parse("test", "TabularScenario(task: DeepSea(size: 3))".to_owned())
                .unwrap()
                .value;
        assert_eq!(play(&scenario, &[], &AtomicBool::new(true)), None);
    }
}
