//! Shapes, and surfaces that touch each other: their schema, and what they mean.

use serde::{Deserialize, Deserializer, de};

use super::resolver::Resolver;
use super::{Direction, Name, Terrain, Vector};
use crate::description::{self, Surface};
use crate::kinematics::single_angle;
use crate::{Shape, caught_panic, physics};
use seedbed_input::limits::MAX_POINTS;
use seedbed_input::numbers::{FiniteNumber, Fraction, Length, NonNegative};
use seedbed_input::{Located, ValidationError};

/// A shape that can touch other shapes.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Collider {
    /// Name by which sensors refer to it, unique among colliders.
    #[serde(default)]
    pub name: Option<Located<Name>>,
    /// Shape of the surface. Half-spaces, polylines and terrains are allowed for the world only.
    pub geom: Located<Geom>,
    /// Coefficient μ of dry friction, 1 by default. The larger one of two surfaces is used.
    #[serde(default)]
    pub friction: Option<NonNegative>,
    /// Coefficient of restitution from 0 (no bounce, the default) to 1. The larger one of two
    /// surfaces is used.
    #[serde(default)]
    pub restitution: Option<Fraction>,
    /// Bits of the collision groups that the surface belongs to; 1 by default.
    #[serde(default = "first_group")]
    pub contype: u32,
    /// Bits of the collision groups that the surface touches, 1 by default. Two surfaces can touch
    /// if one belongs to a group that the other touches, and no joint connects their bodies.
    #[serde(default = "first_group")]
    pub conaffinity: u32,
}

/// A shape in its body's frame.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(remote = "Self", deny_unknown_fields)]
pub enum Geom {
    /// A disc.
    Ball {
        /// Center.
        #[serde(default)]
        center: Vector,
        /// Radius.
        radius: Length,
    },
    /// A rectangle.
    Box {
        /// Center.
        #[serde(default)]
        center: Vector,
        /// Half width and half height.
        half_size: (Length, Length),
        /// Rotation about the center.
        #[serde(default)]
        angle: Option<FiniteNumber>,
    },
    /// A segment with a thickness.
    Capsule {
        /// One end of the segment.
        from: Vector,
        /// The other end.
        to: Vector,
        /// Half the thickness.
        radius: Length,
    },
    /// The convex hull of at least three points.
    Convex(Points<3>),
    /// An open line of at least two points; it weighs nothing. As a collider it can be touched from
    /// its right-hand side.
    Polyline(Points<2>),
    /// Everything behind an infinite line; it weighs nothing.
    HalfSpace {
        /// A point on the line.
        #[serde(default)]
        point: Vector,
        /// Direction to the outside.
        normal: Direction,
    },
    /// A line that is drawn at the start of each episode, for colliders of the task only. It can be
    /// touched from above.
    Terrain(Terrain),
}

impl<'de> Deserialize<'de> for Geom {
    /// Reads a shape, and checks where it is, so that an error points at it.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        // The function that `remote` derives.
        let geom = Self::deserialize(deserializer)?;
        let is_far = |point: &Vector| point.get().iter().any(|along| along.abs() > FARTHEST);
        match geom.points().iter().find(|point| is_far(point)) {
            Some(far) => {
                let [x, y] = far.get();
                Err(de::Error::custom(format!(
                    "expected points of shapes within {FARTHEST} m of the origin, found ({x:?}, {y:?})"
                )))
            }
            None => Ok(geom),
        }
    }
}

/// Maximum of the coordinates of a shape's points, m.
pub(super) const FARTHEST: f64 = 1e6;

/// Minimum distance of points that belong to different corners, m.
const NEAREST: f64 = 1e-6;

impl Geom {
    /// The points that say where the shape is.
    fn points(&self) -> Vec<Vector> {
        match self {
            Self::Ball { center, .. } | Self::Box { center, .. } => vec![*center],
            Self::Capsule { from, to, .. } => vec![*from, *to],
            Self::Convex(points) => points.0.clone(),
            Self::Polyline(points) => points.0.clone(),
            Self::HalfSpace { point, .. } => vec![*point],
            Self::Terrain(_) => Vec::new(),
        }
    }

    fn terrain(&self) -> Option<&Terrain> {
        match self {
            Self::Terrain(terrain) => Some(terrain),
            _ => None,
        }
    }
}

/// At least `MIN` points.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "Vec<Vector>")]
pub struct Points<const MIN: usize>(Vec<Vector>);

impl<const MIN: usize> Points<MIN> {
    /// The points, in f32.
    #[must_use]
    pub fn get(&self) -> Vec<[f32; 2]> {
        self.0
            .iter()
            .map(|point| point.get().map(|value| value as f32))
            .collect()
    }

    /// The first point that the next one repeats.
    fn repeated(&self) -> Option<[f32; 2]> {
        let points = self.get();
        let mut neighbors = points.array_windows();
        let repeated = neighbors.find(|[one, next]| {
            let [x, y] = [0, 1].map(|axis| f64::from(next[axis]) - f64::from(one[axis]));
            x.hypot(y) < NEAREST
        });
        repeated.map(|[one, _]| *one)
    }
}

impl<const MIN: usize> TryFrom<Vec<Vector>> for Points<MIN> {
    type Error = String;

    fn try_from(points: Vec<Vector>) -> Result<Self, String> {
        if (MIN..=MAX_POINTS).contains(&points.len()) {
            return Ok(Self(points));
        }
        let expected = if points.len() < MIN {
            format!("at least {MIN}")
        } else {
            format!("at most {MAX_POINTS}")
        };
        Err(format!(
            "expected {expected} points, found {}",
            points.len()
        ))
    }
}

impl Resolver<'_> {
    /// All colliders: the world's, then those of each body.
    pub(super) fn colliders(&self) -> Result<Vec<description::Collider>, ValidationError> {
        let of_world = self.file.colliders.iter().map(|collider| (None, collider));
        let bodies = self.file.bodies.iter().enumerate();
        let of_bodies = bodies.flat_map(|(index, body)| {
            let colliders = body.colliders.iter();
            colliders.map(move |collider| (Some(index), collider))
        });
        let all = of_world.chain(of_bodies);
        all.map(|(body, collider)| self.collider(body, collider))
            .collect()
    }

    fn collider(
        &self,
        body: Option<usize>,
        collider: &Collider,
    ) -> Result<description::Collider, ValidationError> {
        check_geom(body, collider)?;
        let resolved = description::Collider {
            name: collider.name.as_ref().map(|name| name.as_ref().to_owned()),
            body,
            surface: match &*collider.geom {
                Geom::Terrain(terrain) => Surface::Terrain(Box::new(self.terrain(terrain)?)),
                geom => surface(geom),
            },
            friction: collider.friction.map_or(1.0, NonNegative::get),
            restitution: collider.restitution.map_or(0.0, Fraction::get),
            contype: collider.contype,
            conaffinity: collider.conaffinity,
        };
        // Parry panics at some shapes.
        match caught_panic(|| physics::check_surface(&resolved)) {
            Ok(()) => Ok(resolved),
            Err(reason) => Err(collider.geom.error(format!(
                "the physics engine cannot use this shape: {reason}"
            ))),
        }
    }

    /// Checks that only bodies without joints have continuous collision detection: it would move others
    /// without their joints.
    pub(super) fn check_ccd(&self) -> Result<(), ValidationError> {
        for body in &self.file.bodies {
            let name = body.name.as_ref();
            let Some(ccd) = body.ccd.as_ref().filter(|ccd| ***ccd) else {
                continue;
            };
            if body.colliders.is_empty() {
                return Err(ccd.error(format!(
                    "body `{name}` has no `colliders`: `ccd` needs something that can touch"
                )));
            }
            let mut joints = self.file.joints.iter();
            if let Some(joint) = joints.find(|joint| *joint.child == name || *joint.parent == name)
            {
                return Err(ccd
                    .error(format!(
                        "`ccd` is for bodies without joints, but joint `{}` holds body `{name}`",
                        joint.name.as_ref()
                    ))
                    .with_help("raise `solver.searches`, or make the surfaces thicker"));
            }
        }
        Ok(())
    }

    /// Checks that terrains are colliders of the task, and not shapes that are only drawn.
    pub(super) fn check_terrains(&self) -> Result<(), ValidationError> {
        let of_bodies = self.file.bodies.iter().flat_map(|body| &body.geoms);
        let of_markers = self.file.markers.iter().flat_map(|marker| &marker.geoms);
        let mut drawn = self.file.scenery.iter().chain(of_bodies).chain(of_markers);
        match drawn.find_map(Geom::terrain) {
            Some(terrain) => Err(terrain.height.error(
                "a terrain must be one of the `colliders` of the task: it cannot only be drawn",
            )),
            None => Ok(()),
        }
    }
}

/// Checks that a collider has a shape that its body can have.
fn check_geom(body: Option<usize>, collider: &Collider) -> Result<(), ValidationError> {
    let is_fixed = matches!(
        *collider.geom,
        Geom::HalfSpace { .. } | Geom::Polyline(_) | Geom::Terrain(_)
    );
    if body.is_some() && is_fixed {
        return Err(collider.geom.error(
            "half-spaces, polylines and terrains cannot move: put them into the `colliders` of the \
             task, not of a body",
        ));
    }
    match &*collider.geom {
        Geom::Convex(_) if physics::inertial(1.0, &[shape(&collider.geom)]).is_none() => {
            return Err(collider
                .geom
                .error("the points of a convex collider must not all lie on one line"));
        }
        Geom::Polyline(points) => {
            if let Some([x, y]) = points.repeated() {
                return Err(collider.geom.error(format!(
                    "two neighboring points of the line are at ({x:?}, {y:?}) in single precision: remove one of them"
                )));
            }
        }
        _ => {}
    }
    Ok(())
}

fn surface(geom: &Geom) -> Surface {
    match geom {
        Geom::HalfSpace { point, normal } => Surface::HalfSpace {
            point: to_f32(point.get()),
            normal: to_f32(normal.get()),
        },
        other => Surface::Shape(shape(other)),
    }
}

/// Half of the length that is drawn of an infinite line, m: as far as a fast walker gets in an episode.
const HALF_DRAWN_LENGTH: i16 = 500;

/// The shape as it is drawn.
pub(super) fn shape(geom: &Geom) -> Shape {
    match geom {
        Geom::Ball { center, radius } => Shape::Ball {
            center: to_f32(center.get()),
            radius: radius.get_f32(),
        },
        Geom::Box {
            center,
            half_size: (width, height),
            angle,
        } => Shape::Box {
            center: to_f32(center.get()),
            half_size: [width.get_f32(), height.get_f32()],
            angle: angle.map_or(0.0, |angle| single_angle(angle.get())),
        },
        Geom::Capsule { from, to, radius } => Shape::Capsule {
            from: to_f32(from.get()),
            to: to_f32(to.get()),
            radius: radius.get_f32(),
        },
        Geom::Convex(points) => Shape::Polygon(points.get()),
        Geom::Polyline(points) => Shape::Polyline(points.get()),
        // The line of an episode is drawn instead.
        Geom::Terrain(_) => Shape::Polyline(Vec::new()),
        Geom::HalfSpace { point, normal } => {
            let ([x, y], [right, up]) = (to_f32(point.get()), to_f32(normal.get()));
            let point_at = |[along, depth]: [f32; 2]| {
                [
                    x + along * up - depth * right,
                    y - along * right - depth * up,
                ]
            };
            Shape::Polyline(notched_line().map(point_at).collect())
        }
    }
}

/// Points of an infinite line, as (distance along it, depth behind it), m. A notch at each meter
/// shows which side is behind the line, and makes motion along it visible.
fn notched_line() -> impl Iterator<Item = [f32; 2]> {
    const NOTCH_DEPTH: f32 = 0.04;
    (-HALF_DRAWN_LENGTH..=HALF_DRAWN_LENGTH)
        .map(f32::from)
        .flat_map(|meter| [[meter, 0.0], [meter, NOTCH_DEPTH], [meter, 0.0]])
}

fn to_f32(vector: [f64; 2]) -> [f32; 2] {
    vector.map(|value| value as f32)
}

fn first_group() -> u32 {
    1
}
