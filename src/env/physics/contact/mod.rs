//! Tasks with contacts: one Rapier world a copy.
//!
//! Copies must not meet, and a world in which nothing lives costs nothing. Trees of bodies are held by Rapier's multibody joints,
//! whose coordinates are exact where impulse joints would yield to contacts. In Rapier a body's origin is its centre of mass, as
//! floating multibodies need it; everything that is given in a body's own frame is shifted where it enters.

mod build;
mod link;
mod world;

use self::build::Pristine;
use self::world::World;
use crate::env::description::Description;
use crate::env::dynamics::{Dynamics, JointColumns, from_bytes, to_bytes};
use crate::env::kinematics::{Frame, Tree};
use crate::env::{Force, Pose};

/// M copies of a task with contacts.
pub struct ContactWorlds {
    pristine: Pristine,
    worlds: Vec<World>,
    tree: Tree,
    frames: Vec<Frame>,
    columns: JointColumns,
}

impl ContactWorlds {
    /// Builds `copies` copies of a task, none of them live.
    #[must_use]
    pub fn new(description: &Description, copies: usize) -> Self {
        let tree = Tree::new(description);
        let pristine = Pristine::new(description, &tree);
        Self {
            worlds: (0..copies).map(|_| World::new(&pristine)).collect(),
            pristine,
            frames: tree.frames(),
            tree,
            columns: JointColumns::new(description.coordinates(), copies),
        }
    }
}

impl Dynamics for ContactWorlds {
    fn start(&mut self, copy: usize, positions: &[f64], velocities: &[f64]) {
        self.tree.place(positions, velocities, &mut self.frames);
        for (coordinate, (&position, &velocity)) in positions.iter().zip(velocities).enumerate() {
            self.columns
                .set(coordinate, copy, position as f32, velocity as f32);
        }
        self.worlds[copy].start(&self.pristine, &self.frames, positions, velocities);
    }

    fn stop(&mut self, copy: usize) {
        self.worlds[copy].live = false;
    }

    fn step(&mut self, controls: &[f32]) {
        for (copy, world) in self.worlds.iter_mut().enumerate() {
            if world.live {
                world.step(&self.pristine, copy, controls, self.columns.copies());
                world.read(&self.pristine, copy, &mut self.columns);
            }
        }
    }

    fn joints(&self) -> &JointColumns {
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

    fn contacts(&self, copy: usize, forces: &mut Vec<Force>) {
        self.worlds[copy].contacts(forces);
    }

    fn save(&self) -> Vec<u8> {
        to_bytes(&(&self.columns, &self.worlds))
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), String> {
        let (columns, worlds): (JointColumns, Vec<World>) = from_bytes(bytes)?;
        let fits = columns.same_shape(&self.columns) && worlds.len() == self.worlds.len();
        if !fits
            || !worlds
                .iter()
                .zip(&self.worlds)
                .all(|(new, old)| new.same_shape(old))
        {
            return Err("the state is of other bodies or another number of copies".to_owned());
        }
        (self.columns, self.worlds) = (columns, worlds);
        Ok(())
    }
}
