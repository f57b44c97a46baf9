//! Episodes until training solves its task.

use super::{Bench, BenchReport, BenchTable, Column, Outcome, format_interval};
use crate::study::evaluate::comparison::{Comparison, Samples};
use crate::study::evaluate::rules::Quantity;
use crate::study::evaluate::score::RunScore;
use crate::study::evaluate::score::times_to_event;
use seedbed_stats::aggregate::median;
use seedbed_stats::survival::kaplan_meier;

/// Compares scenarios by the number of episodes until their task is solved. Unsolved runs are
/// censored: they would need more episodes than their maximum.
#[derive(Clone, Copy, Debug)]
pub(super) struct SolvingReport;

const SOLVING_COLUMNS: [Column; 8] = [
    ("agents", 6),
    ("solved", 7),
    ("median", 7),
    ("95 % interval", 15),
    ("min", 6),
    ("max", 6),
    ("env steps", 10),
    ("steps/s", 8),
];

const EXPLORATION_COLUMNS: [Column; 4] = [
    ("agents", 8),
    ("reached", 9),
    ("in episode", 10),
    ("coverage", 8),
];

const COMPARISON_COLUMNS: [Column; 4] = [
    ("difference", 10),
    ("95 % interval", 17),
    ("P(faster)", 9),
    ("95 % interval", 13),
];

impl BenchReport for SolvingReport {
    fn measure(&self) -> &'static str {
        "episodes until solved"
    }

    fn introduction(&self, seeds: &str) -> Vec<String> {
        vec![
            format!(
                "Episodes per agent until solved, over {seeds}: Kaplan–Meier median with 95 % interval, min, max."
            ),
            "env steps: median number of steps of the whole team until solved; steps/s: on one thread."
                .to_owned(),
        ]
    }

    fn columns(&self) -> &'static [Column] {
        &SOLVING_COLUMNS
    }

    fn table_row(&self, bench: &Bench) -> Vec<String> {
        let outcomes = &bench.outcomes;
        let curve = kaplan_meier(&times_to_event(&scores(outcomes, episodes)));
        let env_steps = kaplan_meier(&times_to_event(&scores(outcomes, |outcome| {
            outcome.solved_or_ended_at.env_steps
        })));
        let solved: Vec<f64> = outcomes
            .iter()
            .filter(|outcome| outcome.solved)
            .map(|outcome| f64::from(outcome.solved_or_ended_at.episodes))
            .collect();
        let all_solved = solved.len() == outcomes.len();
        let slowest = if all_solved { 0.0 } else { f64::INFINITY };
        let format = |episodes| format_episodes(episodes, bench);
        vec![
            bench.agents.to_string(),
            format!("{}/{}", solved.len(), outcomes.len()),
            curve
                .median()
                .map_or(format(f64::INFINITY), |median| format!("{median:.1}")),
            format_interval(curve.median_interval(), format),
            format(solved.iter().copied().fold(f64::INFINITY, f64::min)),
            format(solved.iter().copied().fold(slowest, f64::max)),
            env_steps
                .median()
                .map_or("unknown".to_owned(), |median| format!("{median:.0}")),
            format!("{:.0}", bench.speed()),
        ]
    }

    fn exploration(&self, benches: &[Bench]) -> Option<BenchTable> {
        let mut rows = Vec::with_capacity(benches.len());
        for bench in benches {
            rows.push((bench.name.clone(), exploration_cells(bench)));
        }
        Some(BenchTable {
            above: vec![
                "Agents that reached the threshold in an episode of their own, the median number of their first such episode, and"
                    .to_owned(),
                "the mean share of the state space that the team visited.".to_owned(),
            ],
            columns: &EXPLORATION_COLUMNS,
            rows,
            below: Vec::new(),
        })
    }

    fn comparison(&self, benches: &[Bench]) -> Option<BenchTable> {
        let (first, others) = benches.split_first()?;
        if others.is_empty() {
            return None;
        }
        Some(BenchTable {
            above: vec![
                format!(
                    "Compared with {}: difference in the mean number of episodes (below 0: faster), and probability",
                    first.name
                ),
                "that a run is faster. Unsolved runs count with the maximum number of episodes, the smaller one of the two."
                    .to_owned(),
            ],
            columns: &COMPARISON_COLUMNS,
            rows: comparison_rows(first, others),
            below: Vec::new(),
        })
    }
}

fn episodes(outcome: &Outcome) -> u64 {
    outcome.solved_or_ended_at.episodes.into()
}

/// Times of runs, in the order of their run seeds.
fn scores(outcomes: &[Outcome], time: impl Fn(&Outcome) -> u64) -> Vec<RunScore> {
    (0..)
        .zip(outcomes)
        .map(|(run_seed, outcome)| score(outcome, run_seed, time(outcome) as f64))
        .collect()
}

fn score(outcome: &Outcome, run_seed: u64, time: f64) -> RunScore {
    let (value, observed_until) = if outcome.solved {
        (time, f64::INFINITY)
    } else {
        (f64::INFINITY, time)
    };
    RunScore {
        run_seed,
        value,
        observed_until,
        magnitude: value,
    }
}

fn format_episodes(episodes: f64, bench: &Bench) -> String {
    if episodes.is_finite() {
        format!("{episodes}")
    } else {
        format!("> {}", bench.max_episodes)
    }
}

/// Cells of a row of the table of exploration. Agents that never reached the threshold count as
/// slower than all agents that reached it.
fn exploration_cells(bench: &Bench) -> Vec<String> {
    let (mut reached, mut first_goals, mut coverage) = (0, Vec::new(), 0.0);
    for outcome in &bench.outcomes {
        coverage += outcome.coverage;
        for goal in &outcome.first_goals {
            reached += usize::from(goal.is_some());
            first_goals.push(goal.map_or(f64::INFINITY, f64::from));
        }
    }
    let median = median(&first_goals);
    vec![
        first_goals.len().to_string(),
        reached.to_string(),
        if median.is_finite() {
            format!("{median:.1}")
        } else {
            format!("> {}", bench.max_episodes)
        },
        format!("{:.0} %", 100.0 * coverage / bench.outcomes.len() as f64),
    ]
}

fn comparison_rows(first: &Bench, others: &[Bench]) -> Vec<(String, Vec<String>)> {
    let cells = |other: &Bench| comparison_cells(&compare_benches(other, first));
    others
        .iter()
        .map(|other| (other.name.clone(), cells(other)))
        .collect()
}

/// Compares the runs of one scenario with the runs of another scenario, as independent samples.
fn compare_benches(bench: &Bench, reference: &Bench) -> Comparison {
    let horizon = bench.max_episodes.min(reference.max_episodes).into();
    let [scores_of_bench, scores_of_reference] =
        [bench, reference].map(|bench| scores(&bench.outcomes, episodes));
    let quantity = Quantity::RestrictedMeanTime { horizon };
    let samples = Samples::new(&scores_of_bench, &scores_of_reference, quantity, false)
        .expect("a benchmark has at least one run");
    samples.compare(&*samples.test())
}

fn comparison_cells(comparison: &Comparison) -> Vec<String> {
    let share = |value: f64| format!("{value:.2}");
    vec![
        format_difference(comparison.effect.value),
        format_interval(comparison.effect.interval, format_difference),
        share(comparison.probability_below.value),
        format_interval(comparison.probability_below.interval, share),
    ]
}

fn format_difference(episodes: f64) -> String {
    if episodes.is_finite() {
        format!("{episodes:.1}")
    } else {
        format!("{episodes}").replace("inf", "∞")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::run_result::Milestone;

    /// Outcomes from numbers of episodes; `+` marks an unsolved run. Each run took one second and
    /// 10 environment steps per episode.
    fn outcomes(words: &str) -> Vec<Outcome> {
        let outcome = |word: &str| {
            let episodes: u32 = word.trim_end_matches('+').parse().unwrap();
            let (solved, env_steps) = (!word.ends_with('+'), 10 * u64::from(episodes));
            Outcome {
                solved,
                solved_or_ended_at: Milestone {
                    episodes,
                    env_steps,
                },
                first_goals: vec![solved.then_some(episodes / 10), None],
                coverage: 0.25,
                regret: f64::NAN,
                share_of_episodes_without_regret: f64::NAN,
                env_steps,
                seconds: 1.0,
            }
        };
        words.split_whitespace().map(outcome).collect()
    }

    fn bench(agents: u32, max_episodes: u32, words: &str) -> Bench {
        Bench {
            name: "x".to_owned(),
            task_definition: String::new(),
            agents,
            max_episodes,
            outcomes: outcomes(words),
        }
    }

    fn row(max_episodes: u32, words: &str) -> Vec<String> {
        SolvingReport.table_row(&bench(4, max_episodes, words))
    }

    /// The interval is that of `lifelines` for these data, which are in
    /// `crates/seedbed-stats/tests/reference/reference.json`: seven of ten solved.
    #[test]
    fn unsolved_runs_are_censored() {
        let cells = row(600, "299 410 512 600+ 480 333 600+ 345 600+ 391");
        assert_eq!(
            cells[..7],
            ["4", "7/10", "445.0", "299 to > 600", "299", "> 600", "4450"]
        );
    }

    /// Each run has two agents. The first agent reached the threshold after a tenth of the episodes
    /// if its run was solved; the second agent never did. In the first bench, the episodes are 3, 4
    /// and 5, and three agents never reached the threshold, so the median is not reached.
    #[test]
    fn agents_that_never_reached_the_threshold_come_last() {
        assert_eq!(
            exploration_cells(&bench(2, 60, "30 40 50")),
            ["6", "3", "> 60", "25 %"]
        );
        assert_eq!(
            exploration_cells(&bench(2, 60, "30 40 60+")),
            ["6", "2", "> 60", "25 %"]
        );
    }

    #[test]
    fn unsolved_scenarios_have_no_median() {
        assert_eq!(
            row(60, "60+ 60+ 60+ 60+ 60+")[1..7],
            ["0/5", "> 60", "> 60", "> 60", "> 60", "unknown"]
        );
        assert_eq!(
            row(60, "40 50 60+")[1..7],
            ["2/3", "50.0", "none (n = 3)", "40", "> 60", "500"]
        );
    }

    /// Up to episode 50, the first scenario takes 30, 30, 30, 30 and 50 episodes, 34 on average, and
    /// the second 50 in all runs. Four of five runs are faster than all others, the fifth is as
    /// fast. Five runs are too few for an upper bound: 10 of 252 splits have as many short times in
    /// the first sample.
    #[test]
    fn comparisons_are_formatted() {
        let (fast, slow) = (
            bench(4, 90, "30 30 30 30 80"),
            bench(4, 50, "50+ 50+ 50+ 50+ 50+"),
        );
        let cells = comparison_cells(&compare_benches(&fast, &slow));
        assert_eq!((cells[0].as_str(), cells[2].as_str()), ("-16.0", "0.90"));
    }
}
