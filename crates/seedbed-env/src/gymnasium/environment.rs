//! Copies of an environment of Gymnasium in worker processes.

use std::ops::Range;

use rand::RngExt;
use serde::{Deserialize, Serialize};

use super::failure::{EnvironmentFailure, catch_failure};
use super::messages::{Configuration, Request, answer, read_floats};
use super::task::GymnasiumTask;
use super::worker::Worker;
use super::worker_error::WorkerError;
use crate::{Choice, Environment, Status, TaskSpec};
use seedbed_random::Stream;

/// M copies of an environment, divided over worker processes.
#[derive(Debug)]
pub(crate) struct GymnasiumEnvironment {
    task: GymnasiumTask,
    /// Empty before the first reset: commands that never play start no Python.
    workers: Vec<WorkerCopies>,
    worker_count: usize,
    /// Whether copies can draw pictures.
    draws: bool,
    /// `[M × observations]`
    observations: Vec<f32>,
    rewards: Vec<f32>,
    /// Entries of `info` that are recorded: `[M × info]`
    info: Vec<f32>,
    statuses: Vec<Status>,
    episodes: Vec<PlayedEpisode>,
    /// The actions of the present step within their ranges: `[M × action width]`
    actions: Vec<f32>,
}

/// A worker and the copies that it has.
#[derive(Debug)]
struct WorkerCopies {
    worker: Worker,
    copies: Range<usize>,
    /// Whether it has been sent actions and has not answered.
    is_stepping: bool,
    /// The copies whose reset it has been sent and not answered, in this order.
    resetting: Vec<usize>,
}

/// What the present episode of a copy follows from: its seed and the actions so far.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct PlayedEpisode {
    seed: u32,
    steps: u32,
    /// `[steps × action width]`
    actions: Vec<f32>,
}

/// The state of a copy in which an episode is running. Gymnasium cannot store states of environments: they are played
/// again.
#[derive(Serialize, Deserialize)]
struct SavedCopy {
    episode: PlayedEpisode,
    /// The observation that the episode must lead to.
    observation: Vec<f32>,
}

/// Maximum number of resets that a worker has not answered. What the program and the worker send each other
/// meanwhile must fit into the memory of their sockets: both would wait for ever.
const MAX_RESETTING: usize = 32;

/// Number of copies whose step is described if it is not known which of a worker's failed.
const MAX_NAMED_COPIES: usize = 4;

impl GymnasiumEnvironment {
    pub(crate) fn new(task: &GymnasiumTask, copies: usize, workers: usize) -> Self {
        Self {
            workers: Vec::new(),
            worker_count: workers.clamp(1, copies.max(1)),
            draws: false,
            observations: vec![0.0; copies * task.spec.observation_width()],
            rewards: vec![0.0; copies],
            info: vec![0.0; copies * task.spec.info.len()],
            statuses: vec![Status::Idle; copies],
            episodes: vec![PlayedEpisode::default(); copies],
            actions: Vec::new(),
            task: task.clone(),
        }
    }

    /// One copy that draws pictures.
    pub(super) fn drawing(task: &GymnasiumTask) -> Self {
        Self {
            draws: true,
            ..Self::new(task, 1, 1)
        }
    }

    /// A picture of the only copy, as its worker sends it: height, width and colors.
    pub(super) fn picture(&mut self) -> &[u8] {
        let worker = &mut self.workers[0].worker;
        worker
            .begin(Request::Picture)
            .extend_from_slice(&0_u32.to_le_bytes());
        if let Err(error) = worker.send() {
            self.fail(&error, 0, "render()");
        }
        let worker = &mut self.workers[0].worker;
        if let Err(error) = worker.receive(answer::PICTURE) {
            self.fail(&error, 0, "render()");
        }
        self.workers[0].worker.payload()
    }

    /// Starts all workers at the same time, unless they run.
    pub(super) fn start_workers(&mut self) {
        if !self.workers.is_empty() {
            return;
        }
        let (copies, workers) = (self.copies(), self.worker_count);
        let first = |worker: usize| worker * copies / workers;
        let ranges = (0..workers).map(|worker| first(worker)..first(worker + 1));
        match start_together(&self.task, ranges, self.draws) {
            Ok(started) => self.workers = started,
            Err(error) => self.fail(&error, 0, "starting the environment"),
        }
    }

    /// Ends the round: the environment cannot go on.
    fn fail(&mut self, error: &WorkerError, first_copy: usize, action: &str) -> ! {
        self.workers.clear();
        let help = error.help().map(|help| format!("\n  = help: {help}"));
        EnvironmentFailure {
            copy: error.copy().map(|copy| first_copy + copy),
            place: String::new(),
            message: format!(
                "environment `{}`: {action}: {}{}",
                self.task.settings().id.value(),
                error.message(),
                help.unwrap_or_default()
            ),
        }
        .unwind()
    }

    /// Begins an episode with a seed.
    pub(super) fn begin(&mut self, copy: usize, seed: u32) {
        self.send_reset(copy, seed);
        self.finish_resets();
    }

    /// Sends the reset of a copy to its worker.
    fn send_reset(&mut self, copy: usize, seed: u32) {
        self.start_workers();
        let index = worker_of(&self.workers, copy);
        if self.workers[index].resetting.len() >= MAX_RESETTING {
            self.receive_resets(index);
        }
        let WorkerCopies {
            worker,
            copies,
            resetting,
            ..
        } = &mut self.workers[index];
        let (first, own) = (copies.start, (copy - copies.start) as u32);
        let frame = worker.begin(Request::Reset);
        frame.extend_from_slice(&own.to_le_bytes());
        frame.extend_from_slice(&seed.to_le_bytes());
        resetting.push(copy);
        if let Err(error) = worker.send() {
            self.fail(&error, first, &format!("reset(seed={seed})"));
        }
        self.rewards[copy] = 0.0;
        self.statuses[copy] = Status::Running;
        let episode = &mut self.episodes[copy];
        (episode.seed, episode.steps) = (seed, 0);
        episode.actions.clear();
    }

    /// Reads what a worker answers to all resets that it has been sent.
    fn receive_resets(&mut self, index: usize) {
        let (width, info_width) = (
            self.task.spec.observation_width(),
            self.task.spec.info.len(),
        );
        let mut resetting = std::mem::take(&mut self.workers[index].resetting);
        for &copy in &resetting {
            let WorkerCopies { worker, copies, .. } = &mut self.workers[index];
            let first = copies.start;
            match worker.receive(answer::START) {
                Ok(payload) => {
                    let row = &mut self.observations[copy * width..][..width];
                    let info = &mut self.info[copy * info_width..][..info_width];
                    read_floats(payload, row);
                    read_floats(&payload[(4 * width).min(payload.len())..], info);
                }
                Err(error) => {
                    let seed = self.episodes[copy].seed;
                    self.fail(&error, first, &format!("reset(seed={seed})"));
                }
            }
        }
        resetting.clear();
        self.workers[index].resetting = resetting;
    }

    /// Keeps the actions, within the ranges of their components.
    fn set_actions(&mut self, actions: &[f32]) {
        self.actions.clear();
        self.actions.extend_from_slice(actions);
        let spec = &self.task.spec;
        for row in self.actions.chunks_exact_mut(spec.action_width()) {
            for (value, action) in row.iter_mut().zip(&spec.actions) {
                if action.choice == Choice::Continuous {
                    let [low, high] = action.quantity.range;
                    *value = value.clamp(low, high);
                }
            }
        }
    }

    /// Sends a worker the actions of its live copies, if it has any.
    fn send_actions(&mut self, index: usize) {
        let WorkerCopies {
            worker,
            copies,
            is_stepping,
            ..
        } = &mut self.workers[index];
        let statuses = &self.statuses[copies.clone()];
        *is_stepping = statuses.contains(&Status::Running);
        if !*is_stepping {
            return;
        }
        let width = self.task.spec.action_width();
        let frame = worker.begin(Request::Step);
        frame.extend(
            statuses
                .iter()
                .map(|&status| u8::from(status == Status::Running)),
        );
        for action in &self.actions[copies.start * width..copies.end * width] {
            frame.extend_from_slice(&action.to_le_bytes());
        }
        if let Err(error) = worker.send() {
            let first = copies.start;
            let action = self.describe_step(&error, index);
            self.fail(&error, first, &action);
        }
    }

    /// Reads what a worker answers to the actions of its live copies.
    fn receive_step(&mut self, index: usize) {
        let (width, info_width) = (
            self.task.spec.observation_width(),
            self.task.spec.info.len(),
        );
        let WorkerCopies {
            worker,
            copies,
            is_stepping,
            ..
        } = &mut self.workers[index];
        if !*is_stepping {
            return;
        }
        let (first, count) = (copies.start, copies.len());
        let expected = count * (4 * width + 4 * info_width + 5);
        match worker.receive(answer::STEP) {
            Ok(payload) if payload.len() == expected => {
                let (observations, rest) = payload.split_at(4 * width * count);
                let (rewards, rest) = rest.split_at(4 * count);
                let (infos, statuses) = rest.split_at(4 * info_width * count);
                let rows = [
                    (observations, width, &mut self.observations),
                    (rewards, 1, &mut self.rewards),
                    (infos, info_width, &mut self.info),
                ];
                for (received, width, kept) in rows {
                    let live = &self.statuses[copies.clone()];
                    read_rows(received, width, live, &mut kept[first * width..]);
                }
                for (kept, &received) in self.statuses[copies.clone()].iter_mut().zip(statuses) {
                    if *kept == Status::Running {
                        *kept = status(received);
                    }
                }
            }
            Ok(payload) => {
                let found = payload.len();
                let error = WorkerError::Ended(format!(
                    "the worker sent {found} bytes; expected {expected}"
                ));
                self.fail(&error, first, "step");
            }
            Err(error) => {
                let action = self.describe_step(&error, index);
                self.fail(&error, first, &action);
            }
        }
    }

    /// The step that failed, for people.
    fn describe_step(&self, error: &WorkerError, index: usize) -> String {
        let copies = &self.workers[index].copies;
        if let Some(copy) = error.copy() {
            return self.describe_step_of(copies.start + copy);
        }
        let playing = copies
            .clone()
            .filter(|&copy| self.statuses[copy] == Status::Running);
        let steps = playing.map(|copy| self.describe_step_of(copy));
        let steps: Vec<String> = steps.take(MAX_NAMED_COPIES).collect();
        steps.join(", or ")
    }

    fn describe_step_of(&self, copy: usize) -> String {
        let width = self.task.spec.action_width();
        let PlayedEpisode { seed, steps, .. } = self.episodes[copy];
        let action = &self.actions[copy * width..][..width];
        format!("step {steps} after reset(seed={seed}), action {action:?}")
    }

    /// Counts the step of all live copies and remembers their actions.
    fn note_actions(&mut self) {
        let width = self.task.spec.action_width();
        for (copy, action) in self.actions.chunks_exact(width).enumerate() {
            if self.statuses[copy] == Status::Running {
                let episode = &mut self.episodes[copy];
                episode.steps += 1;
                episode.actions.extend_from_slice(action);
            }
        }
    }

    /// Ends episodes that have reached the time limit.
    fn truncate(&mut self) {
        let limit = self.task.spec.time_limit;
        for (status, episode) in self.statuses.iter_mut().zip(&self.episodes) {
            if *status == Status::Running && episode.steps >= limit {
                *status = Status::Truncated;
            }
        }
    }
}

/// Starts one copy, to see whether runs can begin.
///
/// # Errors
/// The environment cannot be made, or is another one than when the task was read.
pub fn check_start(task: &GymnasiumTask) -> Result<(), EnvironmentFailure> {
    catch_failure(|| GymnasiumEnvironment::new(task, 1, 1).start_workers())
}

/// Starts one worker for each range of copies. All make their copies at the same time.
fn start_together(
    task: &GymnasiumTask,
    ranges: impl Iterator<Item = Range<usize>>,
    draws: bool,
) -> Result<Vec<WorkerCopies>, WorkerError> {
    let mut started = Vec::new();
    for copies in ranges {
        let configuration = Configuration {
            render: draws,
            ..task.configuration(copies.len())
        };
        started.push(WorkerCopies {
            worker: Worker::begin_start(&configuration)?,
            copies,
            is_stepping: false,
            resetting: Vec::new(),
        });
    }
    for WorkerCopies { worker, .. } in &mut started {
        let description = worker.finish_start(task.step_timeout())?;
        if let Some(difference) = task.difference_from(&description) {
            return Err(WorkerError::Ended(difference));
        }
    }
    Ok(started)
}

/// Reads the rows of the copies that are live.   `rows: [copies × width]`
fn read_rows(received: &[u8], width: usize, statuses: &[Status], rows: &mut [f32]) {
    for (copy, &status) in statuses.iter().enumerate() {
        if status == Status::Running {
            read_floats(
                &received[4 * width * copy..],
                &mut rows[width * copy..][..width],
            );
        }
    }
}

fn worker_of(workers: &[WorkerCopies], copy: usize) -> usize {
    let found = workers
        .iter()
        .position(|worker| worker.copies.contains(&copy));
    found.expect("each copy has a worker")
}

fn status(byte: u8) -> Status {
    match byte {
        1 => Status::Terminated,
        2 => Status::Truncated,
        _ => Status::Running,
    }
}

impl Environment for GymnasiumEnvironment {
    fn spec(&self) -> &TaskSpec {
        &self.task.spec
    }

    fn copies(&self) -> usize {
        self.statuses.len()
    }

    fn reset(&mut self, copy: usize, random: &mut Stream) {
        let seed = random.random();
        self.begin(copy, seed);
    }

    fn begin_reset(&mut self, copy: usize, random: &mut Stream) {
        let seed = random.random();
        self.send_reset(copy, seed);
    }

    fn finish_resets(&mut self) {
        for index in 0..self.workers.len() {
            self.receive_resets(index);
        }
    }

    fn step(&mut self, actions: &[f32]) {
        self.set_actions(actions);
        self.note_actions();
        // All workers compute at the same time.
        for index in 0..self.workers.len() {
            self.send_actions(index);
        }
        for index in 0..self.workers.len() {
            self.receive_step(index);
        }
        self.truncate();
    }

    fn observations(&self) -> &[f32] {
        &self.observations
    }

    fn info(&self) -> &[f32] {
        &self.info
    }

    fn rewards(&self) -> &[f32] {
        &self.rewards
    }

    fn statuses(&self) -> &[Status] {
        &self.statuses
    }

    fn save(&self, copy: usize) -> Vec<u8> {
        let width = self.task.spec.observation_width();
        let is_running = self.statuses[copy] == Status::Running;
        let saved = is_running.then(|| SavedCopy {
            episode: self.episodes[copy].clone(),
            observation: self.observations[copy * width..][..width].to_vec(),
        });
        postcard::to_stdvec(&saved).expect("plain data always serializes")
    }

    fn restore(&mut self, copy: usize, bytes: &[u8]) -> Result<(), String> {
        let saved: Option<SavedCopy> =
            postcard::from_bytes(bytes).map_err(|error| error.to_string())?;
        self.statuses[copy] = Status::Idle;
        let Some(saved) = saved else {
            return Ok(());
        };
        let (action_width, width) = (
            self.task.spec.action_width(),
            self.task.spec.observation_width(),
        );
        let idle = vec![Status::Idle; self.copies()];
        let others = std::mem::replace(&mut self.statuses, idle);
        self.begin(copy, saved.episode.seed);
        let mut actions = vec![0.0; self.copies() * action_width];
        for action in saved.episode.actions.chunks_exact(action_width) {
            actions[copy * action_width..][..action_width].copy_from_slice(action);
            self.step(&actions);
        }
        let reached = std::mem::replace(&mut self.statuses, others)[copy];
        self.statuses[copy] = reached;
        let observation = &self.observations[copy * width..][..width];
        let bits = |numbers: &[f32]| numbers.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        if reached != Status::Running || bits(observation) != bits(&saved.observation) {
            return Err(
                "an episode that was played again is another one: episodes of this environment \
                        do not depend on their seed alone"
                    .to_owned(),
            );
        }
        Ok(())
    }
}
