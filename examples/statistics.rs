//! Uses only the statistics, for results from any source: intervals, and a verdict on a claim about
//! two samples.
//!
//! Run with `cargo run --release --example statistics`.

use seedbed::stats::aggregate::{interquartile_mean, median};
use seedbed::stats::bootstrap::bootstrap_estimate;
use seedbed::stats::effect_test::{EffectTest, lower_bound, upper_bound};
use seedbed::stats::family::FAMILY_LEVEL;
use seedbed::stats::means::TwoMeans;
use seedbed::stats::survival::{TimeToEvent, kaplan_meier};
use seedbed::stats::{Direction, Estimate, Interval, verdict_on_effect};

fn main() {
    let ours = [195.0, 188.0, 200.0, 171.0, 199.0, 200.0, 183.0, 192.0];
    let theirs = [160.0, 181.0, 175.0, 149.0, 190.0, 172.0, 168.0, 180.0];
    for (name, returns) in [("ours", ours), ("theirs", theirs)] {
        let median_return = bootstrap_estimate(&returns, median);
        println!("{name}: median return {}", format_estimate(&median_return));
    }
    let interquartile_return = bootstrap_estimate(&ours, interquartile_mean);
    println!(
        "ours: interquartile mean {}",
        format_estimate(&interquartile_return)
    );
    judge(&ours, &theirs);

    // Two of six runs had not solved their task when they ended, after 200 episodes.
    let solved = [90.0, 120.0, 151.0, 160.0].map(TimeToEvent::observed);
    let unsolved = [200.0; 2].map(TimeToEvent::censored);
    let survival_curve = kaplan_meier(&[solved.as_slice(), &unsolved].concat());
    let median_episodes = Estimate {
        value: survival_curve.median().unwrap_or(f64::INFINITY),
        interval: survival_curve.median_interval(),
    };
    println!(
        "episodes until solved: median {}",
        format_estimate(&median_episodes)
    );
}

/// Prints the verdict on the claim that ours have higher returns. Differences below 5 are of no
/// interest.
fn judge(ours: &[f64], theirs: &[f64]) {
    const SMALLEST: f64 = 5.0;
    let test = TwoMeans::new(ours, theirs);
    let interval = Interval::Known {
        low: lower_bound(&test, FAMILY_LEVEL, 0.0),
        high: upper_bound(&test, FAMILY_LEVEL, SMALLEST),
    };
    let difference = Estimate {
        value: test.estimate(),
        interval,
    };
    let verdict = verdict_on_effect(interval, Direction::Positive, SMALLEST);
    println!(
        "ours - theirs: {}: {verdict:?}",
        format_estimate(&difference)
    );
}

fn format_estimate(estimate: &Estimate) -> String {
    match estimate.interval {
        Interval::Known { low, high } => format!("{:.1} ({low:.1} to {high:.1})", estimate.value),
        Interval::TooFewRuns { n } => format!("{:.1} (no interval from {n} runs)", estimate.value),
    }
}
