//! Survival analysis of times until a run reaches a threshold.
//!
//! Runs that ended before they reached it are *censored*, not dropped: all that is known of their
//! time is that it is longer than the run.
//!
//! ```
//! use seedbed_stats::survival::{TimeToEvent, kaplan_meier, log_rank_test};
//!
//! // Three runs reached the threshold; one ended after 9 episodes without it.
//! let ours = [3.0, 5.0, 7.0]
//!     .map(TimeToEvent::observed)
//!     .into_iter()
//!     .chain([TimeToEvent::censored(9.0)])
//!     .collect::<Vec<_>>();
//! assert_eq!(kaplan_meier(&ours).median(), Some(6.0));
//!
//! let baseline = [8.0, 9.0, 9.0, 9.0].map(TimeToEvent::censored);
//! let test = log_rank_test(&ours, &baseline).expect("both had runs when one was reached");
//! assert!(test.z > 0.0, "ours is faster");
//! ```

use statrs::distribution::{ContinuousCDF, Normal};

use super::{Interval, two_sided_normal};

/// Tolerance within which a product of shares counts as ½: S = 4/5 · 5/8 need not be exactly ½ in
/// floating point.
const ROUNDING: f64 = 1e-12;

/// Time until a run reached the threshold (the *event*), or until it ended without.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeToEvent {
    /// When the run reached the threshold, or if it did not, when it ended.
    pub time: f64,
    /// Whether it reached the threshold; otherwise it is censored.
    pub observed: bool,
}

impl TimeToEvent {
    /// A run that reached the threshold at `time`.
    #[must_use]
    pub fn observed(time: f64) -> Self {
        Self {
            time,
            observed: true,
        }
    }

    /// A run that ended at `time` without reaching the threshold.
    #[must_use]
    pub fn censored(time: f64) -> Self {
        Self {
            time,
            observed: false,
        }
    }
}

/// One step of a survival curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurvivalStep {
    /// Time of the step, at which some runs reached the threshold.
    pub time: f64,
    /// Number of runs just before that had neither reached it nor ended.
    pub at_risk: usize,
    /// Number of runs that reached it now.
    pub events: usize,
    /// Estimated share S(t) of runs that take longer.
    pub survival: f64,
    /// Pointwise 95 % interval of that share.
    pub interval: Interval,
}

/// Kaplan–Meier curve: the estimated share of runs that have not reached the threshold yet. It
/// starts at 1.
#[derive(Clone, Debug, PartialEq)]
pub struct SurvivalCurve {
    /// Steps in ascending order of time, one for each time at which runs reached the threshold.
    pub steps: Vec<SurvivalStep>,
    runs: usize,
}

/// Kaplan–Meier estimate (1958): S(t) = Π_{tᵢ ≤ t} (1 − dᵢ / nᵢ), where dᵢ of nᵢ runs at risk reach
/// the threshold at tᵢ.   `runs: [n]`
///
/// Values equal those of `scipy.stats.ecdf(…).sf`. The interval is the log-log one,
/// S^exp(± 1.96 √V / ln S) with Greenwood's sum V = Σ dᵢ / (nᵢ (nᵢ − dᵢ)); as in `lifelines` it
/// shrinks to 0 where S does.
#[must_use]
pub fn kaplan_meier(runs: &[TimeToEvent]) -> SurvivalCurve {
    let (mut survival, mut greenwood) = (1.0, 0.0);
    let mut steps = Vec::new();
    for time in event_times(runs) {
        let (at_risk, events) = (at_risk(runs, time), events(runs, time));
        survival *= (at_risk - events) as f64 / at_risk as f64;
        greenwood += events as f64 / (at_risk * (at_risk - events)) as f64;
        let interval = log_log_interval(runs.len(), survival, greenwood);
        steps.push(SurvivalStep {
            time,
            at_risk,
            events,
            survival,
            interval,
        });
    }
    SurvivalCurve {
        steps,
        runs: runs.len(),
    }
}

impl SurvivalCurve {
    /// Median time: the first time with S < ½, or if S equals ½ for a while, the midpoint of that
    /// while. `None` if S never falls below ½.
    ///
    /// Without censoring it is the median of the times. R's `survfit` does the same; `lifelines`
    /// takes the start of the while.
    #[must_use]
    pub fn median(&self) -> Option<f64> {
        let first_time_at_most = |share: f64| {
            let step = self.steps.iter().find(|step| step.survival <= share)?;
            Some(step.time)
        };
        // Both are the same step unless S equals ½.
        let reaches_half = first_time_at_most(0.5 + ROUNDING)?;
        let falls_below_half = first_time_at_most(0.5 - ROUNDING)?;
        Some(f64::midpoint(reaches_half, falls_below_half))
    }

    /// 95 % interval of the median time (Brookmeyer and Crowley 1982): the times at which the lower
    /// and the upper band of the curve come down to ½. The upper end is infinite if its band never
    /// does.
    ///
    /// Equals `lifelines.utils.median_survival_times(curve.confidence_interval_)`.
    #[must_use]
    pub fn median_interval(&self) -> Interval {
        let first = |is_down: fn(&Interval) -> bool| {
            let step = self.steps.iter().find(|step| is_down(&step.interval));
            step.map_or(f64::INFINITY, |step| step.time)
        };
        let low = first(|band| matches!(band, Interval::Known { low, .. } if *low <= 0.5));
        let high = first(|band| matches!(band, Interval::Known { high, .. } if *high <= 0.5));
        Interval::of_runs(self.runs, low, high)
    }
}

/// Result of the log-rank test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogRankTest {
    /// Test statistic, standard normal if both groups are equally fast; above 0 if x is faster. Its
    /// square is the χ² that most packages report.
    pub z: f64,
    /// Two-sided p-value.
    pub p: f64,
}

/// Log-rank test (Mantel 1966) of whether two groups reach the threshold equally fast.
/// `x: [n]`, `y: [m]`
///
/// Equals `scipy.stats.logrank`: Z = Σ (dₓ − nₓ d/n) / √Σ nₓ nᵧ d (n − d) / (n² (n − 1)), over all
/// times at which d of the n runs at risk reached the threshold.
///
/// `None` if no time tells the groups apart: no run reached the threshold while both groups had
/// runs at risk.
#[must_use]
pub fn log_rank_test(x: &[TimeToEvent], y: &[TimeToEvent]) -> Option<LogRankTest> {
    let both = [x, y].concat();
    let (mut excess, mut variance) = (0.0, 0.0);
    for time in event_times(&both) {
        let (n, n_x, d) = (
            at_risk(&both, time) as f64,
            at_risk(x, time) as f64,
            events(&both, time) as f64,
        );
        excess += events(x, time) as f64 - n_x * d / n;
        // The last run at risk has no variance, and n − 1 would be 0.
        if n > 1.0 {
            variance += n_x * (n - n_x) * d * (n - d) / (n * n * (n - 1.0));
        }
    }
    let z = excess / variance.sqrt();
    (variance > 0.0).then(|| LogRankTest {
        z,
        p: two_sided_normal(z),
    })
}

/// Times at which runs reached the threshold, in ascending order, each once.
fn event_times(runs: &[TimeToEvent]) -> Vec<f64> {
    let mut times = Vec::new();
    for run in runs {
        if run.observed {
            times.push(run.time);
        }
    }
    times.sort_unstable_by(f64::total_cmp);
    times.dedup();
    times
}

/// Runs that have neither reached the threshold nor ended before `time`.
///
/// At equal times events come before censoring, by convention: a run that ended at `time` without
/// reaching the threshold was still at risk when others reached it at `time`. Hence ≥.
fn at_risk(runs: &[TimeToEvent], time: f64) -> usize {
    runs.iter().filter(|run| run.time >= time).count()
}

/// Runs that reached the threshold exactly at `time`.
fn events(runs: &[TimeToEvent], time: f64) -> usize {
    runs.iter()
        .filter(|run| run.observed && run.time == time)
        .count()
}

fn log_log_interval(runs: usize, survival: f64, greenwood: f64) -> Interval {
    // Greenwood's sum is infinite there.
    if survival == 0.0 {
        return Interval::of_runs(runs, 0.0, 0.0);
    }
    let spread = Normal::standard().inverse_cdf(0.975) * greenwood.sqrt() / survival.ln();
    Interval::of_runs(
        runs,
        survival.powf((-spread).exp()),
        survival.powf(spread.exp()),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A `+` marks a run that ended before it reached the threshold.
    fn times(words: &str) -> Vec<TimeToEvent> {
        let time = |word: &str| TimeToEvent {
            time: word.trim_end_matches('+').parse().unwrap(),
            observed: !word.ends_with('+'),
        };
        words.split_whitespace().map(time).collect()
    }

    fn shares(runs: &str) -> Vec<f64> {
        kaplan_meier(&times(runs))
            .steps
            .iter()
            .map(|step| step.survival)
            .collect()
    }

    /// At 1, one of 5 has the event: 4/5. At 3 the one censored at 2 is gone, and one of 3 has it:
    /// 4/5 · 2/3 = 8/15. The one censored at 4 still counts at 4, when 1 of 2 has it: 4/15.
    #[test]
    fn censored_runs_count_until_they_end() {
        for (ours, expected) in
            shares("1 2+ 3 4+ 4")
                .iter()
                .zip([4.0 / 5.0, 8.0 / 15.0, 4.0 / 15.0])
        {
            assert!((ours - expected).abs() < 1e-15);
        }
        assert_eq!(kaplan_meier(&times("1 2+ 3 4+ 4")).median(), Some(4.0));
    }

    /// Of four, S is ½ from the second, at 5, to the third, at 7. Of five it passes ½ at the third.
    #[test]
    fn the_median_is_when_half_have_the_event() {
        assert_eq!(kaplan_meier(&times("7 3 5 9")).median(), Some(6.0));
        assert_eq!(kaplan_meier(&times("7 3 5 9 11")).median(), Some(7.0));
        assert_eq!(kaplan_meier(&times("3 9+ 9+ 9+ 5")).median(), None);
        assert_eq!(kaplan_meier(&times("3 9+ 9+ 5")).median(), None);
        assert_eq!(kaplan_meier(&[]).median(), None);
    }

    #[test]
    fn few_runs_make_no_interval() {
        assert_eq!(
            kaplan_meier(&times("7 3 5 9")).median_interval(),
            Interval::TooFewRuns { n: 4 }
        );
        assert_eq!(
            kaplan_meier(&times("7 3 5 9")).steps[0].interval,
            Interval::TooFewRuns { n: 4 }
        );
    }

    /// At 1, one of x has the event (2 · 1/4 expected), at 2 one of y (1 of 3 at risk is x: 1/3
    /// expected), at 3 the last of x (1/2), at 4 y alone. Excess 2 − 1/2 − 1/3 − 1/2 = 2/3,
    /// variance 1/4 + 2/9 + 1/4 = 13/18.
    #[test]
    fn the_log_rank_test_counts_more_events_than_expected() {
        let test = log_rank_test(&times("1 3"), &times("2 4")).unwrap();
        assert!((test.z - (2.0 / 3.0) / (13.0_f64 / 18.0).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn groups_without_events_have_no_test() {
        assert_eq!(log_rank_test(&times("5+ 5+"), &times("5+")), None);
    }
}
