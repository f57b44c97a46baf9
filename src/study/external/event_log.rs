//! What the event files of a run say of one tag, and which of it is void because the run was
//! restarted from a checkpoint.
//!
//! A process that continues a run writes a new file. What earlier files say of the steps that it
//! repeats is void, as for TensorBoard's `EventAccumulator` (`event_accumulator.py`):
//!
//! - From version 2 of the format on, an event `SessionLog.START` voids all earlier values at its step
//!   and at later steps. `SummaryWriter(purge_step=…)` writes one.
//! - Before version 2, a value at a step below that of an earlier event voids the earlier values of
//!   its tag at its step and at later steps.
//!
//! Most programs write no `START`. Then a file of version 2 continues the run at its first step: that
//! of the tag or of another tag whose steps count the same.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::data_file::{DataFile, file_error};
use crate::export::event_file::Event;
use crate::text::pluralize;
use seedbed_input::InputError;

/// Version of the format from which on only `SessionLog.START` voids values.
const VERSION_WITH_START: f64 = 2.0;

/// A value of the tag.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LoggedValue {
    pub(super) step: i64,
    pub(super) value: f64,
    /// Whether the file has it in double precision.
    pub(super) is_double: bool,
    /// Number of its record in the file, from 1.
    record: usize,
    /// Newest step before its event.
    latest: LatestStep,
}

/// What an event file says of the tag.
pub(super) struct EventLog {
    path: PathBuf,
    /// Path relative to the folder of the study.
    pub(super) name: String,
    /// Times of the first and of the last event, in seconds; `None` if the file has no times.
    times: Option<[f64; 2]>,
    version: Option<f64>,
    pub(super) values: Vec<LoggedValue>,
    /// Events `SessionLog.START`: the number of values before them, and their steps.
    starts: Vec<(usize, i64)>,
    latest: LatestStep,
    others: BTreeMap<String, OtherTag>,
}

/// The newest step of a file, as TensorBoard counts it before version 2: events without values set
/// it, values only increase it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct LatestStep {
    step: Option<i64>,
    is_set: bool,
}

/// Steps of another tag in a file.
#[derive(Clone, Copy, Debug)]
struct OtherTag {
    first: i64,
    /// Whether it has a step other than 0. Constants are written without a step.
    has_steps: bool,
    /// Whether its steps and those of the values do not decrease, in the order of the records.
    is_in_order: bool,
    /// Number of its events.
    events: usize,
    /// Whether an event of it comes after a value.
    follows_value: bool,
    /// Number of values before its newest event.
    values_before: usize,
    newest: i64,
}

impl LatestStep {
    fn after(self, event: &Event) -> Self {
        let is_set = event.summary.is_none();
        let earlier = self.step.filter(|_| !is_set);
        Self {
            step: Some(earlier.map_or(event.step, |step| step.max(event.step))),
            is_set: is_set || self.is_set,
        }
    }

    /// The newest step, if it was `earlier` before the file.
    fn since(self, earlier: i64) -> i64 {
        match self.step {
            None => earlier,
            Some(step) if self.is_set => step,
            Some(step) => step.max(earlier),
        }
    }
}

impl EventLog {
    pub(super) fn new(file: &DataFile) -> Self {
        Self {
            path: file.path.clone(),
            name: file.hash.path.clone(),
            times: None,
            version: None,
            values: Vec::new(),
            starts: Vec::new(),
            latest: LatestStep::default(),
            others: BTreeMap::new(),
        }
    }

    /// Adds the next event of the file, which is in the record with this number.
    pub(super) fn add(&mut self, record: usize, event: &Event, tag: &str) {
        self.add_time(event.wall_time);
        self.version = event.version().or(self.version);
        if event.is_start() {
            self.starts.push((self.values.len(), event.step));
        }
        for scalar in event.summary.iter().flat_map(|summary| &summary.value) {
            let Some(value) = scalar.number() else {
                continue;
            };
            if scalar.tag == tag {
                self.values.push(LoggedValue {
                    step: event.step,
                    value,
                    is_double: scalar.is_double(),
                    record,
                    latest: self.latest,
                });
            } else {
                self.add_step_of_other(&scalar.tag, event.step);
            }
        }
        self.latest = self.latest.after(event);
    }

    fn add_time(&mut self, time: f64) {
        let is_first = self.latest.step.is_none();
        match &mut self.times {
            Some([_, last]) => *last = last.max(time),
            None if is_first && time > 0.0 => self.times = Some([time; 2]),
            None => {}
        }
    }

    fn add_step_of_other(&mut self, tag: &str, step: i64) {
        let newest_value = self.values.last().map_or(step, |value| value.step);
        if let Some(other) = self.others.get_mut(tag) {
            other.is_in_order &= other.precedes_next_of(&self.values);
            other.is_in_order &= step >= other.newest && step >= newest_value;
            other.has_steps |= step != 0;
            other.events += 1;
            other.follows_value |= !self.values.is_empty();
            (other.values_before, other.newest) = (self.values.len(), step);
            return;
        }
        let other = OtherTag {
            first: step,
            has_steps: step != 0,
            is_in_order: step >= newest_value,
            events: 1,
            follows_value: !self.values.is_empty(),
            values_before: self.values.len(),
            newest: step,
        };
        self.others.insert(tag.to_owned(), other);
    }

    /// Names of the other tags.
    pub(super) fn other_tags(&self) -> impl Iterator<Item = &str> {
        self.others.keys().map(String::as_str)
    }

    /// The step at which this file continues the run, if no `START` says it.
    fn first_step(&self, all: &[Self]) -> Option<i64> {
        let others = self.others.iter();
        let counting = others.filter(|(tag, _)| steps_count_the_same(tag, all));
        let first_of_values = self.values.first().map(|value| value.step);
        let first_of_others = counting.map(|(_, other)| other.first);
        first_of_others.chain(first_of_values).min()
    }

    /// Whether the process that wrote `earlier` still wrote when that of this file began.
    fn overlaps(&self, earlier: &Self) -> bool {
        let times = self.times.zip(earlier.times);
        times.is_some_and(|([begin, _], [_, end])| end > begin)
    }

    fn error(&self, message: impl Into<String>) -> InputError {
        file_error(&self.path, message)
    }
}

impl OtherTag {
    /// Whether the order of its events and the values can show that both count the same: one event, or
    /// events before all values, are in order whatever they count.
    fn is_evidence(&self) -> bool {
        self.events > 1 && self.follows_value
    }

    /// Whether the value after its newest event, if there is one, has no smaller step.
    fn precedes_next_of(&self, values: &[LoggedValue]) -> bool {
        let next = values.get(self.values_before);
        next.is_none_or(|value| value.step >= self.newest)
    }
}

/// Whether the steps of another tag count the same as those of the values: in all files that have
/// both, they do not decrease in the order of the records, and one of the files has several events of it.
/// Others may count episodes, updates or processes.
fn steps_count_the_same(tag: &str, all: &[EventLog]) -> bool {
    let with_tag = || {
        let logs = all.iter();
        logs.filter_map(|log| Some((log, log.others.get(tag)?)))
    };
    let with_both = || with_tag().filter(|(log, _)| !log.values.is_empty());
    let is_in_order = |(log, other): (&EventLog, &OtherTag)| {
        other.is_in_order && other.precedes_next_of(&log.values)
    };
    with_both().any(|(_, other)| other.is_evidence())
        && with_both().all(is_in_order)
        && with_tag().any(|(_, other)| other.has_steps)
}

/// A value that is not void, and the file that has it.
type Kept<'a> = (&'a EventLog, LoggedValue);

/// The values of a run that are not void, in their order. `path` is that of the run.
pub(super) fn joined(
    path: &Path,
    mut logs: Vec<EventLog>,
    warnings: &mut Vec<String>,
) -> Result<Vec<LoggedValue>, InputError> {
    sort_by_time(&mut logs, warnings);
    let (mut kept, mut version, mut latest) = (Vec::new(), -1.0, -1);
    for (index, log) in logs.iter().enumerate() {
        version = log.version.unwrap_or(version);
        if log.starts.is_empty() && version >= VERSION_WITH_START {
            continue_run(path, &logs[..index], log, &logs, &mut kept, warnings)?;
        }
        let mut starts = log.starts.iter().peekable();
        for (number, &value) in log.values.iter().enumerate() {
            while let Some((_, step)) = starts.next_if(|(before, _)| *before <= number) {
                remove_from(*step, log, &mut kept, warnings);
            }
            if version < VERSION_WITH_START && value.step < value.latest.since(latest) {
                remove_from(value.step, log, &mut kept, warnings);
            }
            kept.push((log, value));
        }
        for (_, step) in starts {
            remove_from(*step, log, &mut kept, warnings);
        }
        if version < VERSION_WITH_START {
            latest = log.latest.since(latest);
        }
    }
    check(&kept)?;
    Ok(kept.into_iter().map(|(_, value)| value).collect())
}

/// Sorts files by the times of their first events, if all have times. They are sorted by their names,
/// which begin with that time in whole seconds.
fn sort_by_time(logs: &mut [EventLog], warnings: &mut Vec<String>) {
    let begin = |log: &EventLog| log.times.map_or(0.0, |[begin, _]| begin);
    if logs.iter().any(|log| log.times.is_none()) || logs.is_sorted_by_key(begin) {
        return;
    }
    logs.sort_by(|one, other| begin(one).total_cmp(&begin(other)));
    let names: Vec<String> = logs.iter().map(|log| format!("`{}`", log.name)).collect();
    warnings.push(format!(
        "the times in the event files differ from the order of their names: they are read in the order {}",
        names.join(", ")
    ));
}

/// Voids what earlier files say of the steps that `log` repeats.
fn continue_run<'a>(
    path: &Path,
    earlier: &'a [EventLog],
    log: &'a EventLog,
    all: &'a [EventLog],
    kept: &mut Vec<Kept<'a>>,
    warnings: &mut Vec<String>,
) -> Result<(), InputError> {
    let parallel = earlier
        .iter()
        .find(|earlier| !earlier.values.is_empty() && log.overlaps(earlier));
    if let Some(parallel) = parallel {
        if log.values.is_empty() {
            return Ok(());
        }
        return Err(file_error(
            path,
            format!(
                "`{}` and `{}` were written at the same time; expected one run per directory",
                parallel.name, log.name
            ),
        ));
    }
    let Some(first) = log.first_step(all) else {
        return Ok(());
    };
    if let Some((oldest, value)) = kept.first()
        && value.step >= first
    {
        return Err(file_error(
            path,
            format!(
                "`{}` begins at step {first}, which is not after the first value of `{}`; expected one run per directory, \
                 whose restarts continue it: move the files of other runs away (`SummaryWriter(purge_step=…)` marks a \
                 restart from the beginning)",
                log.name, oldest.name
            ),
        ));
    }
    remove_from(first, log, kept, warnings);
    Ok(())
}

/// Removes the values at `step` and at later steps.
fn remove_from(step: i64, log: &EventLog, kept: &mut Vec<Kept<'_>>, warnings: &mut Vec<String>) {
    let before = kept.len();
    kept.retain(|(_, value)| value.step < step);
    if kept.len() < before {
        warnings.push(format!(
            "{}: restarts the run at step {step}, which replaces {}",
            log.name,
            pluralize(before - kept.len(), "earlier value")
        ));
    }
}

/// Checks the values that are not void.
fn check(kept: &[Kept<'_>]) -> Result<(), InputError> {
    let mut earlier = 0;
    for (log, value) in kept {
        let LoggedValue {
            step,
            value,
            record,
            ..
        } = *value;
        let problem = if step < 0 {
            format!("expected a step of at least 0, found {step}")
        } else if step < earlier {
            format!("expected steps that do not decrease, found step {step} after step {earlier}")
        } else if !value.is_finite() {
            format!("expected a finite number, found {value} at step {step}")
        } else {
            earlier = step;
            continue;
        };
        return Err(log.error(format!("record {record}: {problem}")));
    }
    Ok(())
}
