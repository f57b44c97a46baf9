//! Documentation of the fields of a scenario, for `seedbed list`.

use super::Scenario;
use crate::record::RecordingSettings;
use seedbed_learn::agent::TeamConfig;
use seedbed_learn::algorithms::catalogue::{Parameter, parameters};

/// Fields whose own fields are listed, or that are documented elsewhere.
const NESTED: [&str; 4] = ["environment", "agents", "algorithm", "recording"];

impl Scenario {
    /// Parameters of a scenario besides its algorithm's, with their defaults; includes those of its
    /// team and its recording.
    #[must_use]
    pub fn catalogue() -> Vec<Parameter> {
        let mut all = fields_of("agents", parameters(&TeamConfig::default()));
        let own = parameters(&Self::with_defaults());
        all.extend(
            own.into_iter()
                .filter(|own| !NESTED.contains(&own.name.as_str())),
        );
        all.extend(fields_of(
            "recording",
            parameters(&RecordingSettings::default()),
        ));
        all
    }
}

/// Parameters of the field `name` of a scenario, with its name as prefix.
fn fields_of(name: &str, mut parameters: Vec<Parameter>) -> Vec<Parameter> {
    for parameter in &mut parameters {
        parameter.name = format!("{name}.{}", parameter.name);
    }
    parameters
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
