//! The difference between the densities of two agents.
//!
//! Differences are shown on a square-root scale. On a linear scale most of them would be black,
//! because they are small compared with the largest difference. A logarithmic scale cannot show 0,
//! the difference where both agents have equal shares.

use crate::run::ranks::Ranks;

/// Distance between the columns of pixels that are compared to find the two agents that differ
/// most.
const COLUMN_STRIDE: usize = 8;

/// For each pixel, the difference d between the share of the states of `one` whose lines cross it, and
/// the share of the states of `other`. Both were drawn on the same axes.
///
/// `one`, `other`: number of lines over each pixel, `[height × width]`, and number of states. Returns
/// sign(d) √(|d| / D) for each pixel, from −1 to 1, and D, the largest |d|.
#[must_use]
pub fn share_difference(
    (one, states_of_one): (&[u32], u64),
    (other, states_of_other): (&[u32], u64),
) -> (Vec<f32>, f32) {
    let share_per_line = |states: u64| 1.0 / (states as f32).max(1.0);
    let (weight_of_one, weight_of_other) = (
        share_per_line(states_of_one),
        share_per_line(states_of_other),
    );
    let differences: Vec<f32> = one
        .iter()
        .zip(other)
        .map(|(&one, &other)| one as f32 * weight_of_one - other as f32 * weight_of_other)
        .collect();
    let largest = differences
        .iter()
        .fold(0.0_f32, |largest, difference| largest.max(difference.abs()));
    let scale = if largest > 0.0 { largest } else { 1.0 };
    let scaled = differences
        .iter()
        .map(|difference| (difference.abs() / scale).sqrt().copysign(*difference))
        .collect();
    (scaled, largest)
}

/// Maximum number of agents of which every pair is compared. The time for all pairs grows with the
/// square of the number of agents.
const MAX_AGENTS_FOR_ALL_PAIRS: u64 = 32;

/// The two agents whose densities differ most, measured by the sum of |d| over every eighth column
/// of pixels. In case of a tie, the first such pair; `None` for a single agent.
///
/// In teams of more than 32 agents, these are the agent that differs most from the mean of the team,
/// and the agent that differs most from this agent.
///
/// `densities`: number of lines over each pixel, `[local agents][height × width]`; `first_agent`: number of the first
/// local agent. All ranks must call it, and get the same agents.
#[must_use]
pub fn most_different(
    densities: &[impl AsRef<[u32]>],
    first_agent: u32,
    width: usize,
    ranks: Ranks,
) -> Option<(u32, u32)> {
    let count = ranks.sum(vec![densities.len() as u64])[0];
    if count < 2 {
        return None;
    }
    let team = TeamDensities {
        densities,
        first_agent,
        width,
        ranks,
    };
    if count > MAX_AGENTS_FOR_ALL_PAIRS {
        let one = team.farthest(&team.mean_shares(count));
        let other = team.farthest(&team.shares_of(one));
        return Some((one.min(other), one.max(other)));
    }
    let all_shares = ranks.all_gather(team.all_shares()).concat();
    let mut max = ((0, 1), f32::NEG_INFINITY);
    for (one, shares_of_one) in (0..).zip(&all_shares) {
        for (other, shares_of_other) in (0..).zip(&all_shares).skip(one as usize + 1) {
            let distance = distance(shares_of_one, shares_of_other);
            if distance > max.1 {
                max = ((one, other), distance);
            }
        }
    }
    Some(max.0)
}

/// The densities of the local agents, and those on other ranks.
struct TeamDensities<'a, D> {
    densities: &'a [D],
    first_agent: u32,
    width: usize,
    ranks: Ranks,
}

impl<D: AsRef<[u32]>> TeamDensities<'_, D> {
    fn all_shares(&self) -> Vec<Vec<f32>> {
        let densities = self.densities.iter();
        let shares = densities.map(|pixels| column_shares(pixels.as_ref(), self.width));
        shares.collect()
    }

    /// The agent whose shares differ most from `shares`; the first one in case of a tie.
    fn farthest(&self, shares: &[f32]) -> u32 {
        let distances = self
            .densities
            .iter()
            .map(|pixels| distance(shares, &column_shares(pixels.as_ref(), self.width)));
        let farther = |max: (u32, f32), next: (u32, f32)| if next.1 > max.1 { next } else { max };
        let local = (self.first_agent..).zip(distances).reduce(farther);
        let all = self.ranks.all_gather(local).into_iter().flatten();
        all.reduce(farther).map_or(0, |(agent, _)| agent)
    }

    /// The mean of the shares of `count` agents.
    fn mean_shares(&self, count: u64) -> Vec<f32> {
        let sums = self.ranks.pass_along(1, |_, sums| {
            for pixels in self.densities {
                let shares = column_shares(pixels.as_ref(), self.width);
                if sums.is_empty() {
                    *sums = shares.into_iter().map(f64::from).collect();
                    continue;
                }
                for (sum, share) in sums.iter_mut().zip(shares) {
                    *sum = f64::from(*sum as f32 + share);
                }
            }
        });
        let sums = self.ranks.all_gather(sums).into_iter().flatten().flatten();
        let agents = count as f32;
        sums.flatten().map(|sum| sum as f32 / agents).collect()
    }

    /// The shares of an agent, which may be on another rank.
    fn shares_of(&self, agent: u32) -> Vec<f32> {
        let index = agent.checked_sub(self.first_agent);
        let local = index.and_then(|index| self.densities.get(index as usize));
        let shares = local.map(|pixels| column_shares(pixels.as_ref(), self.width));
        let all = self.ranks.all_gather(shares);
        all.into_iter().flatten().next().unwrap_or_default()
    }
}

fn distance(one: &[f32], other: &[f32]) -> f32 {
    let differences = one
        .iter()
        .zip(other)
        .map(|(one, other)| (one - other).abs());
    differences.sum()
}

/// The share of lines that cross each pixel of every eighth column, row by row.
fn column_shares(pixels: &[u32], width: usize) -> Vec<f32> {
    let share_per_line = 1.0 / (line_count(pixels, width) as f32).max(1.0);
    pixels
        .chunks_exact(width)
        .flat_map(|row| {
            row.iter()
                .step_by(COLUMN_STRIDE)
                .map(|&lines| lines as f32 * share_per_line)
        })
        .collect()
}

/// Total number of lines of states that have one from the first axis on: each crosses the first column
/// of pixels exactly once.
#[must_use]
pub fn line_count(pixels: &[u32], width: usize) -> u64 {
    pixels
        .iter()
        .step_by(width)
        .map(|&lines| u64::from(lines))
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One agent has 4 lines, the other has 2, over two rows and three columns of pixels. The upper
    /// row has the differences 1/4 − 2/2 = −0.75, 2/4 − 1/2 = 0 and 3/4 − 0/2 = 0.75.
    #[test]
    fn agents_are_compared_by_shares_of_their_lines() {
        let (one, other) = ([1, 2, 3, 3, 2, 1], [2, 1, 0, 0, 1, 2]);
        let difference = |one: &[u32], other: &[u32], width| {
            share_difference(
                (one, line_count(one, width)),
                (other, line_count(other, width)),
            )
        };
        assert_eq!(
            difference(&one, &other, 3),
            (vec![-1.0, 0.0, 1.0, 1.0, 0.0, -1.0], 0.75)
        );
        assert_eq!(difference(&[4, 0], &[3, 1], 1), (vec![1.0, -1.0], 0.25));
        assert_eq!(difference(&[0, 0], &[0, 0], 1), (vec![0.0, 0.0], 0.0));
    }

    /// The difference 0.0625 is a quarter of the largest difference, 0.25, so its value on the
    /// square-root scale is ½.
    #[test]
    fn differences_have_a_square_root_scale() {
        let (scaled, largest) = share_difference((&[8, 3, 5], 16), (&[4, 4, 8], 16));
        assert_eq!(
            (scaled, largest),
            (vec![1.0, -0.5, -(0.1875_f32 / 0.25).sqrt()], 0.25)
        );
    }

    #[test]
    fn the_two_agents_with_the_largest_difference_are_found() {
        let densities: [&[u32]; 4] = [&[5, 5], &[6, 4], &[10, 0], &[2, 8]];
        assert_eq!(
            most_different(&densities, 0, 1, Ranks::SINGLE),
            Some((2, 3))
        );
        assert_eq!(
            most_different(&[&[1, 1], &[1, 1], &[1, 1]], 0, 1, Ranks::SINGLE),
            Some((0, 1))
        );
        assert_eq!(most_different(&densities[..1], 0, 1, Ranks::SINGLE), None);
    }

    /// All agents of a large team have their lines in the upper row, except agent 70, whose lines
    /// are in the lower row, and agent 20, whose lines are in both.
    #[test]
    fn two_agents_of_a_large_team_are_found() {
        let mut densities: Vec<&[u32]> = vec![&[9, 0]; 100];
        (densities[20], densities[70]) = (&[5, 5], &[0, 3]);
        assert_eq!(
            most_different(&densities, 0, 1, Ranks::SINGLE),
            Some((0, 70))
        );
    }
}
