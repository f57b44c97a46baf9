//! How the densities of two agents differ.

/// Between two columns of pixels that are looked at to find who differs most.
const STRIDE: usize = 8;

/// By how much more of the one agent's lines than of the other's cross each pixel, as a share of all lines of each.
///
/// `one`, `other`: lines over each pixel, `[height × width]`. Returns for each pixel sign(d) √(|d| / D), from −1 to 1, and D, the largest |d|.
#[must_use]
pub fn differing(one: &[u32], other: &[u32], width: usize) -> (Vec<f32>, f32) {
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

/// The two agents whose densities differ most: those with the largest total of |d| over every eighth column of pixels. The first such
/// two, if several differ as much; none in a team of one.
///
/// `pictures`: lines over each pixel, `[agents][height × width]`.
#[must_use]
pub fn most_different(pictures: &[&[u32]], width: usize) -> Option<(usize, usize)> {
    let sketches: Vec<Vec<f32>> = pictures
        .iter()
        .map(|pixels| sketch(pixels, width))
        .collect();
    let mut most = None;
    for (one, sketch) in sketches.iter().enumerate() {
        for (other, of_other) in sketches.iter().enumerate().skip(one + 1) {
            let distance: f32 = sketch
                .iter()
                .zip(of_other)
                .map(|(one, other)| (one - other).abs())
                .sum();
            if most.is_none_or(|(_, largest)| distance > largest) {
                most = Some(((one, other), distance));
            }
        }
    }
    most.map(|(agents, _)| agents)
}

fn sketch(pixels: &[u32], width: usize) -> Vec<f32> {
    let share = 1.0 / (lines(pixels, width) as f32).max(1.0);
    pixels
        .chunks_exact(width)
        .flat_map(|row| {
            row.iter()
                .step_by(STRIDE)
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

    /// 4 lines of one agent and 2 of the other over two rows and three columns. In the last column 3 of 4 lines less 0 of 2 are above:
    /// 0.75, the largest; in the middle 2 of 4 less 1 of 2: none; in the first 1 of 4 less 2 of 2: −0.75.
    #[test]
    fn shares_of_lines_are_compared() {
        let (one, other) = ([1, 2, 3, 3, 2, 1], [2, 1, 0, 0, 1, 2]);
        assert_eq!(
            differing(&one, &other, 3),
            (vec![-1.0, 0.0, 1.0, 1.0, 0.0, -1.0], 0.75)
        );
        assert_eq!(differing(&[4, 0], &[3, 1], 1), (vec![1.0, -1.0], 0.25));
        assert_eq!(differing(&[0, 0], &[0, 0], 1), (vec![0.0, 0.0], 0.0));
    }

    /// Differences of 0.25 and 0.0625 in share: the smaller one is a quarter of the larger and gets half its colour.
    #[test]
    fn small_differences_are_raised_by_a_root() {
        let (scaled, largest) = differing(&[8, 3, 5], &[4, 4, 8], 1);
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
