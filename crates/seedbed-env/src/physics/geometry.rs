//! Which colliders touch, and where a ray meets one: Parry's queries over a task's surfaces, given
//! only where the bodies are.

use parry2d::math::{Pose, Vector};
use parry2d::query::{self, Ray};
use parry2d::shape::{HalfSpace, Polyline, PolylineFlags, SharedShape};

use super::vector;
use crate::Shape;
use crate::description::{self, BodyTask, Surface};
use crate::kinematics::Frame;

/// Maximum distance of surfaces that count as touching, m. The solver lets resting surfaces sink
/// into each other by as much.
pub(super) const TOLERANCE: f32 = 1e-3;

/// The surfaces of a task.
pub struct Geometry {
    surfaces: Vec<PlacedShape>,
    /// Lines of the terrains of each copy: `[copies]`, pairs of a collider and its shape.
    terrains: Vec<Vec<(usize, SharedShape)>>,
}

/// A shape of Parry in its body's frame.
pub(super) struct PlacedShape {
    pub(super) body: Option<usize>,
    /// Bits of the collision groups that the surface belongs to.
    contype: u32,
    pub(super) shape: SharedShape,
    pub(super) pose: Pose,
}

impl Geometry {
    /// The surfaces of all colliders, for `copies` copies of the task.
    #[must_use]
    pub fn new(task: &BodyTask, copies: usize) -> Self {
        Self {
            surfaces: task.colliders.iter().map(PlacedShape::new).collect(),
            terrains: vec![Vec::new(); copies],
        }
    }

    /// Sets the line of a collider of `copy` that is a terrain.
    pub fn set_terrain(&mut self, copy: usize, collider: usize, line: &[[f32; 2]]) {
        let terrains = &mut self.terrains[copy];
        terrains.retain(|(other, _)| *other != collider);
        // Without a line, the copy is not live.
        terrains.extend(terrain_line(line).map(|line| (collider, line)));
    }

    /// The shape of a collider of `copy`.
    fn shape(&self, copy: usize, collider: usize) -> &SharedShape {
        let mut terrains = self.terrains[copy].iter();
        match terrains.find(|(other, _)| *other == collider) {
            Some((_, line)) => line,
            None => &self.surfaces[collider].shape,
        }
    }

    /// Whether two colliders of `copy` touch, given where the bodies are. `frames`: `[bodies]`
    #[must_use]
    pub fn touch(&self, copy: usize, [one, other]: [usize; 2], frames: &[Frame]) -> bool {
        // `query::contact` is wrong if the second shape is a half-space.
        let distance = query::distance(
            &self.surfaces[one].pose_in(frames),
            &**self.shape(copy, one),
            &self.surfaces[other].pose_in(frames),
            &**self.shape(copy, other),
        );
        distance.is_ok_and(|distance| distance.distance <= TOLERANCE)
    }

    /// Distance along a ray, m, to the first surface of the world or of another body than the ray's
    /// own that is in one of its groups; the ray's length if there is none.
    /// `frames`: `[bodies]`
    #[must_use]
    pub fn ray_distance(&self, copy: usize, ray: &description::Ray, frames: &[Frame]) -> f32 {
        let frame = &frames[ray.body];
        let direction = if ray.is_local {
            frame.vector(ray.direction)
        } else {
            ray.direction
        };
        let beam = Ray::new(vector(frame.point(ray.from)), vector(direction));
        let surfaces = self.surfaces.iter().enumerate();
        let others = surfaces.filter(|(_, surface)| {
            surface.body != Some(ray.body) && surface.contype & ray.conaffinity != 0
        });
        others.fold(ray.length as f32, |nearest, (index, surface)| {
            self.shape(copy, index)
                .cast_ray(&surface.pose_in(frames), &beam, nearest, true)
                .unwrap_or(nearest)
        })
    }
}

/// Makes the shape of a collider as worlds do. It panics if Parry cannot.
pub(crate) fn check_surface(collider: &description::Collider) {
    let PlacedShape { shape, pose, .. } = PlacedShape::new(collider);
    // A half-space is infinite.
    let bounds = shape.compute_aabb(&pose);
    let is_finite = bounds.mins.is_finite() && bounds.maxs.is_finite();
    assert!(
        is_finite || shape.as_halfspace().is_some(),
        "it has no finite extent"
    );
}

impl PlacedShape {
    pub(super) fn new(collider: &description::Collider) -> Self {
        let (shape, pose) = shape(&collider.surface);
        Self {
            body: collider.body,
            contype: collider.contype,
            shape,
            pose,
        }
    }

    fn pose_in(&self, frames: &[Frame]) -> Pose {
        match self.body {
            None => self.pose,
            Some(body) => pose_of(&frames[body]) * self.pose,
        }
    }
}

/// A surface as a shape of Parry, and the pose of the shape in the body's frame.
fn shape(surface: &Surface) -> (SharedShape, Pose) {
    let pose_at = |center: [f32; 2], angle| Pose::new(Vector::from_array(center), angle);
    match surface {
        Surface::HalfSpace { point, normal } => (
            SharedShape::new(HalfSpace::new(Vector::from_array(*normal))),
            pose_at(*point, 0.0),
        ),
        Surface::Shape(Shape::Ball { center, radius }) => {
            (SharedShape::ball(*radius), pose_at(*center, 0.0))
        }
        Surface::Shape(Shape::Box {
            center,
            half_size: [width, height],
            angle,
        }) => (
            SharedShape::cuboid(*width, *height),
            pose_at(*center, *angle),
        ),
        Surface::Shape(Shape::Capsule { from, to, radius }) => (
            SharedShape::capsule(Vector::from_array(*from), Vector::from_array(*to), *radius),
            Pose::IDENTITY,
        ),
        Surface::Shape(Shape::Polygon(corners)) => (convex_hull(corners), Pose::IDENTITY),
        Surface::Shape(Shape::Polyline(line)) => (oriented_line(line), Pose::IDENTITY),
        Surface::Terrain(terrain) => {
            let flat = terrain.line((0..terrain.points).map(|_| 0.0));
            (oriented_line(&flat), Pose::IDENTITY)
        }
    }
}

/// An open line that can be touched from its right-hand side.
fn oriented_line(points: &[[f32; 2]]) -> SharedShape {
    SharedShape::new(Polyline::with_flags(
        vectors(points),
        None,
        PolylineFlags::ORIENTED,
    ))
}

/// Maximum of the coordinates of a terrain's points, m.
const FARTHEST: f32 = 1e6;

/// The line of a terrain; `None` if some of its points cannot be computed with.
pub(super) fn terrain_line(points: &[[f32; 2]]) -> Option<SharedShape> {
    let is_near = points.iter().flatten().all(|along| along.abs() <= FARTHEST);
    is_near.then(|| oriented_line(points))
}

/// The convex hull of some points that [`has_area`](super::shape::has_area).
pub(super) fn convex_hull(points: &[[f32; 2]]) -> SharedShape {
    SharedShape::convex_hull(&vectors(points)).expect("convex colliders have an area")
}

fn vectors(points: &[[f32; 2]]) -> Vec<Vector> {
    points.iter().copied().map(Vector::from_array).collect()
}

fn pose_of(frame: &Frame) -> Pose {
    let [cosine, sine] = frame.rotation;
    let rotation = parry2d::math::Rotation::from_cos_sin_unchecked(cosine as f32, sine as f32);
    Pose::from_parts(vector(frame.position), rotation)
}
