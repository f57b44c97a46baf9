//! Which bodies joints connect: trees of bodies, and several joints of one body.

use super::resolver::Resolver;
use super::{Joint, JointKind, RotationDirection};
use crate::description;
use seedbed_input::ValidationError;

impl Resolver<'_> {
    /// The joints, which must form trees rooted in the world or in free bodies: the joints of a body
    /// have the same parent, and each parent is a root or the child of earlier joints only.
    pub(super) fn joints(&self) -> Result<Vec<description::Joint>, ValidationError> {
        let mut joints = Vec::new();
        for (index, joint) in self.file.joints.iter().enumerate() {
            let earlier = &self.file.joints[..index];
            let (parent, child) = (self.parent(joint, earlier)?, self.find_body(&joint.child)?);
            check_joint_of_same_child(joint, earlier)?;
            joints.push(description::Joint {
                name: joint.name.value().as_ref().to_owned(),
                parent,
                child,
                anchor: joint.anchor.get(),
                kind: joint_kind(*joint.kind),
                range: joint.checked_range()?,
                range_softness: joint.checked_range_softness()?,
                passive_forces: joint.passive_forces()?,
            });
        }
        Ok(joints)
    }

    fn parent(&self, joint: &Joint, earlier: &[Joint]) -> Result<Option<usize>, ValidationError> {
        let name = &joint.parent;
        let Some(parent) = self.find_body_or_world(name)? else {
            return Ok(None);
        };
        let is_held = earlier.iter().any(|other| *other.child == **name);
        if !is_held && !self.free_bodies().contains(&parent) {
            return Err(name.error(format!(
                "the joint that holds body `{}` must come before this one: joints form a tree, \
                 parents before children",
                name.as_str()
            )));
        }
        Ok(Some(parent))
    }
}

/// Checks a further joint of a body: it must have the same parent, its coordinate must add to those
/// of the earlier joints, and nothing may hang on the body yet.
fn check_joint_of_same_child(joint: &Joint, earlier: &[Joint]) -> Result<(), ValidationError> {
    let same_child = earlier.iter().filter(|other| *other.child == *joint.child);
    let same_child: Vec<_> = same_child.collect();
    let Some(last) = same_child.last() else {
        return Ok(());
    };
    let (child, other) = (joint.child.as_str(), last.name.as_ref());
    if *joint.parent != *last.parent {
        return Err(joint.parent.error(format!(
            "body `{child}` is also the child of joint `{other}`, whose parent is `{}`: all joints \
             of a body have the same parent",
            last.parent.as_str()
        )));
    }
    if earlier.iter().any(|other| *other.parent == *joint.child) {
        return Err(joint.child.error(format!(
            "all joints of body `{child}` must come before those of bodies that hang on it"
        )));
    }
    check_kinds_of_same_child(joint, &same_child)?;
    check_softness_of_same_child(joint, &same_child)
}

/// Rapier has one softness for all coordinates of a body's joint.
fn check_softness_of_same_child(
    joint: &Joint,
    same_child: &[&Joint],
) -> Result<(), ValidationError> {
    let softness = |joint: &Joint| joint.range_softness.as_ref().map(|softness| **softness);
    let differs = |other: &&&Joint| softness(other) != softness(joint);
    let mut with_range = same_child.iter().filter(|other| other.range.is_some());
    match (&joint.range, with_range.find(differs)) {
        (Some(range), Some(other)) => Err(range.error(format!(
            "the range of joint `{}`, which has the same child, has another `range_softness`: give \
             both the same, or none",
            other.name.as_ref()
        ))),
        _ => Ok(()),
    }
}

/// Maximum cosine of the angle between two axes that count as perpendicular. With six digits each, it is at
/// most 1.5e-6.
const MAX_COSINE: f64 = 2e-6;

/// A body may have up to two slides with perpendicular axes, then a hinge.
fn check_kinds_of_same_child(joint: &Joint, same_child: &[&Joint]) -> Result<(), ValidationError> {
    let axis = |joint: &Joint| match *joint.kind {
        JointKind::Slide { axis } => Some(axis.get()),
        _ => None,
    };
    let axes: Option<Vec<_>> = same_child.iter().map(|joint| axis(joint)).collect();
    let is_possible = match (axes.as_deref(), *joint.kind) {
        (Some([_] | [_, _]), JointKind::Hinge { .. }) => true,
        (Some([[x, y]]), JointKind::Slide { axis }) => {
            let [other_x, other_y] = axis.get();
            (x * other_x + y * other_y).abs() < MAX_COSINE
        }
        _ => false,
    };
    if is_possible {
        return Ok(());
    }
    let names = same_child
        .iter()
        .map(|joint| format!("`{}`", joint.name.as_ref()));
    Err(joint.kind.error(format!(
        "body `{}` is already the child of {}: a body may have up to two slides with perpendicular \
         axes, then at most one hinge",
        joint.child.as_str(),
        names.collect::<Vec<_>>().join(" and ")
    )))
}

fn joint_kind(kind: JointKind) -> description::JointKind {
    match kind {
        JointKind::Slide { axis } => description::JointKind::Slide { axis: axis.get() },
        JointKind::Hinge {
            positive: RotationDirection::CounterClockwise,
        } => description::JointKind::Hinge { sign: 1.0 },
        JointKind::Hinge {
            positive: RotationDirection::Clockwise,
        } => description::JointKind::Hinge { sign: -1.0 },
        JointKind::Weld => description::JointKind::Weld,
    }
}
