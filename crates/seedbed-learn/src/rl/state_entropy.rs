//! Bonuses for states that are far from their nearest neighbors. The mean of the logarithms of these
//! distances estimates the entropy of the distribution of states (Seo et al. 2021, RE3; Liu & Abbeel
//! 2021, APT). If the states are those of a team, agents are rewarded for going where no other agent
//! goes (De Paola et al. 2025).

use crate::math::ln_1p;

/// Buffers of [`distance_to_neighbor`].
#[derive(Debug, Default)]
pub struct NeighborScratch {
    /// Squared distance to each reference.
    squares: Vec<f32>,
    /// The smallest of them, in ascending order.
    nearest: Vec<f32>,
}

/// The intrinsic reward of a state: log(1 + d), where d is the distance to its k-th nearest neighbor
/// (RE3, Eq. 4).
#[must_use]
pub fn bonus(distance: f32) -> f32 {
    ln_1p(distance)
}

/// Euclidean distance from a point to its k-th nearest reference, k = `neighbors` ≥ 1. A reference
/// with the index `own` is the point itself and does not count. With fewer than k references, the
/// distance to the farthest; none without references.   `point: [width]`, `columns: [width × N]`
#[must_use]
pub fn distance_to_neighbor(
    point: &[f32],
    columns: &[f32],
    own: Option<usize>,
    neighbors: usize,
    scratch: &mut NeighborScratch,
) -> Option<f32> {
    let NeighborScratch { squares, nearest } = scratch;
    squares.clear();
    squares.resize(columns.len() / point.len().max(1), 0.0);
    for (coordinate, column) in point.iter().zip(columns.chunks_exact(squares.len().max(1))) {
        for (square, reference) in squares.iter_mut().zip(column) {
            let difference = coordinate - reference;
            *square += difference * difference;
        }
    }
    if let Some(own) = own {
        squares[own] = f32::INFINITY;
    }
    nearest.clear();
    for &square in squares.iter() {
        insert(square, neighbors, nearest);
    }
    nearest.last().map(|square| square.sqrt())
}

/// Inserts a finite number into an ascending list of the `max` smallest numbers.
fn insert(number: f32, max: usize, smallest: &mut Vec<f32>) {
    let is_full = smallest.len() == max;
    let limit = if is_full {
        smallest[max - 1]
    } else {
        f32::INFINITY
    };
    if number < limit {
        if is_full {
            smallest.pop();
        }
        let position = smallest.partition_point(|&other| other <= number);
        smallest.insert(position, number);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn distance(
        point: &[f32],
        columns: &[f32],
        own: Option<usize>,
        neighbors: usize,
    ) -> Option<f32> {
        distance_to_neighbor(
            point,
            columns,
            own,
            neighbors,
            &mut NeighborScratch::default(),
        )
    }

    /// References (0, 0), (3, 4), (0, 1), (0, 0): from the origin the distances are 0, 5, 1, 0.
    #[test]
    fn distances_by_hand() {
        let columns = [0.0, 3.0, 0.0, 0.0, 0.0, 4.0, 1.0, 0.0];
        let from_origin = |own, neighbors| distance(&[0.0, 0.0], &columns, own, neighbors);
        assert_eq!(
            [1, 2, 3, 4].map(|k| from_origin(None, k)),
            [Some(0.0), Some(0.0), Some(1.0), Some(5.0)]
        );
        assert_eq!(
            [1, 2, 3, 9].map(|k| from_origin(Some(3), k)),
            [Some(0.0), Some(1.0), Some(5.0), Some(5.0)]
        );
        assert_eq!(distance(&[0.0, 0.0], &[], None, 3), None);
        assert_eq!(distance(&[2.0], &[2.0], Some(0), 1), None);
    }

    /// log 1 = 0, log(1 + (e − 1)) = 1.
    #[test]
    fn bonuses_by_hand() {
        assert_eq!(bonus(0.0), 0.0);
        assert!((bonus(std::f32::consts::E - 1.0) - 1.0).abs() < 1e-6);
    }

    proptest! {
        /// The same distance as that of all references sorted by their distances.
        #[test]
        fn neighbors_are_those_of_a_sorted_list(
            rows in prop::collection::vec(prop::array::uniform3(-5.0_f32..5.0), 1..40),
            point in prop::array::uniform3(-5.0_f32..5.0),
            neighbors in 1_usize..6,
        ) {
            let columns: Vec<f32> = (0..3).flat_map(|axis| rows.iter().map(move |row| row[axis])).collect();
            let mut distances: Vec<f64> = rows
                .iter()
                .map(|row| row.iter().zip(point).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>().sqrt())
                .collect();
            distances.sort_by(f64::total_cmp);
            let expected = distances[neighbors.min(rows.len()) - 1];
            let found = distance(&point, &columns, None, neighbors).unwrap();
            prop_assert!((f64::from(found) - expected).abs() < 1e-4, "{found} and {expected}");
        }
    }
}
