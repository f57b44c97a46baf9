//! What a scenario can set besides its algorithm, for people.

use super::Scenario;
use crate::record::RecordingSettings;
use seedbed_learn::agent::TeamConfig;
use seedbed_learn::algorithms::catalogue::{Parameter, parameters};

/// Fields that are documented field by field, or elsewhere.
const NESTED: [&str; 4] = ["environment", "agents", "algorithm", "recording"];

impl Scenario {
    /// The parameters of a scenario, those of its team and its recording included, with their
    /// defaults.
    #[must_use]
    pub fn catalogue() -> Vec<Parameter> {
        let mut all = of_field("agents", parameters(&TeamConfig::default()));
        let own = parameters(&Self::shortest());
        all.extend(
            own.into_iter()
                .filter(|own| !NESTED.contains(&own.name.as_str())),
        );
        all.extend(of_field(
            "recording",
            parameters(&RecordingSettings::default()),
        ));
        all
    }
}

/// The parameters of a struct that is the field `name` of a scenario.
fn of_field(name: &str, parameters: Vec<Parameter>) -> Vec<Parameter> {
    let named = |parameter: Parameter| Parameter {
        name: format!("{name}.{}", parameter.name),
        ..parameter
    };
    parameters.into_iter().map(named).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_parameter_has_a_meaning_and_a_default() {
        let all = Scenario::catalogue();
        for name in [
            "agents.count",
            "physics",
            "schedule",
            "seed",
            "recording.lines",
        ] {
            assert!(all.iter().any(|parameter| parameter.name == name), "{name}");
        }
        for parameter in all {
            assert!(!parameter.meaning.is_empty(), "{parameter:?}");
            assert!(!parameter.default.is_empty(), "{parameter:?}");
        }
    }
}
