//! Ropes, a fluid, and how soft contacts are: their schema, and what they mean.

use serde::Deserialize;

use super::resolver::Resolver;
use super::{Body, Name, Vector};
use crate::description;
use seedbed_input::numbers::{Length, NonNegative, Positive};
use seedbed_input::{Located, ValidationError};

/// A maximum distance between two points. It pulls when it is taut and never pushes.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rope {
    /// Name, unique among ropes.
    pub name: Located<Name>,
    /// One end.
    pub from: RopeEnd,
    /// The other end.
    pub to: RopeEnd,
    /// Maximum distance of the ends, m.
    pub length: Length,
}

/// A point that a rope is tied to.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RopeEnd {
    /// Name of the body, or `world`.
    pub body: Located<String>,
    /// The point in the body's frame; by default its origin.
    #[serde(default)]
    pub at: Vector,
}

/// A fluid at rest that fills the world.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fluid {
    /// Density, kg/m³.
    pub density: NonNegative,
    /// Dynamic viscosity, Pa s; 0 by default.
    #[serde(default)]
    pub viscosity: Option<NonNegative>,
}

/// How far an overlap or an overshoot yields: like a damped spring that a lasting load presses in by
/// its acceleration over (2 π natural frequency)².
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Softness {
    /// Natural frequency of the spring, Hz.
    pub natural_frequency: Positive,
    /// Damping ratio: 1 is critical damping.
    pub damping_ratio: Positive,
}

impl Softness {
    pub(super) fn resolve(self) -> description::Softness {
        description::Softness {
            natural_frequency: self.natural_frequency.get(),
            damping_ratio: self.damping_ratio.get(),
        }
    }
}

impl Fluid {
    pub(super) fn resolve(self) -> description::Fluid {
        description::Fluid {
            density: self.density.get(),
            viscosity: self.viscosity.map_or(0.0, NonNegative::get),
        }
    }
}

impl Resolver<'_> {
    pub(super) fn ropes(&self) -> Result<Vec<description::Rope>, ValidationError> {
        self.file.ropes.iter().map(|rope| self.rope(rope)).collect()
    }

    fn rope(&self, rope: &Rope) -> Result<description::Rope, ValidationError> {
        let ends = [self.rope_end(&rope.from)?, self.rope_end(&rope.to)?];
        if ends[0].body == ends[1].body {
            return Err(rope.to.body.error(format!(
                "both ends of rope `{}` are tied to `{}`: expected two different bodies",
                rope.name.as_ref(),
                rope.to.body.as_str()
            )));
        }
        Ok(description::Rope {
            name: rope.name.value().as_ref().to_owned(),
            ends,
            length: rope.length.get(),
        })
    }

    fn rope_end(&self, end: &RopeEnd) -> Result<description::RopeEnd, ValidationError> {
        Ok(description::RopeEnd {
            body: self.find_body_or_world(&end.body)?,
            at: end.at.get(),
        })
    }

    /// Checks that only tasks with a fluid give the boxes as which bodies move through it.
    pub(super) fn check_fluid_boxes(&self) -> Result<(), ValidationError> {
        let mut bodies = self.file.bodies.iter();
        match bodies.find(|body| body.fluid_box.is_some()) {
            Some(Body { name, .. }) if self.file.fluid.is_none() => Err(name.error(format!(
                "body `{}` has a `fluid_box`, but the task has no `fluid`: add one",
                name.as_ref()
            ))),
            _ => Ok(()),
        }
    }
}
