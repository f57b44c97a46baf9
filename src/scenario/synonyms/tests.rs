//! Tests of names of other libraries.

use super::*;

const ALGORITHM_NAMES: [&str; 10] = [
    "SeedPg",
    "LeaderFollowers",
    "QLearning",
    "SeedTd",
    "BootstrappedDqn",
    "HyperAgent",
    "SeedSac",
    "SeedPsrl",
    "CrossEntropy",
    "Random",
];

fn scenario(algorithm: &str) -> Document<Scenario> {
    Scenario::like(&format!("algorithm: {algorithm}")).unwrap()
}

fn assignments(algorithm: &str, path: &str, value: &str) -> Vec<String> {
    let suggestion = suggest(&scenario(algorithm), path, value);
    suggestion.map_or_else(Vec::new, |suggestion| suggestion.assignments)
}

/// Algorithm, path, value, and the assignments that are suggested.
type Case = (
    &'static str,
    &'static str,
    &'static str,
    &'static [&'static str],
);

const CASES: &[Case] = &[
    (
        "SeedPg",
        "lr",
        "0.1",
        &[
            "algorithm.policy_optimizer.step_size=0.1",
            "algorithm.value_optimizer.step_size=0.1",
        ],
    ),
    (
        "QLearning",
        "algorithm.learning_rate",
        "3e-4",
        &["algorithm.learning.optimizer.step_size=3e-4"],
    ),
    (
        "SeedPsrl",
        "lr",
        "-1",
        &["algorithm.network.optimizer.step_size=0.001"],
    ),
    ("CrossEntropy", "lr", "0.1", &[]),
    (
        "SeedSac",
        "learning_rate",
        "3e-4",
        &[
            "algorithm.policy_optimizer.step_size=3e-4",
            "algorithm.critic_optimizer.step_size=3e-4",
        ],
    ),
    ("SeedSac", "tau", "0.01", &["algorithm.target_rate=0.01"]),
    (
        "SeedSac",
        "learning_starts",
        "5000",
        &["algorithm.random_steps=5000"],
    ),
    ("SeedSac", "gradient_steps", "2", &["algorithm.updates=2"]),
    (
        "SeedSac",
        "ent_coef",
        "0.2",
        &["algorithm.temperature=Fixed(alpha: 0.2)"],
    ),
    ("SeedPg", "algorithm", "SAC", &["algorithm=SeedSac()"]),
    ("SeedPg", "gamma", "0.9", &["algorithm.discount=0.9"]),
    (
        "SeedTd",
        "algorithm.gamma",
        "0.9",
        &["algorithm.learning.discount=0.9"],
    ),
    ("SeedPg", "agents", "16", &["agents.count=16"]),
    (
        "SeedPg",
        "n_envs",
        "8",
        &["schedule=Synchronous(episodes: 8)"],
    ),
    (
        "SeedPg",
        "num_envs",
        "",
        &["schedule=Synchronous(episodes: 4)"],
    ),
    ("SeedPg", "vf_coef", "0.5", &[]),
    ("SeedPg", "num_minibatches", "4", &[]),
    ("SeedPg", "target_kl", "0.01", &[]),
    (
        "SeedPg",
        "policy_lr",
        "3e-4",
        &["algorithm.policy_optimizer.step_size=3e-4"],
    ),
    (
        "SeedPg",
        "gae_lambda",
        "0.9",
        &[
            "algorithm.policy_data=Own",
            "algorithm.value_data=Own",
            "algorithm.value_target=Gae(lambda: 0.9)",
            "algorithm.advantage=Gae(lambda: 0.9)",
        ],
    ),
    (
        "SeedSac",
        "alpha",
        "0.2",
        &["algorithm.temperature=Fixed(alpha: 0.2)"],
    ),
    ("SeedSac", "autotune", "true", &[]),
    (
        "QLearning",
        "alpha",
        "0.1",
        &["algorithm.learning.optimizer.step_size=0.1"],
    ),
    (
        "SeedPg",
        "net_arch",
        "[64, 64]",
        &["algorithm.hidden=[64, 64]"],
    ),
    (
        "QLearning",
        "net_arch",
        "dict(pi=[64])",
        &["algorithm.learning.hidden=[64, 64]"],
    ),
    (
        "SeedPg",
        "batch_size",
        "32",
        &["algorithm.minibatch=Steps(32)"],
    ),
    (
        "QLearning",
        "batch_size",
        "32",
        &["algorithm.learning.minibatch=32"],
    ),
    (
        "SeedPg",
        "algorithm.minibatch",
        "32",
        &["algorithm.minibatch=Steps(32)"],
    ),
    (
        "SeedPg",
        "ent_coef",
        "0.01",
        &["algorithm.entropy_bonus=0.01"],
    ),
    ("QLearning", "ent_coef", "0.01", &[]),
    (
        "SeedPg",
        "clip_range",
        "0.1",
        &["algorithm.policy_loss.clip=0.1"],
    ),
    (
        "LeaderFollowers",
        "clip_coef",
        "0.1",
        &["algorithm.clip=0.1"],
    ),
    (
        "SeedPg",
        "n_steps",
        "2048",
        &["schedule=Synchronous(episodes: 4)"],
    ),
    (
        "SeedPg",
        "total_timesteps",
        "50000",
        &["stop=Steps(team: 50000, at_most: 100000)"],
    ),
    ("SeedPg", "stop", "100", &["stop=Episodes(100)"]),
    (
        "SeedPg",
        "stop",
        "Steps(1000)",
        &["stop=Steps(team: 1000, at_most: 100000)"],
    ),
    (
        "SeedPg",
        "stop",
        "Steps(team: none)",
        &["stop=Episodes(500)"],
    ),
    ("SeedPg", "algorithm", "SeedPg", &[]),
    (
        "SeedPg",
        "stop",
        "Steps(team: 7000)",
        &["stop=Steps(team: 7000, at_most: 100000)"],
    ),
    (
        "SeedPg",
        "env",
        "CartPole-v1",
        &["environment=Gymnasium(id: \"CartPole-v1\")"],
    ),
    ("SeedPg", "env_id", "cart_pole", &["environment=cartpole"]),
    ("SeedPg", "device", "cuda", &[]),
    (
        "SeedPg",
        "algorithm",
        "\"A2C\"",
        &["algorithm=SeedPg(policy_data: Own, policy_loss: SimplePg)"],
    ),
    (
        "SeedPg",
        "algorithm",
        "DQN(lr: 0.1)",
        &["algorithm=QLearning()"],
    ),
    // Fields with the name that another one has elsewhere are not explained.
    ("SeedPg", "schedule.episodes", "0", &[]),
    ("SeedPg", "agents.seeds", "3", &[]),
    ("SeedPg", "algorithm.policy_optimizer.epsilon", "-1", &[]),
    ("SeedPg", "algorithm.time_limit", "500", &[]),
    ("SeedPg", "algorithm", "Foo", &[]),
];

/// Each name is written as Stable-Baselines3, CleanRL or RLlib have it, and answered for each
/// algorithm that has such a parameter.
#[test]
fn names_are_those_of_the_algorithm() {
    for (algorithm, path, value, expected) in CASES.iter().copied() {
        assert_eq!(
            assignments(algorithm, path, value),
            expected,
            "{algorithm} {path}={value}"
        );
    }
}

/// Whatever is suggested for any name and any algorithm can be applied, in `--set` and in a file.
#[test]
fn suggestions_can_be_pasted() {
    let names = FIELDS.iter().map(|synonym| (synonym, false));
    let names = names.chain(ALGORITHMS.iter().map(|synonym| (synonym, true)));
    for (synonym, is_algorithm) in names {
        let name = &synonym.names[0];
        for algorithm in ALGORITHM_NAMES {
            let mut document = scenario(algorithm);
            let (path, value) = if is_algorithm {
                ("algorithm", *name)
            } else {
                (*name, "")
            };
            let Some(suggestion) = suggest(&document, path, value) else {
                continue;
            };
            let fields =
                ron_fields::nested(&suggestion.assignments, |path| opening_of(&document, path));
            for assignment in &suggestion.assignments {
                document = apply_value(&document, assignment)
                    .unwrap_or_else(|error| panic!("{name}: {error}"));
            }
            document
                .value
                .check()
                .unwrap_or_else(|error| panic!("{name}: {error:?}"));
            if fields.is_empty() || fields.starts_with("environment") {
                continue;
            }
            let text = format!("Scenario(environment: \"cartpole\", {fields})");
            let pasted = seedbed_input::parse::<Scenario>("pasted", text);
            pasted.unwrap_or_else(|error| panic!("{name}: {error}"));
        }
    }
}

/// A name that no scenario accepts has nothing but a meaning.
#[test]
fn every_name_is_unique_and_simplified() {
    for synonyms in [FIELDS, ALGORITHMS] {
        let names: Vec<&str> = synonyms
            .iter()
            .flat_map(|synonym| synonym.names)
            .copied()
            .collect();
        for (index, name) in names.iter().enumerate() {
            assert_eq!(simplified(name), *name);
            assert!(!names[..index].contains(name), "{name} is there twice");
        }
    }
}

/// The error of a scenario file.
fn help_in_file(text: &str) -> String {
    let parsed = seedbed_input::parse::<Scenario>("x.ron", text.to_owned());
    let explained = explain::<Scenario>(text, parsed.unwrap_err());
    explained.help.unwrap_or_default()
}

/// Fields that exist only with other settings than the defaults.
#[test]
fn names_are_those_of_the_settings() {
    let text = "Scenario(environment: \"cartpole\", algorithm: SeedPg(policy_data: Own, value_data: Own, value_target: \
                Gae(lambda: 1), advantage: Gae(lambda: 1), bonus: Rnd()))";
    let document = seedbed_input::parse::<Scenario>("x.ron", text.to_owned()).unwrap();
    for (path, expected) in [
        (
            "gae_lambda",
            &[
                "algorithm.advantage.lambda=0.9",
                "algorithm.value_target.lambda=0.9",
            ][..],
        ),
        ("rnd_coef", &["algorithm.bonus.scale.weight=0.9"]),
    ] {
        let suggestion = suggest(&document, path, "0.9").unwrap();
        assert_eq!(suggestion.assignments, expected, "{path}");
    }
}

/// The help for PPO and the scenario `ppo` have the same settings.
#[test]
fn ppo_is_that_of_its_scenario() {
    let file = include_str!("../../../scenarios/ppo.ron");
    let of_scenario = seedbed_input::parse::<Scenario>("ppo.ron", file.to_owned()).unwrap();
    for (path, name) in [("algorithm", "PPO"), ("algo", "ppo")] {
        let assignments = assignments("SeedPg", path, name);
        let changed = apply_value(&scenario("SeedPg"), &assignments[0]).unwrap();
        assert_eq!(changed.value.algorithm, of_scenario.value.algorithm);
    }
}

#[test]
fn files_are_answered_with_fields() {
    let with = |field: &str| help_in_file(&format!("Scenario(environment: \"cartpole\", {field})"));
    for (field, expected) in [
        ("agents: 16", "write `agents: (count: 16)`"),
        ("n_envs: 8", "write `schedule: Synchronous(episodes: 8)`"),
        (
            "algorithm: SeedPg(gamma: 0.9)",
            "write `algorithm: SeedPg(discount: 0.9)`",
        ),
        (
            "algorithm: QLearning(lr: 0.1)",
            "write `algorithm: QLearning(learning: (optimizer: (step_size: 0.1)))`",
        ),
        (
            "lr: 0.1, algorithm: HyperAgent()",
            "write `algorithm: HyperAgent(learning: (optimizer: (step_size: 0.1)))`",
        ),
        (
            "clip_range: 0.1",
            "write `algorithm: SeedPg(policy_loss: Ppo(clip: 0.1))`",
        ),
        (
            "algorithm: PPO()",
            "policy_optimizer: (step_size: 0.0003), value_optimizer: (step_size: 0.0003))`",
        ),
        ("algorithm: DQN", "write `algorithm: QLearning()`"),
        (
            "algorithm: \"A2C\"",
            "write `algorithm: SeedPg(policy_data: Own, policy_loss: SimplePg)`",
        ),
        (
            "total_timesteps: 1e5",
            "write `stop: Steps(team: 100000, at_most: 100000)`",
        ),
        (
            "env: \"Acrobot-v1\"",
            "write `environment: Gymnasium(id: \"Acrobot-v1\")`",
        ),
        ("env: \"acrobott\"", "write `environment: \"acrobot\"`"),
        (
            "device: \"cuda\"",
            "`--threads N` sets the number of threads",
        ),
    ] {
        let help = with(field);
        assert!(help.ends_with(expected), "{field}: {help}");
    }
}
