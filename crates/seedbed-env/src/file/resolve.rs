//! Resolves a task file: replaces names by indices, formulas by programs, and omitted fields by
//! their defaults.

use super::actuators::action;
use super::resolver::{MAX_MASS, Resolver, WORLD, formula, resolved};
use super::surfaces::shape;
use super::{AnalyticModel, Body, Fluid, Geom, HexColor, Observation, Softness};
use crate::description::{self, BodyTask, Formulas, Inertial};
use crate::expression::{Program, Type, compile};
use crate::{
    Quantity, Scene, SceneBody, SceneRope, SceneRopeEnd, Shape, TaskSpec, analytic, caught_panic,
    parameters, physics,
};
use seedbed_input::ValidationError;
use seedbed_input::numbers::{Count, FiniteNumber, Positive};

impl Resolver<'_> {
    /// Checks every reference of the file and turns it into a task.
    pub(super) fn task(&self, name: &str, origin: &str) -> Result<BodyTask, ValidationError> {
        let file = self.file;
        self.check_names()?;
        self.check_substeps()?;
        self.check_fluid_boxes()?;
        self.check_terrains()?;
        self.check_ccd()?;
        let colliders = self.colliders()?;
        let bodies = file
            .bodies
            .iter()
            .map(body)
            .collect::<Result<Vec<_>, _>>()?;
        let (joints, ropes) = (self.joints()?, self.ropes()?);
        let mut task = BodyTask {
            origin: origin.to_owned(),
            spec: self.spec(name),
            scene: self.scene(&bodies, &joints, &ropes)?,
            gravity: file.gravity.get(),
            solver: description::Solver {
                substeps: file.solver.substeps.get(),
                solver_iterations: file.solver.solver_iterations.map_or(1, Count::get),
                contact_updates: file.solver.contact_updates.get(),
            },
            bodies,
            joints,
            free_bodies: self.free_bodies(),
            colliders,
            contact_softness: file.contact_softness.map(Softness::resolve),
            ropes,
            fluid: file.fluid.map(Fluid::resolve),
            actuators: self.actuators()?,
            run_constants: self.run_constants(),
            episode_numbers: resolved(&file.drawn_per_episode),
            step_numbers: resolved(&file.drawn_per_step),
            sensors: self.sensors()?,
            formula_forces: self.formula_forces()?,
            display_offsets: self.display_offsets()?,
            markers: self.markers()?,
            formulas: self.formulas()?,
            reset: self.start_coordinates()?,
            redrawn_while: formula(&file.redrawn_while, Type::Boolean, &self.state_variables())?,
            analytic_model: self.analytic_model()?,
        };
        if file.solver.solver_iterations.is_none() {
            task.solver.solver_iterations = usual_passes(&task);
        }
        // Callers without a run, such as a check, see the task of run seed 0.
        let task = task.for_run(0);
        self.check_servos(&task)?;
        self.check_analytic_model(&task)?;
        Ok(task)
    }

    fn spec(&self, name: &str) -> TaskSpec {
        let file = self.file;
        TaskSpec {
            name: name.to_owned(),
            description: file.description.clone(),
            observations: file.observations.iter().map(quantity).collect(),
            actions: file.actuators.iter().map(action).collect(),
            control_step: file.control_step.get(),
            time_limit: file.time_limit.get(),
            reward_threshold: file.reward_threshold.map(FiniteNumber::get_f32),
            info: Vec::new(),
        }
    }

    /// Checks that substeps are not so short that nothing moves in them, and that a step ends in a reasonable time.
    fn check_substeps(&self) -> Result<(), ValidationError> {
        let (solver, control_step) = (&self.file.solver, &self.file.control_step);
        let [iterations, passes, searches] = [
            solver.substeps.get(),
            solver.solver_iterations.map_or(1, Count::get),
            solver.contact_updates.get(),
        ]
        .map(u64::from);
        let substeps = iterations * searches;
        if substeps * passes > MAX_PASSES_PER_STEP {
            return Err(solver.error(format!(
                "each step would take {} passes over all joints and contacts: expected a product of `iterations`, `passes` \
                 and `searches` of at most {MAX_PASSES_PER_STEP}",
                substeps * passes
            )));
        }
        let shortest = MIN_SUBSTEP * substeps as f64;
        if control_step.get() < shortest {
            return Err(control_step.error(format!(
                "expected at least {shortest:e} s for {substeps} substeps (`iterations` times `searches` of the solver), found \
                 {:e}: in less than {MIN_SUBSTEP:e} s motion is lost in single precision",
                control_step.get()
            )));
        }
        Ok(())
    }

    /// The world first, if it has shapes to draw, then every body, then every marker. `None` if
    /// nothing has a shape.
    fn scene(
        &self,
        bodies: &[description::Body],
        joints: &[description::Joint],
        ropes: &[description::Rope],
    ) -> Result<Option<Scene>, ValidationError> {
        let world = self.world_body();
        let has_world = !world.shapes.is_empty();
        let index_in_scene = |body: usize| body + usize::from(has_world);
        let tracked = match &self.file.tracked {
            Some(name) => Some(index_in_scene(self.find_body(name)?)),
            None => None,
        };
        let mut drawn = Vec::new();
        if has_world {
            drawn.push(world);
        }
        for (index, (body, given)) in bodies.iter().zip(&self.file.bodies).enumerate() {
            drawn.push(SceneBody {
                name: body.name.clone(),
                is_fixed: false,
                color: given.color.map(HexColor::get),
                shapes: body.shapes.clone(),
                hinge: hinge_of(index, joints),
            });
        }
        drawn.extend(self.file.markers.iter().map(|marker| SceneBody {
            name: marker.name.value().as_ref().to_owned(),
            is_fixed: false,
            color: marker.color.map(HexColor::get),
            shapes: marker.geoms.iter().map(shape).collect(),
            hinge: None,
        }));
        let has_shapes = drawn.iter().any(|body| !body.shapes.is_empty());
        let rope_end = |end: description::RopeEnd| SceneRopeEnd {
            body: end.body.map(index_in_scene),
            at: end.at.map(|component| component as f32),
        };
        Ok(has_shapes.then_some(Scene {
            bodies: drawn,
            tracked,
            ropes: ropes
                .iter()
                .map(|rope| SceneRope(rope.ends.map(rope_end)))
                .collect(),
        }))
    }

    /// The drawable shapes of the world.
    fn world_body(&self) -> SceneBody {
        let colliders = self.file.colliders.iter().map(|collider| &*collider.geom);
        let is_same_in_all_episodes = |geom: &&Geom| !matches!(geom, Geom::Terrain(_));
        SceneBody {
            name: WORLD.to_owned(),
            is_fixed: true,
            color: None,
            shapes: self
                .file
                .scenery
                .iter()
                .chain(colliders)
                .filter(is_same_in_all_episodes)
                .map(shape)
                .collect(),
            hinge: None,
        }
    }

    fn formulas(&self) -> Result<Formulas, ValidationError> {
        let observations = self.file.observations.iter();
        let variables = self.all_variables();
        Ok(Formulas {
            observations: observations
                .map(|observation| self.observation(observation))
                .collect::<Result<_, _>>()?,
            reward: formula(&self.file.reward, Type::Number, &variables)?,
            terminated: formula(&self.file.terminated, Type::Boolean, &variables)?,
        })
    }

    fn run_constants(&self) -> Vec<description::RunConstant> {
        let constants = self.file.drawn_per_run.iter();
        constants
            .map(|constant| description::RunConstant {
                name: constant.name.value().as_ref().to_owned(),
                distribution: constant.value.resolve(),
                value: 0.0,
            })
            .collect()
    }

    /// The formula of an observation: its `value`, or else the sensor or the drawn number of the same
    /// name.
    fn observation(&self, observation: &Observation) -> Result<Program, ValidationError> {
        let sensors = self.state_variables();
        let name = observation.name.value().as_ref();
        let is_sensor = sensors.iter().any(|sensor| sensor.name == name);
        match &observation.value {
            Some(_) if is_sensor => Err(observation.name.error(format!(
                "`{name}` is also the name of {}: leave out `value`, or choose another name",
                self.kind_of_state_variable(name)
            ))),
            Some(value) => formula(value, Type::Number, &sensors),
            None if is_sensor => compile(name, Type::Number, &sensors)
                .map_err(|error| observation.name.error(error.message)),
            None => {
                let names = sensors.iter().map(|sensor| sensor.name.as_str());
                Err(observation
                    .name
                    .unknown_name("sensor", names)
                    .with_help("an observation that is not a sensor needs a `value`"))
            }
        }
    }

    fn kind_of_state_variable(&self, name: &str) -> String {
        match self.list_of_drawn_number(name) {
            Some(list) => format!("a number in `{list}`"),
            None => "a sensor".to_owned(),
        }
    }

    fn analytic_model(&self) -> Result<Option<description::AnalyticModel>, ValidationError> {
        let find = |name| self.find_joint(name);
        let Some(model) = &self.file.analytic else {
            return Ok(None);
        };
        Ok(Some(match model {
            AnalyticModel::CartPole {
                slider,
                hinge,
                integrator,
            } => description::AnalyticModel::CartPole {
                slider: find(slider)?,
                hinge: find(hinge)?,
                integrator: *integrator,
            },
            AnalyticModel::Pendulum { hinge } => description::AnalyticModel::Pendulum {
                hinge: find(hinge)?,
            },
            AnalyticModel::Acrobot { shoulder, elbow } => description::AnalyticModel::Acrobot {
                shoulder: find(shoulder)?,
                elbow: find(elbow)?,
            },
            AnalyticModel::MountainCar { slider } => description::AnalyticModel::MountainCar {
                slider: find(slider)?,
            },
        }))
    }

    /// The equations of the analytic model must be those of the bodies.
    fn check_analytic_model(&self, task: &BodyTask) -> Result<(), ValidationError> {
        let Some(model) = &self.file.analytic else {
            return Ok(());
        };
        let (AnalyticModel::CartPole { slider: first, .. }
        | AnalyticModel::Pendulum { hinge: first }
        | AnalyticModel::Acrobot {
            shoulder: first, ..
        }
        | AnalyticModel::MountainCar { slider: first }) = model;
        analytic::check(task).map_err(|message| first.error(message))
    }
}

fn body(body: &Body) -> Result<description::Body, ValidationError> {
    let colliders = body.colliders.iter().map(|collider| &*collider.geom);
    let shapes: Vec<_> = body.geoms.iter().chain(colliders).map(shape).collect();
    Ok(description::Body {
        name: body.name.value().as_ref().to_owned(),
        position: body.position.get(),
        angle: body.angle.map_or(0.0, FiniteNumber::get),
        fluid_box: body
            .fluid_box
            .map(|(x, y, depth)| [x.get(), y.get(), depth.get()]),
        inertial: inertial(body, &shapes)?,
        shapes,
        ccd: body.ccd.as_ref().is_some_and(|ccd| **ccd),
    })
}

/// The mass properties of a body. If the center of mass or the inertia is left out, it is that of
/// the shapes.
fn inertial(body: &Body, shapes: &[Shape]) -> Result<Inertial, ValidationError> {
    let mass = body.mass.get();
    // Parry panics at some shapes.
    let inertial_of_shapes = caught_panic(|| physics::inertial(mass, shapes)).unwrap_or_default();
    let given_com = body.com.map(super::Vector::get);
    let com = given_com.or(inertial_of_shapes.map(|shapes| shapes.com));
    let given_inertia = body.inertia.map(Positive::get);
    let Some(inertia) = given_inertia.or(inertial_of_shapes.map(|shapes| shapes.inertia)) else {
        return Err(body.name.error(format!(
            "body `{}` has neither an `inertia` nor a shape with an area: add one of them",
            body.name.as_ref()
        )));
    };
    let com = com.unwrap_or_default();
    if !is_single(inertia) || com.iter().any(|along| !(*along as f32).is_finite()) {
        return Err(body.name.error(format!(
            "the shapes of body `{}` give it the inertia {inertia:e} kg m², which does not fit into a number of \
             single precision: give it an `inertia`, or change its mass or shapes",
            body.name.as_ref()
        )));
    }
    for (quantity, number, unit) in [("mass", mass, "kg"), ("inertia", inertia, "kg m²")] {
        if number > MAX_MASS {
            return Err(body.name.error(format!(
                "body `{}` has the {quantity} {number:e} {unit}, with which single precision cannot compute: expected at \
                 most {MAX_MASS:e} {unit}; what nothing moves is one of the task's `colliders`, or a body with a `Weld` \
                 to the world",
                body.name.as_ref()
            )));
        }
    }
    Ok(Inertial { mass, com, inertia })
}

/// Shortest substep, s: a body at 1 m moves by a rounding error in it, at 1 m/s.
const MIN_SUBSTEP: f64 = 1e-7;

/// Passes of a task that does not say how many: those with which its servos hold, as far as a step may have so many.
fn usual_passes(task: &BodyTask) -> u32 {
    let substeps = task.solver.substeps * task.solver.contact_updates;
    let most = MAX_PASSES_PER_STEP / u64::from(substeps);
    parameters::passes_for_servos(task).min(u32::try_from(most).unwrap_or(u32::MAX))
}

/// Maximum number of passes over all joints and contacts per step: a step with so many takes a second.
const MAX_PASSES_PER_STEP: u64 = 1_000_000;

/// Whether a number above 0 keeps its precision as an `f32`.
fn is_single(number: f64) -> bool {
    (number as f32).is_normal()
}

/// Position of the hinge about which a body turns, in the body's frame, m. A body that also slides
/// has none that stays where it is.
fn hinge_of(body: usize, joints: &[description::Joint]) -> Option<[f32; 2]> {
    let joint = joints.iter().find(|joint| joint.child == body)?;
    matches!(joint.kind, description::JointKind::Hinge { .. })
        .then(|| joint.anchor.map(|along| along as f32))
}

fn quantity(observation: &Observation) -> Quantity {
    let range = observation.range.get().map(|end| end as f32);
    Quantity::new(observation.name.as_ref(), &observation.unit, range)
}
