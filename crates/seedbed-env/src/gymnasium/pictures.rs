//! Pictures that an environment draws of itself, with `render()`.

use super::environment::GymnasiumEnvironment;
use super::failure::{EnvironmentFailure, catch_failure};
use super::task::GymnasiumTask;
use crate::{Environment, Status};

/// One copy of an environment, which plays episodes from their seed and actions, and draws pictures.
#[derive(Debug)]
pub struct PictureSource(GymnasiumEnvironment);

/// A picture of an environment.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PictureTaken {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Red, green and blue of each pixel, row by row from the top: `[height × width × 3]`
    pub rgb: Vec<u8>,
}

impl PictureSource {
    /// A copy of a task, which is started by the first [`reset`](Self::reset).
    #[must_use]
    pub fn new(task: &GymnasiumTask) -> Self {
        Self(GymnasiumEnvironment::drawing(task))
    }

    /// Begins an episode. Returns the observation.
    ///
    /// # Errors
    /// The environment cannot be made with `render_mode="rgb_array"`, or fails.
    pub fn reset(&mut self, seed: u32) -> Result<&[f32], EnvironmentFailure> {
        catch_failure(|| self.0.begin(0, seed))?;
        Ok(self.0.observations())
    }

    /// Takes an action: `[action width]`. Returns the observation. Nothing happens after the end of an episode.
    ///
    /// # Errors
    /// The environment fails.
    pub fn step(&mut self, action: &[f32]) -> Result<&[f32], EnvironmentFailure> {
        if self.0.statuses()[0] == Status::Running {
            catch_failure(|| self.0.step(action))?;
        }
        Ok(self.0.observations())
    }

    /// Draws the present state.
    ///
    /// # Errors
    /// The environment has no `render()` that returns pictures, or it fails.
    pub fn picture(&mut self) -> Result<PictureTaken, EnvironmentFailure> {
        let taken = catch_failure(|| self.0.picture().to_vec())?;
        let number = |first: usize| {
            let bytes = taken
                .get(first..first + 4)
                .and_then(|bytes| bytes.try_into().ok());
            bytes.map_or(0, u32::from_le_bytes)
        };
        let (height, width) = (number(0), number(4));
        let rgb = taken.get(8..).unwrap_or_default().to_vec();
        let expected = 3 * u64::from(height) * u64::from(width);
        if expected == 0 || rgb.len() as u64 != expected {
            return Err(EnvironmentFailure {
                copy: None,
                place: String::new(),
                message: format!(
                    "render() gave a picture of {width} × {height} pixels with {} numbers",
                    rgb.len()
                ),
            });
        }
        Ok(PictureTaken { width, height, rgb })
    }
}
