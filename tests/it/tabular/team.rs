//! Results of tabular runs: the same run seed gives the same bits, and regrets agree with values
//! derived by hand and with published comparisons.

use seedbed::scenario::resolve::Resolve;
use seedbed::tabular::TabularScenario;
use seedbed::tabular::results::Results;
use seedbed::tabular::team::{Episode, TabularTeam};

fn parse_scenario(text: &str) -> TabularScenario {
    seedbed_input::parse("test", format!("TabularScenario({text})"))
        .unwrap_or_else(|error| panic!("{error}"))
        .value
}

/// Runs all episodes of a scenario.
fn play(scenario: &TabularScenario) -> Results {
    let mut team = TabularTeam::new(scenario);
    let mut episodes: Vec<Episode> = Vec::new();
    while let Some(step) = team.advance() {
        episodes.extend(step.ended_episode);
    }
    Results::of("test", scenario, &team, episodes)
}

/// Regret per agent, averaged over the runs with run seeds 0 to `runs` − 1.
fn mean_regret(text: &str, runs: u64) -> f64 {
    let regret_of_run = |seed| {
        play(&TabularScenario {
            seed,
            ..parse_scenario(text)
        })
        .summary
        .regret_per_agent
    };
    (0..runs).map(regret_of_run).sum::<f64>() / runs as f64
}

#[test]
fn the_same_run_seed_gives_the_same_bits() {
    for algorithm in [
        "SeedSampling(rewards: MartingaleGaussian)",
        "ThompsonResampling",
        "Ucrl()",
        "CountBonus()",
        "CountBonus(reservation: true)",
        "EpsilonGreedy()",
    ] {
        for task in [
            "BipolarChain(vertices: 20)",
            "MaximumRewardPath(vertices: 12)",
            "DeepSea(size: 5)",
        ] {
            let scenario = parse_scenario(&format!(
                "task: {task}, agents: (count: 12), episodes: 2, algorithm: {algorithm}"
            ));
            let resolved_text = scenario.resolved();
            let resolved: TabularScenario =
                seedbed_input::parse("test", resolved_text).unwrap().value;
            assert_eq!(play(&scenario), play(&resolved), "{task}, {algorithm}");
            let other_run_seed = TabularScenario {
                seed: 1,
                ..scenario.clone()
            };
            assert_ne!(
                play(&scenario).episodes,
                play(&other_run_seed).episodes,
                "{task}, {algorithm}"
            );
        }
    }
}

/// A single agent with an agent seed goes straight to one end. Its regret at the better end is 0.
/// The reward of the other end is lower by 2N = 40, and the way to it is one step longer or
/// shorter, so the regret there is 40 ± 1.
#[test]
fn one_agent_chooses_the_better_end_half_the_time() {
    let text = "task: BipolarChain(vertices: 20), agents: (count: 1)";
    let regrets: Vec<f64> = (0..60)
        .map(|seed| {
            play(&TabularScenario {
                seed,
                ..parse_scenario(text)
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
    let wrong_ends = regrets.iter().filter(|regret| **regret > 0.0).count();
    assert!(
        (15..=45).contains(&wrong_ends),
        "{wrong_ends} of 60; 30 ± 15 are four standard deviations"
    );
}

/// As in Dimakopoulou and Van Roy (2018), the regret of seed sampling decreases with the number of
/// agents, and the regret of Thompson resampling, which lacks commitment, remains high.
#[test]
fn seed_sampling_has_less_regret_than_thompson_resampling_on_the_bipolar_chain() {
    let regret = |algorithm: &str, agents: u32| {
        let text = format!(
            "task: BipolarChain(vertices: 40), agents: (count: {agents}), algorithm: {algorithm}"
        );
        mean_regret(&text, 20)
    };
    let seed_sampling = [1, 10, 100].map(|agents| regret("SeedSampling()", agents));
    assert!(
        seed_sampling[0] > seed_sampling[1] && seed_sampling[1] > 2.0 * seed_sampling[2],
        "{seed_sampling:?}"
    );
    let thompson_resampling = regret("ThompsonResampling", 100);
    assert!(
        thompson_resampling > 3.0 * seed_sampling[2],
        "{thompson_resampling} against {seed_sampling:?}"
    );
}

/// A team with random actions does not learn, so every other algorithm must have clearly less
/// regret.
#[test]
fn every_algorithm_has_less_regret_than_random_actions() {
    let regret = |algorithm: &str| {
        let text = format!("task: ParallelChains(), agents: (count: 50), algorithm: {algorithm}");
        mean_regret(&text, 20)
    };
    let random = regret("Random");
    for algorithm in [
        "SeedSampling()",
        "ThompsonResampling",
        "SharedSeed()",
        "SampleOnce",
        "Ucrl()",
        "CountBonus()",
        "CountBonus(reservation: true)",
        "EpsilonGreedy()",
    ] {
        let learning = regret(algorithm);
        assert!(
            learning < 0.8 * random,
            "{algorithm}: {learning} against {random}"
        );
    }
}

/// Four agents play ten episodes each. The rows add up to the summary, and are sorted by the end of
/// their episodes.
#[test]
fn results_add_up() {
    let scenario = parse_scenario(
        "task: DeepSea(size: 4), agents: (count: 4, starts: Together), episodes: 10",
    );
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
