//! Further properties of joints: ranges, passive forces, formula forces, and start coordinates.

use super::resolver::{MAX_MASS, Resolver, find_index, formula};
use super::{Distribution, Force, ForceFrame, Joint, JointKind, StartCoordinate, Vector};
use crate::description::{self, Drive, PassiveForces};
use crate::expression::Type;
use seedbed_input::numbers::{FiniteNumber, NonNegative, readable};
use seedbed_input::{Located, ValidationError};

impl Joint {
    /// The joint's range.
    pub(super) fn checked_range(&self) -> Result<Option<[f64; 2]>, ValidationError> {
        let Some(range) = &self.range else {
            return Ok(None);
        };
        match *self.kind {
            JointKind::Weld => Err(range.error("a weld has no coordinate: remove `range`")),
            _ => Ok(Some(range.get())),
        }
    }

    /// How soft the ends of the joint's range are.
    pub(super) fn checked_range_softness(
        &self,
    ) -> Result<Option<description::Softness>, ValidationError> {
        match (&self.range_softness, &self.range) {
            (Some(softness), None) => {
                Err(softness.error("`range_softness` needs a range: add a `range`"))
            }
            (softness, _) => Ok(softness.as_ref().map(|softness| softness.resolve())),
        }
    }

    /// What resists motion along the joint.
    pub(super) fn passive_forces(&self) -> Result<PassiveForces, ValidationError> {
        let given = [
            &self.damping,
            &self.frictionloss,
            &self.armature,
            &self.stiffness,
        ];
        if let (JointKind::Weld, Some(value)) = (*self.kind, given.into_iter().flatten().next()) {
            return Err(value.error("a weld does not move, so nothing can resist its motion"));
        }
        if let (Some(springref), None) = (&self.springref, &self.stiffness) {
            return Err(springref.error("`springref` needs a spring: add a `stiffness`"));
        }
        if let Some(armature) = self
            .armature
            .as_ref()
            .filter(|value| value.get() > MAX_MASS)
        {
            return Err(armature.error(format!(
                "single precision cannot compute with such an armature: expected at most {MAX_MASS:e} kg or kg m²"
            )));
        }
        let number =
            |value: &Option<Located<NonNegative>>| value.as_ref().map_or(0.0, |value| value.get());
        Ok(PassiveForces {
            damping: number(&self.damping),
            frictionloss: number(&self.frictionloss),
            armature: number(&self.armature),
            stiffness: number(&self.stiffness),
            springref: self.springref.as_ref().map_or(0.0, |value| value.get()),
        })
    }
}

impl Resolver<'_> {
    /// Index of the joint with this name.
    pub(super) fn find_joint(&self, name: &Located<String>) -> Result<usize, ValidationError> {
        let joints = self.file.joints.iter();
        find_index(name, "joint", joints.map(|joint| &joint.name))
    }

    /// A force along the coordinate with this name. That of a coordinate of a free body acts at the
    /// origin of the body's frame.
    pub(super) fn coordinate_force(
        &self,
        name: &Located<String>,
    ) -> Result<Drive, ValidationError> {
        let coordinate = self.find_coordinate(name)?;
        let Some(free_coordinate) = coordinate.checked_sub(self.file.joints.len()) else {
            return Ok(Drive::JointForce(coordinate));
        };
        let body = self.free_bodies()[free_coordinate / 3];
        let force_along = |direction| Drive::BodyForce {
            body,
            at: Some([0.0, 0.0]),
            direction,
            is_local: false,
        };
        Ok(match free_coordinate % 3 {
            0 => force_along([1.0, 0.0]),
            1 => force_along([0.0, 1.0]),
            _ => Drive::BodyTorque { body },
        })
    }

    /// Index of the joint with this name, which must have a coordinate.
    pub(super) fn find_moving_joint(
        &self,
        name: &Located<String>,
    ) -> Result<usize, ValidationError> {
        let index = self.find_joint(name)?;
        match *self.file.joints[index].kind {
            JointKind::Weld => Err(no_coordinate(name)),
            _ => Ok(index),
        }
    }

    /// Index of the joint with this name, which must be a hinge.
    pub(super) fn find_hinge(&self, name: &Located<String>) -> Result<usize, ValidationError> {
        let index = self.find_joint(name)?;
        match *self.file.joints[index].kind {
            JointKind::Hinge { .. } => Ok(index),
            _ => Err(name.error(format!(
                "expected a hinge, but joint `{}` is not one: only angles can be wrapped",
                name.as_str()
            ))),
        }
    }

    /// Index of the coordinate with this name: a joint, or a coordinate of a free body such as
    /// `NAME.x`.
    pub(super) fn find_coordinate(&self, name: &Located<String>) -> Result<usize, ValidationError> {
        let joints = self.file.joints.iter();
        let mut names: Vec<_> = joints.map(|joint| joint.name.as_ref().to_owned()).collect();
        for body in self.free_bodies() {
            let body = self.file.bodies[body].name.as_ref();
            names.extend(["x", "y", "angle"].map(|axis| format!("{body}.{axis}")));
        }
        let Some(index) = names.iter().position(|known| *known == **name) else {
            return Err(name.unknown_name("coordinate", names.iter().map(String::as_str)));
        };
        match self.file.joints.get(index).map(|joint| *joint.kind) {
            Some(JointKind::Weld) => Err(no_coordinate(name)),
            _ => Ok(index),
        }
    }

    /// Forces given by formulas of the state before a control step and of the action: the forces on
    /// joints, then the forces on bodies.
    pub(super) fn formula_forces(&self) -> Result<Vec<description::FormulaForce>, ValidationError> {
        let mut variables = self.state_variables();
        variables.extend(self.action_variables());
        let mut forces = Vec::new();
        for (index, joint) in self.file.joints.iter().enumerate() {
            let Some(text) = &joint.force else { continue };
            if *joint.kind == JointKind::Weld {
                return Err(text.error("a weld has no coordinate: remove `force`"));
            }
            forces.push((Drive::JointForce(index), text));
        }
        for (index, body) in self.file.bodies.iter().enumerate() {
            forces.extend(
                body.forces
                    .iter()
                    .flat_map(|force| force_components(index, force)),
            );
        }
        let compiled = forces.into_iter().map(|(drive, text)| {
            Ok(description::FormulaForce {
                drive,
                formula: formula(text, Type::Number, &variables)?,
            })
        });
        compiled.collect()
    }

    /// Bodies that are drawn at another place than they are.
    pub(super) fn display_offsets(
        &self,
    ) -> Result<Vec<description::DisplayOffset>, ValidationError> {
        let sensors = self.state_variables();
        let mut offsets = Vec::new();
        for (body, described) in self.file.bodies.iter().enumerate() {
            if let Some(offset) = &described.display_offset {
                offsets.push(description::DisplayOffset {
                    body,
                    y: formula(&offset.y, Type::Number, &sensors)?,
                    angle: formula(&offset.angle, Type::Number, &sensors)?,
                });
            }
        }
        Ok(offsets)
    }

    pub(super) fn start_coordinates(
        &self,
    ) -> Result<Vec<description::StartCoordinate>, ValidationError> {
        let mut starts: Vec<description::StartCoordinate> = Vec::new();
        for start in &self.file.reset {
            let name = &start.joint;
            let coordinate = self.find_coordinate(name)?;
            if let Some(joint) = self.file.joints.get(coordinate) {
                check_start(start, joint)?;
            }
            if starts.iter().any(|other| other.coordinate == coordinate) {
                return Err(name.error(format!(
                    "the start of `{}` is already given: remove one of the two",
                    name.as_str()
                )));
            }
            let reference = self.reference_coordinate(coordinate);
            starts.push(description::StartCoordinate {
                coordinate,
                position: start.position.map_or(
                    description::Distribution::Constant(reference),
                    Distribution::resolve,
                ),
                velocity: start.velocity.resolve(),
            });
        }
        Ok(starts)
    }

    /// A coordinate at the bodies' reference poses: 0 for joints.
    fn reference_coordinate(&self, coordinate: usize) -> f64 {
        let Some(free_coordinate) = coordinate.checked_sub(self.file.joints.len()) else {
            return 0.0;
        };
        let body = &self.file.bodies[self.free_bodies()[free_coordinate / 3]];
        let [x, y] = body.position.get();
        [x, y, body.angle.map_or(0.0, FiniteNumber::get)][free_coordinate % 3]
    }
}

impl Distribution {
    pub(super) fn resolve(self) -> description::Distribution {
        match self {
            Self::Constant(value) => description::Distribution::Constant(value.get()),
            Self::Uniform(interval) => {
                let [low, high] = interval.get();
                description::Distribution::Uniform { low, high }
            }
            Self::Normal(mean, deviation) => description::Distribution::Normal {
                mean: mean.get(),
                deviation: deviation.get(),
            },
            Self::WholeNumber(numbers) => {
                let [from, to] = numbers.get();
                description::Distribution::WholeNumber { from, to }
            }
        }
    }
}

fn no_coordinate(name: &Located<String>) -> ValidationError {
    name.error(format!(
        "expected a slide or a hinge, but joint `{}` is a weld and has no coordinate",
        name.as_str()
    ))
}

/// The two components of a force on a body.
fn force_components(body: usize, force: &Force) -> [(Drive, &Located<String>); 2] {
    let drive = |direction| Drive::BodyForce {
        body,
        at: force.at.map(Vector::get),
        direction,
        is_local: force.frame == ForceFrame::Local,
    };
    [(drive([1.0, 0.0]), &force.x), (drive([0.0, 1.0]), &force.y)]
}

/// Checks that a start position lies within the joint's range; of a normal distribution, that its
/// mean does.
fn check_start(start: &StartCoordinate, joint: &Joint) -> Result<(), ValidationError> {
    let Some([low, high]) = joint.range.as_ref().map(|range| range.get()) else {
        return Ok(());
    };
    let (min, max) = match start.position.unwrap_or_default() {
        Distribution::Constant(value) => (value.get(), value.get()),
        Distribution::Uniform(interval) => (interval.get()[0], interval.get()[1]),
        Distribution::Normal(mean, _) => (mean.get(), mean.get()),
        Distribution::WholeNumber(numbers) => numbers.get().map(f64::from).into(),
    };
    if low <= min && max <= high {
        return Ok(());
    }
    let name = start.joint.as_str();
    Err(start.joint.error(format!(
        "joint `{name}` would start outside its range ({}, {}): move `position` inside it",
        readable(low),
        readable(high)
    )))
}
