//! What the runs of a cell do: agents that learn in an environment, or a team in a finite task.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use serde::de::DeserializeOwned;
use xxhash_rust::xxh64::Xxh64;

use super::finite;
use super::measure::{Measure, Needs};
use super::run_result::{RunResult, StopRule, train};
use crate::record::RecordingSettings;
use crate::run::{Plan, RunError};
use crate::scenario::overrides::{self, Resolve};
use crate::scenario::{self, Scenario};
use crate::tabular::{self, TabularScenario};
use seedbed_env::input::numbers::known_count;
use seedbed_env::input::{Document, InputError, Located, ValidationError};
use seedbed_env::{Quantity, Spec};

/// What runs, with any seed.
#[derive(Clone, Debug)]
pub enum Experiment {
    /// Agents learn.
    Training(Box<Plan>),
    /// A team explores tables.
    Finite(Box<Finite>),
}

/// A team in a finite task.
#[derive(Clone, Debug)]
pub struct Finite {
    /// The scenario.
    pub scenario: TabularScenario,
    /// Where states are, and for how long episodes last.
    pub spec: Spec,
}

/// A value that replaces another one, as `path=value`, with the place that is to blame for it.
pub(super) type Override<'a> = (&'a Located<String>, String);

impl Experiment {
    /// Reads the scenario at `path`, which stands at `place`, and applies `overrides`; `blamed`
    /// stands for the cell as a whole.
    pub(super) fn load(
        path: &Path,
        place: &Located<String>,
        overrides: &[Override<'_>],
        blamed: &Located<String>,
    ) -> Result<Self, ValidationError> {
        if tabular::scenario::is_meant(path) {
            let scenario = overridden(tabular::scenario::load(path, &[]), place, overrides)?.value;
            let scenario = TabularScenario {
                seed: 0,
                ..scenario
            };
            let spec = tabular::recording::spec(&scenario, &scenario.task.model(0));
            return Ok(Self::Finite(Box::new(Finite { scenario, spec })));
        }
        let document = overridden(scenario::load(path, &[]), place, overrides)?;
        let plan = Plan::of(document, path).map_err(|error| repeated(blamed, &error))?;
        Ok(Self::Training(Box::new(Plan {
            scenario: bare(plan.scenario),
            ..plan
        })))
    }

    /// Runs once. `windows`: of which first episodes states are kept. `None` if interrupted.
    ///
    /// # Errors
    /// The task cannot be built, or numbers ceased to be finite.
    pub fn run(
        &self,
        seed: u64,
        windows: &[u32],
        interrupted: &AtomicBool,
    ) -> Result<Option<RunResult>, RunError> {
        match self {
            Self::Training(plan) => {
                let mut plan = plan.clone();
                plan.scenario.seed = seed;
                train(&plan, StopRule::Scenario, windows, interrupted)
            }
            Self::Finite(finite) => {
                let scenario = TabularScenario {
                    seed,
                    ..finite.scenario.clone()
                };
                Ok(finite::play(&scenario, windows, interrupted))
            }
        }
    }

    /// Tells what runs depend on, besides their seeds: a hash of the resolved scenario and of its
    /// task's file.
    #[must_use]
    pub fn digest(&self) -> String {
        let mut hash = Xxh64::new(0);
        match self {
            Self::Training(plan) => {
                hash.update(learned(&plan.scenario).as_bytes());
                hash.update(&[0]);
                hash.update(plan.environment_text.as_bytes());
            }
            Self::Finite(finite) => hash.update(finite.scenario.resolved().as_bytes()),
        }
        format!("{:016x}", hash.digest())
    }

    /// K.
    #[must_use]
    pub fn agents(&self) -> u32 {
        match self {
            Self::Training(plan) => plan.scenario.agents.count.get(),
            Self::Finite(finite) => finite.scenario.agents.count.get(),
        }
    }

    /// Episodes of each agent after which a run ends at the latest.
    #[must_use]
    pub fn max_episodes(&self) -> u32 {
        match self {
            Self::Training(plan) => plan.scenario.max_episodes(),
            Self::Finite(finite) => finite.scenario.episodes.get(),
        }
    }

    /// The name of its task.
    #[must_use]
    pub fn task(&self) -> &str {
        &self.spec().name
    }

    /// What its agents observe.
    #[must_use]
    pub fn observations(&self) -> &[Quantity] {
        &self.spec().observations
    }

    fn spec(&self) -> &Spec {
        match self {
            Self::Training(plan) => plan.description.spec(),
            Self::Finite(finite) => &finite.spec,
        }
    }

    /// Why its runs cannot tell a measure, if so, and what to do about that.
    #[must_use]
    pub fn lacks(&self, measure: Measure) -> Option<(&'static str, &'static str)> {
        let (needs, threshold) = (measure.needs(), self.threshold());
        let is_finite = matches!(self, Self::Finite(_));
        match needs {
            Needs::Tables if !is_finite => Some((
                "the regret of training is not known",
                "expected another measure, or the scenario of a finite task",
            )),
            Needs::Rounds if is_finite => Some((
                "a finite task has no rounds of learning",
                "expected another measure, such as `Regret` or `Coverage`",
            )),
            Needs::Threshold if is_finite => Some((
                "nothing says when a finite task counts as solved",
                "expected another measure, such as `Regret` or `Reach`",
            )),
            Needs::Threshold | Needs::Goal if threshold.is_none() && !is_finite => Some((
                "nothing says when its task counts as solved",
                "expected another measure, or `stop: Solved(return: …, at_most: …)` in its scenario",
            )),
            _ => None,
        }
    }

    /// The mean return at which its task counts as solved, if anything says so.
    fn threshold(&self) -> Option<f64> {
        let Self::Training(plan) = self else {
            return None;
        };
        let threshold = plan.scenario.stop.threshold(plan.description.spec());
        threshold.map(|threshold| threshold.r#return)
    }

    /// A rough guess at a run's work, in steps of learning: only the order of runs and the time
    /// that is left are guessed from it.
    #[must_use]
    pub fn cost(&self) -> f64 {
        let steps = f64::from(self.max_episodes())
            * f64::from(self.spec().time_limit)
            * f64::from(self.agents());
        steps * (1.0 + self.learning())
    }

    /// Work for each step beside that of acting.
    fn learning(&self) -> f64 {
        let Self::Training(plan) = self else {
            return 10.0;
        };
        let scenario = &plan.scenario;
        let config = scenario.algorithm.config();
        config.cost_per_step(scenario.agents.count.get())
    }
}

fn overridden<T: Resolve + DeserializeOwned>(
    read: Result<Document<T>, InputError>,
    place: &Located<String>,
    overrides: &[Override<'_>],
) -> Result<Document<T>, ValidationError> {
    let mut document = read.map_err(|error| repeated(place, &error))?;
    for (place, text) in overrides {
        document = overrides::apply(&document, text).map_err(|error| repeated(place, &error))?;
    }
    Ok(document)
}

/// The same error at a place of the study.
fn repeated(place: &Located<String>, error: &InputError) -> ValidationError {
    let inner = InputError {
        position: None,
        help: None,
        ..error.clone()
    };
    let repeated = place.error(inner.to_string());
    match &error.help {
        Some(help) => repeated.with_help(help.clone()),
        None => repeated,
    }
}

/// The scenario's text without how many rounds its pictures show: the names of stored runs are
/// digests of such texts.
fn learned(scenario: &Scenario) -> String {
    let window = format!("        window: {},\n", scenario.recording.window.get());
    let text = scenario.resolved();
    match text.split_once("\n    recording: (\n") {
        Some((before, rest)) => format!(
            "{before}\n    recording: (\n{}",
            rest.replacen(&window, "", 1)
        ),
        None => text,
    }
}

/// Without what makes no difference to what is learned.
fn bare(mut scenario: Scenario) -> Scenario {
    scenario.recording = RecordingSettings {
        scene: None,
        ..RecordingSettings::default()
    };
    scenario.checkpoint_every = known_count(1);
    scenario.seed = 0;
    scenario
}

#[cfg(test)]
mod tests {
    use super::*;

    fn digest(overrides: &[&str]) -> String {
        let here: Located<String> = "here".to_owned().into();
        let overrides: Vec<Override<'_>> = overrides
            .iter()
            .map(|text| (&here, (*text).to_owned()))
            .collect();
        Experiment::load(
            Path::new("scenarios/cartpole.ron"),
            &here,
            &overrides,
            &here,
        )
        .expect("a scenario")
        .digest()
    }

    /// Stored runs are found by their digests. This one names the runs of a study of `cartpole.ron`
    /// and nothing else, in files such as `runs/eb5eb0b70768f8e1-1000.run`; it changes with the
    /// scenario's text, its defaults, and `envs/cartpole.ron`.
    #[test]
    fn what_a_recording_shows_is_not_in_the_digest() {
        assert_eq!(digest(&[]), "eb5eb0b70768f8e1");
        assert_eq!(
            digest(&[
                "recording.window=7",
                "recording.lines=10",
                "recording.scene=None"
            ]),
            digest(&[])
        );
        assert_ne!(digest(&["agents.count=5"]), digest(&[]));
        // There the stop has a window as well, of 50 episodes.
        assert_ne!(
            digest(&["stop=Solved(return: 1, window: 50, at_most: 99)"]),
            digest(&["stop=Solved(return: 1, window: 51, at_most: 99)"])
        );
    }
}
