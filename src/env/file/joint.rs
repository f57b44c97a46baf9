//! What joints do beside holding: their ranges, passive forces and fields.

use std::f64::consts::TAU;

use super::resolve::{self, action_variables, find, formula, present_sensors};
use super::{Distribution, Environment, Force, ForceFrame, Joint, JointKind, Start, Vector};
use crate::env::description::{self, Columns, Drive, Passive};
use crate::env::expression::{Program, Type};
use crate::input::numbers::NonNegative;
use crate::input::{Complaint, Located};

/// The joint's range. A hinge's is at most a full turn wide: bodies do not tell how often they have turned.
pub(super) fn range(joint: &Joint) -> Result<Option<[f64; 2]>, Complaint> {
    let Some(range) = &joint.range else {
        return Ok(None);
    };
    let [low, high] = range.get();
    match *joint.kind {
        JointKind::Hinge { .. } if high - low > TAU => {
            Err(range.complain("the range of a hinge is at most a full turn wide"))
        }
        JointKind::Weld => Err(range.complain("a weld has no coordinate that could have a range")),
        _ => Ok(Some([low, high])),
    }
}

/// What resists motion along the joint.
pub(super) fn passive(joint: &Joint, file: &Environment) -> Result<Passive, Complaint> {
    let number =
        |value: &Option<Located<NonNegative>>| value.as_ref().map_or(0.0, |value| value.get());
    let given = [
        &joint.damping,
        &joint.frictionloss,
        &joint.armature,
        &joint.stiffness,
    ]
    .into_iter()
    .flatten();
    if let (JointKind::Weld, Some(value)) = (*joint.kind, given.into_iter().next()) {
        return Err(value.complain("a weld does not move: nothing can resist its motion"));
    }
    if let (Some(springref), None) = (&joint.springref, &joint.stiffness) {
        return Err(springref.complain("a spring needs a `stiffness`"));
    }
    check_armature(joint, file)?;
    Ok(Passive {
        damping: number(&joint.damping),
        frictionloss: number(&joint.frictionloss),
        armature: number(&joint.armature),
        stiffness: number(&joint.stiffness),
        springref: joint.springref.as_ref().map_or(0.0, |value| value.get()),
    })
}

/// A rotor's inertia is added to the child's, which is exact only where nothing but this joint moves the child along the coordinate; the
/// joints of worlds with contacts have rotors of their own.
fn check_armature(joint: &Joint, file: &Environment) -> Result<(), Complaint> {
    let Some(armature) = &joint.armature else {
        return Ok(());
    };
    if resolve::needs_worlds(file) {
        return Ok(());
    }
    let holder = |body: &str| {
        file.joints
            .iter()
            .find(|other| other.child.as_str() == body)
    };
    let parents = || {
        std::iter::successors(holder(&joint.parent), |other| holder(&other.parent))
            .map(|other| *other.kind)
    };
    match *joint.kind {
        JointKind::Hinge { .. }
            if parents().any(|kind| matches!(kind, JointKind::Hinge { .. })) =>
        {
            Err(armature.complain("an armature is not supported on a hinge whose parent turns"))
        }
        JointKind::Slide { .. } if parents().any(|kind| kind != JointKind::Weld) => {
            Err(armature.complain("an armature is not supported on a slide whose parent moves"))
        }
        _ => Ok(()),
    }
}

/// Position of the joint with this name, which has a coordinate.
pub(super) fn find_moving(name: &Located<String>, joints: &[Joint]) -> Result<usize, Complaint> {
    let index = find(name, "joint", joints.iter().map(|joint| &joint.name))?;
    match *joints[index].kind {
        JointKind::Weld => Err(name.complain(format!(
            "joint `{}` is a weld and has no coordinate",
            name.as_str()
        ))),
        _ => Ok(index),
    }
}

/// Position of the hinge with this name.
pub(super) fn find_hinge(name: &Located<String>, joints: &[Joint]) -> Result<usize, Complaint> {
    let index = find(name, "joint", joints.iter().map(|joint| &joint.name))?;
    match *joints[index].kind {
        JointKind::Hinge { .. } => Ok(index),
        _ => Err(name.complain(format!(
            "joint `{}` is no hinge: only angles can be wrapped",
            name.as_str()
        ))),
    }
}

/// Forces that depend on the state before a control step and on the action: on joints, then on bodies.
pub(super) fn fields(
    file: &Environment,
    columns: Columns,
) -> Result<Vec<description::Field>, Complaint> {
    let known: Vec<_> = present_sensors(file, columns)
        .into_iter()
        .chain(action_variables(file, columns))
        .collect();
    let with_force = file
        .joints
        .iter()
        .enumerate()
        .filter_map(|(index, joint)| Some((index, joint, joint.force.as_ref()?)));
    let field = |(index, joint, force): (usize, &Joint, &Located<String>)| match *joint.kind {
        JointKind::Weld => {
            Err(force.complain("a weld has no coordinate along which a force could act"))
        }
        _ => Ok(description::Field {
            drive: Drive::JointForce(index),
            force: formula(force, Type::Number, &known)?,
        }),
    };
    let on_joints: Vec<_> = with_force.map(field).collect::<Result<_, _>>()?;
    let bodies = file.bodies.iter().enumerate();
    let forces = bodies.flat_map(|(body, described)| {
        described
            .forces
            .iter()
            .flat_map(move |force| parts(body, force))
    });
    let on_bodies = forces.map(|(drive, force)| {
        Ok(description::Field {
            drive,
            force: formula(force, Type::Number, &known)?,
        })
    });
    on_joints.into_iter().map(Ok).chain(on_bodies).collect()
}

/// The two parts of a force on a body.
fn parts(body: usize, force: &Force) -> [(Drive, &Located<String>); 2] {
    let (at, local) = (force.at.map(Vector::get), force.frame == ForceFrame::Local);
    let drive = |direction| Drive::BodyForce {
        body,
        at,
        direction,
        local,
    };
    [(drive([1.0, 0.0]), &force.x), (drive([0.0, 1.0]), &force.y)]
}

/// Bodies that are drawn elsewhere than they are.
pub(super) fn drawings(
    file: &Environment,
    columns: Columns,
) -> Result<Vec<description::Drawing>, Complaint> {
    let sensors = present_sensors(file, columns);
    let number = |text: &Located<String>| -> Result<Program, Complaint> {
        formula(text, Type::Number, &sensors)
    };
    let drawn = file
        .bodies
        .iter()
        .enumerate()
        .filter_map(|(body, described)| Some((body, described.drawn.as_ref()?)));
    drawn
        .map(|(body, drawn)| {
            Ok(description::Drawing {
                body,
                y: number(&drawn.y)?,
                angle: number(&drawn.angle)?,
            })
        })
        .collect()
}

/// A start lies within the joint's range.
pub(super) fn check_start(start: &Start, joint: &Joint) -> Result<(), Complaint> {
    let Some([low, high]) = joint.range.as_ref().map(|range| range.get()) else {
        return Ok(());
    };
    let (least, most) = match start.position.unwrap_or_default() {
        Distribution::Constant(value) => (value.get(), value.get()),
        Distribution::Uniform(interval) => (interval.get()[0], interval.get()[1]),
        Distribution::Normal(mean, _) => (mean.get(), mean.get()),
    };
    if low <= least && most <= high {
        return Ok(());
    }
    let name = start.joint.as_str();
    Err(start.joint.complain(format!(
        "joint `{name}` would start outside its range, which is ({low}, {high})"
    )))
}
