//! Event files of TensorBoard: reading and writing.
//!
//! An event file is a sequence of records (length, checksum, data, checksum), whose data are protocol
//! buffers: tensorflow/core/lib/io/record_writer.h and tensorflow/core/util/event.proto.

use std::io::{self, Write};

use prost::Message;

/// Number of bytes of a record before its data: length and checksum.
const HEADER_BYTES: usize = 12;

/// Number of bytes of the checksum behind the data of a record.
const CHECKSUM_BYTES: usize = 4;

/// `tensorflow.Event`, as far as it is used.
#[derive(Clone, PartialEq, Message)]
pub struct Event {
    /// Time of the event.
    #[prost(double, tag = "1")]
    pub wall_time: f64,
    /// Step of the values.
    #[prost(int64, tag = "2")]
    pub step: i64,
    /// Version of the file, in its first event.
    #[prost(string, optional, tag = "3")]
    pub file_version: Option<String>,
    /// Values.
    #[prost(message, optional, tag = "5")]
    pub summary: Option<Summary>,
    /// Beginning or end of the process that writes.
    #[prost(message, optional, tag = "7")]
    pub session_log: Option<SessionLog>,
}

/// `tensorflow.SessionLog`, as far as it is used.
#[derive(Clone, PartialEq, Message)]
pub struct SessionLog {
    /// What happened, see [`SessionLog::START`].
    #[prost(int32, tag = "1")]
    pub status: i32,
}

impl SessionLog {
    /// A process begins, and continues the run at the step of the event.
    pub const START: i32 = 1;
}

impl Event {
    /// Whether a process begins here: values of earlier events at this step and later ones are void.
    #[must_use]
    pub fn is_start(&self) -> bool {
        let log = self.session_log.as_ref();
        log.is_some_and(|log| log.status == SessionLog::START)
    }

    /// The version that this event gives the file, as TensorBoard reads it: −1 if it is no number.
    #[must_use]
    pub fn version(&self) -> Option<f64> {
        let text = self.file_version.as_ref()?;
        let number = text.rsplit("brain.Event:").next().unwrap_or_default();
        Some(number.trim().parse().unwrap_or(-1.0))
    }
}

/// `tensorflow.Summary`.
#[derive(Clone, PartialEq, Message)]
pub struct Summary {
    /// Values.
    #[prost(message, repeated, tag = "1")]
    pub value: Vec<Scalar>,
}

/// `tensorflow.Summary.Value`, as far as it is used.
#[derive(Clone, PartialEq, Message)]
pub struct Scalar {
    /// Name of the curve.
    #[prost(string, tag = "1")]
    pub tag: String,
    /// Always present if the value is a number: without `optional`, a value of 0 would not be
    /// written.
    #[prost(float, optional, tag = "2")]
    pub simple_value: Option<f32>,
    /// A number as TensorFlow 2 writes it, or other data.
    #[prost(message, optional, tag = "8")]
    pub tensor: Option<Tensor>,
}

/// `tensorflow.TensorProto`, as far as numbers need it.
#[derive(Clone, PartialEq, Message)]
pub struct Tensor {
    /// Type of the elements: 1 is f32, 2 is f64.
    #[prost(int32, tag = "1")]
    pub dtype: i32,
    /// Shape.
    #[prost(message, optional, tag = "2")]
    pub shape: Option<Shape>,
    /// Elements as bytes, little-endian.
    #[prost(bytes = "vec", tag = "4")]
    pub content: Vec<u8>,
    /// Elements of type f32.
    #[prost(float, repeated, tag = "5")]
    pub floats: Vec<f32>,
    /// Elements of type f64.
    #[prost(double, repeated, tag = "6")]
    pub doubles: Vec<f64>,
}

/// `tensorflow.TensorShapeProto`.
#[derive(Clone, PartialEq, Message)]
pub struct Shape {
    /// One entry per dimension.
    #[prost(message, repeated, tag = "2")]
    pub dimensions: Vec<Dimension>,
}

/// `tensorflow.TensorShapeProto.Dim`.
#[derive(Clone, PartialEq, Message)]
pub struct Dimension {
    /// Number of elements along the dimension.
    #[prost(int64, tag = "1")]
    pub size: i64,
}

impl Scalar {
    /// The number; `None` if the value is no number, such as an image or a histogram.
    #[must_use]
    pub fn number(&self) -> Option<f64> {
        let of_tensor = || self.tensor.as_ref().and_then(Tensor::number);
        self.simple_value.map(f64::from).or_else(of_tensor)
    }

    /// Whether the number is in double precision.
    #[must_use]
    pub fn is_double(&self) -> bool {
        let of_tensor = |tensor: &Tensor| tensor.dtype == Tensor::DOUBLE;
        self.simple_value.is_none() && self.tensor.as_ref().is_some_and(of_tensor)
    }
}

impl Tensor {
    /// Type of the elements: f32.
    const FLOAT: i32 = 1;

    /// Type of the elements: f64.
    const DOUBLE: i32 = 2;

    /// The only element of a tensor of numbers without dimensions.
    fn number(&self) -> Option<f64> {
        if self
            .shape
            .as_ref()
            .is_some_and(|shape| !shape.dimensions.is_empty())
        {
            return None;
        }
        match self.dtype {
            Self::FLOAT => match self.floats[..] {
                [number] => Some(number.into()),
                _ => Some(f32::from_le_bytes(self.content[..].try_into().ok()?).into()),
            },
            Self::DOUBLE => match self.doubles[..] {
                [number] => Some(number),
                _ => Some(f64::from_le_bytes(self.content[..].try_into().ok()?)),
            },
            _ => None,
        }
    }
}

/// Error: a record of an event file is damaged.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("record {record} (byte {byte}) is damaged: {reason}")]
pub struct DamagedRecord {
    /// Number of the record, from 1.
    pub record: usize,
    /// Position of its first byte in the file, from 0.
    pub byte: usize,
    /// What is wrong.
    pub reason: String,
}

/// Calls `on_event` for each event of a file, with the number of its record, from 1. Returns whether
/// the last record is incomplete, as that of a file that is still written to; such a record is
/// ignored.
///
/// # Errors
/// The first damaged record.
pub fn read_events(
    bytes: &[u8],
    mut on_event: impl FnMut(usize, Event),
) -> Result<bool, DamagedRecord> {
    let mut rest = bytes;
    let mut record = 0;
    while !rest.is_empty() {
        record += 1;
        let damaged = |reason: String| DamagedRecord {
            record,
            byte: bytes.len() - rest.len(),
            reason,
        };
        let Some((header, after_header)) = rest.split_at_checked(HEADER_BYTES) else {
            return Ok(true);
        };
        let length = little_endian(&header[..8]);
        check("length", &header[..8], &header[8..]).map_err(damaged)?;
        let length = usize::try_from(length).unwrap_or(usize::MAX);
        let Some((data, after_data)) = after_header.split_at_checked(length) else {
            return Ok(true);
        };
        let Some((checksum, after_record)) = after_data.split_at_checked(CHECKSUM_BYTES) else {
            return Ok(true);
        };
        check("data", data, checksum).map_err(damaged)?;
        let event = Event::decode(data).map_err(|error| damaged(error.to_string()))?;
        on_event(record, event);
        rest = after_record;
    }
    Ok(false)
}

fn check(what: &str, data: &[u8], checksum: &[u8]) -> Result<(), String> {
    let (found, expected) = (little_endian(checksum) as u32, masked_checksum(data));
    if found == expected {
        return Ok(());
    }
    Err(format!(
        "the checksum of its {what} is {found:08x}, expected {expected:08x}"
    ))
}

fn little_endian(bytes: &[u8]) -> u64 {
    bytes
        .iter()
        .rev()
        .fold(0, |number, &byte| number << 8 | u64::from(byte))
}

/// Writes one record.
///
/// # Errors
/// If it cannot be written.
pub fn write_event(file: &mut impl Write, event: &Event) -> io::Result<()> {
    let data = event.encode_to_vec();
    let length = (data.len() as u64).to_le_bytes();
    file.write_all(&length)?;
    file.write_all(&masked_checksum(&length).to_le_bytes())?;
    file.write_all(&data)?;
    file.write_all(&masked_checksum(&data).to_le_bytes())
}

/// The event at the beginning of each file.
#[must_use]
pub fn version_event() -> Event {
    Event {
        file_version: Some("brain.Event:2".to_owned()),
        ..Event::default()
    }
}

/// The event with which a process continues a run: values at this step and later ones, which an earlier process
/// wrote, are void.
#[must_use]
pub fn start_event(step: i64) -> Event {
    Event {
        step,
        session_log: Some(SessionLog {
            status: SessionLog::START,
        }),
        ..Event::default()
    }
}

/// An event with one number. Its time is 0: the same run gives the same bytes.
#[must_use]
pub fn scalar_event(step: i64, tag: &str, value: f32) -> Event {
    let scalar = Scalar {
        tag: tag.to_owned(),
        simple_value: Some(value),
        tensor: None,
    };
    Event {
        step,
        summary: Some(Summary {
            value: vec![scalar],
        }),
        ..Event::default()
    }
}

/// CRC-32C, rotated and shifted by a constant, so that data with checksums can have a checksum.
fn masked_checksum(data: &[u8]) -> u32 {
    crc32c::crc32c(data)
        .rotate_right(15)
        .wrapping_add(0xa282_ead8)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tag and number of a value of 0: fields 1 and 2 of the message.
    #[test]
    fn a_value_of_zero_is_written() {
        let event = scalar_event(0, "a", 0.0);
        let scalar = &event.summary.unwrap().value[0];
        assert_eq!(scalar.encode_to_vec(), b"\x0a\x01a\x15\x00\x00\x00\x00");
    }

    /// The first record of an event file. Its checksums were computed bit by bit, with the reversed
    /// polynomial 0x82f63b78 of CRC-32C.
    #[test]
    fn a_record_has_length_data_and_two_checksums() {
        let mut bytes = Vec::new();
        write_event(&mut bytes, &version_event()).unwrap();
        assert_eq!(bytes[..8], 15_u64.to_le_bytes());
        assert_eq!(bytes[8..12], 0x092b_536d_u32.to_le_bytes());
        assert_eq!(&bytes[12..27], b"\x1a\x0dbrain.Event:2");
        assert_eq!(bytes[27..], 0x2951_98fc_u32.to_le_bytes());
    }

    fn file() -> Vec<u8> {
        let mut bytes = Vec::new();
        write_event(&mut bytes, &version_event()).unwrap();
        write_event(&mut bytes, &scalar_event(7, "a", -1.5)).unwrap();
        bytes
    }

    fn read(bytes: &[u8]) -> Result<(Vec<(usize, Event)>, bool), DamagedRecord> {
        let mut events = Vec::new();
        let is_incomplete = read_events(bytes, |record, event| events.push((record, event)))?;
        Ok((events, is_incomplete))
    }

    #[test]
    fn events_are_read_as_written() {
        let (events, is_incomplete) = read(&file()).unwrap();
        assert_eq!(
            events,
            [(1, version_event()), (2, scalar_event(7, "a", -1.5))]
        );
        assert!(!is_incomplete);
    }

    /// A file that ends within a record is read up to there; the first record has 31 bytes.
    #[test]
    fn an_incomplete_last_record_is_ignored() {
        let bytes = file();
        for length in 32..bytes.len() {
            let (events, is_incomplete) = read(&bytes[..length]).unwrap();
            assert_eq!((events.len(), is_incomplete), (1, true), "{length} bytes");
        }
        assert!(!read(&bytes[..31]).unwrap().1);
    }

    /// A change of any bit is found.
    #[test]
    fn a_damaged_record_is_an_error_that_names_it() {
        let bytes = file();
        for byte in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[byte] ^= 0x10;
            let error = read(&damaged).unwrap_err();
            let record = 1 + usize::from(byte >= 31);
            assert_eq!((error.record, error.byte), (record, 31 * (record - 1)));
        }
    }

    /// Tensors without dimensions, as TensorFlow 2 writes numbers; other tensors are no numbers.
    #[test]
    fn numbers_may_be_tensors() {
        let number = |tensor: Tensor| {
            let scalar = Scalar {
                tensor: Some(tensor),
                ..Scalar::default()
            };
            scalar.number()
        };
        let float = Tensor {
            dtype: 1,
            floats: vec![2.5],
            ..Tensor::default()
        };
        assert_eq!(number(float.clone()), Some(2.5));
        let bytes = Tensor {
            dtype: 2,
            content: 0.1_f64.to_le_bytes().to_vec(),
            ..Tensor::default()
        };
        assert_eq!(number(bytes), Some(0.1));
        let vector = Tensor {
            shape: Some(Shape {
                dimensions: vec![Dimension { size: 1 }],
            }),
            ..float
        };
        assert_eq!(number(vector), None);
        let text = Tensor {
            dtype: 7,
            ..Tensor::default()
        };
        assert_eq!(number(text), None);
    }
}
