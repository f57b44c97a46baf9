//! Shapes, and surfaces that touch each other: their schema, and what they mean.

use serde::Deserialize;

use super::{Direction, Name, Vector};
use crate::env::description::{self, Surface};
use crate::env::{Shape, physics};
use crate::input::numbers::{Finite, Fraction, NonNegative, Positive};
use crate::input::{Complaint, Located};

/// A shape that touches others.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Collider {
    /// By which sensors refer to it; unique among colliders.
    #[serde(default)]
    pub name: Option<Located<Name>>,
    /// Its form. Half-spaces and polylines belong to the world.
    pub geom: Located<Geom>,
    /// Coefficient μ of dry friction, 1 by default; of two surfaces the larger counts.
    #[serde(default)]
    pub friction: Option<NonNegative>,
    /// From 0 (no bounce, the default) to 1; of two surfaces the larger counts.
    #[serde(default)]
    pub restitution: Option<Fraction>,
    /// Bits of the kinds that the surface is of; 1 by default.
    #[serde(default = "first_kind")]
    pub contype: u32,
    /// Bits of the kinds that it touches, 1 by default. Two surfaces touch if one is of a kind that the other touches, and their
    /// bodies do not hang on each other.
    #[serde(default = "first_kind")]
    pub conaffinity: u32,
}

/// A shape in its body's frame.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Geom {
    /// A disc.
    Ball {
        /// Centre.
        #[serde(default)]
        center: Vector,
        /// Radius.
        radius: Positive,
    },
    /// A rectangle.
    Box {
        /// Centre.
        #[serde(default)]
        center: Vector,
        /// Half width and half height.
        half_size: (Positive, Positive),
        /// Rotation about the centre.
        #[serde(default)]
        angle: Option<Finite>,
    },
    /// A segment with a thickness.
    Capsule {
        /// One end of the segment.
        from: Vector,
        /// The other end.
        to: Vector,
        /// Half the thickness.
        radius: Positive,
    },
    /// The convex hull of at least three points.
    Convex(Points<3>),
    /// An open line of at least two points, which weighs nothing. As a collider it can be touched from the right, seen along it.
    Polyline(Points<2>),
    /// All that lies behind an endless line, which weighs nothing.
    HalfSpace {
        /// A point of the line.
        #[serde(default)]
        point: Vector,
        /// To the outside.
        normal: Direction,
    },
}

/// At least `MINIMUM` points.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "Vec<Vector>")]
pub struct Points<const MINIMUM: usize>(Vec<Vector>);

impl<const MINIMUM: usize> Points<MINIMUM> {
    /// The points, in f32.
    #[must_use]
    pub fn get(&self) -> Vec<[f32; 2]> {
        self.0
            .iter()
            .map(|point| point.get().map(|value| value as f32))
            .collect()
    }
}

impl<const MINIMUM: usize> TryFrom<Vec<Vector>> for Points<MINIMUM> {
    type Error = String;

    fn try_from(points: Vec<Vector>) -> Result<Self, String> {
        if points.len() >= MINIMUM {
            return Ok(Self(points));
        }
        Err(format!(
            "expected at least {MINIMUM} points, found {}",
            points.len()
        ))
    }
}

/// All colliders: the world's, then those of each body.
pub(super) fn colliders(
    file: &super::Environment,
) -> Result<Vec<description::Collider>, Complaint> {
    let of_world = file.colliders.iter().map(|collider| (None, collider));
    let bodies = file.bodies.iter().enumerate();
    let of_bodies = bodies.flat_map(|(index, body)| {
        body.colliders
            .iter()
            .map(move |collider| (Some(index), collider))
    });
    of_world
        .chain(of_bodies)
        .map(|(body, collider)| resolved(body, collider))
        .collect()
}

fn resolved(body: Option<usize>, collider: &Collider) -> Result<description::Collider, Complaint> {
    if body.is_some() && matches!(*collider.geom, Geom::HalfSpace { .. } | Geom::Polyline(_)) {
        return Err(collider
            .geom
            .complain("half-spaces and polylines stand still: they are `colliders` of the world, not of a body"));
    }
    if physics::inertial(1.0, &[shape(&collider.geom)]).is_none()
        && matches!(*collider.geom, Geom::Convex(_))
    {
        return Err(collider
            .geom
            .complain("the points lie on one line: there is nothing to touch"));
    }
    Ok(description::Collider {
        name: collider.name.as_ref().map(|name| name.as_ref().to_owned()),
        body,
        surface: surface(&collider.geom),
        friction: collider.friction.map_or(1.0, NonNegative::get),
        restitution: collider.restitution.map_or(0.0, Fraction::get),
        contype: collider.contype,
        conaffinity: collider.conaffinity,
    })
}

fn surface(geom: &Geom) -> Surface {
    match geom {
        Geom::HalfSpace { point, normal } => Surface::HalfSpace {
            point: single(point.get()),
            normal: single(normal.get()),
        },
        other => Surface::Shape(shape(other)),
    }
}

/// Half the length at which an endless line is drawn, m; a notch marks each metre.
const DRAWN: i16 = 100;

/// The shape as it is drawn.
pub(super) fn shape(geom: &Geom) -> Shape {
    match geom {
        Geom::Ball { center, radius } => Shape::Ball {
            center: single(center.get()),
            radius: radius.get_f32(),
        },
        Geom::Box {
            center,
            half_size: (width, height),
            angle,
        } => Shape::Box {
            center: single(center.get()),
            half_size: [width.get_f32(), height.get_f32()],
            angle: angle.map_or(0.0, Finite::get_f32),
        },
        Geom::Capsule { from, to, radius } => Shape::Capsule {
            from: single(from.get()),
            to: single(to.get()),
            radius: radius.get_f32(),
        },
        Geom::Convex(points) => Shape::Polygon(points.get()),
        Geom::Polyline(points) => Shape::Polyline(points.get()),
        Geom::HalfSpace { point, normal } => {
            let ([x, y], [right, up]) = (single(point.get()), single(normal.get()));
            let at = |[along, depth]: [f32; 2]| {
                [
                    x + along * up - depth * right,
                    y - along * right - depth * up,
                ]
            };
            Shape::Polyline(notched_line().map(at).collect())
        }
    }
}

/// Along an endless line and into what lies behind it: notches show on which side that is, and that bodies get on.
fn notched_line() -> impl Iterator<Item = [f32; 2]> {
    const NOTCH: f32 = 0.04;
    (-DRAWN..=DRAWN)
        .map(f32::from)
        .flat_map(|metre| [[metre, 0.0], [metre, NOTCH], [metre, 0.0]])
}

fn single(a: [f64; 2]) -> [f32; 2] {
    a.map(|value| value as f32)
}

fn first_kind() -> u32 {
    1
}
