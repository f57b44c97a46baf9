//! Tabular runs as experiments.

use std::sync::atomic::{AtomicBool, Ordering};

use super::{Experiment, RunControl, RunEnding, RunReport, StopRule};
use crate::experiment::measure::{Curve, Measure, Needs};
use crate::experiment::run_result::{Reservoir, RunResult};
use crate::run::execution::stopping::with_grace;
use crate::run::measures::diversity::{Diversity, divergence};
use crate::run::recorder::RecorderFactory;
use crate::run::{Observer, Options, RunError};
use crate::scenario::resolve::Resolve;
use crate::tabular::recording::MAX_AGENTS;
use crate::tabular::results::Summary;
use crate::tabular::run::{self, Ending};
use crate::tabular::team::{Step, TabularTeam};
use crate::tabular::{Algorithm, TabularPlan, TabularScenario};
use crate::text::pluralize;
use seedbed_env::TaskSpec;
use seedbed_learn::algorithms::RandomActions;
use seedbed_settings::Settings;

impl Experiment for TabularPlan {
    fn name(&self) -> &str {
        &self.name
    }

    fn run_seed(&self) -> u64 {
        self.scenario.seed
    }

    fn spec(&self) -> &TaskSpec {
        &self.spec
    }

    fn task_definition(&self) -> String {
        format!("{:?}", self.scenario.task)
    }

    fn agents(&self) -> u32 {
        self.scenario.agents.count.get()
    }

    fn max_episodes(&self) -> u32 {
        self.scenario.episodes.get()
    }

    fn random_actions(&self) -> RandomActions {
        RandomActions {
            are_correlated: false,
            are_open_loop: matches!(self.scenario.algorithm, Algorithm::Random),
        }
    }

    fn settings(&self) -> Settings {
        let scenario = with_run_seed(&self.scenario, 0);
        seedbed_input::settings_of::<TabularScenario>(&scenario.resolved())
    }

    /// Of each state and agent, the numbers of visits and the agent's own policy.
    fn memory(&self) -> u64 {
        const BYTES_PER_STATE: u64 = 64;
        let states = self.scenario.task.model(0).state_count() as u64;
        u64::from(self.agents()).saturating_mul(BYTES_PER_STATE * states)
    }

    fn learning_cost(&self) -> f64 {
        10.0
    }

    fn measure_obstacle(&self, measure: Measure) -> Option<(&'static str, &'static str)> {
        match measure.needs() {
            Needs::Rounds => Some((
                "a tabular run has no rounds of learning",
                "expected another measure, such as `Regret` or `Coverage`",
            )),
            Needs::Threshold => Some((
                "tabular tasks have no threshold at which they count as solved",
                "expected another measure, such as `Regret` or `Reach`",
            )),
            Needs::Nothing | Needs::Goal | Needs::Tables => None,
        }
    }

    fn has_networks(&self) -> bool {
        false
    }

    fn recording_obstacle(&self) -> Option<String> {
        (self.agents() > MAX_AGENTS)
            .then(|| format!("only teams of at most {MAX_AGENTS} agents are recorded"))
    }

    /// Without checkpoints: tabular runs are short.
    fn measure_once(
        &self,
        run_seed: u64,
        _: StopRule,
        windows: &[u32],
        control: RunControl<'_>,
    ) -> Result<Option<RunResult>, RunError> {
        let scenario = with_run_seed(&self.scenario, run_seed);
        let measured = with_grace(control.interrupted, |cancellation| {
            cancellation.run(|| measure_run(&scenario, windows, control.interrupted))
        });
        Ok(measured.flatten())
    }

    fn run_in_folder(
        &self,
        options: &Options,
        recording: Option<Box<dyn RecorderFactory>>,
        observer: &mut dyn Observer,
        interrupted: &AtomicBool,
    ) -> Result<RunEnding, RunError> {
        let ending = run::execute(self, options, recording, observer, interrupted)?;
        Ok(match ending {
            Ending::Finished(summary) => RunEnding::Finished(report(&summary, options)),
            Ending::Interrupted { episodes } => RunEnding::Interrupted {
                after: pluralize(episodes, "episode"),
                can_resume: false,
            },
        })
    }

    fn knows_regret(&self) -> bool {
        true
    }
}

fn with_run_seed(scenario: &TabularScenario, seed: u64) -> TabularScenario {
    TabularScenario {
        seed,
        ..scenario.clone()
    }
}

fn report(summary: &Summary, options: &Options) -> RunReport {
    let Summary {
        optimal_value,
        regret_per_agent,
        cumulative_regret,
        episodes_without_regret,
        states_visited,
        states,
        ..
    } = summary;
    let folder = options.folder.path().display();
    RunReport {
        episodes_per_agent: summary.episodes_per_agent as usize,
        env_steps: summary.env_steps,
        lines: vec![
            (
                "optimal",
                format!("expected return {optimal_value:.3} per episode"),
            ),
            (
                "regret",
                format!("{regret_per_agent:.3} per agent, {cumulative_regret:.1} in total"),
            ),
            (
                "no regret",
                format!("in {:.1} % of episodes", 100.0 * episodes_without_regret),
            ),
            ("visited", format!("{states_visited} of {states} states")),
            (
                "results",
                format!("{folder}: regret.csv, visits.csv, summary.json, scenario.ron"),
            ),
        ],
    }
}

/// Maximum number of visit counts, K × states, for which differences between agents are measured.
/// They need 64 MB.
const MAX_COUNTS: usize = 1 << 24;

/// Runs once. For each number n in `windows`, the result has a sample of the states visited in the
/// first n episodes of each agent. `None` if interrupted.
fn measure_run(
    scenario: &TabularScenario,
    windows: &[u32],
    interrupted: &AtomicBool,
) -> Option<RunResult> {
    let mut team = TabularTeam::new(scenario);
    let mut measures = TabularMeasures::new(scenario, &team, windows);
    while let Some(step) = team.advance() {
        if interrupted.load(Ordering::Relaxed) {
            return None;
        }
        measures.add_step(&step, &team);
    }
    Some(measures.finish(&team))
}

/// Measures of a tabular run so far.
struct TabularMeasures {
    result: RunResult,
    reservoir: Reservoir,
    /// Number of visits of each state by each agent: `[K × states]`; empty if there would be more
    /// than [`MAX_COUNTS`].
    counts: Vec<u32>,
}

impl TabularMeasures {
    fn new(scenario: &TabularScenario, team: &TabularTeam, windows: &[u32]) -> Self {
        let agents = scenario.agents.count.get() as usize;
        let needed_counts = agents * team.model().state_count();
        Self {
            result: RunResult {
                returns: vec![Vec::new(); agents],
                episode_ends: vec![Vec::new(); agents],
                regrets: vec![Vec::new(); agents],
                ..RunResult::default()
            },
            reservoir: Reservoir::new(scenario.seed, windows),
            counts: vec![
                0;
                if needed_counts <= MAX_COUNTS {
                    needed_counts
                } else {
                    0
                }
            ],
        }
    }

    /// Adds the states that a step visits: the state in which the agent acts and, at the end of an
    /// episode, its last state.
    fn add_step(&mut self, step: &Step, team: &TabularTeam) {
        self.add_visit(step, step.from, team);
        if let Some(episode) = step.ended_episode {
            self.add_visit(step, step.to, team);
            let agent = step.agent as usize;
            self.result.add_return(agent, episode.r#return);
            self.result.episode_ends[agent].push(team.steps());
            self.result.regrets[agent].push(episode.regret as f32);
        }
    }

    fn add_visit(&mut self, step: &Step, state: u32, team: &TabularTeam) {
        let index = step.agent as usize * team.model().state_count() + state as usize;
        if let Some(count) = self.counts.get_mut(index) {
            *count += 1;
        }
        self.reservoir
            .add(step.agent, step.episode, team.model().coordinates_of(state));
    }

    fn finish(mut self, team: &TabularTeam) -> RunResult {
        let diversity = self.diversity(team);
        let mut curves = Vec::with_capacity(Curve::WITH_ROUND_VALUES.len());
        for &curve in Curve::WITH_ROUND_VALUES {
            let value = self.final_value(curve, team, diversity);
            curves.push(value.map(|value| value as f32).into_iter().collect());
        }
        self.result.curves = curves;
        self.result.episodes = vec![self.result.episodes_per_agent() as u32];
        self.result.env_steps = team.steps();
        self.result.states = self.reservoir.into_samples();
        self.result
    }

    /// Value of a curve at the end of the run; `None` if it is not measured in tabular runs.
    fn final_value(
        &self,
        curve: Curve,
        team: &TabularTeam,
        diversity: Option<Diversity>,
    ) -> Option<f64> {
        let states = team.model().state_count() as f64;
        match curve {
            Curve::Coverage => {
                let visitors = team.visits().iter().map(|visits| f64::from(visits.agents));
                let agents = self.result.returns.len() as f64;
                Some(visitors.sum::<f64>() / agents / states)
            }
            Curve::TeamCoverage => Some(team.states_visited() as f64 / states),
            Curve::TeamOverlap => diversity.map(|diversity| diversity.overlap),
            Curve::EffectiveAgents => diversity.map(|diversity| diversity.effective_agents),
            _ => None,
        }
    }

    /// Differences between the visits of the agents; `None` if visits were not counted per agent.
    fn diversity(&self, team: &TabularTeam) -> Option<Diversity> {
        if self.counts.is_empty() {
            return None;
        }
        let per_agent = self.counts.chunks_exact(team.model().state_count());
        Some(Diversity::from_divergence(
            divergence(per_agent),
            self.result.returns.len(),
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scenario(text: &str) -> TabularScenario {
        seedbed_input::parse("test", text.to_owned()).unwrap().value
    }

    /// Three agents in a deterministic task of two rows.
    #[test]
    fn regret_goals_and_coverage_are_measured() {
        let scenario = scenario(
            "TabularScenario(task: DeepSea(size: 2), agents: (count: 3), algorithm: SeedSampling(), episodes: 20)",
        );
        let run = measure_run(&scenario, &[u32::MAX], &AtomicBool::new(false)).unwrap();
        let value_of = |measure: Measure| measure.of(&run).unwrap();
        assert_eq!((run.returns.len(), run.episodes_per_agent()), (3, 20));
        assert!(
            value_of(Measure::Regret) > 0.0 && value_of(Measure::Regret) < 20.0,
            "{run:?}"
        );
        assert_eq!(value_of(Measure::Reach), 1.0);
        assert!((1.0..20.0).contains(&value_of(Measure::FirstGoal)));
        assert!((1.0..=3.0).contains(&value_of(Measure::Last {
            of: Curve::EffectiveAgents
        })));
        let total: f64 = run
            .regrets
            .iter()
            .flatten()
            .map(|&regret| f64::from(regret))
            .sum();
        assert!((value_of(Measure::Regret) - total / 3.0).abs() < 1e-6);
        assert_eq!(value_of(Measure::Coverage), 1.0, "every state is visited");
        assert_eq!(
            Measure::Mean {
                of: Curve::ValueLoss
            }
            .of(&run),
            None
        );
        assert_eq!(Measure::EpisodesToSolve.of(&run), None);
        // Each of the 60 episodes has two steps and three visited states.
        assert_eq!((run.env_steps, run.states[0].visited), (120, 180));
    }

    #[test]
    fn an_interrupted_run_has_no_result() {
        let scenario = scenario("TabularScenario(task: DeepSea(size: 3))");
        assert_eq!(measure_run(&scenario, &[], &AtomicBool::new(true)), None);
    }
}
