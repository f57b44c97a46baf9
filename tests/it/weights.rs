//! `policies.safetensors`: names and shapes of all tensors, and a reader that rebuilds the policies
//! of a run from this file alone.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use safetensors::SafeTensors;
use serde_json::Value;

use seedbed::run::evaluate::{EvaluationSettings, evaluate};
use seedbed::run::folder::RunFolder;
use seedbed::run::measures::RoundRows;
use seedbed::run::ranks::Ranks;
use seedbed::run::{Observer, Options, Plan, Progress, execute};
use seedbed_input::numbers::ranged_number;
use seedbed_learn::agent::action_selection::ActionSelection;
use seedbed_learn::experience::Episode;

use super::util::{run_refused, small_run, stderr};

struct SilentObserver;

impl Observer for SilentObserver {
    fn begun(&mut self, _: &Progress) {}

    fn round_finished(&mut self, _: &Progress, _: &RoundRows) {}
}

/// A run's file, read into memory.
struct PoliciesFile {
    shapes: BTreeMap<String, Vec<usize>>,
    values: BTreeMap<String, Vec<f32>>,
    metadata: BTreeMap<String, String>,
}

impl PoliciesFile {
    fn read(path: &Path) -> Self {
        let bytes = std::fs::read(path).unwrap();
        let (_, header) = SafeTensors::read_metadata(&bytes).unwrap();
        let metadata = header.metadata().clone().unwrap_or_default();
        let tensors = SafeTensors::deserialize(&bytes).unwrap();
        let mut file = Self {
            shapes: BTreeMap::new(),
            values: BTreeMap::new(),
            metadata: metadata.into_iter().collect(),
        };
        for (name, tensor) in tensors.tensors() {
            let numbers = tensor.data().chunks_exact(4);
            let numbers = numbers.map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap()));
            file.shapes.insert(name.clone(), tensor.shape().to_vec());
            file.values.insert(name, numbers.collect());
        }
        file
    }

    /// The value of a key whose text is JSON.
    fn json(&self, key: &str) -> Value {
        serde_json::from_str(&self.metadata[key]).unwrap()
    }

    /// The file has these tensors and no others.
    fn assert_tensors(&self, expected: impl IntoIterator<Item = (String, Vec<usize>)>) {
        assert_eq!(self.shapes, expected.into_iter().collect());
    }
}

/// Runs a scenario for two episodes per agent with two agents, without recorders.
fn run(scenario: &str, overrides: &[&str], folder: &Path, save_initial: bool) -> PoliciesFile {
    let all_overrides = ["agents.count=2", "stop=Episodes(2)"]
        .iter()
        .chain(overrides);
    let overrides: Vec<String> = all_overrides.map(|text| (*text).to_owned()).collect();
    let path = format!("scenarios/{scenario}.ron");
    let plan = Plan::load(Path::new(&path), &overrides).unwrap();
    let folder = RunFolder::new(folder);
    let options = Options {
        folder: folder.clone(),
        resume: false,
        threads: 1,
        save_initial,
        other_versions: false,
        ranks: Ranks::SINGLE,
    };
    let interrupted = AtomicBool::new(false);
    execute(
        &plan,
        &options,
        Vec::new(),
        &mut SilentObserver,
        &interrupted,
    )
    .unwrap();
    PoliciesFile::read(&folder.policies_file())
}

/// The file of a short run, whose folder is removed.
fn policies_of(scenario: &str, overrides: &[&str], save_initial: bool) -> PoliciesFile {
    run(
        scenario,
        overrides,
        tempfile::tempdir().unwrap().path(),
        save_initial,
    )
}

/// Names and shapes of the layers of a network with these sizes.
fn network(name: &str, sizes: &[usize]) -> Vec<(String, Vec<usize>)> {
    let layers = sizes.windows(2).enumerate();
    let tensors = layers.flat_map(|(layer, sizes)| {
        let tensor = |kind, shape| (format!("{name}.layer_{layer}.{kind}"), shape);
        [
            tensor("weight", sizes.to_vec()),
            tensor("bias", vec![sizes[1]]),
        ]
    });
    tensors.collect()
}

fn list(name: &str, length: usize) -> Vec<(String, Vec<usize>)> {
    vec![(name.to_owned(), vec![length])]
}

/// The tensors of agent `agent` of Seed-PG on CartPole (4 observations, 2 choices) with one hidden
/// layer of 5 units.
fn seed_pg_agent(agent: u32) -> Vec<(String, Vec<usize>)> {
    let name = |part: &str| format!("agent_{agent}.{part}");
    [
        network(&name("policy"), &[4, 5, 2]),
        network(&name("value"), &[4, 5, 1]),
        list(&name("value.mean"), 1),
        list(&name("value.deviation"), 1),
    ]
    .concat()
}

const SMALL: &str = "algorithm.hidden=[5]";

#[test]
fn tensors_of_seed_pg() {
    for (scaling, names) in [
        ("Raw", &[][..]),
        ("Range", &["center", "half_range"][..]),
        ("Running", &["mean", "deviation"][..]),
    ] {
        let scaling = format!("algorithm.observations={scaling}");
        let file = policies_of("cartpole", &[SMALL, &scaling], false);
        let scaling_tensors = |agent: u32| {
            let lists = names.iter();
            lists.flat_map(move |name| list(&format!("agent_{agent}.observations.{name}"), 4))
        };
        let agent = |agent| {
            seed_pg_agent(agent)
                .into_iter()
                .chain(scaling_tensors(agent))
        };
        file.assert_tensors((0..2).flat_map(agent));
    }
}

/// The inputs of bonus models are 4 observations and 2 choices; VIME predicts 4 changes. A shared
/// model is saved once, the median of each agent's gains for each agent.
#[test]
fn tensors_of_bonus_models() {
    let vime = |owner: &str| {
        [
            network(&format!("{owner}.bonus.mean"), &[6, 3, 4]),
            network(&format!("{owner}.bonus.deviation"), &[6, 3, 4]),
            list(&format!("{owner}.bonus.inputs.mean"), 6),
            list(&format!("{owner}.bonus.inputs.deviation"), 6),
            list(&format!("{owner}.bonus.changes.root_mean_square"), 4),
        ]
        .concat()
    };
    let rnd = |owner: &str| {
        [
            network(&format!("{owner}.bonus.target"), &[6, 3, 7]),
            network(&format!("{owner}.bonus.predictor"), &[6, 3, 7]),
            list(&format!("{owner}.bonus.inputs.mean"), 6),
            list(&format!("{owner}.bonus.inputs.deviation"), 6),
        ]
        .concat()
    };
    let entropy = |owner: &str, references: usize| {
        [
            list(&format!("{owner}.bonus.observations.center"), 4),
            list(&format!("{owner}.bonus.observations.half_range"), 4),
            vec![(format!("{owner}.bonus.references"), vec![references, 4])],
        ]
        .concat()
    };
    let medians = |agents| -> Vec<(String, Vec<usize>)> {
        let agents: std::ops::Range<u32> = agents;
        agents
            .flat_map(|agent| list(&format!("agent_{agent}.bonus.median_scale"), 1))
            .collect()
    };
    let own = |tensors: &dyn Fn(&str) -> Vec<_>| [tensors("agent_0"), tensors("agent_1")].concat();
    for (bonus, expected) in [
        ("Vime(hidden: [3])", [vime("team"), medians(0..2)].concat()),
        (
            "Vime(hidden: [3], model: Independent, scale: Raw())",
            own(&vime),
        ),
        (
            "Rnd(hidden: [3], outputs: 7)",
            [rnd("team"), medians(0..2)].concat(),
        ),
        (
            "Rnd(hidden: [3], outputs: 7, model: Frozen)",
            [own(&rnd), medians(0..2)].concat(),
        ),
        (
            "TeamEntropy(references: 9)",
            [entropy("team", 9), medians(0..2)].concat(),
        ),
        (
            "TeamEntropy(references: 5, model: Independent, scale: Raw())",
            own(&|owner| entropy(owner, 5)),
        ),
    ] {
        let bonus = format!("algorithm.bonus={bonus}");
        let file = policies_of("cartpole", &[SMALL, &bonus], false);
        let agents = (0..2).flat_map(seed_pg_agent);
        file.assert_tensors(agents.chain(expected));
        let positive = |(_, values): (&String, &Vec<f32>)| values.iter().all(|value| *value > 0.0);
        let deviations = file
            .values
            .iter()
            .filter(|(name, _)| name.contains("bonus.deviation"));
        assert!(deviations.into_iter().all(positive));
    }
}

/// Models of value-based learners: value network, target network, and the prior if there is one.
#[test]
fn tensors_of_value_based_learners() {
    let range = [
        list("observations.center", 4),
        list("observations.half_range", 4),
    ]
    .concat();
    let model = |model: u32, roles: &[&str]| {
        let roles = roles.iter();
        let networks = roles.map(|role| network(&format!("model_{model}.{role}"), &[4, 5, 2]));
        networks.collect::<Vec<_>>().concat()
    };
    let small = "learning: (hidden: [5], minibatch: 4)";
    for (algorithm, models, roles, of_agent) in [
        ("QLearning", 1, &["value", "target"][..], "agent % models"),
        (
            "SeedTd",
            2,
            &["value", "target", "prior"][..],
            "agent % models",
        ),
        (
            "BootstrappedDqn",
            10,
            &["value", "target", "prior"][..],
            "drawn uniformly for each agent and round",
        ),
    ] {
        let setting = format!("algorithm={algorithm}({small})");
        let file = policies_of("cartpole", &[&setting], false);
        let models_of_file = (0..models).flat_map(|number| model(number, roles));
        file.assert_tensors(models_of_file.chain(range.clone()));
        assert_eq!(file.metadata["models"], models.to_string());
        assert_eq!(file.metadata["model_of_agent"], of_agent);
        assert_eq!(file.metadata["algorithm"], algorithm);
    }
    let setting = format!("algorithm=HyperAgent({small}, dimension: 3)");
    let file = policies_of("cartpole", &[&setting], false);
    let heads = ["value", "target", "prior"].map(|role| format!("model_0.{role}"));
    let heads = heads
        .iter()
        .flat_map(|name| network(name, &[4, 5, 2 * (1 + 3)]));
    let agents = (0..2).flat_map(|agent| {
        let networks = ["value", "prior"].map(|role| format!("agent_{agent}.{role}"));
        let index = list(&format!("agent_{agent}.index"), 3);
        let networks = networks.iter().flat_map(|name| network(name, &[4, 5, 2]));
        networks.chain(index).collect::<Vec<_>>()
    });
    file.assert_tensors(heads.chain(agents).chain(range.clone()));
    assert!(!file.metadata.contains_key("models"));
    let with_bonus = format!("algorithm=SeedTd({small}, bonus: Rnd(hidden: [3], outputs: 7))");
    let file = policies_of("cartpole", &[&with_bonus], false);
    assert_eq!(file.shapes["team.bonus.target.layer_0.weight"], [6, 3]);
    assert_eq!(file.shapes["model_1.bonus.median_scale"], [1]);
    assert!(!file.shapes.contains_key("model_0.bonus.inputs.mean"));
}

/// Learners of soft actor-critic: policy, critics with targets and priors, and the temperature.
#[test]
fn tensors_of_soft_actor_critic() {
    let setting =
        "algorithm=SeedSac(hidden: [5], minibatch: 4, prior_scale: 1, layer_normalization: true)";
    let file = policies_of("pendulum", &[setting], false);
    let range = [
        list("observations.center", 3),
        list("observations.half_range", 3),
    ]
    .concat();
    let learners = (0..2).flat_map(|learner| {
        let name = |role: &str| format!("model_{learner}.{role}");
        let mut tensors = network(&name("policy"), &[3, 5, 2]);
        for role in ["critic", "target", "prior"] {
            for number in 0..2 {
                let role = name(&format!("{role}_{number}"));
                tensors.extend(network(&role, &[4, 5, 1]));
                for part in ["gain", "shift"] {
                    tensors.extend(list(&format!("{role}.layer_0.{part}"), 5));
                }
            }
        }
        tensors.extend(list(&name("temperature"), 1));
        tensors
    });
    file.assert_tensors(learners.chain(range));
    assert_eq!(file.metadata["activation"], "relu");
    assert_eq!(
        (&*file.metadata["models"], &*file.metadata["model_of_agent"]),
        ("2", "agent % models")
    );
    assert_eq!(file.json("heads")[0]["kind"], "squashed_gaussian");
}

#[test]
fn tensors_of_cross_entropy_and_random() {
    let file = policies_of("cartpole", &["algorithm=CrossEntropy(hidden: [5])"], false);
    file.assert_tensors(
        [
            network("model_0.policy", &[4, 5, 2]),
            network("model_0.deviation", &[4, 5, 2]),
            list("observations.center", 4),
            list("observations.half_range", 4),
        ]
        .concat(),
    );
    let random = policies_of("cartpole", &["algorithm=Random"], false);
    random.assert_tensors([]);
    assert_eq!(random.metadata["algorithm"], "Random");
    assert!(!random.metadata.contains_key("heads"));
}

/// With `save_initial` the file also has the agent seeds; all other bytes of tensors are the same.
/// CartPole has a time limit of 200 steps. After the first update, parameters differ from the
/// initial ones.
#[test]
fn agent_seeds_are_saved_on_request() {
    let vime = "algorithm.bonus=Vime(hidden: [3], seeds: Shift)";
    let [without, with] = [false, true].map(|save| policies_of("cartpole", &[SMALL, vime], save));
    let added = (0..2).flat_map(|agent| {
        [
            list(&format!("agent_{agent}.reward_seeds"), 200),
            network(&format!("agent_{agent}.initial.policy"), &[4, 5, 2]),
            network(&format!("agent_{agent}.initial.value"), &[4, 5, 1]),
            network(&format!("agent_{agent}.bonus.seeds"), &[6, 3, 4]),
        ]
        .concat()
    });
    with.assert_tensors(without.shapes.clone().into_iter().chain(added));
    assert!(
        without
            .values
            .iter()
            .all(|(name, values)| &with.values[name] == values)
    );
    let weight = |name: &str| &with.values[&format!("agent_0.{name}.layer_0.weight")];
    assert_ne!(weight("initial.policy"), weight("policy"));
    assert_ne!(
        with.values["agent_0.reward_seeds"],
        with.values["agent_1.reward_seeds"]
    );
    let value_based = policies_of("cartpole", &["algorithm=SeedTd()"], true);
    assert_eq!(
        value_based.shapes["model_1.initial.value.layer_2.bias"],
        [2]
    );
}

/// How `docs/network_tensors.md` names a tensor: numbers and owners of bonus models are replaced by letters.
fn documented_name(name: &str) -> String {
    let parts = name.split('.').map(|part| match part.split_once('_') {
        Some(("agent", _)) => "agent_K",
        Some(("model", _)) => "model_M",
        Some(("layer", _)) => "layer_i",
        Some(("critic", _)) => "critic_N",
        Some(("target", _)) => "target_N",
        Some(("prior", _)) => "prior_N",
        _ => part,
    });
    let mut parts: Vec<&str> = parts.collect();
    if matches!(parts.last(), Some(&("weight" | "bias" | "gain" | "shift"))) {
        parts.pop();
        parts.push("…");
    }
    if parts.get(1) == Some(&"bonus") && !matches!(parts[2], "median_scale" | "seeds") {
        parts[0] = "OWNER";
    }
    parts.join(".")
}

#[test]
fn all_tensors_and_keys_are_documented() {
    let documentation = std::fs::read_to_string("docs/network_tensors.md").unwrap();
    for (scenario, algorithm) in [
        (
            "pendulum",
            "SeedSac(hidden: [3], minibatch: 4, prior_scale: 1, layer_normalization: true)",
        ),
        (
            "cartpole",
            "SeedPg(observations: Running, bonus: Vime(seeds: Scale))",
        ),
        ("cartpole", "SeedPg(observations: Range, bonus: Rnd())"),
        ("cartpole", "SeedPg(bonus: TeamEntropy())"),
        ("cartpole", "SeedPg(bonus: Regions())"),
        ("cartpole", "SeedPg(bonus: Discriminator())"),
        (
            "cartpole",
            "SeedTd(learning: (observations: Running), bonus: Vime(seeds: Scale))",
        ),
        ("cartpole", "QLearning()"),
        ("cartpole", "HyperAgent()"),
        ("cartpole", "SeedPsrl(hidden: [3], horizon: 3)"),
        ("cartpole", "CrossEntropy(hidden: [3])"),
    ] {
        let setting = format!("algorithm={algorithm}");
        let file = policies_of(scenario, &[&setting], true);
        for name in file.shapes.keys() {
            let name = documented_name(name);
            let is_documented = |name: &str| documentation.contains(&format!("`{name}`"));
            assert!(
                is_documented(&name) || is_documented(&name.replace("model_M", "model_0")),
                "{algorithm}: {name}"
            );
        }
        for key in file.metadata.keys() {
            assert!(
                documentation.contains(&format!("`{key}`")),
                "{algorithm}: {key}"
            );
        }
    }
}

#[test]
fn metadata_by_hand() {
    let running = "algorithm.observations=Running";
    let file = policies_of("cartpole", &[running, "seed=7"], false);
    let text = |key: &str| file.metadata[key].as_str();
    assert_eq!(text("format_version"), "1");
    assert_eq!(text("seedbed_version"), env!("CARGO_PKG_VERSION"));
    assert_eq!((text("task"), text("scenario")), ("cartpole", "cartpole"));
    assert_eq!((text("run_seed"), text("agents")), ("7", "2"));
    assert_eq!(text("algorithm"), "SeedPg");
    assert_eq!(
        (text("activation"), text("output_activation")),
        ("tanh", "none")
    );
    assert_eq!(text("weight_layout"), "[inputs, outputs], y = x W + b");
    assert_eq!(text("action_selection"), "Sampled");
    assert!(text("value").starts_with("v = mean + deviation * o"));
    assert!(!file.metadata.contains_key("bonus") && !file.metadata.contains_key("models"));
    assert_eq!(
        file.json("observations")[2],
        serde_json::json!({"name": "theta", "unit": "rad"})
    );
    let scaling = file.json("observation_scaling");
    assert_eq!(scaling["offset"], "agent_{agent}.observations.mean");
    assert_eq!(
        (&scaling["kind"], &scaling["limit"]),
        (&"Running".into(), &10.0.into())
    );
    let heads = file.json("heads");
    assert_eq!(heads.as_array().unwrap().len(), 1);
    assert_eq!(heads[0]["kind"], "categorical");
    assert_eq!(heads[0]["values"], serde_json::json!([-10.0, 10.0]));
}

/// Pendulum: torques within ±2 N m, an initial deviation of half the range's half: log 0.5.
#[test]
fn metadata_of_a_gaussian_head_by_hand() {
    let file = policies_of("pendulum", &["algorithm.initial_deviation=0.5"], false);
    let head = &file.json("heads")[0];
    assert_eq!(
        (&head["name"], &head["unit"]),
        (&"torque".into(), &"N m".into())
    );
    assert_eq!(
        (&head["kind"], &head["outputs"]),
        (&"gaussian".into(), &2.into())
    );
    assert_eq!(
        (&head["center"], &head["half_range"]),
        (&0.0.into(), &2.0.into())
    );
    assert_eq!(head["log_deviation_clamp"], serde_json::json!([-4.0, 1.0]));
    let offset = head["log_deviation_offset"].as_f64().unwrap();
    assert!((offset - 0.5_f64.ln()).abs() < 1e-6, "{offset}");
}

/// Computes the outputs of networks from a file, in double precision, with nothing but its tensors
/// and its metadata.
struct Reader<'a> {
    file: &'a PoliciesFile,
    agent: u32,
}

impl Reader<'_> {
    /// A name of tensors of the agent.
    fn name(&self, template: &Value) -> String {
        let models = self.file.metadata.get("models");
        let models: u32 = models.map_or(1, |models| models.parse().unwrap());
        let template = template.as_str().unwrap();
        let name = template.replace("{agent}", &self.agent.to_string());
        name.replace("{model}", &(self.agent % models).to_string())
    }

    fn scaled(&self, observation: &[f32]) -> Vec<f64> {
        let scaling = self.file.json("observation_scaling");
        if scaling["offset"].is_null() {
            return observation.iter().map(|x| f64::from(*x)).collect();
        }
        let [offsets, scales] =
            ["offset", "scale"].map(|key| &self.file.values[&self.name(&scaling[key])]);
        let limit = scaling["limit"].as_f64().unwrap_or(f64::INFINITY);
        let moments = offsets.iter().zip(scales);
        let scaled = observation
            .iter()
            .zip(moments)
            .map(|(x, (offset, scale))| (f64::from(*x) - f64::from(*offset)) / f64::from(*scale));
        scaled.map(|x| x.clamp(-limit, limit)).collect()
    }

    fn forward(&self, network: &str, inputs: &[f64]) -> Vec<f64> {
        let mut x = inputs.to_vec();
        for layer in 0.. {
            let tensor = |kind| {
                self.file
                    .values
                    .get(&format!("{network}.layer_{layer}.{kind}"))
            };
            let (Some(weight), Some(bias)) = (tensor("weight"), tensor("bias")) else {
                break;
            };
            if layer > 0 {
                for x in &mut x {
                    *x = x.tanh();
                }
            }
            let output = |column: usize| {
                let weights = weight[column..].iter().step_by(bias.len());
                let products = x.iter().zip(weights).map(|(x, w)| x * f64::from(*w));
                products.sum::<f64>() + f64::from(bias[column])
            };
            x = (0..bias.len()).map(output).collect();
        }
        x
    }

    fn outputs(&self, observation: &[f32]) -> Vec<f64> {
        let inputs = self.scaled(observation);
        let mut sum = Vec::new();
        for term in self.file.json("outputs").as_array().unwrap() {
            let outputs = self.forward(&self.name(&term["network"]), &inputs);
            sum.resize(outputs.len(), 0.0);
            let factor = term["factor"].as_f64().unwrap();
            sum.iter_mut()
                .zip(outputs)
                .for_each(|(sum, o)| *sum += factor * o);
        }
        sum
    }

    /// The log-probability of an action. `temperature`: of action values
    fn log_prob(&self, observation: &[f32], action: f32, temperature: f64) -> f64 {
        let (outputs, head) = (self.outputs(observation), &self.file.json("heads")[0]);
        let number = |key: &str| head[key].as_f64().unwrap();
        match head["kind"].as_str().unwrap() {
            "gaussian" => {
                let mean = number("center") + number("half_range") * outputs[0];
                let clamp = |index: usize| head["log_deviation_clamp"][index].as_f64().unwrap();
                let relative = outputs[1] + number("log_deviation_offset");
                let log_deviation = relative.clamp(clamp(0), clamp(1)) + number("half_range").ln();
                let standard = (f64::from(action) - mean) / log_deviation.exp();
                -0.5 * standard.powi(2) - log_deviation - 0.5 * std::f64::consts::TAU.ln()
            }
            kind => {
                let scale = if kind == "categorical" {
                    1.0
                } else {
                    temperature
                };
                let total: f64 = outputs.iter().map(|o| (o / scale).exp()).sum();
                outputs[action as usize] / scale - total.ln()
            }
        }
    }
}

/// Episodes that the trained policies of a run play.
fn evaluated(folder: &Path, action_selection: Option<ActionSelection>) -> Vec<Episode> {
    let settings = EvaluationSettings {
        episodes: 1,
        action_selection,
        environment: None,
        seed: 3,
    };
    evaluate(&RunFolder::new(folder), &settings).unwrap().1
}

/// The probabilities that a reader computes from the file are those of the policies that Rust plays.
/// Different formulas and scalings: logits, Gaussians, action values with priors.
#[test]
fn probabilities_from_the_file_are_those_of_the_policies() {
    let gibbs = ActionSelection::Tempered {
        temperature: ranged_number(0.5),
    };
    let running = "algorithm.observations=Running";
    for (scenario, overrides, selection) in [
        ("cartpole", &[running][..], None),
        ("cartpole", &["algorithm.observations=Range"], None),
        ("pendulum", &[running], None),
        ("pendulum", &[], None),
        ("cartpole", &["algorithm=QLearning()"], Some(gibbs)),
        (
            "cartpole",
            &["algorithm=SeedTd(learning: (observations: Running))"],
            Some(gibbs),
        ),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let file = run(scenario, overrides, folder.path(), false);
        let mut compared = 0;
        for episode in evaluated(folder.path(), selection) {
            let reader = Reader {
                file: &file,
                agent: episode.agent,
            };
            let width = episode.states().len() / episode.length();
            let states = episode.states().chunks_exact(width);
            let steps = states.zip(&episode.actions).zip(&episode.log_probs);
            for ((state, action), expected) in steps {
                let log_prob = reader.log_prob(state, *action, 0.5);
                assert!(
                    (log_prob.exp() - f64::from(*expected).exp()).abs() < 1e-5,
                    "{scenario} {overrides:?}: {log_prob}, expected {expected}"
                );
                compared += 1;
            }
        }
        assert!(compared >= 16, "{compared} steps of two agents");
    }
}

#[test]
fn the_command_line_saves_agent_seeds_on_request() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let output = small_run(&path, &["--no-recording", "--save-initial"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let file = PoliciesFile::read(&path.join("policies.safetensors"));
    assert_eq!(file.shapes["agent_1.reward_seeds"], [200]);
    let tabular = folder.path().join("tabular");
    let tabular = tabular.to_string_lossy();
    let arguments = [
        "run",
        "scenarios/tabular/bipolar_chain.ron",
        "--save-initial",
    ];
    let refusal = run_refused(&[&arguments[..], &["--out", &tabular]].concat());
    assert_eq!(
        refusal,
        "error: cannot save initial parameters of scenarios/tabular/bipolar_chain.ron: tabular \
         scenarios have no networks; run it without --save-initial\n"
    );
}
