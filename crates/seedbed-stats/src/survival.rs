//! Survival analysis of the time until a run reaches a threshold.
//!
//! Runs that ended before they reached the threshold are *censored*, not dropped: their time is
//! known to be longer than the run.
//!
//! ```
//! use seedbed_stats::survival::{TimeToEvent, kaplan_meier};
//!
//! // Three runs reached the threshold; one run ended after 9 episodes without reaching it.
//! let ours = [3.0, 5.0, 7.0]
//!     .map(TimeToEvent::observed)
//!     .into_iter()
//!     .chain([TimeToEvent::censored(9.0)])
//!     .collect::<Vec<_>>();
//! assert_eq!(kaplan_meier(&ours).median(), Some(6.0));
//! // Mean time within the first 8 episodes: (3 + 5 + 7 + 8) / 4.
//! let times = ours.iter().map(|run| run.restricted_to(8.0));
//! assert_eq!(times.sum::<f64>() / 4.0, 5.75);
//! ```

use statrs::distribution::{ContinuousCDF, Normal};

use super::Interval;

/// Tolerance within which a survival S counts as ½: the product 4/5 · 5/8 may differ from ½ in
/// floating point.
const SURVIVAL_TOLERANCE: f64 = 1e-12;

/// Time until a run reached the threshold (the *event*), or until it ended without reaching it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeToEvent {
    /// Time at which the run reached the threshold or, if it did not, at which it ended.
    pub time: f64,
    /// Whether the run reached the threshold; otherwise its time is censored.
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

    /// Time up to `horizon`: the time of the run, or the horizon if the run took longer. The mean over
    /// runs is the restricted mean time, which equals
    /// `lifelines.utils.restricted_mean_survival_time` of the Kaplan–Meier curve.
    ///
    /// Of a run that ended before the horizon without reaching the threshold nothing is known
    /// afterwards: the horizon is only the largest time that is possible, see
    /// [`range_up_to`](Self::range_up_to).
    #[must_use]
    pub fn restricted_to(self, horizon: f64) -> f64 {
        self.range_up_to(horizon)[1]
    }

    /// The smallest and the largest possible time up to `horizon`. They differ if the run ended before
    /// the horizon without reaching the threshold: it may have reached it at any time afterwards.
    #[must_use]
    pub fn range_up_to(self, horizon: f64) -> [f64; 2] {
        let least = self.time.min(horizon);
        [least, if self.observed { least } else { horizon }]
    }
}

/// One step of a survival curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurvivalStep {
    /// Time of the step, at which some runs reached the threshold.
    pub time: f64,
    /// Number of runs that had neither reached the threshold nor ended before this time.
    pub at_risk: usize,
    /// Number of runs that reached the threshold at this time.
    pub events: usize,
    /// Estimated share S(t) of runs that need longer than this time.
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
/// Values equal those of `scipy.stats.ecdf(…).sf`. The interval of S is the log-log interval
/// S^exp(± 1.96 √V / ln S) with Greenwood's sum V = Σ dᵢ / (nᵢ (nᵢ − dᵢ)). As in `lifelines`, it is
/// [0, 0] where S is 0.
#[must_use]
pub fn kaplan_meier(runs: &[TimeToEvent]) -> SurvivalCurve {
    let (mut survival, mut greenwood) = (1.0, 0.0);
    let (mut steps, times) = (Vec::new(), SortedTimes::of(runs));
    for time in times.distinct_events() {
        let (at_risk, events) = (times.count_at_risk(time), times.count_events(time));
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
    /// Median time: the first time with S < ½ or, if S equals ½ over an interval of times, the
    /// midpoint of that interval. `None` if S never falls below ½.
    ///
    /// Without censoring this is the median of the times. R's `survfit` has the same definition;
    /// `lifelines` takes the start of the interval.
    #[must_use]
    pub fn median(&self) -> Option<f64> {
        let first_time_with_survival_at_most = |share: f64| {
            let step = self.steps.iter().find(|step| step.survival <= share)?;
            Some(step.time)
        };
        // These two times are equal unless S equals ½ after a step.
        let reaches_half = first_time_with_survival_at_most(0.5 + SURVIVAL_TOLERANCE)?;
        let falls_below_half = first_time_with_survival_at_most(0.5 - SURVIVAL_TOLERANCE)?;
        Some(f64::midpoint(reaches_half, falls_below_half))
    }

    /// 95 % interval of the median time (Brookmeyer and Crowley 1982): the times at which the lower
    /// and the upper band of the curve fall to ½. The upper end is infinite if the upper band stays
    /// above ½.
    ///
    /// Equals `lifelines.utils.median_survival_times(curve.confidence_interval_)`.
    #[must_use]
    pub fn median_interval(&self) -> Interval {
        let first_time = |is_at_most_half: fn(&Interval) -> bool| {
            let step = self
                .steps
                .iter()
                .find(|step| is_at_most_half(&step.interval));
            step.map_or(f64::INFINITY, |step| step.time)
        };
        let low = first_time(|band| matches!(band, Interval::Known { low, .. } if *low <= 0.5));
        let high = first_time(|band| matches!(band, Interval::Known { high, .. } if *high <= 0.5));
        Interval::of_runs(self.runs, low, high)
    }
}

/// Times of runs in ascending order, so that counting takes no pass over all runs.
struct SortedTimes {
    /// Times at which runs reached the threshold or ended.
    all: Vec<f64>,
    /// Times at which runs reached the threshold.
    events: Vec<f64>,
}

impl SortedTimes {
    fn of(runs: &[TimeToEvent]) -> Self {
        let mut all: Vec<f64> = runs.iter().map(|run| run.time).collect();
        let observed = runs.iter().filter(|run| run.observed);
        let mut events: Vec<f64> = observed.map(|run| run.time).collect();
        all.sort_unstable_by(f64::total_cmp);
        events.sort_unstable_by(f64::total_cmp);
        Self { all, events }
    }

    /// Times at which runs reached the threshold, in ascending order, each once.
    fn distinct_events(&self) -> Vec<f64> {
        let mut times = self.events.clone();
        times.dedup();
        times
    }

    /// Number of runs that have neither reached the threshold nor ended before `time`.
    ///
    /// At equal times events come before censoring, by convention: a run that ended at `time`
    /// without reaching the threshold was still at risk when others reached it at `time`. Hence ≥.
    fn count_at_risk(&self, time: f64) -> usize {
        self.all.len() - self.all.partition_point(|&other| other < time)
    }

    /// Number of runs that reached the threshold exactly at `time`.
    fn count_events(&self, time: f64) -> usize {
        let before = self.events.partition_point(|&other| other < time);
        self.events.partition_point(|&other| other <= time) - before
    }
}

fn log_log_interval(runs: usize, survival: f64, greenwood: f64) -> Interval {
    // Greenwood's sum is infinite where the survival is 0.
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

    /// Times of runs from a text such as `3 9+`, in which `+` marks a run that ended before it
    /// reached the threshold.
    fn times(text: &str) -> Vec<TimeToEvent> {
        let time = |word: &str| TimeToEvent {
            time: word.trim_end_matches('+').parse().unwrap(),
            observed: !word.ends_with('+'),
        };
        text.split_whitespace().map(time).collect()
    }

    fn survival_values(runs: &str) -> Vec<f64> {
        kaplan_meier(&times(runs))
            .steps
            .iter()
            .map(|step| step.survival)
            .collect()
    }

    /// At time 1, one of 5 runs has the event: S = 4/5. At time 3, one of 3 has it, because one run
    /// was censored at 2: S = 4/5 · 2/3 = 8/15. At time 4, one of 2 has it, because the run that is
    /// censored at 4 is still at risk: S = 4/15.
    #[test]
    fn censored_runs_are_at_risk_until_they_end() {
        for (ours, expected) in
            survival_values("1 2+ 3 4+ 4")
                .iter()
                .zip([4.0 / 5.0, 8.0 / 15.0, 4.0 / 15.0])
        {
            assert!((ours - expected).abs() < 1e-15);
        }
        assert_eq!(kaplan_meier(&times("1 2+ 3 4+ 4")).median(), Some(4.0));
    }

    /// With four runs, S is ½ from the second event, at 5, to the third, at 7: the median is 6.
    /// With five runs, S falls below ½ at the third event.
    #[test]
    fn the_median_is_the_time_at_which_half_of_the_runs_have_the_event() {
        assert_eq!(kaplan_meier(&times("7 3 5 9")).median(), Some(6.0));
        assert_eq!(kaplan_meier(&times("7 3 5 9 11")).median(), Some(7.0));
        assert_eq!(kaplan_meier(&times("3 9+ 9+ 9+ 5")).median(), None);
        assert_eq!(kaplan_meier(&times("3 9+ 9+ 5")).median(), None);
        assert_eq!(kaplan_meier(&[]).median(), None);
    }

    /// Up to 50, a run that ended at 30 may have reached the threshold at any time after 30.
    #[test]
    fn times_after_the_end_of_a_run_are_unknown() {
        let ranges = |horizon| {
            times("20 70 30+ 60+")
                .iter()
                .map(|run| run.range_up_to(horizon))
                .collect::<Vec<_>>()
        };
        let known = |time| [time; 2];
        assert_eq!(
            ranges(50.0),
            [known(20.0), known(50.0), [30.0, 50.0], known(50.0)]
        );
        assert_eq!(
            ranges(30.0),
            [known(20.0), known(30.0), known(30.0), known(30.0)]
        );
    }

    #[test]
    fn fewer_than_five_runs_give_no_interval() {
        assert_eq!(
            kaplan_meier(&times("7 3 5 9")).median_interval(),
            Interval::TooFewRuns { n: 4 }
        );
        assert_eq!(
            kaplan_meier(&times("7 3 5 9")).steps[0].interval,
            Interval::TooFewRuns { n: 4 }
        );
    }

    /// Counts in sorted times equal counts over all runs.
    #[test]
    fn runs_at_risk_and_events_are_counted_in_sorted_times() {
        let runs = times("5 3 3+ 8 3 1+ 8+ 8 9");
        let sorted = SortedTimes::of(&runs);
        assert_eq!(sorted.distinct_events(), [3.0, 5.0, 8.0, 9.0]);
        for time in [0.0, 1.0, 3.0, 4.0, 8.0, 9.0, 10.0] {
            let at_risk = runs.iter().filter(|run| run.time >= time).count();
            let events = |run: &&TimeToEvent| run.observed && run.time == time;
            assert_eq!(sorted.count_at_risk(time), at_risk, "{time}");
            assert_eq!(
                sorted.count_events(time),
                runs.iter().filter(events).count()
            );
        }
    }
}
