//! The difference between the densities of two agents.
//!
//! Differences are shown on a square-root scale: most of them are a small part of the largest one
//! and would all be black on a linear scale, whereas a logarithm has no zero, which is where two
//! agents agree.

/// Every how many columns of pixels are compared to find the two agents that differ most.
const COLUMN_STRIDE: usize = 8;

/// The difference d between the share of `one`'s lines and the share of `other`'s lines that cross
/// each pixel.
///
/// `one`, `other`: lines over each pixel, `[height × width]`. Returns sign(d) √(|d| / D) for each
/// pixel, from −1 to 1, and D, the largest |d|.
#[must_use]
pub fn share_difference(one: &[u32], other: &[u32], width: usize) -> (Vec<f32>, f32) {
    let shares = |pixels: &[u32]| 1.0 / (lines(pixels, width) as f32).max(1.0);
    let (of_one, of_other) = (shares(one), shares(other));
    let differences: Vec<f32> = one
        .iter()
        .zip(other)
        .map(|(&one, &other)| one as f32 * of_one - other as f32 * of_other)
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

/// The two agents whose densities differ most: those with the largest sum of |d| over every eighth
/// column of pixels. The first such pair in case of a tie; none in a team of one.
///
/// `densities`: lines over each pixel, `[agents][height × width]`.
#[must_use]
pub fn most_different(densities: &[&[u32]], width: usize) -> Option<(usize, usize)> {
    let all_shares: Vec<Vec<f32>> = densities
        .iter()
        .map(|pixels| column_shares(pixels, width))
        .collect();
    let mut max = None;
    for (one, column_shares) in all_shares.iter().enumerate() {
        for (other, of_other) in all_shares.iter().enumerate().skip(one + 1) {
            let distance: f32 = column_shares
                .iter()
                .zip(of_other)
                .map(|(one, other)| (one - other).abs())
                .sum();
            if max.is_none_or(|(_, largest)| distance > largest) {
                max = Some(((one, other), distance));
            }
        }
    }
    max.map(|(agents, _)| agents)
}

fn column_shares(pixels: &[u32], width: usize) -> Vec<f32> {
    let share = 1.0 / (lines(pixels, width) as f32).max(1.0);
    pixels
        .chunks_exact(width)
        .flat_map(|row| {
            row.iter()
                .step_by(COLUMN_STRIDE)
                .map(|&lines| lines as f32 * share)
        })
        .collect()
}

/// Every line crosses the first column once.
fn lines(pixels: &[u32], width: usize) -> u64 {
    pixels
        .iter()
        .step_by(width)
        .map(|&lines| u64::from(lines))
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 4 lines of one agent and 2 of the other over two rows and three columns. In the last column
    /// 3 of 4 lines less 0 of 2 are above: 0.75, the largest; in the middle 2 of 4 less 1 of 2:
    /// none; in the first 1 of 4 less 2 of 2: −0.75.
    #[test]
    fn shares_of_lines_are_subtracted() {
        let (one, other) = ([1, 2, 3, 3, 2, 1], [2, 1, 0, 0, 1, 2]);
        assert_eq!(
            share_difference(&one, &other, 3),
            (vec![-1.0, 0.0, 1.0, 1.0, 0.0, -1.0], 0.75)
        );
        assert_eq!(
            share_difference(&[4, 0], &[3, 1], 1),
            (vec![1.0, -1.0], 0.25)
        );
        assert_eq!(share_difference(&[0, 0], &[0, 0], 1), (vec![0.0, 0.0], 0.0));
    }

    /// Differences of 0.25 and 0.0625 in share: the smaller one is a quarter of the larger and gets
    /// half its color.
    #[test]
    fn small_differences_are_raised_by_a_root() {
        let (scaled, largest) = share_difference(&[8, 3, 5], &[4, 4, 8], 1);
        assert_eq!(
            (scaled, largest),
            (vec![1.0, -0.5, -(0.1875_f32 / 0.25).sqrt()], 0.25)
        );
    }

    #[test]
    fn the_two_that_differ_most_are_found() {
        let pictures: [&[u32]; 4] = [&[5, 5], &[6, 4], &[10, 0], &[2, 8]];
        assert_eq!(most_different(&pictures, 1), Some((2, 3)));
        assert_eq!(
            most_different(&[&[1, 1], &[1, 1], &[1, 1]], 1),
            Some((0, 1))
        );
        assert_eq!(most_different(&pictures[..1], 1), None);
    }
}
