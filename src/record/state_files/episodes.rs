//! The finished episodes of one agent, put together from the frames of its file.

use std::path::Path;

use super::frames::{Frame, FrameKind, Frames, long_number};
use super::header::Header;
use crate::record::{ReadError, RecordedEpisode};
use seedbed_env::Status;

/// Number of bytes before the arrays in the frame of an episode: number of the episode, number of
/// the first step, number of steps, outcome, and the sum of rewards.
pub(super) const EPISODE_START: usize = 24;

/// The finished episodes of one agent, read on demand.
pub(super) struct AgentEpisodes {
    frames: Frames,
    header: Header,
    /// The steps so far of an episode that is not finished.
    unfinished: Option<RecordedEpisode>,
    /// Number of finished episodes so far.
    finished: u32,
    /// Number of steps of the environment before the next or unfinished episode, also of those that
    /// are not recorded.
    begin_step: u64,
    /// Whether an error occurred, after which nothing is read.
    failed: bool,
}

/// A finished episode.
pub(super) struct FinishedEpisode {
    pub episode: RecordedEpisode,
    /// Sum of the rewards, which are recorded with less precision.
    pub total_reward: f64,
    /// Number of steps of the environment up to the end of the episode, also of those that are not
    /// recorded.
    pub end_step: u64,
}

/// The numbers before the arrays.
struct EpisodeStart {
    episode: u32,
    first_step: u32,
    steps: u32,
    outcome: Status,
    total_reward: f64,
}

impl AgentEpisodes {
    pub(super) fn open(path: &Path) -> Result<Self, ReadError> {
        let (frames, header) = Frames::open(path)?;
        Ok(Self {
            frames,
            header,
            unfinished: None,
            finished: 0,
            begin_step: 0,
            failed: false,
        })
    }

    pub(super) fn header(&self) -> &Header {
        &self.header
    }

    /// What is incomplete at the end of the file, when all episodes are read.
    pub(super) fn warning(&self) -> Option<String> {
        let bytes = self.frames.torn_bytes();
        let path = self.frames.path().display();
        (bytes > 0).then(|| {
            format!(
                "{path}: ignored {bytes} bytes of an incomplete episode at its end; its process is in progress or was killed"
            )
        })
    }

    fn next_finished(&mut self) -> Result<Option<FinishedEpisode>, ReadError> {
        while let Some(frame) = self.frames.next_frame()? {
            let added = match frame.kind {
                FrameKind::Episode => self.add(&frame.payload),
                FrameKind::Header => Err("a second header".to_owned()),
                FrameKind::Begin => self.set_begin(&frame.payload).map(|()| None),
                FrameKind::Closed => self.check_end(&frame.payload).map(|()| None),
            };
            let finished = added.map_err(|reason| self.damaged(&frame, reason))?;
            if finished.is_some() {
                return Ok(finished);
            }
        }
        Ok(None)
    }

    fn damaged(&self, frame: &Frame, reason: String) -> ReadError {
        self.frames.damaged(frame.offset, reason)
    }

    /// Adds steps to the episode, and returns it if it is finished.
    fn add(&mut self, payload: &[u8]) -> Result<Option<FinishedEpisode>, String> {
        let (start, arrays) = EpisodeStart::read(payload)?;
        if start.episode != self.finished {
            let [found, expected] = [start.episode, self.finished];
            return Err(format!("episode {found}, expected episode {expected}"));
        }
        if start.first_step == 0 {
            // The previous attempt at this episode was cut off.
            self.unfinished = Some(self.empty_episode());
        }
        let mut episode = self
            .unfinished
            .take()
            .unwrap_or_else(|| self.empty_episode());
        if episode.length() != start.first_step as usize {
            let (found, expected) = (start.first_step, episode.length());
            return Err(format!("steps from {found} on, expected {expected}"));
        }
        self.add_arrays(&mut episode, &start, arrays)?;
        if start.outcome == Status::Running {
            self.unfinished = Some(episode);
            return Ok(None);
        }
        if episode.length() == 0 {
            return Err("an episode without steps".to_owned());
        }
        self.finished += 1;
        self.begin_step = self.begin_step.saturating_add(episode.length() as u64);
        episode.outcome = start.outcome;
        Ok(Some(FinishedEpisode {
            episode,
            total_reward: start.total_reward,
            end_step: self.begin_step,
        }))
    }

    fn set_begin(&mut self, payload: &[u8]) -> Result<(), String> {
        let begin = long_number(payload);
        self.begin_step = begin.ok_or_else(|| "a number of steps without 8 bytes".to_owned())?;
        Ok(())
    }

    fn add_arrays(
        &self,
        episode: &mut RecordedEpisode,
        start: &EpisodeStart,
        arrays: &[u8],
    ) -> Result<(), String> {
        let is_end = start.outcome != Status::Running;
        let steps = start.steps as usize;
        let observations = (steps + usize::from(is_end)) * self.header.observations.len();
        let actions = steps * self.header.actions.len();
        if arrays.len() != 4 * (observations + actions + steps) {
            let bytes = arrays.len();
            return Err(format!("{bytes} bytes do not contain {steps} steps"));
        }
        let numbers = |bytes: &[u8]| {
            let chunks = bytes.chunks_exact(4);
            let number =
                |chunk: &[u8]| f32::from_le_bytes([chunk[0], chunk[1], chunk[2], chunk[3]]);
            chunks.map(number).collect::<Vec<f32>>()
        };
        let (observations, rest) = arrays.split_at(4 * observations);
        let (actions, rewards) = rest.split_at(4 * actions);
        episode.observations.extend(numbers(observations));
        episode.actions.extend(numbers(actions));
        episode.rewards.extend(numbers(rewards));
        Ok(())
    }

    fn check_end(&self, payload: &[u8]) -> Result<(), String> {
        if *payload == self.finished.to_le_bytes() {
            return Ok(());
        }
        Err("another number of episodes than in the file".to_owned())
    }

    fn empty_episode(&self) -> RecordedEpisode {
        RecordedEpisode {
            agent: self.header.agent,
            episode: self.finished,
            round: self.finished,
            observations: Vec::new(),
            actions: Vec::new(),
            info: Vec::new(),
            rewards: Vec::new(),
            intrinsic_rewards: Vec::new(),
            advantages: Vec::new(),
            outcome: Status::Running,
        }
    }
}

impl Iterator for AgentEpisodes {
    type Item = Result<FinishedEpisode, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.failed {
            return None;
        }
        let next = self.next_finished();
        self.failed = next.is_err();
        next.transpose()
    }
}

impl EpisodeStart {
    /// Reads the numbers, and returns them with the arrays that follow.
    fn read(payload: &[u8]) -> Result<(Self, &[u8]), String> {
        let Some((start, arrays)) = payload.split_first_chunk::<EPISODE_START>() else {
            return Err(format!("a frame of {} bytes", payload.len()));
        };
        let number = |index: usize| {
            let bytes = &start[4 * index..4 * index + 4];
            u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])
        };
        let outcome = match number(3) {
            0 => Status::Running,
            1 => Status::Terminated,
            2 => Status::Truncated,
            other => return Err(format!("outcome {other}, expected 0 to 2")),
        };
        let total_reward = u64::from(number(4)) | u64::from(number(5)) << 32;
        let start = Self {
            episode: number(0),
            first_step: number(1),
            steps: number(2),
            outcome,
            total_reward: f64::from_bits(total_reward),
        };
        Ok((start, arrays))
    }
}
