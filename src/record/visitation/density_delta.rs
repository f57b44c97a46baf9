//! The counts that one round adds to a histogram, in a compact encoding. The counts of the latest
//! rounds of every agent are kept in memory and in checkpoints.

use serde::{Deserialize, Serialize};

/// The counts that one round adds, by cell. Each cell is stored as the number of empty cells since
/// the previous cell, followed by its count, both as LEB128 (seven bits per byte, lowest bits
/// first).
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DensityDelta(Vec<u8>);

impl DensityDelta {
    /// Encodes cells in ascending order, with their counts.
    #[must_use]
    pub fn of(cells: impl Iterator<Item = (u32, u32)>) -> Self {
        let (mut bytes, mut next) = (Vec::new(), 0);
        for (cell, count) in cells {
            push_varint(&mut bytes, cell - next);
            push_varint(&mut bytes, count);
            next = cell + 1;
        }
        bytes.shrink_to_fit();
        Self(bytes)
    }

    /// Decodes the cells in ascending order, with their counts.
    pub fn cells(&self) -> impl Iterator<Item = (u32, u32)> {
        let (mut bytes, mut next) = (self.0.iter().copied(), 0_u32);
        std::iter::from_fn(move || {
            let cell = next.saturating_add(read_varint(&mut bytes)?);
            next = cell.saturating_add(1);
            Some((cell, read_varint(&mut bytes)?))
        })
    }
}

fn push_varint(bytes: &mut Vec<u8>, mut number: u32) {
    while number >= 0x80 {
        bytes.push(number as u8 | 0x80);
        number >>= 7;
    }
    bytes.push(number as u8);
}

fn read_varint(bytes: &mut impl Iterator<Item = u8>) -> Option<u32> {
    let mut number = 0;
    for shift in (0..32).step_by(7) {
        let byte = bytes.next()?;
        number |= u32::from(byte & 0x7f) << shift;
        if byte < 0x80 {
            return Some(number);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decoded_cells_equal_encoded_cells() {
        let cells = [
            (0, 1),
            (1, 127),
            (130, 128),
            (4_000_000, u32::MAX),
            (u32::MAX - 1, 3),
        ];
        let delta = DensityDelta::of(cells.into_iter());
        assert_eq!(delta.cells().collect::<Vec<_>>(), cells);
        assert_eq!(DensityDelta::default().cells().count(), 0);
    }

    /// A cell next to the previous one with a count below 128 takes two bytes. The count 300 = 2 ·
    /// 128 + 44 takes two bytes itself.
    #[test]
    fn a_cell_takes_two_bytes() {
        assert_eq!(
            DensityDelta::of([(5, 3), (6, 1), (107, 2)].into_iter()).0,
            [5, 3, 0, 1, 100, 2]
        );
        assert_eq!(DensityDelta::of([(300, 1)].into_iter()).0, [128 + 44, 2, 1]);
    }

    #[test]
    fn decoding_stops_at_incomplete_bytes() {
        assert_eq!(
            DensityDelta(vec![5, 3, 7]).cells().collect::<Vec<_>>(),
            [(5, 3)]
        );
        assert_eq!(DensityDelta(vec![0xff; 9]).cells().count(), 0);
    }
}
