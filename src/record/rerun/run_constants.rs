//! Constants of a run and its scenario that a recorder needs.

use crate::record::visitation::LineQuota;
use crate::run::recorder::BonusRange;
use crate::run::recorder::{Focus, RunInfo};
use crate::scenario::recording::{Difference, RecordingSettings};
use seedbed_env::TaskSpec;

/// Constants of a run and its scenario that a recorder needs.
pub(super) struct RunConstants {
    pub(super) focus: Focus,
    pub(super) spec: TaskSpec,
    pub(super) bonus: BonusRange,
    pub(super) max_episodes: u32,
    pub(super) run_seed: u64,
    /// Number of agents of the team.
    pub(super) agents: u32,
    /// Number of states that are drawn as lines and points.
    pub(super) line_quota: LineQuota,
    /// Number of latest rounds in one image.
    pub(super) window: u32,
    /// Number of rounds between two images, before the interval doubles.
    pub(super) density_every: u32,
    /// Interval between the episodes that are recorded in `/raw`.
    pub(super) raw_every: u32,
    /// The two agents that are compared; `Off` for a single agent.
    pub(super) difference: Difference,
}

impl RunConstants {
    pub(super) fn of(info: &RunInfo<'_>, settings: &RecordingSettings) -> Self {
        Self {
            focus: info.focus,
            spec: info.spec.clone(),
            bonus: info.bonus,
            max_episodes: info.max_episodes,
            run_seed: info.run_seed,
            agents: info.agents,
            line_quota: LineQuota::of(settings.lines.get(), settings.window.get()),
            window: settings.window.get(),
            density_every: settings.density_every.get(),
            raw_every: settings.raw_every.get(),
            difference: if info.agents > 1 {
                settings.difference.clone()
            } else {
                Difference::Off
            },
        }
    }
}
