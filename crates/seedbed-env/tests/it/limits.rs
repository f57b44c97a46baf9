//! What the physics cannot compute well is said: numbers far beyond their ranges, bodies that pass
//! surfaces, large ratios of masses, degenerate shapes.

use rand::RngExt;
use seedbed_env::description::BodyTask;
use seedbed_env::random::{Purpose, Stream, stream};
use seedbed_env::{Physics, PhysicsWarning, build_dynamics, load, parse, physics_warnings};

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

#[test]
#[ignore = "a measurement"]
fn measure_the_cost_of_ccd() {
    for mover in MOVERS {
        for fields in ["", "ccd: true,"] {
            let walls = r#"colliders: [
                (geom: Box(center: (-1.0, 0.0), half_size: (0.15, 5.0))), (geom: Box(center: (1.0, 0.0), half_size: (0.15, 5.0))),
            ],"#;
            let task = flight(mover, walls, fields, 1.0);
            let mut bodies = build_dynamics(&task, Physics::Rapier, 1).unwrap();
            bodies.start(0, &[0.0, 0.0, 0.3], &[2.0, 0.0, 0.0]);
            let begin = std::time::Instant::now();
            (0..50_000).for_each(|_| bodies.step(&[]));
            println!(
                "{mover} {fields} {:.2} µs per step",
                begin.elapsed().as_secs_f64() * 20.0
            );
        }
    }
}

#[test]
#[ignore = "a measurement"]
fn measure_inertias() {
    for inertia in [1e-1, 1e-3, 1e-5, 1e-7, 1e-9, 1e-12, 1e-20, 1e-30] {
        for (name, fields) in [
            ("impulse", ""),
            (
                "multibody",
                r#"colliders: [(geom: Ball(center: (90.0, 0.0), radius: 1.0))],"#,
            ),
        ] {
            let mut task = double_pendulum(1.0, 1.0, "(iterations: 4)", fields);
            for body in &mut task.bodies {
                body.inertial.inertia = inertia;
            }
            let mut bodies = build_dynamics(&task, Physics::Rapier, 1).unwrap();
            bodies.start(0, &[0.5, 0.3], &[0.0, 0.0]);
            (0..50).for_each(|_| bodies.step(&[]));
            let row = [0, 1].map(|joint| bodies.coordinates().get(joint, 0).0);
            println!("{name} {inertia:e}: {row:?}");
        }
    }
    // A rope of 1 m holds a ball that flies away.
    for speed in [1.0, 5.0, 20.0, 60.0, 200.0] {
        for mass in [1.0, 100.0] {
            let task = parse_bodies(
                "rope",
                format!(
                    r#"Environment(
                description: "A test.", gravity: (0.0, 0.0), control_step: 0.02, time_limit: 1000,
                bodies: [(name: "ball", mass: {mass}, inertia: 0.1)], ropes: [(name: "leash", from: (body: "world"), to: (body: "ball"), length: 1.0)],
                actuators: [], sensors: [], observations: [], reward: "0",
            )"#
                ),
            );
            let mut bodies = build_dynamics(&task, Physics::Rapier, 1).unwrap();
            bodies.start(0, &[0.5, 0.0, 0.0], &[speed, 0.0, 0.0]);
            let mut longest = 0.0_f32;
            for _ in 0..100 {
                bodies.step(&[]);
                let [x, y] = [0, 1].map(|axis| bodies.coordinates().get(axis, 0).0);
                longest = longest.max(x.hypot(y));
            }
            println!("rope {speed} {mass}: {longest}");
        }
    }
}

#[test]
#[ignore = "a measurement"]
fn measure_mass_ratios() {
    for (name, fields) in [
        ("impulse", ""),
        (
            "multibody",
            r#"colliders: [(geom: Ball(center: (90.0, 0.0), radius: 1.0))],"#,
        ),
    ] {
        for (substeps, passes) in [(4, 1), (4, 4), (4, 16), (16, 1), (16, 4), (16, 16), (64, 4)] {
            let mut row = String::new();
            for ratio in [
                0.01, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 1000.0, 1e4, 1e6,
            ] {
                let solver = format!("(iterations: {substeps}, passes: {passes})");
                let task = double_pendulum(1.0, ratio, &solver, fields);
                row += &format!(" {ratio}: {:.4}", error_after(&task, 1.0));
            }
            println!("{name} {substeps} {passes}:{row}");
        }
    }
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
    println!(
        "{passed} passed; silent {}, false {}, leaks {}",
        silent.len(),
        false_alarms.len(),
        leaks.len()
    );
    for list in [&silent, &false_alarms, &leaks] {
        println!(
            "{}\n",
            list.iter().take(12).cloned().collect::<Vec<_>>().join("\n")
        );
    }
    assert!(passed > 100);
    assert!(silent.is_empty() && false_alarms.is_empty() && leaks.is_empty());
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
    let (mut accepted, mut failing) = (0, 0);
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
                    failing += 1;
                    println!("{failure}\n{text}");
                }
            }
        }
    }
    println!("{accepted} of {count} accepted, {failing} fail");
    assert!(accepted > count / 100, "{accepted}");
    assert_eq!(failing, 0);
}
