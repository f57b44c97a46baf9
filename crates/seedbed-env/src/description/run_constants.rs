//! Numbers that are drawn once per run.

use super::Distribution;
use seedbed_random::{Purpose, stream};

/// A number that is drawn once per run, and is the same in all episodes of all agents of the run.
#[derive(Clone, Debug, PartialEq)]
pub struct RunConstant {
    /// Name, unique among constants, sensors, observations and actions.
    pub name: String,
    /// Distribution over runs.
    pub distribution: Distribution,
    /// The value in one run.
    pub value: f32,
}

impl RunConstant {
    /// The value of the constant with this index in the run with this run seed. Each constant has a
    /// random stream of its own.
    #[must_use]
    pub fn draw(&self, index: usize, run_seed: u64) -> f32 {
        let mut random = stream(run_seed, Purpose::RunConstant, index as u32, 0);
        self.distribution.draw_f32(&mut random)
    }
}
