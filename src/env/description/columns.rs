//! The layout of the table that formulas read.

/// Where each kind of number stands in the table that formulas read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Columns {
    /// Number of sensors.
    pub sensors: usize,
    /// Number of observations.
    pub observations: usize,
    /// Number of action components.
    pub actions: usize,
    /// Number of fields.
    pub fields: usize,
}

impl Columns {
    /// The first observation's column.
    #[must_use]
    pub fn first_observation(&self) -> usize {
        self.sensors
    }

    /// The first action's column.
    #[must_use]
    pub fn first_action(&self) -> usize {
        self.sensors + self.observations
    }

    /// The first field's column.
    #[must_use]
    pub fn first_field(&self) -> usize {
        self.first_action() + self.actions
    }

    /// The column of the first sensor's value before the step.
    #[must_use]
    pub fn first_previous(&self) -> usize {
        self.first_field() + self.fields
    }

    /// Number of columns.
    #[must_use]
    pub fn count(&self) -> usize {
        self.first_previous() + self.sensors + self.observations
    }
}
