//! The order of the columns that formulas read.

/// Number of columns of each kind in the table that formulas read. The columns are in this order:
/// constants of the run, numbers of the episode, numbers of the step, sensors, observations,
/// actions, formula forces, sensors before the step, observations before the step, heights of
/// terrains.
///
/// The order matters. A formula may read only what is computed before it:
/// [`ValueTable::split_at`](crate::expression::ValueTable::split_at) gives it only the columns
/// before its own. Actions and formula forces are neighbors because together they are the controls
/// that the dynamics receive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ColumnLayout {
    /// Number of constants of the run.
    pub run_constant_count: usize,
    /// Number of numbers that are drawn at the start of each episode.
    pub episode_number_count: usize,
    /// Number of numbers that are drawn in each step.
    pub step_number_count: usize,
    /// Number of sensors.
    pub sensor_count: usize,
    /// Number of observations.
    pub observation_count: usize,
    /// Number of action components.
    pub action_count: usize,
    /// Number of formula forces.
    pub formula_force_count: usize,
    /// Number of points of all terrains.
    pub terrain_point_count: usize,
}

impl ColumnLayout {
    /// Column of the first number of the episode.
    #[must_use]
    pub fn first_episode_number(&self) -> usize {
        self.run_constant_count
    }

    /// Column of the first number of the step.
    #[must_use]
    pub fn first_step_number(&self) -> usize {
        self.first_episode_number() + self.episode_number_count
    }

    /// Column of the first sensor.
    #[must_use]
    pub fn first_sensor(&self) -> usize {
        self.first_step_number() + self.step_number_count
    }

    /// Column of the first observation.
    #[must_use]
    pub fn first_observation(&self) -> usize {
        self.first_sensor() + self.sensor_count
    }

    /// Column of the first action component.
    #[must_use]
    pub fn first_action(&self) -> usize {
        self.first_observation() + self.observation_count
    }

    /// Column of the first formula force.
    #[must_use]
    pub fn first_formula_force(&self) -> usize {
        self.first_action() + self.action_count
    }

    /// Column of the first sensor's value before the step.
    #[must_use]
    pub fn first_previous_value(&self) -> usize {
        self.first_formula_force() + self.formula_force_count
    }

    /// Column of the height of the first point of a terrain. No formula reads these.
    #[must_use]
    pub fn first_terrain_height(&self) -> usize {
        self.first_previous_value() + self.sensor_count + self.observation_count
    }

    /// Number of columns.
    #[must_use]
    pub fn count(&self) -> usize {
        self.first_terrain_height() + self.terrain_point_count
    }
}
