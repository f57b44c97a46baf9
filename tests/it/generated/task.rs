//! Generated tasks, and playing them with random actions.

use rand::RngExt;
use seedbed_env::{Choice, Environment, Physics, Pose, Status, TaskDescription, build};
use seedbed_random::{Purpose, Stream, stream};

use super::{number, positive};
use crate::util::REPOSITORY;

/// Every field and variant of the language of tasks, except `extends`, which names another file.
pub(crate) const KEYWORDS: &[&str] = &[
    "Environment",
    "description",
    "gravity",
    "control_step",
    "time_limit",
    "reward_threshold",
    "solver",
    "iterations",
    "passes",
    "searches",
    "scenery",
    "colliders",
    "tracked",
    "bodies",
    "joints",
    "actuators",
    "sensors",
    "observations",
    "reward",
    "terminated",
    "reset",
    "analytic",
    "name",
    "position",
    "angle",
    "mass",
    "com",
    "inertia",
    "geoms",
    "forces",
    "drawn",
    "x",
    "y",
    "at",
    "frame",
    "World",
    "Local",
    "Ball",
    "center",
    "radius",
    "Box",
    "half_size",
    "Capsule",
    "from",
    "to",
    "Convex",
    "Polyline",
    "HalfSpace",
    "point",
    "normal",
    "geom",
    "friction",
    "restitution",
    "contype",
    "conaffinity",
    "parent",
    "child",
    "anchor",
    "type",
    "Slide",
    "axis",
    "Hinge",
    "positive",
    "CounterClockwise",
    "Clockwise",
    "Weld",
    "range",
    "damping",
    "frictionloss",
    "armature",
    "stiffness",
    "springref",
    "force",
    "control",
    "Discrete",
    "Continuous",
    "gear",
    "unit",
    "JointForce",
    "VelocityServo",
    "PositionServo",
    "BodyForce",
    "Signal",
    "kv",
    "kp",
    "force_limit",
    "direction",
    "JointPosition",
    "WrappedJointPosition",
    "JointVelocity",
    "BodyPosition",
    "BodyVelocity",
    "BodyAngle",
    "BodyAngularVelocity",
    "Contact",
    "Ray",
    "length",
    "Formula",
    "X",
    "Y",
    "value",
    "Constant",
    "Uniform",
    "Normal",
    "WholeNumber",
    "from",
    "to",
    "velocity",
    "CartPole",
    "Pendulum",
    "Acrobot",
    "MountainCar",
    "integrator",
    "Euler",
    "previous",
    "abs",
    "sqrt",
    "exp",
    "log",
    "sin",
    "cos",
    "tan",
    "atan2",
    "min",
    "max",
    "pow",
    "clamp",
    "tanh",
    "sign",
    "floor",
    "if",
    "else",
    "pi",
    "degree",
    "TabularEnvironment",
    "task",
    "DeepSea",
    "size",
    "move_cost",
    "randomized",
    "slip",
    "BipolarChain",
    "vertices",
    "ParallelChains",
    "chains",
    "edges",
    "variance",
    "noise",
    "MaximumRewardPath",
    "steps",
    "mean",
    "deviation",
    "observation",
    "OneHot",
    "Place",
    "drawn_with",
    "drawn_per_run",
];

/// Files of tasks with an analytic model.
const ANALYTIC: [&str; 6] = [
    "cartpole",
    "cartpole_gym_euler",
    "pendulum",
    "acrobot",
    "mountain_car_continuous",
    "cartpole_swingup",
];

/// The text of a task.
pub(crate) fn generate(random: &mut Stream) -> String {
    match random.random_range(0..10) {
        0 => tabular(random),
        1 => analytic(random),
        _ => BodyTaskText::generate(random),
    }
}

fn one<'a>(values: &[&'a str], random: &mut Stream) -> &'a str {
    values[random.random_range(0..values.len())]
}

/// A field that is given in one of `in_` tasks.
fn sometimes(in_: u32, random: &mut Stream, field: impl FnOnce(&mut Stream) -> String) -> String {
    if random.random_ratio(1, in_) {
        format!("{}, ", field(random))
    } else {
        String::new()
    }
}

fn vector(random: &mut Stream) -> String {
    format!("({:?}, {:?})", number(random), number(random))
}

fn interval(random: &mut Stream) -> String {
    let low = number(random).clamp(-1e38, 1e38);
    let width = positive(random).clamp(low.abs() * 1e-5, 1e38);
    format!("{low:?}, {:?}", low + width)
}

fn tabular(random: &mut Stream) -> String {
    let small = |random: &mut Stream, low| random.random_range(low..low + 4);
    let (p, q) = (small(random, 2), small(random, 2));
    let family = match random.random_range(0..4) {
        0 => format!(
            "DeepSea(size: {p}, move_cost: {:?}, randomized: {}, slip: {:?})",
            positive(random),
            random.random::<bool>(),
            random.random::<f64>()
        ),
        1 => format!("BipolarChain(vertices: {})", 2 * (p + 1)),
        2 => format!(
            "ParallelChains(chains: {p}, edges: {q}, variance: {:?}, noise: {:?})",
            positive(random),
            positive(random)
        ),
        _ => format!(
            "MaximumRewardPath(vertices: {}, steps: {q}, mean: {:?}, deviation: {:?}, noise: {:?})",
            p + 3,
            number(random),
            positive(random),
            positive(random)
        ),
    };
    let drawn = one(&["drawn_with: 3, ", "drawn_per_run: true, ", ""], random);
    let observation = one(&["OneHot", "Place"], random);
    format!(
        "TabularEnvironment(description: \"Generated.\", task: {family}, observation: {observation}, {drawn})"
    )
}

/// A task with an analytic model, of which one number is replaced.
fn analytic(random: &mut Stream) -> String {
    let name = one(&ANALYTIC, random);
    let euler = name.ends_with("_euler");
    let name = if euler { "cartpole" } else { name };
    let text = std::fs::read_to_string(format!("{REPOSITORY}/envs/{name}.ron")).unwrap();
    let mut text: String = text
        .lines()
        .map(|line| line.split("//").next().unwrap_or_default().to_owned() + "\n")
        .collect();
    if text.contains("extends:") || euler {
        let base = std::fs::read_to_string(format!("{REPOSITORY}/envs/cartpole.ron")).unwrap();
        text = base.replace("hinge: \"hinge\")", "hinge: \"hinge\", integrator: Euler)");
    }
    let places: Vec<usize> = text
        .match_indices("mass: ")
        .map(|(at, found)| at + found.len())
        .collect();
    let at = places[random.random_range(0..places.len())];
    let end = at + text[at..].find(',').unwrap();
    text.replace_range(at..end, &format!("{:?}", positive(random)));
    text
}

/// A task of rigid bodies while it is generated.
#[derive(Default)]
struct BodyTaskText {
    bodies: Vec<String>,
    joints: Vec<String>,
    /// Names of joints with a coordinate, and whether they are hinges.
    moving: Vec<(String, bool)>,
    /// Free bodies.
    free: Vec<usize>,
    actuators: Vec<String>,
    sensors: Vec<String>,
    colliders: usize,
}

impl BodyTaskText {
    fn generate(random: &mut Stream) -> String {
        let mut task = Self::default();
        let has_contacts = random.random_ratio(1, 3);
        let count = random.random_range(1..=3);
        for index in 0..count {
            task.add_body(index, has_contacts, random);
        }
        for index in 0..random.random_range(1..=2) {
            task.add_actuator(index, random);
        }
        for index in 0..random.random_range(1..=5) {
            task.add_sensor(index, random);
        }
        task.text(has_contacts, random)
    }

    fn add_body(&mut self, index: usize, has_contacts: bool, random: &mut Stream) {
        let massive = geom(one(&["Ball", "Box", "Capsule", "Convex"], random), random);
        let massless = geom(one(&["Polyline", "HalfSpace", "Ball"], random), random);
        let forces = |random: &mut Stream| {
            format!(
                "forces: [(x: \"a0\", y: \"{}\", at: {}, frame: {})]",
                formula(&["s0", "a0"], 1, random),
                vector(random),
                one(&["World", "Local"], random)
            )
        };
        let collider = if has_contacts {
            self.collider(random)
        } else {
            String::new()
        };
        let mut body = format!("(name: \"b{index}\", mass: {:?}, ", positive(random));
        body += &sometimes(2, random, |random| format!("position: {}", vector(random)));
        body += &sometimes(3, random, |random| format!("angle: {:?}", number(random)));
        if random.random() {
            body += &format!("geoms: [{massive}, {massless}], ");
            body += &sometimes(3, random, |random| format!("com: {}", vector(random)));
            body += &sometimes(3, random, |random| {
                format!("inertia: {:?}", positive(random))
            });
        } else {
            body += &format!("com: {}, inertia: {:?}, ", vector(random), positive(random));
        }
        body += &collider;
        body += &sometimes(6, random, forces);
        body += &sometimes(6, random, |_| {
            "drawn: (y: \"s0\", angle: \"-s0\")".to_owned()
        });
        self.bodies.push(body + ")");
        if random.random_ratio(1, 5) {
            self.free.push(index);
        } else {
            self.add_joint(index, has_contacts, random);
        }
    }

    fn collider(&mut self, random: &mut Stream) -> String {
        let name = self.colliders;
        self.colliders += 1;
        let kind = one(&["Ball", "Box", "Capsule", "Convex"], random);
        format!(
            "colliders: [(name: \"c{name}\", geom: {}{})], ",
            geom(kind, random),
            surface(random)
        )
    }

    fn add_joint(&mut self, child: usize, has_contacts: bool, random: &mut Stream) {
        let parent = random.random_range(0..=child);
        let is_root = parent == child;
        let parent = if is_root {
            "world".to_owned()
        } else {
            format!("b{parent}")
        };
        let (kind, is_hinge) = match random.random_range(0..9) {
            0 => ("Weld".to_owned(), false),
            1..=4 => {
                let axis = one(
                    &["(1.0, 0.0)", "(0.0, 1.0)", "(1.0, 1e-30)", "(-3.0, 4.0)"],
                    random,
                );
                (format!("Slide(axis: {axis})"), false)
            }
            _ => {
                let sense = one(&["CounterClockwise", "Clockwise"], random);
                (format!("Hinge(positive: {sense})"), true)
            }
        };
        let name = format!("j{child}");
        let mut joint =
            format!("(name: \"{name}\", parent: \"{parent}\", child: \"b{child}\", type: {kind}, ");
        joint += &sometimes(3, random, |random| format!("anchor: {}", vector(random)));
        if kind != "Weld" {
            joint += &sometimes(4, random, |_| "range: (-1.5, 2.0)".to_owned());
            for field in ["damping", "frictionloss"] {
                joint += &sometimes(3, random, |random| {
                    format!("{field}: {:?}", number(random).abs())
                });
            }
            joint += &sometimes(3, random, |random| {
                format!(
                    "stiffness: {:?}, springref: {:?}",
                    positive(random),
                    number(random)
                )
            });
            if is_root || has_contacts {
                joint += &sometimes(4, random, |random| {
                    format!("armature: {:?}", number(random).abs())
                });
            }
            joint += &sometimes(5, random, |random| {
                format!("force: \"{}\"", formula(&["s0", "a0"], 2, random))
            });
            self.moving.push((name, is_hinge));
        }
        self.joints.push(joint + ")");
    }

    fn body(&self, random: &mut Stream) -> String {
        format!("b{}", random.random_range(0..self.bodies.len()))
    }

    fn add_actuator(&mut self, index: usize, random: &mut Stream) {
        let joint = match self.moving.get(index % self.moving.len().max(1)) {
            Some((joint, _)) => joint.clone(),
            None => String::new(),
        };
        let body = self.body(random);
        let limit = sometimes(2, random, |random| {
            format!("force_limit: {:?}", positive(random))
        });
        let choice = if joint.is_empty() {
            random.random_range(3..5)
        } else {
            random.random_range(0..5)
        };
        let kind = match choice {
            0 => format!("JointForce(\"{joint}\")"),
            1 => format!(
                "VelocityServo(joint: \"{joint}\", kv: {:?}, {limit})",
                positive(random)
            ),
            2 => format!(
                "PositionServo(joint: \"{joint}\", kp: {:?}, kv: {:?}, {limit})",
                positive(random),
                number(random).abs()
            ),
            3 => format!(
                "BodyForce(body: \"{body}\", at: {}, direction: (0.6, {:?}), frame: {})",
                vector(random),
                number(random),
                one(&["World", "Local"], random)
            ),
            _ => "Signal".to_owned(),
        };
        let control = if random.random() {
            format!(
                "Discrete([{:?}, 0.0, {:?}])",
                number(random),
                number(random)
            )
        } else {
            format!("Continuous({})", interval(random))
        };
        let gear = sometimes(3, random, |random| format!("gear: {:?}", number(random)));
        self.actuators.push(format!(
            "(name: \"a{index}\", type: {kind}, control: {control}, {gear}unit: \"N\")"
        ));
    }

    fn add_sensor(&mut self, index: usize, random: &mut Stream) {
        let body = self.body(random);
        let axis = one(&["X", "Y"], random);
        let coordinate = match (self.moving.last(), self.free.last()) {
            (Some((joint, _)), _) => joint.clone(),
            (_, Some(body)) => format!("b{body}.angle"),
            _ => return self.push_sensor(index, &format!("BodyAngle(\"{body}\")")),
        };
        let hinge = self.moving.iter().find(|(_, is_hinge)| *is_hinge);
        let kind = match random.random_range(0..10) {
            0 | 1 => format!("JointPosition(\"{coordinate}\")"),
            2 => format!("JointVelocity(\"{coordinate}\")"),
            3 => format!(
                "BodyPosition(body: \"{body}\", axis: {axis}, at: {})",
                vector(random)
            ),
            4 => format!("BodyVelocity(body: \"{body}\", axis: {axis})"),
            5 => format!("BodyAngularVelocity(\"{body}\")"),
            6 if self.colliders >= 2 => "Contact(\"c0\", \"c1\")".to_owned(),
            7 if index > 0 => format!("Formula(\"{}\")", formula(&["s0"], 2, random)),
            8 => format!(
                "Ray(body: \"{body}\", from: {}, direction: (1.0, {:?}), length: {:?})",
                vector(random),
                number(random),
                positive(random)
            ),
            9 if hinge.is_some() => format!("WrappedJointPosition(\"{}\")", hinge.unwrap().0),
            _ => format!("BodyAngle(\"{body}\")"),
        };
        self.push_sensor(index, &kind);
    }

    fn push_sensor(&mut self, index: usize, kind: &str) {
        self.sensors
            .push(format!("(name: \"s{index}\", type: {kind})"));
    }

    fn text(&self, has_contacts: bool, random: &mut Stream) -> String {
        let names: Vec<String> = (0..self.sensors.len())
            .map(|index| format!("s{index}"))
            .chain(["r0".to_owned()])
            .collect();
        let sensors: Vec<&str> = names.iter().map(String::as_str).collect();
        let all: Vec<&str> = sensors
            .iter()
            .copied()
            .chain(["o", "a0", "previous(s0)", "previous(o)"])
            .collect();
        let mut text = format!(
            "Environment(description: \"Generated.\", gravity: {}, control_step: {:?}, time_limit: {}, ",
            vector(random),
            positive(random).min(10.0),
            random.random_range(1..40)
        );
        text += &sometimes(3, random, |random| {
            format!("reward_threshold: {:?}", number(random))
        });
        text += &sometimes(3, random, |random| {
            let mut count = || random.random_range(1..6);
            format!(
                "solver: (iterations: {}, passes: {}, searches: {})",
                count(),
                count(),
                count()
            )
        });
        text += &sometimes(3, random, |random| {
            let kind = one(&["Polyline", "Box", "HalfSpace"], random);
            format!("scenery: [{}]", geom(kind, random))
        });
        if has_contacts {
            let kind = one(&["HalfSpace", "Polyline", "Box", "Ball"], random);
            text += &format!(
                "colliders: [(geom: {}{})], ",
                geom(kind, random),
                surface(random)
            );
        }
        text += &sometimes(4, random, |_| "tracked: \"b0\"".to_owned());
        let observation = format!(
            "(name: \"s0\", range: ({})), (name: \"o\", value: \"{}\", unit: \"m\", range: ({}))",
            interval(random),
            formula(&sensors, 2, random),
            interval(random)
        );
        for (field, entries) in [
            ("bodies", &self.bodies),
            ("joints", &self.joints),
            ("actuators", &self.actuators),
            ("sensors", &self.sensors),
            ("drawn_per_run", &Self::run_constants(random)),
        ] {
            text += &format!("{field}: [{}], ", entries.join(", "));
        }
        text += &format!(
            "observations: [{observation}], reset: [{}], ",
            self.reset(random)
        );
        text += &format!("reward: \"{}\", ", formula(&all, 3, random));
        text + &sometimes(2, random, |random| {
            format!("terminated: \"{}\"", condition(&all, 2, random))
        }) + ")"
    }

    /// The number `r0`, which formulas read, and sometimes another one.
    fn run_constants(random: &mut Stream) -> Vec<String> {
        let value = |random: &mut Stream| match random.random_range(0..4) {
            0 => format!("Constant({:?})", number(random)),
            1 => format!("Uniform({})", interval(random)),
            2 => format!("Normal({:?}, {:?})", number(random), positive(random)),
            _ => "WholeNumber(from: -3, to: 16777216)".to_owned(),
        };
        let count = random.random_range(1..=2);
        (0..count)
            .map(|index| format!("(name: \"r{index}\", value: {})", value(random)))
            .collect()
    }

    fn reset(&self, random: &mut Stream) -> String {
        let joints = self.moving.iter().map(|(joint, _)| joint.clone());
        let free = self.free.iter().map(|body| format!("b{body}.x"));
        let mut starts = Vec::new();
        for coordinate in joints.chain(free) {
            if random.random() {
                let position = one(
                    &["Uniform(-0.5, 0.5)", "Normal(0.1, 0.2)", "Constant(0.3)"],
                    random,
                );
                let velocity = match random.random_range(0..3) {
                    0 => format!("Constant({:?})", number(random)),
                    1 => format!("Uniform({})", interval(random)),
                    _ => format!("Normal({:?}, {:?})", number(random), positive(random)),
                };
                starts.push(format!(
                    "(joint: \"{coordinate}\", position: {position}, velocity: {velocity})"
                ));
            }
        }
        starts.join(", ")
    }
}

fn surface(random: &mut Stream) -> String {
    let friction = sometimes(2, random, |random| {
        format!("friction: {:?}", number(random).abs())
    });
    let restitution = sometimes(2, random, |random| {
        format!("restitution: {:?}", random.random::<f64>())
    });
    let groups = sometimes(4, random, |_| {
        "contype: 3, conaffinity: 4294967295".to_owned()
    });
    format!(", {friction}{restitution}{groups}")
}

fn geom(kind: &str, random: &mut Stream) -> String {
    match kind {
        "Ball" => format!(
            "Ball(center: {}, radius: {:?})",
            vector(random),
            positive(random)
        ),
        "Box" => format!(
            "Box(center: {}, half_size: ({:?}, {:?}), angle: {:?})",
            vector(random),
            positive(random),
            positive(random),
            number(random)
        ),
        "Capsule" => format!(
            "Capsule(from: {}, to: {}, radius: {:?})",
            vector(random),
            vector(random),
            positive(random)
        ),
        "Convex" => format!("Convex([(0.0, 0.0), (1.0, 0.0), {}])", vector(random)),
        "Polyline" => format!(
            "Polyline([{}, {}, (0.0, 1.0)])",
            vector(random),
            vector(random)
        ),
        _ => format!(
            "HalfSpace(point: {}, normal: (0.6, {:?}))",
            vector(random),
            number(random)
        ),
    }
}

/// A formula of a number.
fn formula(names: &[&str], depth: u32, random: &mut Stream) -> String {
    if depth == 0 {
        return match random.random_range(0..5) {
            0 => format!("{:?}", number(random).abs()),
            1 => one(&["pi", "degree"], random).to_owned(),
            _ => one(names, random).to_owned(),
        };
    }
    let mut part = || formula(names, depth - 1, random);
    let (x, y, z) = (part(), part(), part());
    match random.random_range(0..8) {
        0 | 1 => format!("({x} {} {y})", one(&["+", "-", "*", "/", "%"], random)),
        2 | 3 => {
            let functions = [
                "abs", "sqrt", "exp", "log", "sin", "cos", "tan", "tanh", "sign", "floor", "-",
            ];
            format!("{}({x})", one(&functions, random))
        }
        4 => format!("{}({x}, {y})", one(&["atan2", "min", "max", "pow"], random)),
        5 => format!("clamp({x}, {y}, {z})"),
        _ => format!(
            "if {} {{ {x} }} else {{ {y} }}",
            condition(names, depth - 1, random)
        ),
    }
}

/// A formula that is true or false.
fn condition(names: &[&str], depth: u32, random: &mut Stream) -> String {
    let (x, y) = (formula(names, depth, random), formula(names, 0, random));
    let comparison = format!(
        "({x} {} {y})",
        one(&["<", "<=", ">", ">=", "==", "!="], random)
    );
    match (depth, random.random_range(0..4)) {
        (1.., 0) => format!("{comparison} && {}", condition(names, depth - 1, random)),
        (1.., 1) => format!("{comparison} || !{}", condition(names, 0, random)),
        _ => comparison,
    }
}

/// Whether the task can run on exact equations.
pub(crate) fn has_analytic_model(task: &TaskDescription) -> bool {
    matches!(task, TaskDescription::Bodies(task) if task.analytic_model.is_some())
}

/// Plays a task unless a step would take long, because a valid file may ask for a very accurate or a
/// very large simulation.
pub(crate) fn play_if_affordable(task: &TaskDescription, steps: u32) {
    let is_affordable = match task {
        TaskDescription::Gymnasium(_) => unreachable!("generated tasks run no Python"),
        TaskDescription::Bodies(task) => {
            let solver = task.solver;
            let work = u64::from(solver.substeps)
                * u64::from(solver.solver_iterations)
                * u64::from(solver.contact_updates);
            work <= 1000
        }
        TaskDescription::Tabular(task) => task.model.state_count() <= 10_000,
    };
    if is_affordable {
        play(task, Physics::Rapier, steps);
    }
}

/// Plays two copies of a task with random actions. The state of a copy can be saved and restored,
/// and it can be drawn.
pub(crate) fn play(task: &TaskDescription, physics: Physics, steps: u32) {
    let mut environment = build(task, physics, 2).expect("the task was accepted");
    let mut random = stream(0, Purpose::Preview, 1, 0);
    for _ in 0..steps {
        for copy in 0..2 {
            if environment.statuses()[copy] != Status::Running {
                environment.reset(copy, &mut random);
            }
        }
        let actions = random_actions(&*environment, &mut random);
        environment.step(&actions);
        draw(&*environment);
    }
    let saved = environment.save(0);
    environment
        .restore(1, &saved)
        .expect("it is a state of this task");
    assert_eq!(environment.save(1), saved);
}

fn random_actions(environment: &dyn Environment, random: &mut Stream) -> Vec<f32> {
    let actions = &environment.spec().actions;
    let mut action = |choice: &Choice, [low, high]: [f32; 2]| match choice {
        Choice::Discrete(values) => random.random_range(0..values.len()) as f32,
        Choice::Continuous => random.random_range(low..=high),
    };
    let of_one_copy = || {
        actions
            .iter()
            .map(|component| (&component.choice, component.quantity.range))
    };
    of_one_copy()
        .chain(of_one_copy())
        .map(|(choice, range)| action(choice, range))
        .collect()
}

fn draw(environment: &dyn Environment) {
    if let Some(scene) = environment.scene() {
        let mut poses = vec![Pose::default(); scene.bodies.len()];
        environment.poses(0, &mut poses);
        environment.forces(0, &poses, &mut Vec::new());
    }
}
