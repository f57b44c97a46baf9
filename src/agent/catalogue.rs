//! What can be set, for people: every algorithm with its parameters, their meaning and their defaults.

use ron::extensions::Extensions;
use ron::ser::PrettyConfig;
use serde::Serialize;

use super::Algorithm;
use super::q_learning::{config as values, meanings};
use super::seed_pg::config as seed_pg;

/// An algorithm as a user may choose it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Catalogued {
    /// Its name in a scenario.
    pub name: &'static str,
    /// What it is for, in a sentence.
    pub purpose: &'static str,
    /// What can be set.
    pub parameters: Vec<Parameter>,
}

/// One parameter of an algorithm.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parameter {
    /// Its name in a scenario.
    pub name: String,
    /// What it means, and what may stand there.
    pub meaning: &'static str,
    /// Its default, as one writes it.
    pub default: String,
}

impl Algorithm {
    /// Every algorithm with its parameters and defaults.
    #[must_use]
    pub fn catalogue() -> Vec<Catalogued> {
        vec![
            Catalogued {
                name: "SeedPg",
                purpose: seed_pg::PURPOSE,
                parameters: parameters(&seed_pg::SeedPg::default(), &seed_pg::PARAMETERS),
            },
            Catalogued {
                name: "QLearning",
                purpose: meanings::PURPOSES[0],
                parameters: parameters(&values::QLearning::default(), &meanings::Q_LEARNING),
            },
            Catalogued {
                name: "SeedTd",
                purpose: meanings::PURPOSES[1],
                parameters: parameters(&values::SeedTd::default(), &meanings::SEED_TD),
            },
            Catalogued {
                name: "BootstrappedDqn",
                purpose: meanings::PURPOSES[2],
                parameters: parameters(
                    &values::BootstrappedDqn::default(),
                    &meanings::BOOTSTRAPPED_DQN,
                ),
            },
            Catalogued {
                name: "Random",
                purpose: "Uniformly random actions: the control that learning has to beat.",
                parameters: Vec::new(),
            },
        ]
    }
}

/// Pairs each field of a default configuration with its meaning.
pub(crate) fn parameters(
    default: &impl Serialize,
    meanings: &[(&str, &'static str)],
) -> Vec<Parameter> {
    let config = PrettyConfig::new()
        .depth_limit(1)
        .extensions(Extensions::UNWRAP_VARIANT_NEWTYPES);
    let text = ron::ser::to_string_pretty(default, config).unwrap_or_default();
    let fields = text
        .lines()
        .filter_map(|line| line.strip_prefix("    ")?.split_once(": "));
    let parameter = |(name, default): (&str, &str)| Parameter {
        name: name.to_owned(),
        meaning: meanings
            .iter()
            .find(|(known, _)| *known == name)
            .map_or("", |(_, meaning)| meaning),
        // RON marks a name of ours that is also one of its own, such as `None`, but reads it without the mark.
        default: default.trim_end_matches(',').replace("r#", ""),
    };
    fields.map(parameter).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_parameter_has_a_meaning_and_a_default() {
        for algorithm in Algorithm::catalogue() {
            for parameter in algorithm.parameters {
                assert!(
                    !parameter.meaning.is_empty(),
                    "{} of {}",
                    parameter.name,
                    algorithm.name
                );
                assert!(
                    !parameter.default.is_empty(),
                    "{} of {}",
                    parameter.name,
                    algorithm.name
                );
            }
        }
        let seed_pg = &Algorithm::catalogue()[0];
        assert_eq!(seed_pg.parameters.len(), seed_pg::PARAMETERS.len());
        let hidden = seed_pg
            .parameters
            .iter()
            .find(|parameter| parameter.name == "hidden")
            .unwrap();
        assert_eq!(hidden.default.replace(' ', ""), "[32,32]");
        let bonus = seed_pg
            .parameters
            .iter()
            .find(|parameter| parameter.name == "bonus")
            .unwrap();
        assert_eq!(bonus.default, "None");
    }
}
