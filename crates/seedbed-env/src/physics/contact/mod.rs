//! Tasks with contacts: one Rapier world per copy.
//!
//! Each copy has a world of its own, so that copies cannot touch each other and a copy that has
//! ended costs nothing. Joints are Rapier's multibody joints, whose coordinates stay exact where
//! impulse joints would yield to contacts. In Rapier, the origin of a body is its center of mass,
//! as floating multibodies need it: everything given in a body's own frame is shifted accordingly.

mod bounce;
mod build;
mod control;
mod fluid;
mod joint_group;
mod link;
mod passage;
mod rope;
mod world;

use self::build::WorldTemplate;
pub(crate) use self::passage::depth;
use self::world::World;
use crate::description::BodyTask;
use crate::dynamics::{CoordinateColumns, Dynamics, OTHER_BODIES, Passage, from_bytes, to_bytes};
use crate::kinematics::{Frame, KinematicTree};
use crate::{Force, Pose};

/// M copies of a task with contacts.
pub struct ContactWorlds {
    template: WorldTemplate,
    worlds: Vec<World>,
    tree: KinematicTree,
    frames: Vec<Frame>,
    columns: CoordinateColumns,
}

impl ContactWorlds {
    /// Builds `copies` copies of a task, none of them live.
    #[must_use]
    pub fn new(task: &BodyTask, copies: usize) -> Self {
        let tree = KinematicTree::new(task);
        let template = WorldTemplate::new(task);
        Self {
            worlds: (0..copies).map(|_| World::new(&template)).collect(),
            template,
            frames: tree.frame_buffer(),
            tree,
            columns: CoordinateColumns::new(task.coordinate_count(), copies),
        }
    }
}

impl Dynamics for ContactWorlds {
    fn start(&mut self, copy: usize, positions: &[f64], velocities: &[f64]) {
        self.tree
            .compute_frames(positions, velocities, &mut self.frames);
        for (coordinate, (&position, &velocity)) in positions.iter().zip(velocities).enumerate() {
            self.columns
                .set(coordinate, copy, position as f32, velocity as f32);
        }
        if !self.worlds[copy].start(&self.template, &self.frames, positions, velocities) {
            self.columns.set_not_finite(copy);
        }
    }

    fn set_terrain(&mut self, copy: usize, collider: usize, line: &[[f32; 2]]) {
        self.worlds[copy].set_terrain(collider, line);
    }

    fn stop(&mut self, copy: usize) {
        self.worlds[copy].live = false;
    }

    fn step(&mut self, controls: &[f32]) {
        for (copy, world) in self.worlds.iter_mut().enumerate() {
            if world.live {
                if world.step(&self.template, copy, controls, self.columns.copies()) {
                    world.read(&self.template, copy, &mut self.columns);
                } else {
                    self.columns.set_not_finite(copy);
                }
            }
        }
    }

    fn coordinates(&self) -> &CoordinateColumns {
        &self.columns
    }

    fn poses(&self, copy: usize, poses: &mut [Pose]) {
        for (pose, frame) in poses
            .iter_mut()
            .zip(&self.tree.frames_of(&self.columns, copy))
        {
            *pose = Pose::from(frame);
        }
    }

    fn contact_forces(&self, copy: usize, forces: &mut Vec<Force>) {
        self.worlds[copy].contact_forces(forces);
    }

    fn contact_force(&self, copy: usize, one: usize, other: usize) -> f32 {
        self.worlds[copy].contact_force(&self.template, one, other)
    }

    fn passage(&self, copy: usize) -> Option<Passage> {
        self.worlds[copy].passage
    }

    fn has_passages(&self) -> bool {
        self.worlds.iter().any(|world| world.passage.is_some())
    }

    fn save(&self, copy: usize) -> Vec<u8> {
        to_bytes(&(self.columns.row(copy), &self.worlds[copy]))
    }

    fn restore(&mut self, copy: usize, bytes: &[u8]) -> Result<(), String> {
        let (row, world): (Vec<(f32, f32)>, World) = from_bytes(bytes)?;
        if !world.same_shape(&self.worlds[copy]) {
            return Err(OTHER_BODIES.to_owned());
        }
        self.columns.set_row(copy, &row)?;
        self.worlds[copy] = world;
        Ok(())
    }
}
