//! Counts of groups of different sizes on a common scale.

use super::group::StateGroup;
use seedbed_figure::Key;

/// Scales the counts of each group as if it had as many states as the largest group. So panels show
/// shares, which do not depend on the lengths of runs.
pub(super) fn scale_to_largest(groups: &[StateGroup<'_>], counts: Vec<Vec<u32>>) -> Vec<Vec<u32>> {
    let max_states = max_states(groups);
    let scale = |count: u32, group_states: u64| {
        if count == 0 {
            0
        } else {
            ((u64::from(count) * max_states + group_states / 2) / group_states)
                .max(1)
                .try_into()
                .unwrap_or(u32::MAX)
        }
    };
    groups
        .iter()
        .map(StateGroup::state_count)
        .zip(counts)
        .map(|(group_states, counts)| {
            counts
                .into_iter()
                .map(|count| scale(count, group_states.max(1)))
                .collect()
        })
        .collect()
}

/// Number of states of the largest group.
fn max_states(groups: &[StateGroup<'_>]) -> u64 {
    groups
        .iter()
        .map(StateGroup::state_count)
        .max()
        .unwrap_or(0)
}

/// Key of the densities; with several groups, a key of shares.
pub(super) fn density_key(groups: &[StateGroup<'_>], label: &str, max_count: u32) -> Key {
    if groups.len() > 1 {
        return Key::Shares {
            label: format!("share of {label}"),
            max_count,
            total: max_states(groups),
        };
    }
    Key::Counts {
        label: label.to_owned(),
        max_count,
    }
}
