//! Tabular runs: reproducible to the bit, with regret as derived by hand and as published.

use seedbed::scenario::overrides::Resolve;
use seedbed::tabular::TabularScenario;
use seedbed::tabular::results::Results;
use seedbed::tabular::team::{Episode, TabularTeam};
use seedbed_env::input;

fn scenario(text: &str) -> TabularScenario {
    input::parse("test", format!("TabularScenario({text})"))
        .unwrap_or_else(|error| panic!("{error}"))
        .value
}

fn play(scenario: &TabularScenario) -> Results {
    let mut team = TabularTeam::new(scenario);
    let mut episodes: Vec<Episode> = Vec::new();
    while let Some(step) = team.advance() {
        episodes.extend(step.ended);
    }
    Results::of("test", scenario, &team, episodes)
}

/// Mean regret per agent over runs 0 to `runs` − 1.
fn regret(text: &str, runs: u64) -> f64 {
    let run = |seed| {
        play(&TabularScenario {
            seed,
            ..scenario(text)
        })
        .summary
        .regret_per_agent
    };
    (0..runs).map(run).sum::<f64>() / runs as f64
}

#[test]
fn the_same_seed_gives_the_same_bits() {
    for algorithm in [
        "SeedSampling(rewards: MartingaleGaussian)",
        "ThompsonResampling",
        "Ucrl()",
        "EpsilonGreedy()",
    ] {
        for task in [
            "BipolarChain(vertices: 20)",
            "MaximumRewardPath(vertices: 12)",
            "DeepSea(size: 5)",
        ] {
            let scenario = scenario(&format!(
                "task: {task}, agents: (count: 12), episodes: 2, algorithm: {algorithm}"
            ));
            let text = scenario.resolved();
            let again: TabularScenario = input::parse("test", text).unwrap().value;
            assert_eq!(play(&scenario), play(&again), "{task}, {algorithm}");
            let other = TabularScenario {
                seed: 1,
                ..scenario.clone()
            };
            assert_ne!(
                play(&scenario).episodes,
                play(&other).episodes,
                "{task}, {algorithm}"
            );
        }
    }
}

/// A single agent with a seed goes straight to one end. At the better end its regret is 0; at the
/// other end the return is lower by 2N = 40 for the reward of the ends, and the way is one step longer
/// or shorter, so regret is 40 ± 1.
#[test]
fn one_agent_chooses_the_better_end_half_the_time() {
    let text = "task: BipolarChain(vertices: 20), agents: (count: 1)";
    let regrets: Vec<f64> = (0..60)
        .map(|seed| {
            play(&TabularScenario {
                seed,
                ..scenario(text)
            })
            .summary
            .regret_per_agent
        })
        .collect();
    assert!(
        regrets
            .iter()
            .all(|regret| [0.0, 39.0, 41.0].contains(regret)),
        "{regrets:?}"
    );
    let wrong = regrets.iter().filter(|regret| **regret > 0.0).count();
    assert!(
        (15..=45).contains(&wrong),
        "{wrong} of 60, where 30 ± 15 are four deviations"
    );
}

/// As published: seed sampling's regret falls with the number of agents, and without commitment it
/// remains high.
#[test]
fn seed_sampling_has_the_least_regret_on_the_bipolar_chain() {
    let regret = |algorithm: &str, agents: u32| {
        let text = format!(
            "task: BipolarChain(vertices: 40), agents: (count: {agents}), algorithm: {algorithm}"
        );
        regret(&text, 20)
    };
    let seeded = [1, 10, 100].map(|agents| regret("SeedSampling()", agents));
    assert!(
        seeded[0] > seeded[1] && seeded[1] > 2.0 * seeded[2],
        "{seeded:?}"
    );
    let resampled = regret("ThompsonResampling", 100);
    assert!(
        resampled > 3.0 * seeded[2],
        "{resampled} against {seeded:?}"
    );
}

/// A team that does not learn has the most regret.
#[test]
fn every_algorithm_has_less_regret_than_random_actions() {
    let regret = |algorithm: &str| {
        let text = format!("task: ParallelChains(), agents: (count: 50), algorithm: {algorithm}");
        regret(&text, 20)
    };
    let random = regret("Random");
    for algorithm in [
        "SeedSampling()",
        "ThompsonResampling",
        "SharedSeed()",
        "SampleOnce",
        "Ucrl()",
        "EpsilonGreedy()",
    ] {
        let learned = regret(algorithm);
        assert!(
            learned < 0.8 * random,
            "{algorithm}: {learned} against {random}"
        );
    }
}

/// Ten episodes of four agents: rows add up to the summary and are in the order of their ends.
#[test]
fn results_add_up() {
    let scenario =
        scenario("task: DeepSea(size: 4), agents: (count: 4, starts: Together), episodes: 10");
    let Results {
        summary,
        episodes,
        visits,
    } = play(&scenario);
    assert_eq!((episodes.len(), summary.env_steps), (40, 160));
    assert!(episodes.is_sorted_by(|one, other| one.ended <= other.ended));
    let total: f64 = episodes.iter().map(|episode| episode.regret).sum();
    assert_eq!(summary.regret_per_agent, total / 4.0);
    assert!(
        episodes
            .iter()
            .all(|episode| (episode.r#return + episode.regret - 0.99).abs() < 1e-12)
    );
    // One visit at the start of each episode and one after each step.
    assert_eq!(visits.iter().map(|row| row.visits).sum::<u64>(), 160 + 40);
    assert_eq!(
        (visits[0].place.as_str(), visits[0].visits, visits[0].agents),
        ("row 0, column 0", 40, 4)
    );
}
