//! Regret of tabular runs.

use super::{Bench, BenchReport, BenchTable, Column, format_interval};
use crate::study::evaluate::comparison::Samples;
use crate::study::evaluate::rules::Quantity;
use crate::study::evaluate::score::RunScore;
use seedbed_stats::aggregate::mean;
use seedbed_stats::bootstrap_estimate;

/// Compares tabular scenarios by their regret.
#[derive(Clone, Copy, Debug)]
pub(super) struct RegretReport;

const REGRET_COLUMNS: [Column; 7] = [
    ("agents", 6),
    ("regret", 8),
    ("95 % interval", 18),
    ("min", 8),
    ("max", 8),
    ("no regret", 9),
    ("steps/s", 9),
];

const COMPARISON_COLUMNS: [Column; 2] = [("difference", 10), ("95 % interval", 20)];

impl BenchReport for RegretReport {
    fn measure(&self) -> &'static str {
        "regret"
    }

    fn introduction(&self, seeds: &str) -> Vec<String> {
        vec![
            format!("Regret per agent over {seeds}: mean with 95 % interval, min and max."),
            "no regret: share of episodes without regret; steps/s: on one thread. Each run seed draws its own task."
                .to_owned(),
        ]
    }

    fn columns(&self) -> &'static [Column] {
        &REGRET_COLUMNS
    }

    fn table_row(&self, bench: &Bench) -> Vec<String> {
        let regrets = regrets(bench);
        let regret = bootstrap_estimate(&regrets, mean);
        let mut shares = Vec::with_capacity(bench.outcomes.len());
        for outcome in &bench.outcomes {
            shares.push(outcome.share_of_episodes_without_regret);
        }
        vec![
            bench.agents.to_string(),
            format_regret(regret.value),
            format_interval(regret.interval, format_regret),
            format_regret(regrets.iter().copied().fold(f64::INFINITY, f64::min)),
            format_regret(regrets.iter().copied().fold(f64::NEG_INFINITY, f64::max)),
            format!("{:.0} %", 100.0 * mean(&shares)),
            format!("{:.0}", bench.speed()),
        ]
    }

    /// Compares the first scenario with all scenarios that have the same task. Their runs can be
    /// paired, because equal run seeds draw equal tasks.
    fn comparison(&self, benches: &[Bench]) -> Option<BenchTable> {
        let (first, others) = benches.split_first()?;
        let mut others: Vec<&Bench> = others.iter().collect();
        others.retain(|other| other.task_definition == first.task_definition);
        if others.is_empty() {
            return None;
        }
        Some(BenchTable {
            above: vec![format!(
                "Compared with {}, paired by run seed: mean difference in regret (below 0: better).",
                first.name
            )],
            columns: &COMPARISON_COLUMNS,
            rows: comparison_rows(first, &others),
            below: Vec::new(),
        })
    }
}

/// Regret per agent of each run.
fn regrets(bench: &Bench) -> Vec<f64> {
    bench
        .outcomes
        .iter()
        .map(|outcome| outcome.regret)
        .collect()
}

fn comparison_rows(first: &Bench, others: &[&Bench]) -> Vec<(String, Vec<String>)> {
    let mut rows = Vec::with_capacity(others.len());
    for other in others {
        let samples = Samples::new(&scores(other), &scores(first), Quantity::Mean, true)
            .expect("both have the same run seeds");
        let difference = samples.compare(&*samples.test()).effect;
        let cells = vec![
            format_regret(difference.value),
            format_interval(difference.interval, format_regret),
        ];
        rows.push((other.name.clone(), cells));
    }
    rows
}

/// Regrets of runs, in the order of their run seeds.
fn scores(bench: &Bench) -> Vec<RunScore> {
    let score = |(run_seed, value)| RunScore {
        run_seed,
        value,
        observed_until: f64::INFINITY,
        magnitude: f64::abs(value),
    };
    (0..).zip(regrets(bench)).map(score).collect()
}

/// Three decimals for values below 10, otherwise one.
fn format_regret(value: f64) -> String {
    if value.abs() < 10.0 {
        format!("{value:.3}")
    } else {
        format!("{value:.1}")
    }
}
