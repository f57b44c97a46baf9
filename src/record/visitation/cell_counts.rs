//! The format of a histogram in checkpoints: the number of its cells, and those that are not zero.

use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::DensityDelta;

/// More cells than any histogram has: a damaged file must not make the process allocate all memory.
const MAX_CELLS: u32 = 1 << 28;

pub(super) fn serialize<S: Serializer>(counts: &[u32], serializer: S) -> Result<S::Ok, S::Error> {
    let nonzero = (0..).zip(counts).filter(|(_, count)| **count > 0);
    let nonzero = nonzero.map(|(cell, count)| (cell, *count));
    (counts.len() as u32, DensityDelta::of(nonzero)).serialize(serializer)
}

pub(super) fn deserialize<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Vec<u32>, D::Error> {
    let (length, nonzero) = <(u32, DensityDelta)>::deserialize(deserializer)?;
    if length > MAX_CELLS {
        return Err(D::Error::custom("too many cells"));
    }
    let mut counts = vec![0; length as usize];
    for (cell, count) in nonzero.cells() {
        *counts
            .get_mut(cell as usize)
            .ok_or_else(|| D::Error::custom("a cell outside the histogram"))? = count;
    }
    Ok(counts)
}
