//! What the physics cannot compute well is said: numbers far beyond their ranges, bodies that pass
//! surfaces, large ratios of masses, degenerate shapes.

use rand::RngExt;
use seedbed_env::description::BodyTask;
use seedbed_env::{Physics, PhysicsWarning, build_dynamics, load, parse, physics_warnings};
use seedbed_random::{Purpose, Stream, stream};

use crate::{build_bodies, parse_bodies, repository};

/// A double pendulum of point-like bodies on rods of 1 m, that of `lower` kg below that of 1 kg. Without
/// contacts it has impulse joints, else multibody joints.
fn double_pendulum(upper: f64, lower: f64, solver: &str, fields: &str) -> BodyTask {
    parse_bodies(
        "double_pendulum",
        format!(
            r#"Environment(
            description: "A test.", gravity: (0.0, -9.81), control_step: 0.02, time_limit: 1000, solver: {solver},
            bodies: [
                (name: "upper", mass: {upper}, com: (0.0, -1.0), inertia: {}, position: (0.0, 0.0)),
                (name: "lower", mass: {lower}, com: (0.0, -1.0), inertia: {}, position: (0.0, -1.0)),
            ],
            joints: [
                (name: "first", parent: "world", child: "upper", type: Hinge()),
                (name: "second", parent: "upper", child: "lower", type: Hinge()),
            ],
            {fields}
            actuators: [], sensors: [], observations: [], reward: "0",
        )"#,
            0.1 * upper,
            0.1 * lower,
        ),
    )
}

/// Accelerations of both absolute angles, for point masses at 1 m with moments of inertia of a tenth.
fn accelerations([m1, m2]: [f64; 2], [a, b, u, v]: [f64; 4]) -> [f64; 2] {
    let (i1, i2, g) = (0.1 * m1, 0.1 * m2, 9.81);
    let (c, s) = ((a - b).cos(), (a - b).sin());
    // M q̈ = f in the absolute angles a, b.
    let (m11, m12, m22) = (m1 + m2 + i1, m2 * c, m2 + i2);
    let f1 = -m2 * v * v * s - (m1 + m2) * g * a.sin();
    let f2 = m2 * u * u * s - m2 * g * b.sin();
    let det = m11 * m22 - m12 * m12;
    [(f1 * m22 - m12 * f2) / det, (m11 * f2 - m12 * f1) / det]
}

/// Angles of both joints after `seconds` from (0.5, 0.3), by the classic Runge–Kutta method.
fn exact(masses: [f64; 2], seconds: f64) -> [f64; 2] {
    let h = 1e-4;
    let mut state = [0.5, 0.8, 0.0, 0.0];
    let rate = |x: [f64; 4]| {
        let [u, v] = accelerations(masses, x);
        [x[2], x[3], u, v]
    };
    let ahead = |x: [f64; 4], k: [f64; 4], h: f64| std::array::from_fn(|i| x[i] + h * k[i]);
    for _ in 0..(seconds / h).round() as u32 {
        let k1 = rate(state);
        let k2 = rate(ahead(state, k1, h / 2.0));
        let k3 = rate(ahead(state, k2, h / 2.0));
        let k4 = rate(ahead(state, k3, h));
        state =
            std::array::from_fn(|i| state[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]));
    }
    [state[0], state[1] - state[0]]
}

fn error_after(task: &BodyTask, seconds: f64) -> f64 {
    let mut bodies = build_dynamics(task, Physics::Rapier, 1).unwrap();
    bodies.start(0, &[0.5, 0.3], &[0.0, 0.0]);
    (0..(seconds / 0.02).round() as u32).for_each(|_| bodies.step(&[]));
    let masses = [0, 1].map(|body| task.bodies[body].inertial.mass);
    let exact = exact(masses, seconds);
    let found = [0, 1].map(|joint| f64::from(bodies.coordinates().get(joint, 0).0));
    (found[0] - exact[0]).abs().max((found[1] - exact[1]).abs())
}

/// From the ratio on that `parameters.rs` says, the error of a double pendulum grows; the number of
/// iterations that the warning names removes it. The reference is the classic Runge–Kutta method.
#[test]
fn large_ratios_of_masses_are_reported_with_what_mends_them() {
    let usual = double_pendulum(1.0, 10.0, "(iterations: 4)", "");
    assert!(error_after(&usual, 1.0) < 0.006);
    assert_eq!(physics_warnings(&usual.into(), Physics::Rapier), [""; 0]);
    let heavy = double_pendulum(1.0, 100.0, "(iterations: 4)", "");
    assert!(error_after(&heavy, 1.0) > 0.1);
    assert_eq!(
        physics_warnings(&heavy.into(), Physics::Rapier),
        [
            "joint `second` holds 100 times the mass of body `upper`: with this solver joints yield from a ratio of 10 on \
             (a double pendulum is off by 0.06 rad after 1 s at 3 times that); expected `solver: (iterations: 19, …)`, or \
             more `passes`"
        ]
    );
    let mended = double_pendulum(1.0, 100.0, "(iterations: 19)", "");
    assert!(error_after(&mended, 1.0) < 0.006);
    assert_eq!(physics_warnings(&mended.into(), Physics::Rapier), [""; 0]);
    let exact = r"colliders: [(geom: Ball(center: (90.0, 0.0), radius: 1.0))],";
    let with_contacts = double_pendulum(1.0, 1000.0, "(iterations: 4)", exact);
    assert!(error_after(&with_contacts, 1.0) < 0.03);
    assert_eq!(
        physics_warnings(&with_contacts.into(), Physics::Rapier),
        [""; 0]
    );
}

/// A load of 1 kg slips at m g/kv = 0.0981 m/s from a winch that stands still, on an arm of this mass.
fn winch(arm: f64, solver: &str, further: &str) -> BodyTask {
    let text = format!(
        r#"Environment(
            description: "A test.", gravity: (0.0, -9.81), control_step: 0.1, time_limit: 100, solver: {solver}, {further}
            bodies: [
                (name: "arm", mass: {arm}, inertia: 0.1),
                (name: "load", mass: 1.0, inertia: 0.1, position: (0.0, -1.0)),
            ],
            joints: [
                (name: "swing", parent: "world", child: "arm", type: Hinge()),
                (name: "hoist", parent: "arm", child: "load", type: Slide(axis: (0.0, 1.0))),
            ],
            actuators: [(name: "winch", type: VelocityServo(joint: "hoist", kv: 100.0), control: Continuous(-0.5, 0.5))],
            sensors: [(name: "drop", type: JointPosition("hoist"))],
            observations: [(name: "drop", range: (-9.0, 9.0))],
            reward: "0",
        )"#
    );
    parse_bodies("winch", text)
}

/// Where servos of bodies that hang on each other do not hold, a warning says how many passes do.
#[test]
fn servos_on_chains_are_reported_with_what_mends_them() {
    let slip = |task: &BodyTask| {
        let mut bodies = build_dynamics(task, Physics::Rapier, 1).unwrap();
        bodies.start(0, &[0.0, 0.0], &[0.0, 0.0]);
        (0..10).for_each(|_| bodies.step(&[0.0]));
        f64::from(bodies.coordinates().get(1, 0).0) / -0.0981
    };
    for (arm, passes, mended_passes) in [(0.2, 1, 16), (10.0, 1, 4)] {
        let usual = winch(arm, &format!("(iterations: 4, passes: {passes})"), "");
        assert!(slip(&usual) > 3.0, "{}", slip(&usual));
        let expected = format!(
            "servo `winch` hardly holds joint `hoist` between two bodies: a load on it falls several times too fast, and \
             passes the ends of its range; expected `solver: (passes: {mended_passes}, …)` or more, or a collider in the \
             task, with which joints are exact"
        );
        assert_eq!(physics_warnings(&usual.into(), Physics::Rapier), [expected]);
        let mended = winch(
            arm,
            &format!("(iterations: 4, passes: {mended_passes})"),
            "",
        );
        assert!((0.95..1.15).contains(&slip(&mended)), "{}", slip(&mended));
        assert_eq!(physics_warnings(&mended.into(), Physics::Rapier), [""; 0]);
    }
    // Without `passes`, a task has those.
    for arm in [0.2, 10.0] {
        let usual = winch(arm, "(iterations: 4)", "");
        assert!((0.95..1.15).contains(&slip(&usual)), "{}", slip(&usual));
        assert_eq!(physics_warnings(&usual.into(), Physics::Rapier), [""; 0]);
    }
    let collider = "colliders: [(geom: Ball(center: (90.0, 0.0), radius: 1.0))],";
    let exact = winch(0.2, "(iterations: 4)", collider);
    assert!((0.95..1.05).contains(&slip(&exact)), "{}", slip(&exact));
    assert_eq!(physics_warnings(&exact.into(), Physics::Rapier), [""; 0]);
}

/// Bodies with moments of inertia of 1e-7 m r² move as points do; smaller ones are lost beside the mass. The
/// reference is the same task with joints of multibodies, whose accelerations do not depend on them. There is
/// also where a copy goes on whose bodies turn too fast, so that 1e-12 does no harm here.
#[test]
fn small_inertias_are_reported() {
    let angles = |inertia: f64, fields: &str| {
        let mut task = double_pendulum(1.0, 1.0, "(iterations: 4)", fields);
        task.bodies
            .iter_mut()
            .for_each(|body| body.inertial.inertia = inertia);
        let mut bodies = build_dynamics(&task, Physics::Rapier, 1).unwrap();
        bodies.start(0, &[0.5, 0.3], &[0.0, 0.0]);
        (0..50).for_each(|_| bodies.step(&[]));
        let warnings = physics_warnings(&task.into(), Physics::Rapier);
        (
            [0, 1].map(|joint| bodies.coordinates().get(joint, 0).0),
            warnings,
        )
    };
    let with_contacts = r"colliders: [(geom: Ball(center: (90.0, 0.0), radius: 1.0))],";
    let (exact, none) = angles(1e-12, with_contacts);
    let (near, none_either) = angles(1e-7, "");
    let (far, warnings) = angles(1e-12, "");
    let error = |angles: [f32; 2]| {
        (angles[0] - exact[0])
            .abs()
            .max((angles[1] - exact[1]).abs())
    };
    assert!(
        error(near) < 1e-3 && error(far) < 1e-3,
        "{near:?}, {far:?}, {exact:?}"
    );
    assert_eq!((none, none_either), (Vec::new(), Vec::new()));
    assert_eq!(
        warnings[0],
        "the inertia of body `upper`, 1.0e-12 kg m², is lost in single precision beside its mass at that distance from \
         joint `first`: expected at least 1.0e-8 kg m²"
    );
}

/// The first warning of a task of `envs/` in which a text is replaced.
fn changed(name: &str, from: &str, to: &str) -> String {
    let path = repository().join("envs").join(name);
    let text = std::fs::read_to_string(path).unwrap();
    assert!(text.contains(from), "{name} has no {from}");
    let description = parse("changed", "changed", text.replacen(from, to, 1)).unwrap();
    let warnings = physics_warnings(&description, Physics::Rapier);
    warnings.join("\n")
}

#[test]
fn motion_that_explodes_is_reported_with_its_place() {
    let warning = changed("cartpole.ron", "inertia: ", "inertia: 1e-30, // ");
    assert!(
        warning.contains("the inertia of body `pole`, 1.0e-30 kg m², is lost in single precision"),
        "{warning}"
    );
    let warning = changed(
        "double_pendulum_cart.ron",
        "control_step: 0.05",
        "control_step: 10",
    );
    assert!(warning.contains("has a period of"), "{warning}");
    assert!(
        warning.contains(", in step ") && warning.contains(", the velocity of"),
        "{warning}"
    );
    assert!(
        warning.contains("the physics cannot compute it; check masses"),
        "{warning}"
    );
}

#[test]
fn a_spring_that_is_too_stiff_for_the_substeps_is_reported() {
    let spring = |fields: &str| {
        let text = format!(
            r#"Environment(
            description: "A test.", gravity: (0.0, 0.0), control_step: 0.02, time_limit: 100,
            bodies: [(name: "bead", mass: 1.0, inertia: 1.0)],
            joints: [(name: "rail", parent: "world", child: "bead", type: Slide(axis: (1.0, 0.0)), {fields})],
            actuators: [], sensors: [], observations: [], reward: "0",
        )"#
        );
        physics_warnings(&parse_bodies("spring", text).into(), Physics::Rapier)
    };
    // √(k / m) times the substep of 5 ms: 0.1, and 1.
    assert_eq!(spring("stiffness: 400.0"), [""; 0]);
    assert_eq!(
        spring("stiffness: 40000.0"),
        [
            "the spring of joint `rail` has a period of 3.14e-2 s, too fast for substeps of 5.00e-3 s, which damp it away: \
             expected 2 times as many `solver.iterations`, or a shorter `control_step`"
        ]
    );
    // An overdamped one does not swing anyway.
    assert_eq!(spring("stiffness: 40000.0, damping: 400.0"), [""; 0]);
}

/// No task in `envs/` has a warning.
#[test]
fn the_physics_of_all_tasks_is_accurate() {
    let mut warnings = Vec::new();
    for folder in ["envs", "envs/mistakes", "crates/seedbed-env/tests/envs"] {
        for entry in repository().join(folder).read_dir().unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|extension| extension == "ron") {
                let description = load(&path).unwrap();
                let name = path.file_stem().unwrap().to_string_lossy().into_owned();
                let found = physics_warnings(&description, Physics::Rapier);
                warnings.extend(
                    found
                        .into_iter()
                        .map(|warning| format!("{name}: {warning}")),
                );
                if description.has_analytic_model() {
                    let found = physics_warnings(&description, Physics::Analytic);
                    warnings.extend(
                        found
                            .into_iter()
                            .map(|warning| format!("{name}, analytic: {warning}")),
                    );
                }
            }
        }
    }
    assert!(warnings.is_empty(), "{}", warnings.join("\n"));
}

/// A body that flies to the right along y = 0 toward x = 0, at 20 m/s from x = −1.
fn flight(mover: &str, obstacle: &str, fields: &str, restitution: f64) -> BodyTask {
    parse_bodies(
        "flight",
        format!(
            r#"Environment(
            description: "A test.", gravity: (0.0, 0.0), control_step: 0.02, time_limit: 1000,
            {obstacle}
            bodies: [(name: "ball", mass: 1.0, {fields} colliders: [(geom: {mover}, restitution: {restitution:?})]){}
            actuators: [], sensors: [], observations: [], reward: "0",
        )"#,
            if obstacle.contains("bodies") { "" } else { "]," },
        )
        .replace(")bodies:", "), bodies:"),
    )
}

const MOVERS: [&str; 4] = [
    "Ball(radius: 0.1)",
    "Capsule(from: (-0.1, 0.0), to: (0.1, 0.0), radius: 0.05)",
    "Box(half_size: (0.1, 0.1))",
    "Convex([(-0.1, -0.1), (0.1, -0.1), (0.0, 0.1)])",
];

const OBSTACLES: [&str; 4] = [
    "Box(half_size: (0.15, 5.0))",
    "Capsule(from: (0.0, -5.0), to: (0.0, 5.0), radius: 0.05)",
    "Polyline([(0.0, -5.0), (0.0, 5.0)])",
    "Convex([(-0.1, -5.0), (0.1, -5.0), (0.1, 5.0), (-0.1, 5.0)])",
];

/// Whether the body ends behind the obstacle, and the first warning.
fn fly(task: &BodyTask, start: f64, speed: f64, angle: f64) -> (bool, Option<PhysicsWarning>) {
    let mut environment = build_bodies(task, Physics::Rapier, 1);
    let names = environment.start_names().coordinates;
    let index = |name: &str| names.iter().position(|known| known == name).unwrap();
    let given = seedbed_env::GivenStart {
        positions: vec![(index("ball.x"), start), (index("ball.angle"), angle)],
        velocities: vec![(index("ball.x"), speed)],
        ..Default::default()
    };
    environment.reset_at(0, &mut stream(0, Purpose::Reset, 0, 0), &given);
    for _ in 0..20 {
        environment.step(&[]);
    }
    let positions = environment.coordinates(0).positions;
    (
        positions[index("ball.x")].1 * -start.signum() > 0.0,
        environment.physics_warning(0),
    )
}

/// Starts at distances that differ within a step, and turned.
fn starts(random: &mut Stream) -> (f64, f64, f64) {
    // A line can be touched from its right-hand side: all come from there.
    (
        random.random_range(1.0..1.5),
        -random.random_range(5.0..60.0),
        random.random_range(-3.0..3.0),
    )
}

#[test]
fn whoever_passes_a_wall_is_reported_and_ccd_keeps_it_out() {
    let mut random = stream(5, Purpose::Trial, 0, 0);
    let (mut passed, mut silent, mut false_alarms, mut leaks) =
        (0, Vec::new(), Vec::new(), Vec::new());
    for obstacle in OBSTACLES {
        for mover in MOVERS {
            for restitution in [0.0, 0.5] {
                let wall = format!("colliders: [(name: \"wall\", geom: {obstacle})],");
                let free = flight(mover, &wall, "", restitution);
                let held = flight(mover, &wall, "ccd: true,", restitution);
                for _ in 0..20 {
                    let (start, speed, angle) = starts(&mut random);
                    let case = format!("{mover} {obstacle} {restitution} {start} {speed} {angle}");
                    let (is_behind, warning) = fly(&free, start, speed, angle);
                    passed += u32::from(is_behind);
                    if is_behind && warning.is_none() {
                        silent.push(case.clone());
                    } else if !is_behind && warning.is_some() {
                        false_alarms.push(format!("{case} {warning:?}"));
                    }
                    let (is_behind, warning) = fly(&held, start, speed, angle);
                    if is_behind || warning.is_some() {
                        leaks.push(format!("{case} {is_behind} {warning:?}"));
                    }
                }
            }
        }
    }
    assert!(passed > 100);
    let none: [String; 0] = [];
    assert_eq!(
        (&silent[..], &false_alarms[..], &leaks[..]),
        (&none[..], &none[..], &none[..])
    );
}

const SHAPES: &str = r#"Environment(
    description: "A test.", gravity: (0.0, -9.8), control_step: 0.02, time_limit: 200,
    colliders: [(geom: WORLD)],
    bodies: [(name: "puck", mass: MASS, INERTIA geoms: [DRAWN], colliders: [(geom: SHAPE)])],
    scenery: [DRAWN], actuators: [], sensors: [(name: "x", type: JointPosition("puck.x"))], observations: [], reward: "0",
)"#;

/// A number that is small, large, degenerate or usual.
fn number(random: &mut Stream) -> String {
    let usual = ["0.0", "-0.0", "0.1", "1.0", "-1.0", "0.3", "1e-3", "1e3"];
    let unusual = [
        "1e-6",
        "2e-6",
        "1e-7",
        "1e-30",
        "1e-38",
        "1e-45",
        "1e6",
        "-1e6",
        "999999.9",
        "1e7",
        "1e30",
        "3e38",
        "1e39",
        "1e300",
        "1e400",
        "NaN",
        "inf",
        "-inf",
        "0.1000001",
        "0.10000001",
        "1.1754944e-38",
        "123456.78",
    ];
    let list: &[&str] = if random.random_bool(0.94) {
        &usual
    } else {
        &unusual
    };
    list[random.random_range(0..list.len())].to_owned()
}

fn point(random: &mut Stream) -> String {
    format!("({}, {})", number(random), number(random))
}

fn points(random: &mut Stream) -> String {
    let pool: Vec<_> = (0..3).map(|_| point(random)).collect();
    let count = random.random_range(0..7);
    let points = (0..count).map(|_| match random.random_range(0..3) {
        0 => pool[random.random_range(0..pool.len())].clone(),
        _ => point(random),
    });
    points.collect::<Vec<_>>().join(", ")
}

fn geom(random: &mut Stream) -> String {
    let mut next = || number(random);
    let (a, b, c, d) = (next(), next(), next(), next());
    let at = point(random);
    match random.random_range(0..7) {
        0 => format!("Ball(center: {at}, radius: {a})"),
        1 => format!("Box(center: {at}, half_size: ({a}, {b}), angle: {c})"),
        2 => format!("Capsule(from: {at}, to: {}, radius: {a})", point(random)),
        3 => format!("Capsule(from: {at}, to: {at}, radius: {a})"),
        4 => format!("Polyline([{}])", points(random)),
        5 => format!("HalfSpace(point: {at}, normal: ({c}, {d}))"),
        _ => format!("Convex([{}])", points(random)),
    }
}

/// Whatever shapes a file has: it is refused with a place, or its task can be computed.
#[test]
fn degenerate_shapes_never_panic() {
    let seed = std::env::var("SEEDBED_FUZZ_SEED").map_or(1, |seed| seed.parse().unwrap());
    let count = std::env::var("SEEDBED_FUZZ_COUNT").map_or(3000, |count| count.parse().unwrap());
    let mut random = stream(seed, Purpose::Trial, 1, 0);
    let mut accepted = 0;
    for _ in 0..count {
        let mut text = SHAPES
            .replace("WORLD", &geom(&mut random))
            .replace("SHAPE", &geom(&mut random));
        text = text
            .replace("DRAWN", &geom(&mut random))
            .replace("MASS", &number(&mut random));
        let inertia = if random.random_bool(0.5) {
            String::new()
        } else {
            format!("inertia: {},", number(&mut random))
        };
        text = text.replace("INERTIA", &inertia);
        match parse("shapes", "shapes.ron", text.clone()) {
            Err(error) => assert!(error.position.is_some(), "{error}\n{text}"),
            Ok(description) => {
                accepted += 1;
                let warnings = physics_warnings(&description, Physics::Rapier);
                if let Some(failure) = warnings
                    .iter()
                    .find(|warning| warning.contains("engine fails"))
                {
                    panic!("{failure}\n{text}");
                }
            }
        }
    }
    assert!(accepted > count / 100, "{accepted}");
}
