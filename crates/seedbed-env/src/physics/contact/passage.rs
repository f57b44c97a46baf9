//! Notices bodies that pass surfaces between two contact updates.
//!
//! Rapier searches for contacts once per contact update. A body that moves farther than its own depth
//! in between may be on the other side of a surface without having touched it. The paths of some
//! points inside each collider are compared with all surfaces that it could touch.

use parry2d::query::{Ray, RayCast};
use rapier2d::prelude::{
    Collider, ColliderHandle, ColliderSet, Pose, RigidBodyHandle, RigidBodySet, Vector,
};

use crate::Shape;
use crate::description::{self, BodyTask, Surface};
use crate::dynamics::Passage;

/// A core that has entered an obstacle or crossed its line. It counts as a passage if it is found behind
/// it in a later step: contacts may push it back, and a crash may end the episode.
#[derive(Clone, Copy)]
pub(super) struct Suspect {
    pair: Pair,
    /// The mover's pose before, in the obstacle's frame.
    before: Pose,
    moved: f32,
    /// Number of control steps since.
    steps: u32,
}

/// Which surfaces could pass which.
pub(super) struct PassageWatch {
    /// `[colliders]`
    surfaces: Vec<WatchedSurface>,
    pairs: Vec<Pair>,
}

struct WatchedSurface {
    collider: ColliderHandle,
    /// Its body's handle, and its pose in the body's frame; `None` of the body if it is fixed.
    body: Option<RigidBodyHandle>,
    pose: Pose,
    /// Points inside the shape, in the shape's frame, its center first.
    core: Vec<Vector>,
    /// Distance of the core from the surface, m: a core that moves less than that has touched a surface
    /// before it passes it.
    depth: f32,
    /// Distance of the farthest point of the core from the origin of the shape's frame, m.
    reach: f32,
}

/// A collider with a core, and a surface that it must not pass.
#[derive(Clone, Copy)]
struct Pair {
    mover: usize,
    obstacle: usize,
}

impl PassageWatch {
    /// `colliders`, `poses`: of the shapes in their bodies' frames, whose origins are the centers of mass.
    pub(super) fn new(
        task: &BodyTask,
        handles: &[RigidBodyHandle],
        colliders: &[ColliderHandle],
        poses: impl Iterator<Item = Pose>,
    ) -> Self {
        let colliders = task.colliders.iter().zip(colliders).zip(poses);
        let surfaces = colliders.map(|((described, &collider), pose)| {
            let (core, depth) = core_of(&described.surface);
            WatchedSurface {
                collider,
                body: described.body.map(|body| handles[body]),
                pose,
                reach: core.iter().map(|point| point.length()).fold(0.0, f32::max),
                core,
                depth,
            }
        });
        let surfaces: Vec<_> = surfaces.collect();
        let all = 0..surfaces.len();
        let pairs = all.clone().flat_map(|mover| {
            let obstacles = all.clone();
            obstacles.map(move |obstacle| Pair { mover, obstacle })
        });
        let pairs = pairs.filter(|pair| is_watched(*pair, task)).collect();
        Self { surfaces, pairs }
    }

    /// A buffer for [`poses`](Self::poses): where every surface is, and how far it has moved.
    pub(super) fn buffer(&self) -> Vec<(Pose, f32)> {
        vec![(Pose::IDENTITY, 0.0); self.surfaces.len()]
    }

    /// Stores where the surfaces are before a contact update.
    pub(super) fn begin(&self, bodies: &RigidBodySet, buffer: &mut [(Pose, f32)]) {
        if self.pairs.is_empty() {
            return;
        }
        for (surface, (pose, _)) in self.surfaces.iter().zip(buffer) {
            *pose = surface.pose_in(bodies);
        }
    }

    /// The first surface that may have been passed since [`begin`](Self::begin).
    pub(super) fn find(
        &self,
        bodies: &RigidBodySet,
        colliders: &ColliderSet,
        buffer: &mut [(Pose, f32)],
    ) -> Option<Suspect> {
        if self.pairs.is_empty() {
            return None;
        }
        for (surface, (before, moved)) in self.surfaces.iter().zip(&mut *buffer) {
            *moved = surface.distance(before, &surface.pose_in(bodies));
        }
        let suspects = self.pairs.iter().filter(|pair| {
            let moved = buffer[pair.mover].1 + buffer[pair.obstacle].1;
            moved > self.surfaces[pair.mover].depth
        });
        let mut entered = suspects.filter_map(|pair| {
            let obstacle = &colliders[self.surfaces[pair.obstacle].collider];
            let before = self.before_entering(*pair, obstacle, bodies, buffer)?;
            Some(Suspect {
                pair: *pair,
                before,
                moved: buffer[pair.mover].1 + buffer[pair.obstacle].1,
                steps: 0,
            })
        });
        entered.next()
    }

    /// Looks at a suspect again in a later control step: the passage if the center of its core is behind
    /// the obstacle, or in a half-space, which has no other side. The suspect is removed unless a part of it
    /// is still inside or behind.
    pub(super) fn confirm(
        &self,
        suspect: &mut Option<Suspect>,
        bodies: &RigidBodySet,
        colliders: &ColliderSet,
    ) -> Option<Passage> {
        let found = suspect.as_mut()?;
        found.steps += 1;
        let Pair { mover, obstacle } = found.pair;
        let [moving, other] = [mover, obstacle].map(|index| &self.surfaces[index]);
        let collider = &colliders[other.collider];
        let relative = other.pose_in(bodies).inverse() * moving.pose_in(bodies);
        let is_line = collider.shape().as_polyline().is_some();
        let is_half_space = collider.shape().as_halfspace().is_some();
        let is_behind = |point: Vector| {
            let end = relative * point;
            // Parry's lines contain what is behind them.
            let is_inside = !is_line && collider.shape().contains_local_point(end);
            is_inside == is_half_space && crosses(found.before * point, end, collider)
        };
        let touches = |point: &Vector| {
            is_behind(*point)
                || (!is_line && collider.shape().contains_local_point(relative * *point))
        };
        let passage = Passage {
            mover,
            obstacle,
            moved: found.moved,
            steps: found.steps,
        };
        let has_passed = is_behind(moving.core[0]);
        if has_passed || !moving.core.iter().any(touches) {
            *suspect = None;
        }
        has_passed.then_some(passage)
    }

    /// The mover's pose before, in the obstacle's frame, if a point of its core has entered the obstacle or
    /// crossed its line.
    fn before_entering(
        &self,
        pair: Pair,
        obstacle: &Collider,
        bodies: &RigidBodySet,
        buffer: &[(Pose, f32)],
    ) -> Option<Pose> {
        let [mover, other] = [pair.mover, pair.obstacle].map(|index| &self.surfaces[index]);
        let relative = |mover: Pose, obstacle: Pose| obstacle.inverse() * mover;
        let before = relative(buffer[pair.mover].0, buffer[pair.obstacle].0);
        let after = relative(mover.pose_in(bodies), other.pose_in(bodies));
        let mut core = mover.core.iter();
        core.any(|point| crosses(before * *point, after * *point, obstacle))
            .then_some(before)
    }
}

impl WatchedSurface {
    fn pose_in(&self, bodies: &RigidBodySet) -> Pose {
        match self.body {
            Some(body) => *bodies[body].position() * self.pose,
            None => self.pose,
        }
    }

    /// An upper limit of the distance that a point of the core has moved, m.
    fn distance(&self, before: &Pose, after: &Pose) -> f32 {
        if self.body.is_none() {
            return 0.0;
        }
        let turned = (after.rotation.re - before.rotation.re).abs()
            + (after.rotation.im - before.rotation.im).abs();
        (after.translation - before.translation).length() + turned * self.reach
    }
}

/// Whether a path enters a shape from outside, or crosses a line from its right-hand side.
fn crosses(start: Vector, end: Vector, obstacle: &Collider) -> bool {
    let shape = obstacle.shape();
    let ray = Ray::new(start, end - start);
    if let Some(line) = shape.as_polyline() {
        let hit = line.cast_local_ray_and_get_normal(&ray, 1.0, true);
        return hit.is_some_and(|hit| {
            let segment = line.segment(hit.subshape);
            let along = segment.b - segment.a;
            // Whoever comes from the right-hand side of (x, y) moves along (−y, x).
            ray.dir.y * along.x - ray.dir.x * along.y > 0.0
        });
    }
    !shape.contains_local_point(start) && shape.intersects_local_ray(&ray, 1.0)
}

/// Half of the thickness of a surface, m; infinite of what has none.
pub(crate) fn depth(surface: &Surface) -> f32 {
    match surface {
        Surface::Shape(Shape::Box {
            half_size: [x, y], ..
        }) => x.min(*y),
        _ => core_of(surface).1,
    }
}

/// Points inside a shape, its center first, in Parry's frame of the shape, and their distance from its
/// surface. Lines and half-spaces have none.
fn core_of(surface: &Surface) -> (Vec<Vector>, f32) {
    match surface {
        Surface::Shape(Shape::Ball { radius, .. }) => (vec![Vector::ZERO], *radius),
        Surface::Shape(Shape::Capsule { from, to, radius }) => {
            let [from, to] = [from, to].map(|end| Vector::from_array(*end));
            (vec![(from + to) / 2.0, from, to], *radius)
        }
        Surface::Shape(Shape::Box {
            half_size: [x, y], ..
        }) => {
            let corner = |right: f32, up: f32| Vector::new(right * x, up * y) / 2.0;
            let corners = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)];
            let corners = corners.map(|(right, up)| corner(right, up));
            let core = [Vector::ZERO].into_iter().chain(corners).collect();
            (core, x.min(*y) / 2.0)
        }
        Surface::Shape(Shape::Polygon(corners)) => core_of_polygon(corners),
        Surface::Shape(Shape::Polyline(_)) | Surface::HalfSpace { .. } | Surface::Terrain(_) => {
            (Vec::new(), f32::MAX)
        }
    }
}

/// The mean of the corners, and the corners half way to it.
fn core_of_polygon(corners: &[[f32; 2]]) -> (Vec<Vector>, f32) {
    let hull = super::super::geometry::convex_hull(corners);
    let corners: Vec<_> = corners.iter().copied().map(Vector::from_array).collect();
    let center = corners.iter().sum::<Vector>() / corners.len() as f32;
    let half_way = corners.iter().map(|corner| (*corner + center) / 2.0);
    let core: Vec<_> = [center].into_iter().chain(half_way).collect();
    let depths = core
        .iter()
        .map(|&point| hull.distance_to_local_point(point, false));
    // Distances of points inside are negative.
    let depth = depths.map(|distance| -distance).fold(f32::MAX, f32::min);
    (core, depth.max(0.0))
}

/// Whether a collider of a body and a surface, which can touch, are watched.
fn is_watched(Pair { mover, obstacle }: Pair, task: &BodyTask) -> bool {
    let [one, other] = [mover, obstacle].map(|index| &task.colliders[index]);
    let touches = |one: &description::Collider, other: &description::Collider| {
        one.contype & other.conaffinity != 0
    };
    let has_core = !core_of(&one.surface).0.is_empty();
    has_core
        && one.body.is_some()
        && one.body != other.body
        && (touches(one, other) || touches(other, one))
        && !are_joined(one.body, other.body, task)
}

fn are_joined(one: Option<usize>, other: Option<usize>, task: &BodyTask) -> bool {
    let (Some(one), Some(other)) = (one, other) else {
        return false;
    };
    task.joints.iter().any(|joint| {
        let joined = joint.parent.map(|parent| [parent, joint.child]);
        joined == Some([one, other]) || joined == Some([other, one])
    })
}
