//! Numbers as compressed text, which the page decodes (`page/decode.js`).
//!
//! Consecutive states of an episode differ little. So the differences of consecutive numbers are
//! stored, their low and high bytes apart, compressed by Deflate and written in base64.

use std::io::Write;

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use flate2::Compression;
use flate2::write::DeflateEncoder;

/// The level that stands for a missing value.
pub(super) const MISSING: u16 = u16::MAX;

/// The highest level.
pub(super) const MAX_LEVEL: u16 = u16::MAX - 1;

/// The level of a value: 0 at the lower end of the range, [`MAX_LEVEL`] at the upper end. Values
/// outside the range have the level of the nearest end. The level is monotonic in the value, so that
/// a range of levels is a range of values.
pub(super) fn level(value: f32, [low, high]: [f64; 2]) -> u16 {
    if value.is_nan() {
        return MISSING;
    }
    let share = (f64::from(value) - low) / (high - low);
    (share.clamp(0.0, 1.0) * f64::from(MAX_LEVEL)).round() as u16
}

/// Encodes 16-bit numbers.
pub(super) fn encode_16(values: &[u16]) -> String {
    let mut previous = 0_u16;
    let differences = values.iter().map(|&value| {
        let difference = value.wrapping_sub(previous) as i16;
        previous = value;
        ((difference << 1) ^ (difference >> 15)) as u16
    });
    encode_planes(&differences.map(u16::to_le_bytes).collect::<Vec<_>>())
}

/// Encodes 32-bit numbers.
pub(super) fn encode_32(values: &[u32]) -> String {
    let mut previous = 0_u32;
    let differences = values.iter().map(|&value| {
        let difference = value.wrapping_sub(previous) as i32;
        previous = value;
        ((difference << 1) ^ (difference >> 31)) as u32
    });
    encode_planes(&differences.map(u32::to_le_bytes).collect::<Vec<_>>())
}

/// All first bytes, then all second bytes and so on, compressed.
fn encode_planes<const N: usize>(numbers: &[[u8; N]]) -> String {
    let planes = (0..N).flat_map(|plane| numbers.iter().map(move |bytes| bytes[plane]));
    let bytes: Vec<u8> = planes.collect();
    let mut encoder = DeflateEncoder::new(Vec::new(), Compression::best());
    let compressed = encoder.write_all(&bytes).and_then(|()| encoder.finish());
    BASE64_STANDARD.encode(compressed.expect("a vector can be written to"))
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use flate2::read::DeflateDecoder;

    use super::*;

    /// Ends and middle of a range; values outside have the level of the nearest end.
    #[test]
    fn levels_divide_a_range() {
        let levels = [-1.0, 0.0, 1.0, 3.0].map(|value| level(value, [-1.0, 1.0]));
        assert_eq!(levels, [0, MAX_LEVEL / 2, MAX_LEVEL, MAX_LEVEL]);
        assert_eq!(level(f32::NAN, [-1.0, 1.0]), MISSING);
    }

    /// 5, 3, 65535 are the differences 5, −2, −4 (mod 2¹⁶), which are 10, 3, 7 with the sign in the
    /// lowest bit; the second plane has the high bytes.
    #[test]
    fn differences_are_stored_in_planes() {
        let compressed = BASE64_STANDARD.decode(encode_16(&[5, 3, MISSING])).unwrap();
        let mut bytes = Vec::new();
        DeflateDecoder::new(&compressed[..])
            .read_to_end(&mut bytes)
            .unwrap();
        assert_eq!(bytes, [10, 3, 7, 0, 0, 0]);
    }
}
