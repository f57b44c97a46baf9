//! Progress of runs on the terminal.

use std::io::IsTerminal;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use indicatif::{HumanCount, ProgressBar, ProgressStyle};

use super::forecast::Forecast;
use seedbed::run::measures::RoundRows;
use seedbed::run::{Observer, Progress};
use seedbed::study::design::cell::PlannedRun;
use seedbed::text::short_number;

/// Shows no progress; prints warnings only.
pub(super) struct NoProgress;

impl Observer for NoProgress {
    fn begun(&mut self, _: &Progress) {}

    fn round_finished(&mut self, _: &Progress, _: &RoundRows) {}

    fn warn(&mut self, warning: &str) {
        note!("warning: {warning}");
    }
}

/// Aborts the process without cleanup when a number of rounds is finished. So tests of resuming get
/// a crash at a known moment.
pub(super) struct AbortAfter {
    pub(super) rounds: u32,
}

impl Observer for AbortAfter {
    fn begun(&mut self, _: &Progress) {}

    fn round_finished(&mut self, _: &Progress, _: &RoundRows) {
        self.rounds = self.rounds.saturating_sub(1);
        if self.rounds == 0 {
            std::process::abort();
        }
    }
}

/// Several observers of one run, in their order.
pub(super) struct Observers {
    pub(super) all: Vec<Box<dyn Observer>>,
    /// Environment steps of a resumed run before this process; otherwise 0.
    pub(super) steps_before: u64,
}

impl Observer for Observers {
    fn begun(&mut self, progress: &Progress) {
        self.steps_before = progress.env_steps;
        self.all.iter_mut().for_each(|each| each.begun(progress));
    }

    fn round_finished(&mut self, progress: &Progress, rows: &RoundRows) {
        self.all
            .iter_mut()
            .for_each(|each| each.round_finished(progress, rows));
    }

    fn warn(&mut self, warning: &str) {
        self.all.iter_mut().for_each(|each| each.warn(warning));
    }
}

/// Progress of a run: a bar on a terminal, otherwise one line per tenth of the run.
pub(super) struct RunProgress {
    bar: Option<ProgressBar>,
    started: Instant,
    /// Environment steps of a resumed run before this process; otherwise 0.
    steps_before: u64,
    /// Number of tenths of the run for which a line was printed.
    printed_tenths: u64,
}

impl RunProgress {
    pub(super) fn new(name: &str) -> Self {
        let style =
            ProgressStyle::with_template("{prefix} {bar:32} {pos}/{len} {msg} · {eta} left");
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::no_length().with_prefix(name.to_owned());
            bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
        });
        Self {
            bar,
            started: Instant::now(),
            steps_before: 0,
            printed_tenths: 0,
        }
    }
}

impl Observer for RunProgress {
    fn begun(&mut self, progress: &Progress) {
        (self.started, self.steps_before) = (Instant::now(), progress.env_steps);
        let Played { count, max, unit } = Played::of(progress);
        if progress.env_steps > 0 {
            note!("resumed    from the newest checkpoint, after {count} of {max} {unit}");
        }
        if let Some(bar) = &self.bar {
            bar.set_length(max);
        }
    }

    fn round_finished(&mut self, progress: &Progress, _: &RoundRows) {
        let rate = (progress.env_steps - self.steps_before) as f64
            / self.started.elapsed().as_secs_f64().max(1e-3);
        let rate = HumanCount(rate as u64);
        let message = format!(
            "mean return {} · {rate} env steps/s",
            short_number(progress.recent_return)
        );
        let played = Played::of(progress);
        match &self.bar {
            Some(bar) => {
                bar.set_position(played.count);
                bar.set_message(format!("{} · {message}", played.unit));
            }
            None => self.print_line(&played, &message),
        }
    }

    fn warn(&mut self, warning: &str) {
        match &self.bar {
            Some(bar) => bar.suspend(|| note!("warning: {warning}")),
            None => note!("warning: {warning}"),
        }
    }
}

impl RunProgress {
    fn print_line(&mut self, played: &Played, message: &str) {
        let tenths = 10 * played.count / played.max.max(1);
        if tenths > self.printed_tenths {
            self.printed_tenths = tenths;
            let Played { count, max, unit } = played;
            note!("{count}/{max} {unit} · {message}");
        }
    }
}

/// How much of a run has been played, in the unit after which it ends.
struct Played {
    count: u64,
    max: u64,
    unit: &'static str,
}

impl Played {
    fn of(progress: &Progress) -> Self {
        match progress.max_env_steps {
            Some(max) => Self {
                count: progress.env_steps.min(max),
                max,
                unit: "env steps",
            },
            None => Self {
                count: progress.episodes as u64,
                max: progress.max_episodes as u64,
                unit: "episodes",
            },
        }
    }
}

impl Drop for RunProgress {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// Progress of a study: a bar on a terminal, otherwise one line per tenth of the work, and at least
/// one in five minutes.
pub(super) struct StudyProgress {
    bar: Option<ProgressBar>,
    runs: usize,
    finished_runs: usize,
    /// Estimated cost of all runs.
    cost: f64,
    finished_cost: f64,
    forecast: Forecast,
    /// Number of tenths of the cost for which a line was printed.
    printed_tenths: usize,
    last_line: Instant,
}

/// Maximum time between two lines, if a run ends in that time.
const MAX_SILENCE: Duration = Duration::from_mins(5);

impl StudyProgress {
    pub(super) fn new(name: &str, planned: &[PlannedRun<'_>], threads: usize) -> Self {
        let style = ProgressStyle::with_template("{prefix} {bar:32} {msg}")
            .unwrap_or_else(|_| ProgressStyle::default_bar());
        let bar = std::io::stderr().is_terminal().then(|| {
            ProgressBar::new(BAR_STEPS)
                .with_prefix(name.to_owned())
                .with_style(style)
        });
        let cost = planned.iter().map(|run| run.cell.source.cost()).sum();
        let progress = Self {
            bar,
            runs: planned.len(),
            finished_runs: 0,
            cost,
            finished_cost: 0.0,
            forecast: Forecast::new(planned, threads),
            printed_tenths: 0,
            last_line: Instant::now(),
        };
        progress.show();
        progress
    }

    /// `seconds`: for which a thread worked on the run
    pub(super) fn run_finished(&mut self, run: &PlannedRun<'_>, seconds: f64) {
        self.finished_runs += 1;
        self.finished_cost += run.cell.source.cost();
        let was_measured = self.forecast.is_measured();
        self.forecast.run_finished(run.cell.digest(), seconds);
        if self.forecast.is_measured() && !was_measured {
            self.print_forecast();
        }
        self.show();
        let tenths = (10.0 * self.finished_share() + 1e-9) as usize;
        let is_due = tenths > self.printed_tenths || self.last_line.elapsed() > MAX_SILENCE;
        if self.bar.is_none() && is_due {
            self.printed_tenths = tenths;
            self.last_line = Instant::now();
            note!("{}", self.message());
        }
    }

    /// Prints how long all runs take, when one of each cell has finished.
    fn print_forecast(&self) {
        let seconds = self.forecast.seconds_left().unwrap_or_default();
        if seconds >= MIN_IN_MINUTES {
            let left = remaining_time(seconds);
            self.print(&format!(
                "forecast   one run of each cell is finished{left}"
            ));
        }
    }

    /// Prints a line.
    pub(super) fn print(&self, line: &str) {
        match &self.bar {
            Some(bar) => bar.suspend(|| note!("{line}")),
            None => note!("{line}"),
        }
    }

    fn show(&self) {
        if let Some(bar) = &self.bar {
            bar.set_position((BAR_STEPS as f64 * self.finished_share()) as u64);
            bar.set_message(self.message());
        }
    }

    /// Finished share of the work, by the estimated costs of runs.
    fn finished_share(&self) -> f64 {
        if self.finished_runs == self.runs {
            1.0
        } else {
            self.finished_cost / self.cost
        }
    }

    fn message(&self) -> String {
        let left = self.forecast.seconds_left().map(remaining_time);
        let left = left.unwrap_or_default();
        format!("{}/{} runs{left}", self.finished_runs, self.runs)
    }
}

/// Shortest time that is told in minutes, s.
const MIN_IN_MINUTES: f64 = 90.0;

/// Estimated remaining time, e.g. ` · about 3 min left`.
fn remaining_time(seconds: f64) -> String {
    match seconds {
        seconds if seconds < 1.0 => String::new(),
        seconds if seconds < MIN_IN_MINUTES => format!(" · about {seconds:.0} s left"),
        seconds => format!(" · about {:.0} min left", seconds / 60.0),
    }
}

/// Number of steps into which the bar of a study is divided.
const BAR_STEPS: u64 = 1000;

impl Drop for StudyProgress {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// Progress of equal parts of some work, which several threads may finish: a bar on a terminal, otherwise a line after
/// the first part if the others take long, and one each minute.
pub(super) struct PartsProgress {
    bar: Option<ProgressBar>,
    /// What the parts are.
    what: &'static str,
    parts: usize,
    finished: AtomicUsize,
    started: Instant,
    /// When the latest line was printed, in seconds after the start.
    latest_line: AtomicU64,
}

/// Seconds from one line to the next.
const SECONDS_PER_LINE: u64 = 60;

/// Shortest time of all parts together that is told after the first, s.
const MIN_FORECAST: f64 = 10.0;

impl PartsProgress {
    pub(super) fn new(what: &'static str, parts: usize) -> Self {
        let is_terminal = std::io::stderr().is_terminal();
        Self {
            bar: is_terminal.then(|| episode_bar(parts as u32, what)),
            what,
            parts,
            finished: AtomicUsize::new(0),
            started: Instant::now(),
            latest_line: AtomicU64::new(0),
        }
    }

    pub(super) fn part_finished(&self) {
        let finished = self.finished.fetch_add(1, Ordering::Relaxed) + 1;
        match &self.bar {
            Some(bar) => bar.inc(1),
            None => self.print_line_if_due(finished),
        }
    }

    fn print_line_if_due(&self, finished: usize) {
        let (what, parts, elapsed) = (self.what, self.parts, self.started.elapsed());
        let left = elapsed.as_secs_f64() / finished as f64 * (parts - finished) as f64;
        let latest_line = self.latest_line.load(Ordering::Relaxed);
        let since_line = elapsed.as_secs().saturating_sub(latest_line);
        let is_forecast = finished == 1 && left >= MIN_FORECAST;
        if finished < parts && (is_forecast || since_line >= SECONDS_PER_LINE) {
            self.latest_line.store(elapsed.as_secs(), Ordering::Relaxed);
            note!("{finished}/{parts} {what}{}", remaining_time(left));
        }
    }

    /// Prints something beside the bar.
    pub(super) fn suspend(&self, print: impl FnOnce()) {
        match &self.bar {
            Some(bar) => bar.suspend(print),
            None => print(),
        }
    }
}

impl Drop for PartsProgress {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// Bar that counts to `total` units `what`; hidden if the output is not a terminal.
pub(super) fn episode_bar(total: u32, what: &str) -> ProgressBar {
    let bar = ProgressBar::new(total.into());
    let style =
        ProgressStyle::with_template(&format!("{{bar:30}} {{pos}}/{{len}} {what} · {{eta}} left"));
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar
}

/// Counter of what was read; shown on a terminal only.
pub(super) struct ReadCounter(Option<ProgressBar>);

impl ReadCounter {
    pub(super) fn new(what: &'static str) -> Self {
        Self(std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::no_length().with_message(what);
            let style = ProgressStyle::with_template("{spinner} {human_pos} {msg}");
            bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_spinner()))
        }))
    }

    pub(super) fn count(&self) {
        if let Some(bar) = &self.0 {
            bar.inc(1);
        }
    }
}

impl Drop for ReadCounter {
    fn drop(&mut self) {
        if let Some(bar) = &self.0 {
            bar.finish_and_clear();
        }
    }
}
