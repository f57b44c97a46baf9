//! One copy of a task with contacts, in a Rapier world of its own.

use std::f32::consts::TAU;

use rapier2d::prelude::{
    BroadPhaseBvh, CCDSolver, IntegrationParameters, IslandManager, NarrowPhase, PhysicsPipeline,
    PhysicsWorld, Pose, RigidBody, Rotation, SharedShape, Vector,
};
use serde::{Deserialize, Serialize};

use super::super::body::MAX_TURN_PER_SUBSTEP;
use super::super::geometry::terrain_line;
use super::super::vector;
use super::bounce::FlatImpacts;
use super::build::WorldTemplate;
use super::link::{LinkState, Root};
use super::passage::Suspect;
use crate::dynamics::{CoordinateColumns, Passage};
use crate::kinematics::Frame;
use crate::{Force, ForceSource, caught_panic};

/// One copy of a task in its own Rapier world.
#[derive(Serialize, Deserialize)]
pub(super) struct World {
    simulation: PhysicsWorld,
    /// Lines of terrains: pairs of a collider and its shape, which replace those of the template when
    /// an episode starts; `None` if not all of its heights can be
    /// computed with.
    #[serde(skip)]
    terrains: Vec<(usize, Option<SharedShape>)>,
    /// How far free bodies have turned in the latest control step: `[free bodies]`.
    #[serde(skip)]
    turns: Vec<FreeTurn>,
    /// States of joints with soft ends before the latest step of Rapier: `[joints]`.
    #[serde(skip)]
    links_before: Vec<LinkState>,
    /// Whether the copy is live.
    pub(super) live: bool,
    /// The first surface that was passed in the latest step.
    #[serde(skip)]
    pub(super) passage: Option<Passage>,
    /// What may have passed a surface.
    #[serde(skip)]
    suspect: Option<Suspect>,
    /// Where surfaces were before a contact update; memory that is used again in each.
    #[serde(skip)]
    surfaces_before: Vec<(Pose, f32)>,
}

/// The rotation of a free body that is no link of a multibody.
#[derive(Clone, Copy, Debug, Default)]
struct FreeTurn {
    /// Angular velocity before the latest step of Rapier, rad/s.
    spin: f32,
    /// Angle turned since the start of the control step, rad.
    angle: f32,
}

impl FreeTurn {
    /// Rapier turns a body at ω by arctan(ω h) in a substep h, instead of ω h. The difference is added
    /// where it matters: see `turns`. Forces are constant during a step of Rapier, so that the
    /// angular velocity changes evenly, if no contact changes it.
    fn complete(&mut self, body: &mut RigidBody, parameters: &IntegrationParameters) {
        let substeps = parameters.num_solver_iterations as f32;
        let (first, last) = (self.spin, body.angvel());
        let fastest = first.abs().max(last.abs());
        let is_fast = fastest * (parameters.dt / substeps) > MAX_TURN_PER_SUBSTEP;
        let (mut turned, mut lacking) = (0.0, 0.0);
        for substep in 1..=parameters.num_solver_iterations {
            let spin = first + (last - first) * (substep as f32 / substeps);
            let turn = spin * (parameters.dt / substeps);
            turned += turn;
            if is_fast {
                lacking += turn - libm::atanf(turn);
            }
        }
        self.angle += turned;
        if is_fast {
            body.set_rotation(Rotation::new(lacking) * *body.rotation(), false);
        }
    }
}

impl World {
    pub(super) fn new(template: &WorldTemplate) -> Self {
        let mut world = PhysicsWorld::new();
        // Nobody reads the counters, and counting visits every contact.
        world.physics_pipeline.counters.disable();
        world.gravity = template.gravity;
        world.integration_parameters = template.parameters;
        world.bodies = template.bodies.clone();
        world.colliders = template.colliders.clone();
        world.multibody_joints = template.multibody_joints.clone();
        world.impulse_joints = template.impulse_joints.clone();
        Self {
            simulation: world,
            terrains: Vec::new(),
            turns: Vec::new(),
            links_before: Vec::new(),
            live: false,
            passage: None,
            suspect: None,
            surfaces_before: template.passage_watch.buffer(),
        }
    }

    /// Sets the line of a terrain for the episodes that start from now on.
    pub(super) fn set_terrain(&mut self, collider: usize, line: &[[f32; 2]]) {
        self.terrains.retain(|(other, _)| *other != collider);
        self.terrains.push((collider, terrain_line(line)));
    }

    /// Starts an episode with the same bits as a new world: everything that Rapier keeps between
    /// steps is replaced. Returns whether the numbers of the start are small enough to compute with;
    /// if not, the copy is not live.
    pub(super) fn start(
        &mut self,
        template: &WorldTemplate,
        frames: &[Frame],
        positions: &[f64],
        velocities: &[f64],
    ) -> bool {
        (self.passage, self.suspect) = (None, None);
        // Rapier's limits panic where numbers are not finite.
        let placed = caught_panic(|| self.place(template, frames, positions, velocities));
        self.live = placed.is_ok() && self.terrains.iter().all(|(_, shape)| shape.is_some());
        self.live
    }

    fn place(
        &mut self,
        template: &WorldTemplate,
        frames: &[Frame],
        positions: &[f64],
        velocities: &[f64],
    ) {
        self.simulation.bodies.clone_from(&template.bodies);
        self.simulation.colliders.clone_from(&template.colliders);
        for (collider, shape) in &self.terrains {
            let handle = template.collider_handles[*collider];
            if let (Some(shape), Some(collider)) =
                (shape, self.simulation.colliders.get_mut(handle))
            {
                collider.set_shape(shape.clone());
            }
        }
        self.simulation
            .multibody_joints
            .clone_from(&template.multibody_joints);
        self.simulation
            .impulse_joints
            .clone_from(&template.impulse_joints);
        self.simulation.islands = IslandManager::new();
        self.simulation.broad_phase = BroadPhaseBvh::new();
        self.simulation.narrow_phase = NarrowPhase::new();
        self.simulation.ccd_solver = CCDSolver::new();
        self.simulation.physics_pipeline = PhysicsPipeline::new();
        self.place_bodies(template, frames);
        template
            .links
            .iter()
            .zip(positions.iter().zip(velocities))
            .for_each(|(link, (&position, &velocity))| {
                link.place(
                    position as f32,
                    velocity as f32,
                    &mut self.simulation.multibody_joints,
                );
            });
        self.place_roots(template, frames);
        self.process_changes();
    }

    fn place_bodies(&mut self, template: &WorldTemplate, frames: &[Frame]) {
        for ((&handle, frame), &com) in template.handles.iter().zip(frames).zip(&template.coms) {
            let body = &mut self.simulation.bodies[handle];
            let rotation = Rotation::from_cos_sin_unchecked(
                frame.rotation[0] as f32,
                frame.rotation[1] as f32,
            );
            let center = frame.point(com);
            body.set_position(Pose::from_parts(vector(center), rotation), false);
            body.set_linvel(vector(frame.velocity_at(center)), false);
            body.set_angvel(frame.angular_velocity as f32, false);
        }
    }

    /// Places the roots of multibodies, and the bodies that hang on them.
    fn place_roots(&mut self, template: &WorldTemplate, frames: &[Frame]) {
        for root in template.roots.iter().filter(|root| root.is_linked) {
            let (frame, com) = (&frames[root.body], template.coms[root.body]);
            Root::place(
                frame,
                com,
                template.handles[root.body],
                &mut self.simulation.multibody_joints,
            );
        }
        let world = &mut self.simulation;
        for &index in &template.multibodies {
            let Some(multibody) = world.multibody_joints.get_multibody_mut(index) else {
                continue;
            };
            multibody.forward_kinematics(&world.bodies, false);
            multibody.update_rigid_bodies(&mut world.bodies, true);
        }
    }

    /// Lets Rapier process new bodies without time passing.
    fn process_changes(&mut self) {
        let duration = std::mem::take(&mut self.simulation.integration_parameters.dt);
        self.simulation.step();
        self.simulation.integration_parameters.dt = duration;
    }

    /// Advances the world by one control step. `controls`: `[(actuators + formula
    /// forces) × copies]`. Returns whether numbers were small enough to compute with; if not, the copy
    /// is not live any more.
    pub(super) fn step(
        &mut self,
        template: &WorldTemplate,
        copy: usize,
        controls: &[f32],
        copies: usize,
    ) -> bool {
        self.turns.clear();
        self.turns.resize(template.roots.len(), FreeTurn::default());
        let watch = &template.passage_watch;
        let earlier = self.suspect.is_some();
        // A restored world has none.
        self.surfaces_before
            .resize(template.collider_handles.len(), (Pose::IDENTITY, 0.0));
        self.links_before
            .resize(template.links.len(), LinkState::default());
        for _ in 0..template.steps {
            self.apply_controls(template, copy, controls, copies);
            self.begin_turns(template);
            self.begin_links(template);
            watch.begin(&self.simulation.bodies, &mut self.surfaces_before);
            // Rapier's limits of motors panic where coordinates are not finite.
            if caught_panic(|| self.simulation.step_with_events(&FlatImpacts, &())).is_err() {
                self.live = false;
                return false;
            }
            self.complete_turns(template);
            let PhysicsWorld {
                bodies, colliders, ..
            } = &self.simulation;
            let before = &mut self.surfaces_before;
            if self.suspect.is_none() {
                self.suspect = watch.find(bodies, colliders, before);
            }
        }
        let PhysicsWorld {
            bodies, colliders, ..
        } = &self.simulation;
        self.passage = if earlier {
            watch.confirm(&mut self.suspect, bodies, colliders)
        } else {
            None
        };
        true
    }

    fn begin_turns(&mut self, template: &WorldTemplate) {
        for (root, turn) in template.roots.iter().zip(&mut self.turns) {
            turn.spin = self.simulation.bodies[template.handles[root.body]].angvel();
        }
    }

    fn begin_links(&mut self, template: &WorldTemplate) {
        let joints = &self.simulation.multibody_joints;
        for (link, state) in template.links.iter().zip(&mut self.links_before) {
            if link.has_soft_end() {
                *state = link.state(joints);
            }
        }
    }

    /// Adds what Rapier has left out of the rotations of free bodies in its latest step. The others
    /// are links of multibodies, whose angles are exact.
    fn complete_turns(&mut self, template: &WorldTemplate) {
        for (root, turn) in template.roots.iter().zip(&mut self.turns) {
            if !root.is_linked {
                let body = &mut self.simulation.bodies[template.handles[root.body]];
                turn.complete(body, &self.simulation.integration_parameters);
            }
        }
    }

    /// Sets the forces and servo targets.
    fn apply_controls(
        &mut self,
        template: &WorldTemplate,
        copy: usize,
        controls: &[f32],
        copies: usize,
    ) {
        for &handle in &template.handles {
            let body = &mut self.simulation.bodies[handle];
            body.reset_forces(false);
            body.reset_torques(false);
        }
        for (index, input) in template.control_inputs.iter().enumerate() {
            let control = controls[index * copies + copy];
            input.apply(
                control,
                &template.links,
                &mut self.simulation.bodies,
                &mut self.simulation.multibody_joints,
            );
        }
        for rope in &template.ropes {
            rope.turn(&self.simulation.bodies, &mut self.simulation.impulse_joints);
        }
        for fluid_body in &template.fluid_bodies {
            fluid_body.resist(&mut self.simulation.bodies[template.handles[fluid_body.body]]);
        }
    }

    /// Writes the coordinates into their columns. The angle of a free body counts the full turns
    /// that bring it nearest to where its rate has turned it.
    pub(super) fn read(
        &self,
        template: &WorldTemplate,
        copy: usize,
        columns: &mut CoordinateColumns,
    ) {
        let joints = &self.simulation.multibody_joints;
        for (index, link) in template.links.iter().enumerate() {
            let (position, velocity) =
                link.read(self.links_before[index], &template.parameters, joints);
            columns.set(index, copy, position, velocity);
        }
        for (index, root) in template.roots.iter().enumerate() {
            let first_coordinate = template.links.len() + 3 * index;
            let (before, _) = columns.get(first_coordinate + 2, copy);
            let body = &self.simulation.bodies[template.handles[root.body]];
            let state = root.frame_state(
                body,
                template.handles[root.body],
                &self.simulation.multibody_joints,
            );
            let expected = state.coordinate.unwrap_or(before + self.turned(index));
            let angle = state.angle + TAU * ((expected - state.angle) / TAU).round();
            columns.set(first_coordinate, copy, state.position.x, state.velocity.x);
            columns.set(
                first_coordinate + 1,
                copy,
                state.position.y,
                state.velocity.y,
            );
            columns.set(first_coordinate + 2, copy, angle, state.spin);
        }
    }

    /// The angle by which a free body has turned in the latest control step, rad; 0 before the first.
    fn turned(&self, root: usize) -> f32 {
        self.turns.get(root).map_or(0.0, |turn| turn.angle)
    }

    /// Appends the contact forces of the latest step: those on the body that touches the world, or
    /// on the second of two bodies.
    pub(super) fn contact_forces(&self, forces: &mut Vec<Force>) {
        let dt = self.simulation.integration_parameters.dt;
        for pair in self.simulation.narrow_phase.contact_pairs() {
            let pose = self.simulation.colliders[pair.collider1].position();
            for manifold in pair.solver_manifolds() {
                let normal = manifold.data.normal;
                let sign = if manifold.data.rigid_body2.is_some() {
                    1.0
                } else {
                    -1.0
                };
                for point in manifold
                    .points
                    .iter()
                    .filter(|point| point.data.impulse > 0.0)
                {
                    let tangent = Vector::new(-normal.y, normal.x) * point.data.tangent_impulse.x;
                    let force = (normal * point.data.impulse + tangent) * (sign / dt);
                    let at = *pose * point.local_p1;
                    forces.push(Force {
                        source: ForceSource::Contact,
                        at: at.to_array(),
                        newtons: force.to_array(),
                    });
                }
            }
        }
    }

    /// The normal force between two colliders in the latest step, N.
    pub(super) fn contact_force(&self, template: &WorldTemplate, one: usize, other: usize) -> f32 {
        let [one, other] = [one, other].map(|index| template.collider_handles[index]);
        let Some(pair) = self.simulation.narrow_phase.contact_pair(one, other) else {
            return 0.0;
        };
        let manifolds = pair.solver_manifolds().iter();
        let points = manifolds.flat_map(|manifold| &manifold.points);
        let impulse: f32 = points.map(|point| point.data.impulse).sum();
        impulse / self.simulation.integration_parameters.dt
    }

    /// Whether both have the same bodies and joints.
    pub(super) fn same_shape(&self, other: &Self) -> bool {
        self.simulation.bodies.len() == other.simulation.bodies.len()
            && self.simulation.colliders.len() == other.simulation.colliders.len()
    }
}
