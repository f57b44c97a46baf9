//! How far a run has come, on the terminal.

use std::io::IsTerminal;
use std::time::Instant;

use indicatif::{HumanCount, ProgressBar, ProgressStyle};

use crate::run::{Observer, Plan, Progress};

/// Says nothing.
pub(super) struct Silent;

impl Observer for Silent {
    fn begun(&mut self, _: &Progress) {}

    fn round_finished(&mut self, _: &Progress) {}

    fn warn(&mut self, warning: &str) {
        eprintln!("warning: {warning}");
    }
}

/// A bar on a terminal; elsewhere a line for each tenth of the run.
pub(super) struct Bar {
    drawn: Option<ProgressBar>,
    started: Instant,
    /// Steps that a resumed run had before.
    first_steps: u64,
    tenths: usize,
}

impl Bar {
    pub(super) fn new(plan: &Plan) -> Self {
        let style = ProgressStyle::with_template("{prefix} {bar:32} {pos}/{len} episodes · {msg} · {eta} left");
        let drawn = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::new(u64::from(plan.scenario.most_episodes())).with_prefix(plan.name.clone());
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            bar
        });
        Self { drawn, started: Instant::now(), first_steps: 0, tenths: 0 }
    }
}

impl Observer for Bar {
    fn begun(&mut self, progress: &Progress) {
        (self.started, self.first_steps) = (Instant::now(), progress.env_steps);
    }

    fn round_finished(&mut self, progress: &Progress) {
        let rate = (progress.env_steps - self.first_steps) as f64 / self.started.elapsed().as_secs_f64().max(1e-3);
        let rate = HumanCount(rate as u64);
        let message = format!("mean return {:.1} · {rate} env steps/s", progress.recent_return);
        match &self.drawn {
            Some(bar) => {
                bar.set_position(progress.episodes_per_agent as u64);
                bar.set_message(message);
            }
            None => self.print_line(progress, &message),
        }
    }

    fn warn(&mut self, warning: &str) {
        match &self.drawn {
            Some(bar) => bar.suspend(|| eprintln!("warning: {warning}")),
            None => eprintln!("warning: {warning}"),
        }
    }
}

impl Bar {
    fn print_line(&mut self, progress: &Progress, message: &str) {
        let tenths = 10 * progress.episodes_per_agent / progress.at_most.max(1);
        if tenths > self.tenths {
            self.tenths = tenths;
            eprintln!("{}/{} episodes · {message}", progress.episodes_per_agent, progress.at_most);
        }
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        if let Some(bar) = &self.drawn {
            bar.finish_and_clear();
        }
    }
}

/// A bar that counts to `total`; none where nobody looks on.
pub(super) fn counter(total: u32, what: &str) -> ProgressBar {
    let bar = ProgressBar::new(total.into());
    let style = ProgressStyle::with_template(&format!("{{bar:30}} {{pos}}/{{len}} {what} · {{eta}} left"));
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar
}

/// Counts on a terminal how much was read; elsewhere it says nothing.
pub(super) struct Counter(Option<ProgressBar>);

impl Counter {
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

impl Drop for Counter {
    fn drop(&mut self) {
        if let Some(bar) = &self.0 {
            bar.finish_and_clear();
        }
    }
}
