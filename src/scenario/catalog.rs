//! Documentation of the fields of a scenario, for `seedbed list`.

use super::Scenario;
use crate::scenario::recording::RecordingSettings;
use seedbed_learn::agent::TeamConfig;
use seedbed_learn::algorithms::catalog::{Parameter, parameters};

/// Fields that are not listed: their own fields are listed instead, or they are documented
/// elsewhere.
const OMITTED_FIELDS: [&str; 4] = ["environment", "agents", "algorithm", "recording"];

impl Scenario {
    /// Parameters of a scenario with their defaults: those of the scenario itself, its team and its
    /// recording, without those of its algorithm.
    #[must_use]
    pub fn catalog() -> Vec<Parameter> {
        let mut catalog = with_prefix("agents", parameters(&TeamConfig::default()));
        let direct_fields = parameters(&Self::with_defaults());
        catalog.extend(
            direct_fields
                .into_iter()
                .filter(|field| !OMITTED_FIELDS.contains(&field.name.as_str())),
        );
        catalog.extend(with_prefix(
            "recording",
            parameters(&RecordingSettings::default()),
        ));
        catalog
    }
}

/// Adds the name of a field of the scenario as prefix to the names of the field's parameters.
fn with_prefix(name: &str, mut parameters: Vec<Parameter>) -> Vec<Parameter> {
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
        let catalog = Scenario::catalog();
        for name in [
            "agents.count",
            "physics",
            "schedule",
            "seed",
            "recording.lines",
        ] {
            assert!(
                catalog.iter().any(|parameter| parameter.name == name),
                "{name}"
            );
        }
        for parameter in catalog {
            assert!(!parameter.meaning.is_empty(), "{parameter:?}");
            assert!(!parameter.default.is_empty(), "{parameter:?}");
        }
    }
}
