//! What the program and its workers send each other: frames of a length (u32, little-endian), a tag
//! and a payload. `worker.py` describes them.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// Bytes before the payload of a frame.
pub(super) const HEADER: usize = 5;

/// The largest payload that is read, against a stream that is no stream of frames.
pub(super) const MAX_PAYLOAD: usize = 1 << 30;

/// What a frame of the program asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Request {
    Configure = b'C',
    Reset = b'R',
    Step = b'S',
    Probe = b'P',
    Picture = b'F',
}

/// What a frame of a worker contains.
pub(super) mod answer {
    pub(in crate::gymnasium) const JSON: u8 = b'J';
    pub(in crate::gymnasium) const START: u8 = b'r';
    pub(in crate::gymnasium) const STEP: u8 = b's';
    pub(in crate::gymnasium) const PICTURE: u8 = b'I';
    pub(in crate::gymnasium) const ERROR: u8 = b'E';
}

/// The first frame that a worker gets.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Configuration {
    pub(super) id: String,
    pub(super) kwargs: serde_json::Value,
    pub(super) copies: usize,
    pub(super) time_limit: Option<u32>,
    pub(super) render: bool,
    pub(super) discrete: &'static str,
    pub(super) log_info: Vec<String>,
    /// Folders in which Python looks for modules first.
    pub(super) path: Vec<String>,
}

/// What random actions are to find out.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct ProbeRequest {
    pub(super) steps: u32,
    pub(super) seed: u32,
    /// Number of episodes that are played twice, to see whether they are the same.
    pub(super) seeds: u32,
}

/// An environment as it describes itself.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub(super) struct Description {
    pub(super) observations: Vec<DescribedObservation>,
    pub(super) actions: Vec<DescribedAction>,
    pub(super) time_limit: Option<u32>,
    pub(super) reward_threshold: Option<f64>,
    /// Time between two actions, s.
    pub(super) control_step: f64,
    pub(super) versions: BTreeMap<String, String>,
    pub(super) source: Option<Source>,
}

/// An observed number with its bounds, if they are finite.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub(super) struct DescribedObservation {
    pub(super) name: String,
    pub(super) low: Option<f64>,
    pub(super) high: Option<f64>,
}

/// A component of an action.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub(super) struct DescribedAction {
    pub(super) name: String,
    #[serde(flatten)]
    pub(super) values: DescribedValues,
}

/// The values of a component of an action.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub(super) enum DescribedValues {
    Discrete { count: u32 },
    Continuous { low: f64, high: f64 },
}

/// The Python file in which the environment is programmed.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub(super) struct Source {
    pub(super) sha256: String,
}

/// What random actions found out.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub(super) struct Probe {
    /// Lowest and highest value of each observed number, as far as there are finite ones.
    pub(super) ranges: Vec<[Option<f64>; 2]>,
    /// How an episode in a used environment differs from one in a new environment.
    pub(super) difference: Option<String>,
}

/// An error of Python.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub(super) struct PythonError {
    /// What failed, such as `info`: an entry of it that is recorded.
    pub(super) kind: String,
    pub(super) message: String,
    pub(super) help: Option<String>,
    pub(super) copy: Option<usize>,
    #[serde(default)]
    pub(super) traceback: Option<String>,
}

/// The numbers of a payload.
pub(super) fn read_floats(bytes: &[u8], numbers: &mut [f32]) {
    for (number, bytes) in numbers.iter_mut().zip(bytes.chunks_exact(4)) {
        *number = f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
    }
}
