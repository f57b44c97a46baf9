//! Times until something is reached, where some runs ended before they got there: those are censored, not dropped.

use statrs::distribution::{ContinuousCDF, Normal};

use super::{Interval, two_sided_normal};

/// Products of shares that should make ½ miss it by less.
const ROUNDING: f64 = 1e-12;

/// A run, until it reached the threshold or ended without.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lifetime {
    /// When it reached the threshold or, if it did not, how long it was watched.
    pub time: f64,
    /// Whether it reached the threshold.
    pub reached: bool,
}

/// One step of a survival curve: the share of runs still on the way after `time`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// When runs reached the threshold.
    pub time: f64,
    /// The runs on the way just before.
    pub at_risk: usize,
    /// How many of them reached it now.
    pub reached: usize,
    /// S(t), the estimated share that takes longer.
    pub survival: f64,
    /// Its pointwise 95 % interval.
    pub interval: Interval,
}

/// Kaplan and Meier's curve: a step at each time at which runs reached the threshold, from early to late. It starts at 1.
#[derive(Clone, Debug, PartialEq)]
pub struct SurvivalCurve {
    /// The steps.
    pub steps: Vec<Step>,
    runs: usize,
}

/// S(t) = Π_{tᵢ ≤ t} (1 − dᵢ / nᵢ) with dᵢ of nᵢ runs reaching the threshold at tᵢ (Kaplan and Meier 1958).   `runs: [n]`
///
/// Values are those of `scipy.stats.ecdf(…).sf`. The interval is the log-log one, S^exp(± 1.96 √V / ln S), with Greenwood's
/// sum V = Σ dᵢ / (nᵢ (nᵢ − dᵢ)); as in `lifelines` it shrinks to 0 where S does.
#[must_use]
pub fn kaplan_meier(runs: &[Lifetime]) -> SurvivalCurve {
    let (mut survival, mut greenwood) = (1.0, 0.0);
    let mut steps = Vec::new();
    for time in times_reached(runs) {
        let (at_risk, reached) = (at_risk(runs, time), reached(runs, time));
        survival *= (at_risk - reached) as f64 / at_risk as f64;
        greenwood += reached as f64 / (at_risk * (at_risk - reached)) as f64;
        let interval = log_log(runs.len(), survival, greenwood);
        steps.push(Step {
            time,
            at_risk,
            reached,
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
    /// When half of the runs have arrived: the first time with S < ½ or, where S rests on ½ exactly, halfway through the rest, as
    /// R's `survfit` has it and `lifelines`, which takes the start of the rest, has not. So without censoring it is the median
    /// of the times. `None` where S never falls below ½.
    #[must_use]
    pub fn median(&self) -> Option<f64> {
        let first = |most: f64| {
            self.steps
                .iter()
                .find(|step| step.survival <= most)
                .map(|step| step.time)
        };
        Some(f64::midpoint(
            first(0.5 + ROUNDING)?,
            first(0.5 - ROUNDING)?,
        ))
    }

    /// From where the lower to where the upper band of the curve comes down to a half (Brookmeyer and Crowley 1982); the upper
    /// end is infinite where it never does. It is `lifelines.utils.median_survival_times(curve.confidence_interval_)`.
    #[must_use]
    pub fn median_interval(&self) -> Interval {
        let first = |down: fn(&Interval) -> bool| {
            self.steps
                .iter()
                .find(|step| down(&step.interval))
                .map_or(f64::INFINITY, |step| step.time)
        };
        let low = first(|band| matches!(band, Interval::Known { low, .. } if *low <= 0.5));
        let high = first(|band| matches!(band, Interval::Known { high, .. } if *high <= 0.5));
        Interval::of_runs(self.runs, low, high)
    }
}

/// A test of whether two groups reach the threshold equally fast.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogRank {
    /// Standard normal if they do; above 0 where x is faster. Its square is the χ² of most packages.
    pub z: f64,
    /// The two-sided p.
    pub p: f64,
}

/// The log-rank test (Mantel 1966), as `scipy.stats.logrank`: Z = Σ (dₓ − nₓ d/n) / √Σ nₓ nᵧ d (n − d) / (n² (n − 1)), over
/// all times at which d of the n runs on the way reached the threshold.   `x: [n]`, `y: [m]`
///
/// `None` where no time tells them apart: none was reached while both had runs on the way.
#[must_use]
pub fn log_rank(x: &[Lifetime], y: &[Lifetime]) -> Option<LogRank> {
    let both = [x, y].concat();
    let (mut excess, mut variance) = (0.0, 0.0);
    for time in times_reached(&both) {
        let (n, n_x, d) = (
            at_risk(&both, time) as f64,
            at_risk(x, time) as f64,
            reached(&both, time) as f64,
        );
        excess += reached(x, time) as f64 - n_x * d / n;
        if n > 1.0 {
            variance += n_x * (n - n_x) * d * (n - d) / (n * n * (n - 1.0));
        }
    }
    let z = excess / variance.sqrt();
    (variance > 0.0).then(|| LogRank {
        z,
        p: two_sided_normal(z),
    })
}

/// The times at which runs reached the threshold, from early to late, each once.
fn times_reached(runs: &[Lifetime]) -> Vec<f64> {
    let mut times: Vec<f64> = runs
        .iter()
        .filter(|run| run.reached)
        .map(|run| run.time)
        .collect();
    times.sort_unstable_by(f64::total_cmp);
    times.dedup();
    times
}

/// A run that was watched until `time` and no longer still counts as on the way then.
fn at_risk(runs: &[Lifetime], time: f64) -> usize {
    runs.iter().filter(|run| run.time >= time).count()
}

fn reached(runs: &[Lifetime], time: f64) -> usize {
    runs.iter()
        .filter(|run| run.reached && run.time == time)
        .count()
}

fn log_log(runs: usize, survival: f64, greenwood: f64) -> Interval {
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
    fn lifetimes(words: &str) -> Vec<Lifetime> {
        let lifetime = |word: &str| Lifetime {
            time: word.trim_end_matches('+').parse().unwrap(),
            reached: !word.ends_with('+'),
        };
        words.split_whitespace().map(lifetime).collect()
    }

    fn shares(runs: &str) -> Vec<f64> {
        kaplan_meier(&lifetimes(runs))
            .steps
            .iter()
            .map(|step| step.survival)
            .collect()
    }

    /// At 1 one of 5 arrives: 4/5. At 3 the one watched until 2 is gone, of 3 one arrives: 4/5 · 2/3 = 8/15. The one watched
    /// until 4 still counts at 4, when 1 of 2 arrives: 4/15.
    #[test]
    fn censored_runs_count_until_they_end() {
        for (ours, expected) in
            shares("1 2+ 3 4+ 4")
                .iter()
                .zip([4.0 / 5.0, 8.0 / 15.0, 4.0 / 15.0])
        {
            assert!((ours - expected).abs() < 1e-15);
        }
        assert_eq!(kaplan_meier(&lifetimes("1 2+ 3 4+ 4")).median(), Some(4.0));
    }

    /// Of four S is ½ from the second, at 5, to the third, at 7. Of five it passes ½ at the third.
    #[test]
    fn the_median_is_when_half_have_arrived() {
        assert_eq!(kaplan_meier(&lifetimes("7 3 5 9")).median(), Some(6.0));
        assert_eq!(kaplan_meier(&lifetimes("7 3 5 9 11")).median(), Some(7.0));
        assert_eq!(kaplan_meier(&lifetimes("3 9+ 9+ 9+ 5")).median(), None);
        assert_eq!(kaplan_meier(&lifetimes("3 9+ 9+ 5")).median(), None);
        assert_eq!(kaplan_meier(&[]).median(), None);
    }

    #[test]
    fn few_runs_make_no_interval() {
        assert_eq!(
            kaplan_meier(&lifetimes("7 3 5 9")).median_interval(),
            Interval::TooFewRuns { n: 4 }
        );
        assert_eq!(
            kaplan_meier(&lifetimes("7 3 5 9")).steps[0].interval,
            Interval::TooFewRuns { n: 4 }
        );
    }

    /// Of 4 at 1 one of x arrives (of which 2 · 1/4 is expected), at 2 one of y (2 − 1 = 1 of 3 is x: 1/3 expected), at 3 the
    /// last of x (1/2), at 4 y alone. Excess 2 − 1/2 − 1/3 − 1/2 = 2/3, variance 1/4 + 2/9 + 1/4 = 13/18.
    #[test]
    fn the_log_rank_counts_more_arrivals_than_expected() {
        let test = log_rank(&lifetimes("1 3"), &lifetimes("2 4")).unwrap();
        assert!((test.z - (2.0 / 3.0) / (13.0_f64 / 18.0).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn groups_that_never_meet_are_not_told_apart() {
        assert_eq!(log_rank(&lifetimes("5+ 5+"), &lifetimes("5+")), None);
    }
}
