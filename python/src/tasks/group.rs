//! Copies of a task that one thread steps, with their episodes.

use seedbed_env::{Environment, GivenStart, Physics, PhysicsWarning, Pose, Status};
use seedbed_random::{Purpose, Stream, stream};

use super::options::{Autoreset, physics_name};
use super::state::CopyState;

/// Consecutive copies of a task.
pub(super) struct Group {
    pub(super) environment: Box<dyn Environment>,
    physics: Physics,
    /// Index of the first copy among all copies.
    pub(super) first_copy: usize,
    /// Steps after which an episode is truncated.
    time_limit: u32,
    /// Random stream of each copy's start states; `None` before its first reset.
    streams: Vec<Option<Stream>>,
    /// Steps of each copy since its reset.
    steps: Vec<u32>,
    phases: Vec<Phase>,
    /// Number of resets of each copy.
    episodes: Vec<u32>,
    /// The first physics warning, with its copy and the number of the copy's episode, from 0.
    pub(super) physics_warning: Option<(usize, u32, PhysicsWarning)>,
    /// The copies that are reset in the current step; memory that is used again in each step.
    resets: Vec<usize>,
}

/// Whether a copy can be stepped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Phase {
    /// No episode has started.
    Idle,
    /// An episode is running.
    Running,
    /// The episode has ended, and the copy has not been reset since.
    Ended,
}

/// Memory for the results of a group's copies, one row per copy.
pub(super) struct Rows<'a> {
    /// `[copies × observations]`
    pub(super) observations: &'a mut [f32],
    pub(super) rewards: &'a mut [f64],
    pub(super) terminated: &'a mut [bool],
    pub(super) truncated: &'a mut [bool],
    /// The last observation of each episode that ends and is followed by a reset in the same step:
    /// `[copies × observations]`, or empty if there are none.
    pub(super) final_observations: &'a mut [f32],
}

impl Group {
    pub(super) fn new(
        environment: Box<dyn Environment>,
        physics: Physics,
        first_copy: usize,
    ) -> Self {
        let copies = environment.copies();
        Self {
            physics,
            first_copy,
            time_limit: environment.spec().time_limit,
            streams: vec![None; copies],
            steps: vec![0; copies],
            phases: vec![Phase::Idle; copies],
            episodes: vec![0; copies],
            physics_warning: None,
            resets: Vec::with_capacity(copies),
            environment,
        }
    }

    pub(super) fn copies(&self) -> usize {
        self.phases.len()
    }

    /// The phase of each copy: `[copies]`.
    pub(super) fn phases(&self) -> &[Phase] {
        &self.phases
    }

    /// Lets a copy draw its start states from the random stream (run seed, reset, agent, round).
    pub(super) fn seed(&mut self, copy: usize, run_seed: u64, agent: u32, round: u32) {
        self.streams[copy] = Some(stream(run_seed, Purpose::Reset, agent, round));
    }

    pub(super) fn has_stream(&self, copy: usize) -> bool {
        self.streams[copy].is_some()
    }

    /// Starts a new episode in a copy that has a random stream, in a given state or a drawn one.
    pub(super) fn reset(&mut self, copy: usize, start: Option<&GivenStart>) {
        if let Some(stream) = &mut self.streams[copy] {
            match start {
                Some(start) => self.environment.reset_at(copy, stream, start),
                None => self.environment.reset(copy, stream),
            }
            self.episodes[copy] += 1;
            (self.steps[copy], self.phases[copy]) = (0, Phase::Running);
        }
    }

    /// Advances all copies by one step. `actions`: `[copies × action width]`
    pub(super) fn step(&mut self, actions: &[f32], autoreset: Autoreset, rows: &mut Rows<'_>) {
        self.environment.step(actions);
        if self.physics_warning.is_none() {
            self.physics_warning = self.find_physics_warning();
        }
        self.resets.clear();
        self.write_results(autoreset, rows);
        let resets = std::mem::take(&mut self.resets);
        if autoreset == Autoreset::SameStep {
            for &copy in &resets {
                self.write_final_observation(copy, rows.final_observations);
            }
        }
        for &copy in &resets {
            self.reset(copy, None);
        }
        self.resets = resets;
        self.write_observations(rows.observations);
    }

    fn find_physics_warning(&self) -> Option<(usize, u32, PhysicsWarning)> {
        (0..self.copies()).find_map(|copy| {
            let warning = self.environment.physics_warning(copy)?;
            Some((copy, self.episodes[copy].saturating_sub(1), warning))
        })
    }

    /// Writes rewards and ends of the latest step, and lists the copies to be reset.
    fn write_results(&mut self, autoreset: Autoreset, rows: &mut Rows<'_>) {
        let (statuses, rewards) = (self.environment.statuses(), self.environment.rewards());
        for (copy, phase) in self.phases.iter_mut().enumerate() {
            if *phase != Phase::Running {
                rows.rewards[copy] = 0.0;
                if autoreset == Autoreset::NextStep {
                    (rows.terminated[copy], rows.truncated[copy]) = (false, false);
                    self.resets.push(copy);
                }
                continue;
            }
            self.steps[copy] += 1;
            let terminated = statuses[copy] == Status::Terminated;
            // As Gymnasium's `TimeLimit`: an episode can end in both ways at once.
            let truncated = self.steps[copy] >= self.time_limit;
            rows.rewards[copy] = f64::from(rewards[copy]);
            (rows.terminated[copy], rows.truncated[copy]) = (terminated, truncated);
            if terminated || truncated {
                *phase = Phase::Ended;
                if autoreset == Autoreset::SameStep {
                    self.resets.push(copy);
                }
            }
        }
    }

    fn write_final_observation(&self, copy: usize, final_observations: &mut [f32]) {
        let width = self.environment.spec().observation_width();
        let observation = &self.environment.observations()[copy * width..][..width];
        final_observations[copy * width..][..width].copy_from_slice(observation);
    }

    /// Writes the current observation of each copy: `[copies × observations]`.
    pub(super) fn write_observations(&self, observations: &mut [f32]) {
        observations.copy_from_slice(self.environment.observations());
    }

    pub(super) fn save(&self, copy: usize) -> Vec<u8> {
        let state = CopyState {
            physics: self.physics,
            steps: self.steps[copy],
            has_ended: self.phases[copy] == Phase::Ended,
            stream: self.streams[copy].clone(),
            environment: self.environment.save(copy),
        };
        state.to_bytes()
    }

    /// Sets a copy to a state that [`save`](Self::save) returned.
    ///
    /// # Errors
    /// Why the bytes are not a state of this task.
    pub(super) fn restore(&mut self, copy: usize, bytes: &[u8]) -> Result<(), String> {
        let state = CopyState::from_bytes(bytes)?;
        if state.physics != self.physics {
            let [found, expected] = [state.physics, self.physics].map(physics_name);
            return Err(format!(
                "the state is of an environment with physics=\"{found}\", expected physics=\"{expected}\""
            ));
        }
        self.environment.restore(copy, &state.environment)?;
        self.steps[copy] = state.steps;
        self.streams[copy] = state.stream;
        self.phases[copy] = match (state.has_ended, self.environment.statuses()[copy]) {
            (true, _) => Phase::Ended,
            (false, Status::Idle) => Phase::Idle,
            (false, _) => Phase::Running,
        };
        Ok(())
    }

    /// Writes where the bodies of a copy are: `[bodies]`.
    pub(super) fn poses(&self, copy: usize) -> Vec<Pose> {
        let bodies = self
            .environment
            .scene()
            .map_or(0, |scene| scene.bodies.len());
        let mut poses = vec![Pose::default(); bodies];
        self.environment.poses(copy, &mut poses);
        poses
    }
}
