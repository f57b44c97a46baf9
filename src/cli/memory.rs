//! Refuses to start what needs more memory than this process can have.

use std::fs;
use std::path::Path;

use super::{CliError, pluralize};

/// The most memory that this process can have.
#[derive(Debug, PartialEq, Eq)]
struct Limit {
    bytes: u64,
    /// What sets the limit.
    source: &'static str,
}

/// An error if `needed` bytes, by a rough estimate, are more than this process can have. `what` is the
/// subject of the message, such as `the run`.
pub(super) fn check(what: &str, needed: u64) -> Result<(), CliError> {
    let Some(limit) = lowest_limit().filter(|limit| needed > limit.bytes) else {
        return Ok(());
    };
    Err(CliError::Usage(format!(
        "{what} would need about {}, and {} {}; reduce the number of agents, `hidden` or `replay`, or \
         start anyway with --ignore-memory",
        gigabytes(needed),
        limit.source,
        gigabytes(limit.bytes)
    )))
}

/// An error if `at_once` runs need more memory than this process can have, each as much as the largest
/// of `runs`, in bytes.
pub(super) fn check_runs(
    runs: impl Iterator<Item = u64>,
    at_once: usize,
    name: &str,
) -> Result<(), CliError> {
    let what = format!("{}{name} at once", pluralize(at_once, "run"));
    check(
        &what,
        runs.max().unwrap_or(0).saturating_mul(at_once as u64),
    )
}

fn gigabytes(bytes: u64) -> String {
    format!("{:.1} GB", bytes as f64 / 1e9)
}

/// The lowest limit; `None` if this system tells of none.
fn lowest_limit() -> Option<Limit> {
    let limits = [machine(), control_group(), address_space()];
    limits.into_iter().flatten().min_by_key(|limit| limit.bytes)
}

/// All memory of the machine.
fn machine() -> Option<Limit> {
    let text = fs::read_to_string("/proc/meminfo").ok()?;
    let line = text
        .lines()
        .find_map(|line| line.strip_prefix("MemTotal:"))?;
    let kilobytes: u64 = line.trim().strip_suffix(" kB")?.trim().parse().ok()?;
    Some(Limit {
        bytes: kilobytes * 1024,
        source: "this machine has",
    })
}

/// The lowest limit of the control groups of this process: of a container, or of a job of a cluster.
fn control_group() -> Option<Limit> {
    let groups = fs::read_to_string("/proc/self/cgroup").ok()?;
    let limits = groups.lines().flat_map(|line| {
        let mut fields = line.splitn(3, ':').skip(1);
        match (fields.next(), fields.next()) {
            (Some(""), Some(group)) => limits_upwards("/sys/fs/cgroup", group, "memory.max"),
            (Some("memory"), Some(group)) => {
                limits_upwards("/sys/fs/cgroup/memory", group, "memory.limit_in_bytes")
            }
            _ => Vec::new(),
        }
    });
    limits.min().map(|bytes| Limit {
        bytes,
        source: "its control group may have",
    })
}

/// The limits of a control group and of those that contain it.
fn limits_upwards(root: &str, group: &str, file: &str) -> Vec<u64> {
    let group = group.trim_start_matches('/');
    let folders = Path::new(group).ancestors();
    let texts = folders
        .filter_map(|folder| fs::read_to_string(Path::new(root).join(folder).join(file)).ok());
    texts.filter_map(|text| text.trim().parse().ok()).collect()
}

/// What `ulimit -v` sets.
fn address_space() -> Option<Limit> {
    let limits = fs::read_to_string("/proc/self/limits").ok()?;
    let mut lines = limits.lines();
    let line = lines.find_map(|line| line.strip_prefix("Max address space"))?;
    Some(Limit {
        bytes: line.split_whitespace().next()?.parse().ok()?,
        source: "`ulimit -v` allows",
    })
}
