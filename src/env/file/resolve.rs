//! From what a file says to what it means: names become indices, formulas programs, omitted fields their defaults.

use super::joint::{check_start, drawings, fields, passive, range};
use super::surfaces::{self, shape};
use super::{
    Actuator, ActuatorKind, Body, Control, Distribution, Environment, Joint, JointKind, Name,
    Observation, Sense, Start, Twin, instruments,
};
use crate::env::analytic;
use crate::env::description::{self, Columns, Description, Formulas, Inertial};
use crate::env::expression::{Mistake, Program, Type, Variable, compile};
use crate::env::{Action, Choice, Quantity, Scene, SceneBody, Shape, Spec, physics};
use crate::input::numbers::Finite;
use crate::input::{Complaint, Located};

/// Checks every reference of a task file and turns it into a description.
pub(super) fn description(
    name: &str,
    origin: &str,
    file: &Environment,
) -> Result<Description, Complaint> {
    check_unique_names(file)?;
    instruments::check_servos(file)?;
    let colliders = surfaces::colliders(file)?;
    let bodies = file
        .bodies
        .iter()
        .map(body)
        .collect::<Result<Vec<_>, _>>()?;
    let joints = joints(file)?;
    let columns = columns(file);
    let sensors = file.sensors.iter().enumerate();
    let description = Description {
        origin: origin.to_owned(),
        spec: spec(name, file),
        scene: scene(file, &bodies, &joints)?,
        gravity: file.gravity.get(),
        solver: description::Solver {
            iterations: file.solver.iterations.get(),
            passes: file.solver.passes.get(),
            searches: file.solver.searches.get(),
        },
        joints,
        free: free_bodies(file),
        colliders,
        actuators: file
            .actuators
            .iter()
            .map(|actuator| instruments::actuator(actuator, file))
            .collect::<Result<_, _>>()?,
        sensors: sensors
            .map(|(index, sensor)| instruments::sensor(index, sensor, file))
            .collect::<Result<_, _>>()?,
        fields: fields(file, columns)?,
        drawings: drawings(file, columns)?,
        formulas: formulas(file, columns)?,
        reset: starts(file)?,
        twin: file
            .analytic
            .as_ref()
            .map(|twin| twin_of(twin, &file.joints))
            .transpose()?,
        finite: None,
        bodies,
    };
    check_twin(file, &description)?;
    Ok(description)
}

fn spec(name: &str, file: &Environment) -> Spec {
    Spec {
        name: name.to_owned(),
        description: file.description.clone(),
        observations: file.observations.iter().map(quantity).collect(),
        actions: file.actuators.iter().map(action).collect(),
        control_step: file.control_step.get(),
        time_limit: file.time_limit.get(),
        reward_threshold: file
            .reward_threshold
            .map(|threshold| threshold.get() as f32),
    }
}

fn check_unique_names(file: &Environment) -> Result<(), Complaint> {
    unique("body", file.bodies.iter().map(|body| &body.name))?;
    let colliders = file
        .colliders
        .iter()
        .chain(file.bodies.iter().flat_map(|body| &body.colliders));
    unique(
        "collider",
        colliders.filter_map(|collider| collider.name.as_ref()),
    )?;
    unique("joint", file.joints.iter().map(|joint| &joint.name))?;
    unique("sensor", file.sensors.iter().map(|sensor| &sensor.name))?;
    unique(
        "observation",
        file.observations
            .iter()
            .map(|observation| &observation.name),
    )?;
    let read = file
        .sensors
        .iter()
        .map(|sensor| &sensor.name)
        .chain(file.observations.iter().map(|seen| &seen.name));
    for name in file.actuators.iter().map(|actuator| &actuator.name) {
        if read.clone().any(|other| other == name) {
            return Err(name.complain(format!(
                "`{}` also names a sensor or an observation",
                name.as_ref()
            )));
        }
    }
    unique(
        "actuator",
        file.actuators.iter().map(|actuator| &actuator.name),
    )?;
    match file.bodies.iter().find(|body| body.name.as_ref() == WORLD) {
        Some(body) => Err(body
            .name
            .complain("`world` is what stands still and cannot name a body")),
        None => Ok(()),
    }
}

fn unique<'a>(what: &str, names: impl Iterator<Item = &'a Located<Name>>) -> Result<(), Complaint> {
    let mut seen: Vec<&str> = Vec::new();
    for name in names {
        if seen.contains(&name.as_ref()) {
            return Err(name.complain(format!(
                "another {what} is named `{}` already",
                name.as_ref()
            )));
        }
        seen.push(name.value().as_ref());
    }
    Ok(())
}

/// Position of the name in a list.
pub(super) fn find<'a>(
    name: &Located<String>,
    what: &str,
    names: impl Iterator<Item = &'a Located<Name>> + Clone,
) -> Result<usize, Complaint> {
    let names = names.map(|known| known.value().as_ref());
    names
        .clone()
        .position(|known| known == name.as_str())
        .ok_or_else(|| name.complain_unknown(what, names))
}

pub(super) fn find_joint(name: &Located<String>, joints: &[Joint]) -> Result<usize, Complaint> {
    find(name, "joint", joints.iter().map(|joint| &joint.name))
}

pub(super) fn find_body(name: &Located<String>, file: &Environment) -> Result<usize, Complaint> {
    find(name, "body", file.bodies.iter().map(|body| &body.name))
}

/// Index of a joint's coordinate, or of one that a free body has, such as `NAME.x`.
pub(super) fn find_coordinate(
    name: &Located<String>,
    file: &Environment,
) -> Result<usize, Complaint> {
    let joints = file
        .joints
        .iter()
        .map(|joint| joint.name.as_ref().to_owned());
    let free = free_bodies(file)
        .into_iter()
        .map(|body| file.bodies[body].name.as_ref());
    let names: Vec<_> = joints
        .chain(free.flat_map(|body| ["x", "y", "angle"].map(|axis| format!("{body}.{axis}"))))
        .collect();
    let position = names.iter().position(|known| *known == **name);
    let index =
        position.ok_or_else(|| name.complain_unknown("joint", names.iter().map(String::as_str)))?;
    match file.joints.get(index).map(|joint| *joint.kind) {
        Some(JointKind::Weld) => Err(name.complain(format!(
            "joint `{}` is a weld and has no coordinate",
            name.as_str()
        ))),
        _ => Ok(index),
    }
}

/// Whether the task is one of bodies that touch, float, or are pushed directly; see [`Description::needs_worlds`].
pub(super) fn needs_worlds(file: &Environment) -> bool {
    let pushed = file
        .actuators
        .iter()
        .any(|actuator| matches!(actuator.kind, ActuatorKind::BodyForce { .. }));
    let touching = |body: &Body| !body.colliders.is_empty() || !body.forces.is_empty();
    pushed
        || !file.colliders.is_empty()
        || file.bodies.iter().any(touching)
        || !free_bodies(file).is_empty()
}

/// The bodies that no joint holds.
fn free_bodies(file: &Environment) -> Vec<usize> {
    let held = |body: &Body| {
        file.joints
            .iter()
            .any(|joint| *joint.child == *body.name.as_ref())
    };
    (0..file.bodies.len())
        .filter(|&body| !held(&file.bodies[body]))
        .collect()
}

fn body(body: &Body) -> Result<description::Body, Complaint> {
    let shapes: Vec<_> = body
        .geoms
        .iter()
        .chain(body.colliders.iter().map(|collider| &*collider.geom))
        .map(shape)
        .collect();
    Ok(description::Body {
        name: body.name.value().as_ref().to_owned(),
        position: body.position.get(),
        angle: body.angle.map_or(0.0, Finite::get),
        inertial: inertial(body, &shapes)?,
        shapes,
    })
}

/// What is omitted follows from the shapes.
fn inertial(body: &Body, shapes: &[Shape]) -> Result<Inertial, Complaint> {
    let mass = body.mass.get();
    let filled = physics::inertial(mass, shapes);
    let com = body.com.map(super::Vector::get);
    match (body.inertia, filled) {
        (Some(inertia), filled) => {
            let com = com.or(filled.map(|filled| filled.com)).unwrap_or_default();
            Ok(Inertial {
                mass,
                com,
                inertia: inertia.get(),
            })
        }
        (None, Some(filled)) => Ok(Inertial {
            com: com.unwrap_or(filled.com),
            ..filled
        }),
        (None, None) => {
            let message = format!(
                "body `{}` has neither an `inertia` nor a shape with an area",
                body.name.as_ref()
            );
            Err(body.name.complain(message))
        }
    }
}

/// The world first, if there is anything of it to draw, then every body. None if nothing has a shape.
fn scene(
    file: &Environment,
    bodies: &[description::Body],
    joints: &[description::Joint],
) -> Result<Option<Scene>, Complaint> {
    let standing = file
        .scenery
        .iter()
        .chain(file.colliders.iter().map(|collider| &*collider.geom));
    let world = SceneBody {
        name: WORLD.to_owned(),
        fixed: true,
        shapes: standing.map(shape).collect(),
        hinge: None,
    };
    let world = Some(world).filter(|world| !world.shapes.is_empty());
    let tracked = file
        .tracked
        .as_ref()
        .map(|name| find_body(name, file))
        .transpose()?;
    let tracked = tracked.map(|body| body + usize::from(world.is_some()));
    let drawn = bodies.iter().enumerate().map(|(index, body)| SceneBody {
        name: body.name.clone(),
        fixed: false,
        shapes: body.shapes.clone(),
        hinge: hinge(index, joints),
    });
    let bodies: Vec<_> = world.into_iter().chain(drawn).collect();
    let shown = bodies.iter().any(|body| !body.shapes.is_empty());
    Ok(shown.then_some(Scene { bodies, tracked }))
}

/// About what a body turns, in its frame.
fn hinge(body: usize, joints: &[description::Joint]) -> Option<[f32; 2]> {
    let joint = joints.iter().find(|joint| joint.child == body)?;
    matches!(joint.kind, description::JointKind::Hinge { .. })
        .then(|| joint.anchor.map(|along| along as f32))
}

/// Trees rooted in the world or in free bodies: each body hangs on one joint at most, each parent on an earlier one.
fn joints(file: &Environment) -> Result<Vec<description::Joint>, Complaint> {
    let mut hung: Vec<Option<&Joint>> = vec![None; file.bodies.len()];
    let mut joints = Vec::new();
    for joint in &file.joints {
        let (parent, child) = (parent(joint, file, &hung)?, child(joint, file, &hung)?);
        hung[child] = Some(joint);
        let name = joint.name.value().as_ref().to_owned();
        let (anchor, kind) = (joint.anchor.get(), joint_kind(*joint.kind));
        let (range, passive) = (range(joint)?, passive(joint, file)?);
        joints.push(description::Joint {
            name,
            parent,
            child,
            anchor,
            kind,
            range,
            passive,
        });
    }
    Ok(joints)
}

fn parent(
    joint: &Joint,
    file: &Environment,
    hung: &[Option<&Joint>],
) -> Result<Option<usize>, Complaint> {
    if joint.parent.as_str() == WORLD {
        return Ok(None);
    }
    let known = || {
        [WORLD]
            .into_iter()
            .chain(file.bodies.iter().map(|body| body.name.value().as_ref()))
    };
    let Some(parent) = file
        .bodies
        .iter()
        .position(|body| body.name.as_ref() == joint.parent.as_str())
    else {
        let names: Vec<_> = known().collect();
        return Err(joint.parent.complain_unknown("body", names));
    };
    if hung[parent].is_none() && !free_bodies(file).contains(&parent) {
        let message = format!(
            "no earlier joint holds body `{}`: joints form a tree, parents before children",
            &*joint.parent
        );
        return Err(joint.parent.complain(message));
    }
    Ok(Some(parent))
}

fn child(joint: &Joint, file: &Environment, hung: &[Option<&Joint>]) -> Result<usize, Complaint> {
    let child = find_body(&joint.child, file)?;
    match hung[child] {
        Some(other) => {
            let message = format!(
                "body `{}` hangs on joint `{}` already",
                &*joint.child,
                other.name.as_ref()
            );
            Err(joint.child.complain(message))
        }
        None => Ok(child),
    }
}

fn joint_kind(kind: JointKind) -> description::JointKind {
    match kind {
        JointKind::Slide { axis } => description::JointKind::Slide { axis: axis.get() },
        JointKind::Hinge {
            positive: Sense::CounterClockwise,
        } => description::JointKind::Hinge { sense: 1.0 },
        JointKind::Hinge {
            positive: Sense::Clockwise,
        } => description::JointKind::Hinge { sense: -1.0 },
        JointKind::Weld => description::JointKind::Weld,
    }
}

fn quantity(observation: &Observation) -> Quantity {
    Quantity {
        name: observation.name.value().as_ref().to_owned(),
        unit: observation.unit.clone(),
        range: observation.range.get().map(|end| end as f32),
    }
}

fn action(actuator: &Actuator) -> Action {
    let (choice, range) = choice(&actuator.control);
    let name = actuator.name.value().as_ref().to_owned();
    Action {
        quantity: Quantity {
            name,
            unit: actuator.unit.clone(),
            range,
        },
        choice,
    }
}

/// What may be chosen, and its lowest and highest value.
pub(super) fn choice(control: &Control) -> (Choice, [f32; 2]) {
    match control {
        Control::Continuous(interval) => (Choice::Continuous, interval.get().map(|end| end as f32)),
        Control::Discrete(values) => {
            let values = values.get();
            let range = [
                values.iter().copied().fold(f32::MAX, f32::min),
                values.iter().copied().fold(f32::MIN, f32::max),
            ];
            (Choice::Discrete(values), range)
        }
    }
}

pub(super) fn columns(file: &Environment) -> Columns {
    let on_joints = file
        .joints
        .iter()
        .filter(|joint| joint.force.is_some())
        .count();
    let on_bodies: usize = file.bodies.iter().map(|body| 2 * body.forces.len()).sum();
    Columns {
        sensors: file.sensors.len(),
        observations: file.observations.len(),
        actions: file.actuators.len(),
        fields: on_joints + on_bodies,
    }
}

fn formulas(file: &Environment, columns: Columns) -> Result<Formulas, Complaint> {
    let sensors = sensor_variables(file, columns);
    let all = all_variables(file, columns, &sensors);
    Ok(Formulas {
        observations: file
            .observations
            .iter()
            .map(|seen| observation(seen, &sensors))
            .collect::<Result<_, _>>()?,
        reward: formula(&file.reward, Type::Number, &all)?,
        terminated: formula(&file.terminated, Type::Boolean, &all)?,
    })
}

pub(super) fn sensor_variables(file: &Environment, columns: Columns) -> Vec<Variable> {
    let names = file
        .sensors
        .iter()
        .map(|sensor| sensor.name.value().as_ref().to_owned())
        .enumerate();
    names
        .map(|(column, name)| Variable {
            name,
            column,
            previous: Some(columns.first_previous() + column),
        })
        .collect()
}

/// Observations, then the sensors that are not observed under their own name, then actions.
fn all_variables(file: &Environment, columns: Columns, sensors: &[Variable]) -> Vec<Variable> {
    let observations = file
        .observations
        .iter()
        .enumerate()
        .map(|(index, seen)| Variable {
            name: seen.name.value().as_ref().to_owned(),
            column: columns.first_observation() + index,
            previous: Some(columns.first_previous() + columns.sensors + index),
        });
    let unseen = |sensor: &&Variable| {
        !file
            .observations
            .iter()
            .any(|seen| seen.name.as_ref() == sensor.name)
    };
    observations
        .chain(sensors.iter().filter(unseen).cloned())
        .chain(action_variables(file, columns))
        .collect()
}

/// The sensors without a look back: what acts during a step depends on the present.
pub(super) fn present_sensors(file: &Environment, columns: Columns) -> Vec<Variable> {
    sensor_variables(file, columns)
        .into_iter()
        .map(|sensor| Variable {
            previous: None,
            ..sensor
        })
        .collect()
}

/// The actions, under their actuators' names.
pub(super) fn action_variables(file: &Environment, columns: Columns) -> Vec<Variable> {
    let actions = file
        .actuators
        .iter()
        .enumerate()
        .map(|(index, actuator)| Variable {
            name: actuator.name.value().as_ref().to_owned(),
            column: columns.first_action() + index,
            previous: None,
        });
    actions.collect()
}

/// Observations are functions of the present, so `previous` means nothing in them.
fn observation(seen: &Observation, sensors: &[Variable]) -> Result<Program, Complaint> {
    let name = seen.name.value().as_ref();
    let present: Vec<_> = sensors
        .iter()
        .map(|sensor| Variable {
            previous: None,
            ..sensor.clone()
        })
        .collect();
    let same = sensors.iter().any(|sensor| sensor.name == name);
    match &seen.value {
        Some(_) if same => Err(seen.name.complain(format!(
            "`{name}` also names a sensor, but has a formula of its own"
        ))),
        Some(value) => formula(value, Type::Number, &present),
        None if same => compile(name, Type::Number, &present)
            .map_err(|mistake| seen.name.complain(mistake.message)),
        None => {
            let names = sensors.iter().map(|sensor| sensor.name.as_str());
            Err(seen
                .name
                .complain_unknown("sensor", names)
                .with_help("an observation that is not a sensor needs a `value`"))
        }
    }
}

pub(super) fn formula(
    text: &Located<String>,
    kind: Type,
    variables: &[Variable],
) -> Result<Program, Complaint> {
    compile(text, kind, variables).map_err(
        |Mistake {
             message,
             help,
             line,
             column,
         }| {
            let complaint = text.complain(message).at(line, column);
            help.into_iter().fold(complaint, Complaint::with_help)
        },
    )
}

fn starts(file: &Environment) -> Result<Vec<description::Start>, Complaint> {
    let mut starts: Vec<description::Start> = Vec::new();
    for start in &file.reset {
        let coordinate = find_coordinate(&start.joint, file)?;
        if let Some(joint) = file.joints.get(coordinate) {
            check_start(start, joint)?;
        }
        if starts.iter().any(|other| other.coordinate == coordinate) {
            return Err(start
                .joint
                .complain(format!("joint `{}` has a start already", &*start.joint)));
        }
        starts.push(resolved_start(
            coordinate,
            start,
            drawn_at(coordinate, file),
        ));
    }
    Ok(starts)
}

/// A coordinate where the file draws the bodies.
fn drawn_at(coordinate: usize, file: &Environment) -> f64 {
    let Some(free) = coordinate.checked_sub(file.joints.len()) else {
        return 0.0;
    };
    let body = &file.bodies[free_bodies(file)[free / 3]];
    let [x, y] = body.position.get();
    [x, y, body.angle.map_or(0.0, Finite::get)][free % 3]
}

fn resolved_start(coordinate: usize, start: &Start, drawn_at: f64) -> description::Start {
    let resolved = |distribution: &Distribution| match *distribution {
        Distribution::Constant(value) => description::Distribution::Constant(value.get()),
        Distribution::Uniform(interval) => {
            let [low, high] = interval.get();
            description::Distribution::Uniform { low, high }
        }
        Distribution::Normal(mean, deviation) => description::Distribution::Normal {
            mean: mean.get(),
            deviation: deviation.get(),
        },
    };
    let position = start
        .position
        .as_ref()
        .map_or(description::Distribution::Constant(drawn_at), resolved);
    description::Start {
        coordinate,
        position,
        velocity: resolved(&start.velocity),
    }
}

fn twin_of(twin: &Twin, joints: &[Joint]) -> Result<description::Twin, Complaint> {
    let find = |name| find_joint(name, joints);
    Ok(match twin {
        Twin::CartPole { slider, hinge } => description::Twin::CartPole {
            slider: find(slider)?,
            hinge: find(hinge)?,
        },
        Twin::Pendulum { hinge } => description::Twin::Pendulum {
            hinge: find(hinge)?,
        },
        Twin::Acrobot { shoulder, elbow } => description::Twin::Acrobot {
            shoulder: find(shoulder)?,
            elbow: find(elbow)?,
        },
        Twin::MountainCar { slider } => description::Twin::MountainCar {
            slider: find(slider)?,
        },
    })
}

/// The twin's equations must be those of the bodies.
fn check_twin(file: &Environment, description: &Description) -> Result<(), Complaint> {
    let Some(twin) = &file.analytic else {
        return Ok(());
    };
    let (Twin::CartPole { slider: first, .. }
    | Twin::Pendulum { hinge: first }
    | Twin::Acrobot {
        shoulder: first, ..
    }
    | Twin::MountainCar { slider: first }) = twin;
    analytic::check(description).map_err(|message| first.complain(message))
}

const WORLD: &str = "world";
