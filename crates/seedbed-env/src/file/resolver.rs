//! What the names of a task file refer to: bodies, and the variables of formulas.

use std::collections::HashSet;

use super::{DrawnNumber, Name, TaskFile};
use crate::description::{self, ColumnLayout};
use crate::expression::{Previous, Program, Type, Variable, compile};
use seedbed_input::{Located, ValidationError};

/// The name of the body that does not move, to which joints without a parent body are attached.
pub(super) const WORLD: &str = "world";

/// Maximum mass of a body, kg, and moment of inertia, kg m². Rapier takes inverse masses below 1e-20 for 0,
/// also those about joints that are 100 m away.
pub(super) const MAX_MASS: f64 = 1e15;

/// Resolves the names of a task file. Methods for actuators, joints, sensors and surfaces are in
/// the files of this folder.
pub(super) struct Resolver<'a> {
    pub(super) file: &'a TaskFile,
    pub(super) columns: ColumnLayout,
}

impl<'a> Resolver<'a> {
    pub(super) fn new(file: &'a TaskFile) -> Self {
        let forces_on_joints = file
            .joints
            .iter()
            .filter(|joint| joint.force.is_some())
            .count();
        // A force on a body has two components, each with a formula.
        let forces_on_bodies: usize = file.bodies.iter().map(|body| 2 * body.forces.len()).sum();
        let columns = ColumnLayout {
            run_constant_count: file.drawn_per_run.len(),
            episode_number_count: file.drawn_per_episode.len(),
            step_number_count: file.drawn_per_step.len(),
            sensor_count: file.sensors.len(),
            observation_count: file.observations.len(),
            action_count: file.actuators.len(),
            formula_force_count: forces_on_joints + forces_on_bodies,
            terrain_point_count: 0, // no formula reads them
        };
        Self { file, columns }
    }

    pub(super) fn check_names(&self) -> Result<(), ValidationError> {
        let file = self.file;
        check_unique("body", file.bodies.iter().map(|body| &body.name))?;
        check_unique(
            "collider",
            self.all_colliders()
                .filter_map(|collider| collider.name.as_ref()),
        )?;
        check_unique("joint", file.joints.iter().map(|joint| &joint.name))?;
        check_unique(
            "drawn number",
            self.drawn_numbers().map(|number| &number.name),
        )?;
        check_unique("rope", file.ropes.iter().map(|rope| &rope.name))?;
        let bodies = file.bodies.iter().map(|body| &body.name);
        let markers = file.markers.iter().map(|marker| &marker.name);
        check_unique("body or marker", bodies.chain(markers))?;
        check_unique("sensor", file.sensors.iter().map(|sensor| &sensor.name))?;
        check_unique(
            "observation",
            file.observations
                .iter()
                .map(|observation| &observation.name),
        )?;
        check_unique(
            "actuator",
            file.actuators.iter().map(|actuator| &actuator.name),
        )?;
        self.check_sensor_names()?;
        self.check_actuator_names()?;
        match file.bodies.iter().find(|body| body.name.as_ref() == WORLD) {
            Some(body) => Err(body
                .name
                .error("`world` is reserved for what does not move: choose another name")),
            None => Ok(()),
        }
    }

    /// The numbers that are drawn per run, then those per episode, then those per step.
    fn drawn_numbers(&self) -> impl Iterator<Item = &DrawnNumber> {
        let per_run = self.file.drawn_per_run.iter();
        let per_episode = per_run.chain(&self.file.drawn_per_episode);
        per_episode.chain(&self.file.drawn_per_step)
    }

    /// The list in which a drawn number has this name.
    pub(super) fn list_of_drawn_number(&self, name: &str) -> Option<&'static str> {
        let lists = [
            ("drawn_per_run", &self.file.drawn_per_run),
            ("drawn_per_episode", &self.file.drawn_per_episode),
            ("drawn_per_step", &self.file.drawn_per_step),
        ];
        let has_name = |numbers: &[DrawnNumber]| {
            let mut numbers = numbers.iter();
            numbers.any(|number| number.name.as_ref() == name)
        };
        let list = lists.into_iter().find(|(_, numbers)| has_name(numbers));
        list.map(|(list, _)| list)
    }

    /// Nothing else may have the name of a drawn number, but an observation that shows it.
    fn check_is_not_drawn(&self, name: &Located<Name>) -> Result<(), ValidationError> {
        match self.list_of_drawn_number(name.as_ref()) {
            Some(list) => Err(name.error(format!(
                "`{}` already names a number in `{list}`: choose another name",
                name.as_ref()
            ))),
            None => Ok(()),
        }
    }

    fn check_sensor_names(&self) -> Result<(), ValidationError> {
        let mut sensors = self.file.sensors.iter();
        sensors.try_for_each(|sensor| self.check_is_not_drawn(&sensor.name))
    }

    /// Formulas read drawn numbers, sensors, observations and actions, so that these share one set of
    /// names. Only an observation may have the name of a sensor or of a drawn number: it shows it.
    fn check_actuator_names(&self) -> Result<(), ValidationError> {
        let file = self.file;
        for actuator in &file.actuators {
            let name = &actuator.name;
            let is_sensor = file.sensors.iter().any(|sensor| sensor.name == *name);
            let mut observations = file.observations.iter();
            let is_observation = observations.any(|observation| observation.name == *name);
            self.check_is_not_drawn(name)?;
            if is_sensor || is_observation {
                return Err(name.error(format!(
                    "`{}` already names a sensor or an observation: choose another name",
                    name.as_ref()
                )));
            }
        }
        Ok(())
    }

    /// Index of the body with this name.
    pub(super) fn find_body(&self, name: &Located<String>) -> Result<usize, ValidationError> {
        find_index(name, "body", self.file.bodies.iter().map(|body| &body.name))
    }

    /// Index of the body with this name; `None` for the world.
    pub(super) fn find_body_or_world(
        &self,
        name: &Located<String>,
    ) -> Result<Option<usize>, ValidationError> {
        if name.as_str() == WORLD {
            return Ok(None);
        }
        let bodies = self.file.bodies.iter();
        let bodies = bodies.map(|body| body.name.value().as_ref());
        match bodies.clone().position(|body| body == name.as_str()) {
            Some(body) => Ok(Some(body)),
            None => Err(name.unknown_name("body", [WORLD].into_iter().chain(bodies))),
        }
    }

    /// Indices of the bodies that are no joint's child.
    pub(super) fn free_bodies(&self) -> Vec<usize> {
        let joints = self.file.joints.iter();
        let children: HashSet<&str> = joints.map(|joint| joint.child.as_str()).collect();
        let bodies = self.file.bodies.iter().enumerate();
        bodies
            .filter(|(_, body)| !children.contains(body.name.value().as_ref()))
            .map(|(index, _)| index)
            .collect()
    }

    /// The sensors, with their values before the step.
    fn sensor_variables(&self) -> Vec<Variable> {
        let sensors = self.file.sensors.iter().enumerate();
        sensors
            .map(|(index, sensor)| Variable {
                name: sensor.name.value().as_ref().to_owned(),
                column: self.columns.first_sensor() + index,
                previous: Previous::Column(self.columns.first_previous_value() + index),
            })
            .collect()
    }

    /// The drawn numbers. They have no values before the step.
    pub(super) fn drawn_variables(&self) -> Vec<Variable> {
        let numbers = self.drawn_numbers().enumerate();
        numbers
            .map(|(column, number)| Variable {
                name: number.name.value().as_ref().to_owned(),
                column,
                previous: Previous::Nowhere,
            })
            .collect()
    }

    /// The drawn numbers, and the sensors without their values before the step: observations and
    /// forces depend only on the current state.
    pub(super) fn state_variables(&self) -> Vec<Variable> {
        let mut variables = self.drawn_variables();
        variables.extend(self.sensor_variables().into_iter().map(|sensor| Variable {
            previous: Previous::NotHere,
            ..sensor
        }));
        variables
    }

    /// The actions, under their actuators' names.
    pub(super) fn action_variables(&self) -> Vec<Variable> {
        let actuators = self.file.actuators.iter().enumerate();
        actuators
            .map(|(index, actuator)| Variable {
                name: actuator.name.value().as_ref().to_owned(),
                column: self.columns.first_action() + index,
                previous: Previous::Nowhere,
            })
            .collect()
    }

    /// Observations, then the sensors and drawn numbers that are not observed under their own name,
    /// then actions.
    pub(super) fn all_variables(&self) -> Vec<Variable> {
        let observations = self.file.observations.iter().enumerate();
        let first_previous_observation =
            self.columns.first_previous_value() + self.columns.sensor_count;
        let mut variables: Vec<_> = observations
            .map(|(index, observation)| Variable {
                name: observation.name.value().as_ref().to_owned(),
                column: self.columns.first_observation() + index,
                previous: Previous::Column(first_previous_observation + index),
            })
            .collect();
        for variable in [self.sensor_variables(), self.drawn_variables()].concat() {
            if variables.iter().all(|known| known.name != variable.name) {
                variables.push(variable);
            }
        }
        variables.extend(self.action_variables());
        variables
    }
}

/// Numbers that are drawn during a run.
pub(super) fn resolved(numbers: &[DrawnNumber]) -> Vec<description::DrawnNumber> {
    let numbers = numbers.iter().map(|number| description::DrawnNumber {
        name: number.name.value().as_ref().to_owned(),
        distribution: number.value.resolve(),
    });
    numbers.collect()
}

/// Checks that all names of one kind differ; `what` is the kind in the error message.
pub(super) fn check_unique<'a>(
    what: &str,
    names: impl Iterator<Item = &'a Located<Name>>,
) -> Result<(), ValidationError> {
    let mut seen: Vec<&str> = Vec::new();
    for name in names {
        if seen.contains(&name.as_ref()) {
            return Err(name.error(format!(
                "another {what} is already named `{}`: choose another name",
                name.as_ref()
            )));
        }
        seen.push(name.value().as_ref());
    }
    Ok(())
}

/// Index of `name` in `names`; `what` is the kind of the names in the error message.
pub(super) fn find_index<'a>(
    name: &Located<String>,
    what: &str,
    names: impl Iterator<Item = &'a Located<Name>> + Clone,
) -> Result<usize, ValidationError> {
    let names = names.map(|known| known.value().as_ref());
    names
        .clone()
        .position(|known| known == name.as_str())
        .ok_or_else(|| name.unknown_name(what, names))
}

/// Compiles a formula; errors point at the character within it.
pub(super) fn formula(
    text: &Located<String>,
    kind: Type,
    variables: &[Variable],
) -> Result<Program, ValidationError> {
    compile(text, kind, variables).map_err(|error| {
        let located = text.error(error.message).at(error.line, error.column);
        match error.help {
            Some(help) => located.with_help(help),
            None => located,
        }
    })
}
