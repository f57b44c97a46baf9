//! Curves of a run as event files of TensorBoard: one directory for the team's mean return, and one
//! per agent with its returns and metrics. The step is the number of the episode or round.
//!
//! An event file is a sequence of records (length, checksum, data, checksum), whose data are protocol
//! buffers: tensorflow/core/lib/io/record_writer.h and tensorflow/core/util/event.proto.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::Path;

use prost::Message;

use crate::record::metrics::{METRICS, Source};
use crate::run::review::LoadedRun;

/// `tensorflow.Event`, as far as it is used.
#[derive(Clone, PartialEq, Message)]
struct Event {
    #[prost(double, tag = "1")]
    wall_time: f64,
    #[prost(int64, tag = "2")]
    step: i64,
    #[prost(string, optional, tag = "3")]
    file_version: Option<String>,
    #[prost(message, optional, tag = "5")]
    summary: Option<Summary>,
}

/// `tensorflow.Summary`.
#[derive(Clone, PartialEq, Message)]
struct Summary {
    #[prost(message, repeated, tag = "1")]
    value: Vec<Scalar>,
}

/// `tensorflow.Summary.Value` with a number.
#[derive(Clone, PartialEq, Message)]
struct Scalar {
    #[prost(string, tag = "1")]
    tag: String,
    /// Always present: without `optional`, a value of 0 would not be written.
    #[prost(float, optional, tag = "2")]
    simple_value: Option<f32>,
}

/// A value of a curve: step, name of the curve, value.
type Point = (i64, String, f64);

/// Writes the curves of a run below `folder` and returns the number of values.
///
/// # Errors
/// A file cannot be written.
pub fn export(run: &LoadedRun, folder: &Path) -> io::Result<usize> {
    let mut curves: BTreeMap<String, Vec<Point>> = BTreeMap::new();
    for (step, value) in (0..).zip(run.team_returns()) {
        let team = curves.entry("team".to_owned()).or_default();
        team.push((step, "return".to_owned(), value));
    }
    for row in &run.episodes {
        let agent = curves.entry(agent_folder(row.agent)).or_default();
        agent.push((i64::from(row.episode), "return".to_owned(), row.r#return));
    }
    for row in &run.rounds {
        let agent = curves.entry(agent_folder(row.agent)).or_default();
        for metric in METRICS {
            if let Source::Round(value) = metric.source
                && let Some(value) = value(row)
            {
                agent.push((i64::from(row.round), metric.key.to_owned(), value));
            }
        }
    }
    for (name, points) in &curves {
        write_events(&folder.join(name), points)?;
    }
    Ok(curves.values().map(Vec::len).sum())
}

fn agent_folder(agent: u32) -> String {
    format!("agent_{agent}")
}

/// Writes an event file to a directory. The time of all events is 0: the same run gives the same
/// bytes.
fn write_events(folder: &Path, points: &[Point]) -> io::Result<()> {
    fs::create_dir_all(folder)?;
    let file = File::create(folder.join("events.out.tfevents.0.seedbed"))?;
    let mut file = BufWriter::new(file);
    let version = Event {
        file_version: Some("brain.Event:2".to_owned()),
        ..Event::default()
    };
    write_record(&mut file, &version.encode_to_vec())?;
    for (step, tag, value) in points {
        let scalar = Scalar {
            tag: tag.clone(),
            simple_value: Some(*value as f32),
        };
        let event = Event {
            step: *step,
            summary: Some(Summary {
                value: vec![scalar],
            }),
            ..Event::default()
        };
        write_record(&mut file, &event.encode_to_vec())?;
    }
    file.flush()
}

fn write_record(file: &mut impl Write, data: &[u8]) -> io::Result<()> {
    let length = (data.len() as u64).to_le_bytes();
    file.write_all(&length)?;
    file.write_all(&masked_checksum(&length).to_le_bytes())?;
    file.write_all(data)?;
    file.write_all(&masked_checksum(data).to_le_bytes())
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
        let scalar = Scalar {
            tag: "a".to_owned(),
            simple_value: Some(0.0),
        };
        assert_eq!(scalar.encode_to_vec(), b"\x0a\x01a\x15\x00\x00\x00\x00");
    }

    /// The first record of an event file. Its checksums were computed bit by bit, with the reversed
    /// polynomial 0x82f63b78 of CRC-32C.
    #[test]
    fn a_record_has_length_data_and_two_checksums() {
        let version = Event {
            file_version: Some("brain.Event:2".to_owned()),
            ..Event::default()
        };
        let mut bytes = Vec::new();
        write_record(&mut bytes, &version.encode_to_vec()).unwrap();
        assert_eq!(bytes[..8], 15_u64.to_le_bytes());
        assert_eq!(bytes[8..12], 0x092b_536d_u32.to_le_bytes());
        assert_eq!(&bytes[12..27], b"\x1a\x0dbrain.Event:2");
        assert_eq!(bytes[27..], 0x2951_98fc_u32.to_le_bytes());
    }
}
