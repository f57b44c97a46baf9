//! `seedbed bench`.

use crate::util::{seedbed, stderr, stdout};

#[test]
fn bench_compares_tabular_scenarios_by_regret() {
    let files = [
        "scenarios/tabular/parallel_chains.ron",
        "scenarios/tabular/parallel_chains_ucrl.ron",
    ];
    let output = seedbed(
        &[
            &["bench"],
            files.as_slice(),
            &["--seeds", "5", "--set", "agents.count=10"],
        ]
        .concat(),
    );
    assert!(output.status.success(), "{}", stderr(&output));
    let printed = stdout(&output);
    assert!(
        printed.contains("| parallel_chains      |     10 |")
            && printed.contains("Compared with parallel_chains, paired by run seed"),
        "{printed}"
    );
    let mixed = seedbed(&["bench", files[0], "scenarios/cartpole.ron"]);
    assert_eq!(mixed.status.code(), Some(2));
    assert_eq!(
        stderr(&mixed),
        "error: cannot compare scenarios/tabular/parallel_chains.ron, which is measured by regret, with \
         scenarios/cartpole.ron, which is measured by episodes until solved\n"
    );
}

/// The lines that `bench` prints for two scenarios, without speeds, which differ from run to run.
/// The threshold is low, so that the runs are short: random actions keep the pole up for about 20
/// steps.
fn bench_lines_without_speeds(run_seeds: &str) -> Vec<String> {
    let short_runs = [
        "--set",
        "stop=Solved(return: 25, window: 1, at_most: 40)",
        "--seeds",
        run_seeds,
    ];
    let output = seedbed(
        &[
            &[
                "bench",
                "scenarios/cartpole_1.ron",
                "scenarios/cartpole.ron",
            ],
            short_runs.as_slice(),
        ]
        .concat(),
    );
    assert!(output.status.success(), "{}", stderr(&output));
    let without_speed = |line: &str| {
        if line.matches('|').count() == 10 {
            line[..line.trim_end_matches('|').rfind('|').unwrap()].to_owned()
        } else {
            line.to_owned()
        }
    };
    stdout(&output).lines().map(without_speed).collect()
}

#[test]
fn a_benchmark_is_reproducible() {
    let lines = bench_lines_without_speeds("6");
    assert_eq!(lines, bench_lines_without_speeds("6"));
    let rows: Vec<&String> = lines
        .iter()
        .filter(|line| line.starts_with("| cartpole"))
        .collect();
    assert_eq!(
        rows.len(),
        2 + 1,
        "one row per scenario, and one comparison: {lines:#?}"
    );
    assert!(
        rows[0].contains("/6 |") && rows[2].starts_with("| cartpole   |"),
        "{lines:#?}"
    );
    assert!(
        lines
            .iter()
            .all(|line| line.chars().count() <= 110 && !line.contains("No intervals")),
        "{lines:#?}"
    );
}

#[test]
fn a_benchmark_of_four_run_seeds_has_no_intervals() {
    let lines = bench_lines_without_speeds("4");
    assert_eq!(
        lines.last().map(String::as_str),
        Some("No intervals: 5 run seeds are needed, found 4.")
    );
    assert_eq!(
        lines
            .iter()
            .map(|line| line.matches("none (n = 4)").count())
            .sum::<usize>(),
        2 + 2,
        "{lines:#?}"
    );
    assert!(
        !lines
            .iter()
            .any(|line| line.contains(" to ") && line.starts_with('|')),
        "{lines:#?}"
    );
}
