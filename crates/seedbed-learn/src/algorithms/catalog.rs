//! Documentation of algorithms for users: parameters with their meaning, choices and defaults.
//!
//! Meanings are the doc comments of the configuration's fields, and choices those of its enums;
//! both are read from the JSON schema that `schemars` derives. Defaults are the `Default` of the
//! configuration as RON. So nothing is documented twice.

use ron::extensions::Extensions;
use ron::ser::PrettyConfig;
use schemars::{JsonSchema, SchemaGenerator};
use seedbed_env::{Action, Choice as ActionChoice, Quantity, TaskSpec};
use seedbed_settings::{Field, Tree};
use serde::Serialize;
use serde_json::Value;

use super::{AlgorithmConfig, ScheduleKind};

/// Documentation of one algorithm.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AlgorithmInfo {
    /// Its name in a scenario.
    pub name: &'static str,
    /// What it does, in a sentence.
    pub purpose: String,
    /// Where it can be used.
    pub uses: Uses,
    /// Its parameters.
    pub parameters: Vec<Parameter>,
}

/// What actions a task can have.
pub const ACTION_KINDS: [&str; 4] = [
    "one discrete action",
    "several",
    "continuous actions",
    "both at once",
];

/// Where teams of an algorithm can be used, with the defaults of its parameters.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Uses {
    /// In tasks with these of the [`ACTION_KINDS`].
    pub actions: Vec<&'static str>,
    /// Names of the kinds of schedules in which they can learn.
    pub schedules: Vec<&'static str>,
    /// Whether rewards can have an exploration bonus.
    pub bonus: bool,
}

/// Documentation of one parameter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parameter {
    /// Its name in a scenario.
    pub name: String,
    /// What it means.
    pub meaning: String,
    /// The expected range of numbers; empty if the parameter is not a number.
    pub expected: String,
    /// The values to choose from; empty for numbers.
    pub choices: Vec<Choice>,
    /// Its default, as written in a scenario.
    pub default: String,
}

/// One of the values of a parameter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Choice {
    /// How it is written, such as `Ppo(clip: …, clipping: Joint | DimensionWise)`.
    pub form: String,
    /// What it means.
    pub meaning: String,
}

impl AlgorithmInfo {
    /// Documentation of the algorithm `name`, which has the configuration `T`.
    #[must_use]
    pub fn of<T: AlgorithmConfig + JsonSchema + Default + Serialize>(name: &'static str) -> Self {
        let config = T::default();
        Self {
            name,
            purpose: description(&Schemas::of::<T>().root),
            uses: Uses::of(&config),
            parameters: parameters(&config),
        }
    }
}

impl Uses {
    fn of(config: &dyn AlgorithmConfig) -> Self {
        let discrete = || ActionChoice::Discrete(vec![0.0, 1.0]);
        let of_kinds = [
            vec![discrete()],
            vec![discrete(), discrete()],
            vec![ActionChoice::Continuous, ActionChoice::Continuous],
            vec![discrete(), ActionChoice::Continuous],
        ];
        let mut actions = Vec::new();
        for (kind, choices) in ACTION_KINDS.into_iter().zip(of_kinds) {
            if config.check_task(&task_with(choices)).is_ok() {
                actions.push(kind);
            }
        }
        let mut schedules = Vec::new();
        for (name, kind) in [
            ("Synchronous", ScheduleKind::Synchronous { episodes: 1 }),
            ("Asynchronous", ScheduleKind::Asynchronous),
            ("Lockstep", ScheduleKind::Lockstep),
        ] {
            if config.check_schedule(kind).is_ok() {
                schedules.push(name);
            }
        }
        Self {
            actions,
            schedules,
            bonus: config.bonus().is_some(),
        }
    }
}

/// A task of one observation with these actions.
fn task_with(choices: Vec<ActionChoice>) -> TaskSpec {
    let quantity = |name: String| Quantity {
        name,
        unit: String::new(),
        range: [-1.0, 1.0],
    };
    let actions = choices
        .into_iter()
        .enumerate()
        .map(|(index, choice)| Action {
            quantity: quantity(format!("action {index}")),
            choice,
        });
    TaskSpec {
        name: String::new(),
        description: String::new(),
        observations: vec![quantity("observation".to_owned())],
        actions: actions.collect(),
        control_step: 1.0,
        time_limit: 1,
        reward_threshold: None,
        info: Vec::new(),
    }
}

/// Every field of a configuration, with the values of `default` as defaults.
///
/// # Panics
/// Never: what is written can be read.
#[must_use]
pub fn parameters<T: JsonSchema + Serialize>(default: &T) -> Vec<Parameter> {
    let schemas = Schemas::of::<T>();
    let config = PrettyConfig::new()
        .depth_limit(1)
        .extensions(Extensions::UNWRAP_VARIANT_NEWTYPES);
    let text = ron::ser::to_string_pretty(default, config).expect("a configuration can be written");
    let tree = Tree::parse(&text).expect("what is written can be read");
    let mut parameters = Vec::new();
    for Field { name, value, .. } in tree.root.fields() {
        let field = &schemas.root["properties"][*name];
        parameters.push(Parameter {
            name: (*name).to_owned(),
            meaning: description(field),
            expected: schemas.expected(field),
            choices: schemas.choices(field),
            // RON writes `r#None` for a variant that is called `None`, but reads `None` as well.
            default: text[value.place.clone()].replace("r#", ""),
        });
    }
    parameters
}

/// The variants of an enum, as they are written in a scenario, with their meanings.
#[must_use]
pub fn choices<T: JsonSchema>() -> Vec<Choice> {
    let schemas = Schemas::of::<T>();
    schemas.choices(&schemas.root)
}

/// The schema of a configuration with the definitions that it refers to.
struct Schemas {
    root: Value,
}

impl Schemas {
    fn of<T: JsonSchema>() -> Self {
        let schema = SchemaGenerator::default().into_root_schema_for::<T>();
        Self {
            root: schema.to_value(),
        }
    }

    /// Follows references: the schema that `schema` refers to, or `schema` itself. For an optional
    /// value, the schema of the value.
    fn resolve<'a>(&'a self, schema: &'a Value) -> &'a Value {
        if let Some(reference) = schema["$ref"].as_str() {
            let name = reference.trim_start_matches("#/$defs/");
            return self.resolve(&self.root["$defs"][name]);
        }
        match schema["anyOf"].as_array().map(Vec::as_slice) {
            Some([some, null]) if null["type"] == "null" => self.resolve(some),
            _ => schema,
        }
    }

    /// Whether a value may be `None`.
    fn is_optional(schema: &Value) -> bool {
        let alternatives = schema["anyOf"].as_array().into_iter().flatten();
        let types = schema["type"].as_array().into_iter().flatten();
        alternatives
            .map(|alternative| &alternative["type"])
            .chain(types)
            .any(|name| name == "null")
    }

    /// The expected range of a number, or of the items of a list.
    fn expected(&self, schema: &Value) -> String {
        let resolved = self.resolve(schema);
        let expected = resolved["expected"].as_str().unwrap_or_default();
        if resolved["type"] == "array" {
            return format!("a list, each {}", self.expected(&resolved["items"]));
        }
        if Self::is_optional(schema) && !expected.is_empty() {
            return format!("None, or Some of {expected}");
        }
        expected.to_owned()
    }

    /// The variants of an enum.
    fn choices(&self, schema: &Value) -> Vec<Choice> {
        let resolved = self.resolve(schema);
        if resolved["type"] == "boolean" {
            return Vec::new();
        }
        let mut choices = Vec::new();
        for variant in resolved["oneOf"].as_array().into_iter().flatten() {
            let meaning = self.meaning(variant);
            choices.extend(self.forms(variant).into_iter().map(|form| Choice {
                form,
                meaning: meaning.clone(),
            }));
        }
        if choices.is_empty() {
            let names = resolved["enum"].as_array().into_iter().flatten();
            choices.extend(names.filter_map(Value::as_str).map(|name| Choice {
                form: name.to_owned(),
                meaning: String::new(),
            }));
        }
        choices
    }

    /// The description of a variant, or else of the only value that it has.
    fn meaning(&self, variant: &Value) -> String {
        let properties = variant["properties"].as_object().into_iter().flatten();
        let values = properties.map(|(_, value)| description(self.resolve(value)));
        let mut descriptions = std::iter::once(description(variant)).chain(values);
        descriptions
            .find(|text| !text.is_empty())
            .unwrap_or_default()
    }

    /// How a variant is written: a name, or a name with fields. A schema may combine several
    /// variants that have no fields.
    fn forms(&self, variant: &Value) -> Vec<String> {
        if let Some(name) = variant["const"].as_str() {
            return vec![name.to_owned()];
        }
        if let Some(names) = variant["enum"].as_array() {
            return names
                .iter()
                .filter_map(Value::as_str)
                .map(str::to_owned)
                .collect();
        }
        let properties = variant["properties"].as_object().into_iter().flatten();
        properties
            .map(|(name, fields)| format!("{name}({})", self.fields(fields)))
            .collect()
    }

    /// The fields of a variant with their possible values.
    fn fields(&self, schema: &Value) -> String {
        let resolved = self.resolve(schema);
        let Some(properties) = resolved["properties"].as_object() else {
            return self.possible_values(schema);
        };
        let written = properties
            .iter()
            .map(|(name, field)| format!("{name}: {}", self.possible_values(field)));
        written.collect::<Vec<_>>().join(", ")
    }

    /// The possible values of a field of a variant: the names of its own variants, or `…` for a
    /// number.
    fn possible_values(&self, schema: &Value) -> String {
        let choices = self.choices(schema);
        if choices.is_empty() {
            return "…".to_owned();
        }
        let names: Vec<&str> = choices
            .iter()
            .map(|choice| choice.form.split('(').next().unwrap_or_default())
            .collect();
        names.join(" | ")
    }
}

/// The first paragraph of a doc comment, on one line.
fn description(schema: &Value) -> String {
    let text = schema["description"].as_str().unwrap_or_default();
    let paragraph = text.split("\n\n").next().unwrap_or_default();
    paragraph.replace('\n', " ").replace(['[', ']', '`'], "")
}

#[cfg(test)]
mod tests {
    use super::super::Algorithm;
    use super::ACTION_KINDS;

    #[test]
    fn every_parameter_has_a_meaning_and_a_default() {
        for algorithm in Algorithm::catalog() {
            assert!(!algorithm.purpose.is_empty(), "{}", algorithm.name);
            for parameter in algorithm.parameters {
                let name = format!("{} of {}", parameter.name, algorithm.name);
                assert!(parameter.meaning.ends_with('.'), "{name}: {parameter:?}");
                assert!(!parameter.default.is_empty(), "{name}");
                for choice in parameter.choices {
                    assert!(!choice.meaning.is_empty(), "{name}: {choice:?}");
                }
            }
        }
    }

    #[test]
    fn uses_are_those_that_scenarios_can_have() {
        let uses = |name: &str| {
            let found = Algorithm::catalog()
                .into_iter()
                .find(|info| info.name == name);
            found.unwrap().uses
        };
        assert_eq!(uses("SeedPg").actions, ACTION_KINDS);
        assert_eq!(uses("QLearning").actions, ["one discrete action"]);
        assert_eq!(uses("SeedSac").actions, ["continuous actions"]);
        assert_eq!(uses("SeedPg").schedules, ["Synchronous", "Asynchronous"]);
        assert_eq!(uses("QLearning").schedules, ["Synchronous", "Lockstep"]);
        assert_eq!(uses("CrossEntropy").schedules, ["Synchronous"]);
        assert!(uses("SeedSac").bonus && !uses("Random").bonus);
    }

    #[test]
    fn parameters_derive_from_the_configuration() {
        let seed_pg = &Algorithm::catalog()[0];
        let parameter = |name: &str| {
            let mut parameters = seed_pg.parameters.iter();
            parameters.find(|other| other.name == name).unwrap()
        };
        assert_eq!(parameter("hidden").default.replace(' ', ""), "[32,32]");
        assert_eq!(parameter("bonus").default, "None");
        assert_eq!(parameter("discount").expected, "a number from 0 to 1");
        let losses: Vec<&str> = parameter("policy_loss")
            .choices
            .iter()
            .map(|choice| choice.form.as_str())
            .collect();
        assert_eq!(
            losses,
            [
                "Ppo(clip: …, clipping: Joint | DimensionWise)",
                "SimplePg",
                "OffPac(ratio_cap: …)"
            ]
        );
    }
}
