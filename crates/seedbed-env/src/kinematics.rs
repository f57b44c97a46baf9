//! Forward kinematics: where the bodies of a joint tree are, given its joint coordinates.
//!
//! Rigid bodies are reset and analytic models are drawn with it. This module must not depend on
//! time, forces or masses.

use super::description::{BodyTask, Joint, JointKind};
use super::dynamics::CoordinateColumns;

/// The joints of a task as rigid transforms, parents before their children.
#[derive(Clone, Debug)]
pub struct KinematicTree {
    links: Vec<Link>,
    /// Indices of the free bodies. Their coordinates follow those of the joints, three per body.
    free_bodies: Vec<usize>,
    body_count: usize,
}

/// A joint as a transform between the frames of its parent and of its child. A further joint of the
/// same child starts from where the earlier ones put it: its parent is then the child itself.
#[derive(Clone, Copy, Debug)]
pub struct Link {
    /// Index of the parent body; `None` is the world.
    pub parent: Option<usize>,
    /// Index of the child body.
    pub child: usize,
    /// Position of the joint in its parent's frame, m.
    pub anchor_in_parent: [f64; 2],
    /// Position of the joint in its child's frame, m.
    pub anchor_in_child: [f64; 2],
    /// Angle of the child's frame in its parent's at coordinate 0, rad.
    pub angle: f64,
    /// How the child moves.
    pub motion: Motion,
}

/// How a joint's coordinate moves its child.
#[derive(Clone, Copy, Debug)]
pub enum Motion {
    /// Along this unit vector in the parent's frame.
    Slide([f64; 2]),
    /// Counter-clockwise (+1) or clockwise (−1).
    Hinge(f64),
    /// Not at all.
    Weld,
}

/// An angle as an `f32`; one of more than a full turn without full turns, which would take its digits.
#[must_use]
pub fn single_angle(angle: f64) -> f32 {
    if angle.abs() <= std::f64::consts::TAU {
        return angle as f32;
    }
    let (sine, cosine) = libm::sincos(angle);
    libm::atan2(sine, cosine) as f32
}

/// Position and velocity of a body's frame in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Origin, m.
    pub position: [f64; 2],
    /// Angle, counter-clockwise and counting full turns, rad.
    pub angle: f64,
    /// Cosine and sine of the angle.
    pub rotation: [f64; 2],
    /// Velocity of the origin, m/s.
    pub velocity: [f64; 2],
    /// Angular velocity, rad/s, counter-clockwise.
    pub angular_velocity: f64,
}

impl KinematicTree {
    /// The joints of a task.
    #[must_use]
    pub fn new(task: &BodyTask) -> Self {
        let links = task.joints.iter().enumerate().map(|(index, joint)| {
            if task.first_joint_of_child(index) == index {
                Link::alone(joint, task)
            } else {
                Link::new(Some(joint.child), joint, task)
            }
        });
        Self {
            links: links.collect(),
            free_bodies: task.free_bodies.clone(),
            body_count: task.bodies.len(),
        }
    }

    /// The joints, parents before their children.
    #[must_use]
    pub fn links(&self) -> &[Link] {
        &self.links
    }

    /// A buffer for [`compute_frames`](Self::compute_frames): one frame per body.
    #[must_use]
    pub fn frame_buffer(&self) -> Vec<Frame> {
        vec![Frame::WORLD; self.body_count]
    }

    /// The frames of the bodies of one copy: `[bodies]`.
    #[must_use]
    pub fn frames_of(&self, columns: &CoordinateColumns, copy: usize) -> Vec<Frame> {
        let coordinates = (0..self.links.len() + 3 * self.free_bodies.len())
            .map(|coordinate| columns.get(coordinate, copy));
        let (positions, velocities): (Vec<_>, Vec<_>) = coordinates
            .map(|(q, v)| (f64::from(q), f64::from(v)))
            .unzip();
        let mut frames = self.frame_buffer();
        self.compute_frames(&positions, &velocities, &mut frames);
        frames
    }

    /// Computes each body's frame from each coordinate's position and velocity. `positions`,
    /// `velocities`: `[coordinates]`; `frames`: `[bodies]`.
    pub fn compute_frames(&self, positions: &[f64], velocities: &[f64], frames: &mut [Frame]) {
        for (index, &body) in self.free_bodies.iter().enumerate() {
            let first = self.links.len() + 3 * index;
            let [x, y, angle] = std::array::from_fn(|axis| positions[first + axis]);
            let [right, up, spin] = std::array::from_fn(|axis| velocities[first + axis]);
            frames[body] = Frame {
                velocity: [right, up],
                angular_velocity: spin,
                ..Frame::at([x, y], angle)
            };
        }
        for ((link, &position), &velocity) in self.links.iter().zip(positions).zip(velocities) {
            let parent = link.parent.map_or(Frame::WORLD, |body| frames[body]);
            frames[link.child] = link.child_frame(&parent, position, velocity);
        }
    }
}

impl Link {
    /// A joint as if it were the only one of its child.
    pub(crate) fn alone(joint: &Joint, task: &BodyTask) -> Self {
        Self::new(joint.parent, joint, task)
    }

    fn new(parent_body: Option<usize>, joint: &Joint, task: &BodyTask) -> Self {
        let frame_at_zero_coordinates =
            |body: usize| Frame::at(task.bodies[body].position, task.bodies[body].angle);
        let parent = parent_body.map_or(Frame::WORLD, frame_at_zero_coordinates);
        let child = frame_at_zero_coordinates(joint.child);
        Self {
            parent: parent_body,
            child: joint.child,
            anchor_in_parent: parent.local_point(child.point(joint.anchor)),
            anchor_in_child: joint.anchor,
            angle: child.angle - parent.angle,
            motion: match joint.kind {
                JointKind::Slide { axis } => Motion::Slide(rotate(
                    inverse(parent.rotation),
                    rotate(child.rotation, axis),
                )),
                JointKind::Hinge { sign } => Motion::Hinge(sign),
                JointKind::Weld => Motion::Weld,
            },
        }
    }

    /// The child's frame. Its velocity is that of the parent at the same point plus that of the
    /// joint.
    fn child_frame(&self, parent: &Frame, position: f64, velocity: f64) -> Frame {
        let (offset, offset_rate, turn, turn_rate) = match self.motion {
            Motion::Slide(axis) => (scale(axis, position), scale(axis, velocity), 0.0, 0.0),
            Motion::Hinge(sign) => ([0.0; 2], [0.0; 2], sign * position, sign * velocity),
            Motion::Weld => ([0.0; 2], [0.0; 2], 0.0, 0.0),
        };
        let anchor = parent.point(add(self.anchor_in_parent, offset));
        let mut child = Frame::at([0.0; 2], parent.angle + self.angle + turn);
        let arm = rotate(child.rotation, self.anchor_in_child);
        child.position = subtract(anchor, arm);
        child.angular_velocity = parent.angular_velocity + turn_rate;
        let anchor_velocity = add(
            parent.velocity_at(anchor),
            rotate(parent.rotation, offset_rate),
        );
        child.velocity = subtract(anchor_velocity, cross(child.angular_velocity, arm));
        child
    }
}

impl Frame {
    /// The world's frame, at rest.
    pub const WORLD: Self = Self {
        position: [0.0; 2],
        angle: 0.0,
        rotation: [1.0, 0.0],
        velocity: [0.0; 2],
        angular_velocity: 0.0,
    };

    /// A frame at rest.
    #[must_use]
    pub fn at(position: [f64; 2], angle: f64) -> Self {
        let (sine, cosine) = libm::sincos(angle);
        Self {
            position,
            angle,
            rotation: [cosine, sine],
            ..Self::WORLD
        }
    }

    /// The position in the world of a point of this frame.
    #[must_use]
    pub fn point(&self, local: [f64; 2]) -> [f64; 2] {
        add(self.position, rotate(self.rotation, local))
    }

    /// The coordinates in this frame of a point of the world.
    #[must_use]
    pub fn local_point(&self, point: [f64; 2]) -> [f64; 2] {
        rotate(inverse(self.rotation), subtract(point, self.position))
    }

    /// The components in the world of a vector of this frame.
    #[must_use]
    pub fn vector(&self, local: [f64; 2]) -> [f64; 2] {
        rotate(self.rotation, local)
    }

    /// Velocity of the point that moves with this frame and is now at a point of the world, m/s.
    #[must_use]
    pub fn velocity_at(&self, point: [f64; 2]) -> [f64; 2] {
        add(
            self.velocity,
            cross(self.angular_velocity, subtract(point, self.position)),
        )
    }
}

fn add(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] + b[0], a[1] + b[1]]
}

fn subtract(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

fn scale(a: [f64; 2], factor: f64) -> [f64; 2] {
    [a[0] * factor, a[1] * factor]
}

/// Rotates `a` by the angle whose cosine and sine are `rotation`.
fn rotate(rotation: [f64; 2], a: [f64; 2]) -> [f64; 2] {
    [
        rotation[0] * a[0] - rotation[1] * a[1],
        rotation[1] * a[0] + rotation[0] * a[1],
    ]
}

fn inverse(rotation: [f64; 2]) -> [f64; 2] {
    [rotation[0], -rotation[1]]
}

/// ω × a in the plane.
fn cross(omega: f64, a: [f64; 2]) -> [f64; 2] {
    [-omega * a[1], omega * a[0]]
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};
    use std::path::Path;

    use approx::assert_abs_diff_eq;

    use super::*;
    use crate::load;

    fn task(file: &str) -> BodyTask {
        let repository = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        load(&repository.join(file))
            .unwrap()
            .body_task()
            .unwrap()
            .clone()
    }

    fn tree(file: &str) -> KinematicTree {
        KinematicTree::new(&task(file))
    }

    #[test]
    fn a_pole_leans_to_positive_x_and_moves_with_its_cart() {
        let tree = tree("envs/cartpole.ron");
        let mut frames = tree.frame_buffer();
        tree.compute_frames(&[0.3, FRAC_PI_2], &[2.0, 1.0], &mut frames);
        let [cart, pole] = frames[..] else {
            panic!("expected two bodies")
        };
        assert_eq!(
            (cart.position, cart.angle, cart.velocity),
            ([0.3, 0.0], 0.0, [2.0, 0.0])
        );
        assert_eq!(
            (pole.position, pole.angle, pole.angular_velocity),
            ([0.3, 0.0], -FRAC_PI_2, -1.0)
        );
        // The center of mass, 0.5 m from the hinge, lies level with it and falls at 0.5 m × 1
        // rad/s.
        let com = pole.point([0.0, 0.5]);
        let velocity = pole.velocity_at(com);
        assert_abs_diff_eq!(com[..], [0.8, 0.0][..], epsilon = 1e-15);
        assert_abs_diff_eq!(velocity[..], [2.0, -0.5][..], epsilon = 1e-15);
    }

    /// Velocities are time derivatives: they equal the difference quotient of positions a short
    /// time apart.
    #[test]
    fn velocities_are_the_rates_of_positions() {
        let tree = tree("crates/seedbed-env/tests/envs/crane.ron");
        let (positions, velocities) = ([0.2, 1.0, -2.0, 0.1], [1.0, -0.5, 2.0, 0.7]);
        let duration = 1e-6;
        let later: Vec<_> = positions
            .iter()
            .zip(velocities)
            .map(|(position, rate)| position + duration * rate)
            .collect();
        let (mut now, mut then) = (tree.frame_buffer(), tree.frame_buffer());
        tree.compute_frames(&positions, &velocities, &mut now);
        tree.compute_frames(&later, &velocities, &mut then);
        for (now, then) in now.iter().zip(&then) {
            let rate = scale(subtract(then.position, now.position), 1.0 / duration);
            assert_abs_diff_eq!(rate[..], now.velocity[..], epsilon = 1e-5);
            assert_abs_diff_eq!(
                (then.angle - now.angle) / duration,
                now.angular_velocity,
                epsilon = 1e-8
            );
        }
    }

    #[test]
    fn at_coordinate_zero_bodies_are_where_the_file_puts_them() {
        let task = task("crates/seedbed-env/tests/envs/crane.ron");
        let tree = KinematicTree::new(&task);
        let mut frames = tree.frame_buffer();
        tree.compute_frames(&[0.0; 4], &[0.0; 4], &mut frames);
        for (frame, body) in frames.iter().zip(&task.bodies) {
            assert_abs_diff_eq!(frame.position[..], body.position[..], epsilon = 1e-15);
            assert_abs_diff_eq!(frame.angle, body.angle, epsilon = 1e-15);
        }
        assert!(frames.iter().all(|frame| frame.angle.abs() < PI));
    }
}
