//! Generated scenarios: every field and variant that the schemas of the configurations have.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use rand::RngExt;
use schemars::{JsonSchema, SchemaGenerator};
use seedbed::scenario::Scenario;
use seedbed::scenario::recording::RecordingSettings;
use seedbed_learn::agent::TeamConfig;
use seedbed_learn::algorithms::cross_entropy::CrossEntropy;
use seedbed_learn::algorithms::leader_followers::LeaderFollowers;
use seedbed_learn::algorithms::seed_pg::config::SeedPg;
use seedbed_learn::algorithms::seed_psrl::SeedPsrl;
use seedbed_learn::algorithms::seed_sac::config::SeedSac;
use seedbed_learn::algorithms::value_based::config::{BootstrappedDqn, QLearning, SeedTd};
use seedbed_learn::algorithms::value_based::hyper_agent::HyperAgent;
use seedbed_random::Stream;
use serde_json::Value;

use super::{number, positive};

/// Generates scenarios from the schemas of their parts.
pub(crate) struct Generator {
    algorithms: Vec<(&'static str, Value)>,
    agents: Value,
    recording: Value,
    scenario: Value,
}

/// Tasks in which generated scenarios run.
const TASKS: [&str; 4] = ["discrete", "continuous", "tabular", "analytic"];

/// Writes [`TASKS`] with short episodes, and a generated one.
pub(crate) fn write_tasks(folder: &Path) {
    let envs = folder.join("envs");
    fs::create_dir(&envs).unwrap();
    for (name, base) in [
        ("discrete", "cartpole"),
        ("continuous", "pendulum"),
        ("analytic", "cartpole_gym"),
    ] {
        let base = Path::new(crate::util::REPOSITORY).join(format!("envs/{base}.ron"));
        let text = format!("Environment(extends: {:?}, time_limit: 12)", base.display());
        fs::write(envs.join(name).with_extension("ron"), text).unwrap();
    }
    let tabular = "TabularEnvironment(description: \"Small.\", task: DeepSea(size: 4))";
    fs::write(envs.join("tabular.ron"), tabular).unwrap();
}

fn schema<T: JsonSchema>() -> Value {
    SchemaGenerator::default()
        .into_root_schema_for::<T>()
        .to_value()
}

impl Generator {
    pub(crate) fn new() -> Self {
        Self {
            algorithms: vec![
                ("SeedPg", schema::<SeedPg>()),
                ("LeaderFollowers", schema::<LeaderFollowers>()),
                ("QLearning", schema::<QLearning>()),
                ("SeedTd", schema::<SeedTd>()),
                ("BootstrappedDqn", schema::<BootstrappedDqn>()),
                ("HyperAgent", schema::<HyperAgent>()),
                ("SeedSac", schema::<SeedSac>()),
                ("SeedPsrl", schema::<SeedPsrl>()),
                ("CrossEntropy", schema::<CrossEntropy>()),
            ],
            agents: schema::<TeamConfig>(),
            recording: schema::<RecordingSettings>(),
            scenario: schema::<Scenario>(),
        }
    }

    /// A scenario and overrides of it.
    pub(crate) fn generate(&self, random: &mut Stream) -> (String, Vec<String>) {
        let (name, config) = &self.algorithms[random.random_range(0..self.algorithms.len())];
        let is_value_based = !matches!(
            *name,
            "SeedPg" | "LeaderFollowers" | "SeedSac" | "SeedPsrl" | "CrossEntropy"
        );
        let is_continuous = *name == "SeedSac";
        let mut overrides = Vec::new();
        let mut parts = vec![format!(
            "algorithm: {name}{}",
            fields(config, config, 8, random)
        )];
        let task = loop {
            let task = TASKS[random.random_range(0..TASKS.len())];
            let fits = if task == "continuous" {
                !is_value_based
            } else {
                !is_continuous
            };
            if fits {
                break task;
            }
        };
        parts.push(format!("environment: {task:?}"));
        if task == "analytic" && random.random() {
            parts.push("physics: Analytic".to_owned());
        } else if random.random_ratio(1, 4) {
            parts.push("physics: Rapier".to_owned());
        }
        parts.push(format!(
            "agents: {}",
            fields(&self.agents, &self.agents, 8, random)
        ));
        if random.random_ratio(1, 3) {
            parts.push(format!(
                "recording: {}",
                fields(&self.recording, &self.recording, 8, random)
            ));
        }
        if random.random_ratio(1, 5) {
            let schedule = &self.scenario["properties"]["schedule"];
            parts.push(format!(
                "schedule: {}",
                value(&self.scenario, schedule, random)
            ));
        } else if is_value_based || is_continuous {
            parts.push("schedule: Lockstep(learn_every: 3)".to_owned());
        }
        if random.random_ratio(1, 3) {
            overrides.push(format!("checkpoint_every={}", random.random_range(1..3)));
            overrides.push(format!(
                "checkpoint_share={:?}",
                random.random_range(0.01..=1.0)
            ));
            overrides.push(format!("seed={}", random.random::<u64>()));
        }
        parts.push(stop(random));
        (format!("Scenario({})", parts.join(", ")), overrides)
    }

    /// Names of all fields and variants.
    pub(crate) fn keywords(&self) -> BTreeSet<String> {
        let configs = self.algorithms.iter().map(|(_, config)| config);
        let mut keywords = BTreeSet::new();
        for schema in configs.chain([&self.agents, &self.recording, &self.scenario]) {
            collect_keywords(schema, &mut keywords);
        }
        keywords
    }
}

fn stop(random: &mut Stream) -> String {
    match random.random_range(0..4) {
        0 => format!(
            "stop: Steps(team: {}, at_most: 3)",
            random.random_range(1..100)
        ),
        1 => format!(
            "stop: Solved(return: {:?}, window: 2, at_most: 3)",
            number(random)
        ),
        _ => "stop: Episodes(3)".to_owned(),
    }
}

fn collect_keywords(schema: &Value, keywords: &mut BTreeSet<String>) {
    match schema {
        Value::Object(members) => {
            for (key, member) in members {
                match (key.as_str(), member) {
                    ("properties", Value::Object(fields)) => {
                        keywords.extend(fields.keys().cloned());
                    }
                    ("const", Value::String(name)) => drop(keywords.insert(name.clone())),
                    ("enum", Value::Array(names)) => {
                        keywords.extend(names.iter().filter_map(Value::as_str).map(str::to_owned));
                    }
                    _ => {}
                }
                collect_keywords(member, keywords);
            }
        }
        Value::Array(members) => members
            .iter()
            .for_each(|member| collect_keywords(member, keywords)),
        _ => {}
    }
}

/// The fields of a structure in parentheses: the required ones, and each of the others in one of
/// `given_in` cases.
fn fields(root: &Value, schema: &Value, given_in: u32, random: &mut Stream) -> String {
    let schema = resolve(root, schema);
    let required: Vec<&str> = schema["required"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(Value::as_str)
        .collect();
    let mut written = Vec::new();
    for (name, field) in schema["properties"].as_object().into_iter().flatten() {
        if required.contains(&name.as_str()) || random.random_ratio(1, given_in) {
            written.push(format!("{name}: {}", value(root, field, random)));
        }
    }
    format!("({})", written.join(", "))
}

fn resolve<'a>(root: &'a Value, schema: &'a Value) -> &'a Value {
    match schema["$ref"].as_str() {
        Some(reference) => resolve(
            root,
            &root["$defs"][reference.trim_start_matches("#/$defs/")],
        ),
        None => schema,
    }
}

/// A value of a schema, as it is written in a scenario.
fn value(root: &Value, schema: &Value, random: &mut Stream) -> String {
    let schema = resolve(root, schema);
    for alternatives in ["anyOf", "oneOf"] {
        if let Some(list) = schema[alternatives].as_array() {
            let chosen = &list[random.random_range(0..list.len())];
            return value(root, chosen, random);
        }
    }
    if let Some(name) = schema["const"].as_str() {
        return name.to_owned();
    }
    if let Some(names) = schema["enum"].as_array() {
        return names[random.random_range(0..names.len())]
            .as_str()
            .unwrap()
            .to_owned();
    }
    let kind = match &schema["type"] {
        Value::Array(kinds) => kinds[random.random_range(0..kinds.len())].as_str(),
        kind => kind.as_str(),
    };
    match kind {
        Some("null") => "None".to_owned(),
        Some("boolean") => random.random::<bool>().to_string(),
        Some("integer") => integer(schema, random),
        Some("number") => real(schema, random),
        Some("string") => "\"x\"".to_owned(),
        Some("array") => list(root, schema, random),
        Some("object") => object(root, schema, random),
        other => panic!("a schema of type {other:?}: {schema}"),
    }
}

fn integer(schema: &Value, random: &mut Stream) -> String {
    let min = schema["minimum"].as_u64().unwrap_or(0);
    let max = schema["maximum"].as_u64().unwrap_or(u64::MAX);
    random.random_range(min..=max.min(min + 3)).to_string()
}

/// A number in the range that its schema describes in words.
fn real(schema: &Value, random: &mut Stream) -> String {
    let value = match schema["expected"].as_str().unwrap_or_default() {
        "a number above 0" => positive(random),
        "a number of at least 0" => number(random).abs(),
        "a time from 0.000001 to 10 s" => positive(random).clamp(1e-6, 10.0),
        "a number from 0 to 1" => (number(random).abs() / 4.0).min(1.0),
        "a number above 0 and at most 1" => (positive(random) / 2.0).clamp(1.2e-38, 1.0),
        "a number of at least 0 and below 1" => (number(random).abs() / 4.0).min(0.999),
        "a finite number" => number(random),
        other => panic!("numbers that are {other:?} are not generated"),
    };
    format!("{value:?}")
}

fn list(root: &Value, schema: &Value, random: &mut Stream) -> String {
    if let Some(items) = schema["prefixItems"].as_array() {
        let items: Vec<String> = items.iter().map(|item| value(root, item, random)).collect();
        return format!("({})", items.join(", "));
    }
    let length = random.random_range(1..=2);
    let items: Vec<String> = (0..length)
        .map(|_| value(root, &schema["items"], random))
        .collect();
    format!("[{}]", items.join(", "))
}

/// A structure, or a variant with fields.
fn object(root: &Value, schema: &Value, random: &mut Stream) -> String {
    let properties = schema["properties"].as_object();
    let mut properties = properties.into_iter().flatten();
    match (properties.next(), properties.next()) {
        (Some((name, content)), None) if name.starts_with(|c: char| c.is_ascii_uppercase()) => {
            let resolved = resolve(root, content);
            let content = match resolved["type"].as_str() {
                Some("object") => fields(root, resolved, 2, random),
                Some("array") if resolved["prefixItems"].is_array() => {
                    value(root, resolved, random)
                }
                _ => format!("({})", value(root, resolved, random)),
            };
            format!("{name}{content}")
        }
        _ => fields(root, schema, 2, random),
    }
}
