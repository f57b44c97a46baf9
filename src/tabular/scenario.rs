//! Tabular scenario files: `TabularScenario(…)` in `scenarios/tabular/`.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::Algorithm;
use crate::input_files;
use crate::scenario::overrides;
use crate::scenario::resolve::Resolve;
use seedbed_env::tabular::TaskFamily;
use seedbed_input::edit::to_ron_string;
use seedbed_input::numbers::{Count, NonNegative, ranged_count, ranged_number};
use seedbed_input::{Document, InputError};

/// A scenario of a team that knows the states and actions of its task.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TabularScenario {
    /// Family of tasks, from which the run draws one.
    pub task: TaskFamily,
    /// Number of agents, and when they begin.
    #[serde(default)]
    pub agents: Agents,
    /// How the agents explore.
    #[serde(default)]
    pub algorithm: Algorithm,
    /// Number of episodes per agent, one after the other.
    #[serde(default = "one")]
    pub episodes: Count<100_000>,
    /// Run seed, from which all random numbers are derived.
    #[serde(default)]
    pub seed: u64,
}

/// Number of agents, and when they begin.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Agents {
    /// Number of agents K.
    pub count: Count<100_000>,
    /// When the agents begin.
    pub starts: Starts,
}

/// When agents begin. The unit of time is the mean time between two actions of an agent, which is
/// exponentially distributed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Starts {
    /// One after the other; the time between the starts of two agents is exponentially distributed.
    OneByOne {
        /// Mean time between the starts of two agents.
        #[serde(default = "default_gap")]
        mean_gap: NonNegative,
    },
    /// All at once.
    Together,
}

impl Default for Agents {
    fn default() -> Self {
        Self {
            count: ranged_count(100),
            starts: Starts::default(),
        }
    }
}

impl Default for Starts {
    fn default() -> Self {
        Self::OneByOne {
            mean_gap: default_gap(),
        }
    }
}

fn default_gap() -> NonNegative {
    ranged_number(1.0)
}

fn one() -> Count<100_000> {
    ranged_count(1)
}

/// Reads the scenario at `path` and applies `overrides`, each as `path.to.field=value`.
///
/// # Errors
/// If the file or an override is invalid.
pub fn load(path: &Path, overrides: &[String]) -> Result<Document<TabularScenario>, InputError> {
    overrides::apply_all(
        overrides::parse(path, &input_files::read_text(path)?)?,
        overrides,
    )
}

impl Resolve for TabularScenario {
    fn resolved(&self) -> String {
        to_ron_string("TabularScenario", self)
    }

    fn examples(_: &str) -> Vec<String> {
        vec!["TabularScenario(task: BipolarChain())".to_owned()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shortest_scenario_resolves_to_one_that_reads_back_the_same() {
        let short: Document<TabularScenario> =
            seedbed_input::parse("test", "TabularScenario(task: DeepSea(size: 5))".to_owned())
                .unwrap();
        let text = short.value.resolved();
        assert!(
            text.starts_with("TabularScenario(\n    task: DeepSea(\n        size: 5,\n"),
            "{text}"
        );
        let again: Document<TabularScenario> = seedbed_input::parse("test", text).unwrap();
        assert_eq!(short.value, again.value);
    }

    #[test]
    fn overrides_replace_values() {
        let document: Document<TabularScenario> =
            seedbed_input::parse("test", "TabularScenario(task: BipolarChain())".to_owned())
                .unwrap();
        let assignments = [
            "task.vertices=50",
            "agents.count=1000",
            "agents.starts=Together",
            "algorithm=Ucrl(width: 3)",
        ];
        let changed = overrides::apply_all(document, &assignments.map(str::to_owned))
            .unwrap()
            .value
            .resolved();
        for expected in [
            "vertices: 50,",
            "count: 1000,",
            "starts: Together,",
            "width: 3.0,",
        ] {
            assert!(changed.contains(expected), "{expected} in {changed}");
        }
    }
}
