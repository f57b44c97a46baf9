//! Joints and free bodies that turn fast or far, and joints at the ends of their ranges, against
//! closed forms: with and without contacts, at several speeds, control steps and substeps.

use std::f64::consts::TAU;

use seedbed_env::description::BodyTask;
use seedbed_env::dynamics::Dynamics;
use seedbed_env::random::{Purpose, stream};
use seedbed_env::{GivenStart, Physics, build_dynamics};

use crate::{build_bodies, parse_bodies};

/// Control steps (s) and substeps.
const STEPS: [(f64, &str, f64); 5] = [
    (0.05, "iterations: 4", 4.0),
    (0.05, "iterations: 1", 1.0),
    (0.02, "iterations: 5, passes: 2", 5.0),
    (0.2, "iterations: 32", 32.0),
    (0.05, "iterations: 2, searches: 3", 2.0),
];

const HINGES: [&str; 2] = ["Hinge()", "Hinge(positive: Clockwise)"];

const SLIDES: [&str; 3] = [
    "Slide(axis: (1.0, 0.0))",
    "Slide(axis: (0.0, -1.0))",
    "Slide(axis: (0.8, 0.6))",
];

const RATES: [f64; 8] = [0.7, 5.0, 10.0, 30.0, 70.0, -80.0, 500.0, -3000.0];

const PUSH: &str =
    r#"(name: "push", type: JointForce("joint"), control: Continuous(-1000.0, 1000.0))"#;

/// A weightless body of 2 kg and 0.1 kg m² on one joint, with contacts if it has a collider.
#[derive(Clone, Copy)]
struct Rig<'a> {
    kind: &'a str,
    has_collider: bool,
    fields: &'a str,
    actuators: &'a str,
    control_step: f64,
    solver: &'a str,
}

impl Rig<'_> {
    fn task(&self) -> BodyTask {
        let Self {
            kind,
            fields,
            actuators,
            control_step,
            solver,
            ..
        } = self;
        let collider = if self.has_collider {
            "colliders: [(geom: Ball(radius: 0.1))]"
        } else {
            ""
        };
        parse_bodies(
            "rig",
            format!(
                r#"Environment(
                description: "A body on a joint.", gravity: (0.0, 0.0), control_step: {control_step}, time_limit: 100000,
                solver: ({solver}),
                bodies: [(name: "body", mass: 2.0, inertia: 0.1, {collider})],
                joints: [(name: "joint", parent: "world", child: "body", type: {kind}, {fields})],
                actuators: [{actuators}], sensors: [(name: "q", type: JointPosition("joint"))],
                observations: [(name: "q", range: (-1.0, 1.0))], reward: "q - previous(q)",
            )"#
            ),
        )
    }

    fn start(&self, position: f64, velocity: f64) -> Box<dyn Dynamics> {
        let mut bodies = rigid_bodies(&self.task(), 1);
        bodies.start(0, &[position], &[velocity]);
        bodies
    }

    fn describe(&self) -> String {
        let Self {
            kind,
            fields,
            control_step,
            solver,
            has_collider,
            ..
        } = self;
        format!("{kind} {fields} {control_step} s ({solver}), collider: {has_collider}")
    }
}

/// A rig of each kind, engine, and control step.
fn rigs(kinds: &'static [&'static str]) -> impl Iterator<Item = (Rig<'static>, f64)> {
    kinds.iter().flat_map(|kind| {
        [false, true].into_iter().flat_map(move |has_collider| {
            STEPS
                .into_iter()
                .map(move |(control_step, solver, substeps)| {
                    let rig = Rig {
                        kind,
                        has_collider,
                        fields: "",
                        actuators: "",
                        control_step,
                        solver,
                    };
                    let searches = if has_collider && solver.contains("searches") {
                        3.0
                    } else {
                        1.0
                    };
                    (rig, control_step / substeps / searches)
                })
        })
    })
}

fn rigid_bodies(task: &BodyTask, copies: usize) -> Box<dyn Dynamics> {
    build_dynamics(task, Physics::Rapier, copies).expect("every task has rigid bodies")
}

fn state(bodies: &dyn Dynamics, index: usize) -> (f64, f64) {
    let (position, velocity) = bodies.coordinates().get(index, 0);
    (position.into(), velocity.into())
}

fn assert_none(failures: &[String]) {
    assert!(
        failures.is_empty(),
        "{} failures:\n{}",
        failures.len(),
        failures.join("\n")
    );
}

/// The largest share by which an angle may be off: up to 1/16 rad per substep, a body in a world
/// without contacts turns by arctan(ω h) instead of ω h. Sums of f32 are off by less than 1e-5.
fn turn_error(rate: f64, substep: f64) -> f64 {
    let turn = (rate * substep).abs();
    1e-5 + if turn > 1.0 / 16.0 {
        0.0
    } else {
        turn * turn / 3.0
    }
}

#[test]
fn a_free_wheel_turns_by_its_rate() {
    let mut failures = Vec::new();
    for (rig, substep) in rigs(&HINGES) {
        for rate in RATES {
            let mut bodies = rig.start(0.3, rate);
            (0..20).for_each(|_| bodies.step(&[]));
            let (angle, end_rate) = state(&*bodies, 0);
            let expected = rate * 20.0 * rig.control_step;
            if (angle - 0.3 - expected).abs() > 1e-5 + turn_error(rate, substep) * expected.abs()
                || (end_rate - rate).abs() > 1e-5 * rate.abs()
            {
                failures.push(format!(
                    "{} at {rate} rad/s: {angle}, expected {}; {end_rate}",
                    rig.describe(),
                    expected + 0.3
                ));
            }
        }
    }
    assert_none(&failures);
}

/// A free body, alone and as the root of a chain.
#[test]
fn a_free_body_turns_by_its_rate() {
    let mut failures = Vec::new();
    for arm in [
        "",
        r#"(name: "arm", parent: "stone", child: "other", type: Hinge()),"#,
    ] {
        for collider in ["", "colliders: [(geom: Ball(radius: 0.1))]"] {
            for (control_step, solver, substeps) in STEPS {
                for rate in RATES {
                    let other = if arm.is_empty() {
                        ""
                    } else {
                        r#"(name: "other", mass: 1.0, inertia: 0.1)"#
                    };
                    let task = parse_bodies(
                        "stone",
                        format!(
                            r#"Environment(
                            description: "A stone.", gravity: (0.0, -9.8), control_step: {control_step}, time_limit: 100000,
                            solver: ({solver}),
                            bodies: [(name: "stone", mass: 2.0, inertia: 0.1, com: (0.0, 0.0), {collider}), {other}],
                            joints: [{arm}], actuators: [], sensors: [], observations: [], reward: "0",
                        )"#
                        ),
                    );
                    let mut bodies = rigid_bodies(&task, 1);
                    let joints = task.joints.len();
                    let mut positions = vec![0.0; task.coordinate_count()];
                    let mut velocities = positions.clone();
                    (positions[joints + 2], velocities[joints + 2]) = (20.0, rate);
                    bodies.start(0, &positions, &velocities);
                    (0..20).for_each(|_| bodies.step(&[]));
                    let (angle, _) = state(&*bodies, joints + 2);
                    let expected = rate * 20.0 * control_step;
                    let searches = if solver.contains("searches") {
                        3.0
                    } else {
                        1.0
                    };
                    let error = turn_error(rate, control_step / substeps / searches);
                    // A sum of f32 near 20 rad is off by at most 1e-6 rad per substep.
                    let rounding = 20.0 * substeps * searches * 1e-6;
                    if (angle - 20.0 - expected).abs() > 5e-5 + rounding + error * expected.abs() {
                        failures.push(format!(
                            "{arm} {collider} {solver} {rate}: {angle}, expected {}",
                            expected + 20.0
                        ));
                    }
                }
            }
        }
    }
    assert_none(&failures);
}

/// Two balanced discs on one axle turn independently; the second angle is relative to the first.
#[test]
fn each_hinge_of_a_chain_turns_by_its_own_rate() {
    let mut failures = Vec::new();
    for collider in ["", "colliders: [(geom: Ball(radius: 0.1))]"] {
        for rates in [[40.0, -70.0], [-3.0, 100.0], [2.0, 3.0], [90.0, -90.0]] {
            let task = parse_bodies(
                "discs",
                format!(
                    r#"Environment(
                    description: "Discs.", gravity: (0.0, -9.8), control_step: 0.05, time_limit: 100000, solver: (iterations: 4, passes: 4),
                    bodies: [(name: "one", mass: 2.0, inertia: 0.1, com: (0.0, 0.0), {collider}), (name: "two", mass: 1.0, inertia: 0.05, com: (0.0, 0.0))],
                    joints: [
                        (name: "first", parent: "world", child: "one", type: Hinge(positive: Clockwise)),
                        (name: "second", parent: "one", child: "two", type: Hinge()),
                    ],
                    actuators: [], sensors: [], observations: [], reward: "0",
                )"#
                ),
            );
            let mut bodies = rigid_bodies(&task, 1);
            bodies.start(0, &[0.0, 7.0], &rates);
            (0..20).for_each(|_| bodies.step(&[]));
            for (index, start) in [(0, 0.0), (1, 7.0)] {
                let (angle, rate) = state(&*bodies, index);
                let expected = start + rates[index];
                if (angle - expected).abs() > 2e-3 * (expected.abs() + 1.0)
                    || (rate - rates[index]).abs() > 1e-3
                {
                    failures.push(format!(
                        "{collider} {rates:?}: {index}: {angle} at {rate}, expected {expected}"
                    ));
                }
            }
        }
    }
    assert_none(&failures);
}

/// Rewards that are differences of an angle add up to the angle.
#[test]
fn rewards_add_up_to_the_angle() {
    for has_collider in [false, true] {
        let rig = Rig {
            kind: HINGES[0],
            has_collider,
            fields: "",
            actuators: "",
            control_step: 0.05,
            solver: "iterations: 4",
        };
        let mut environment = build_bodies(&rig.task(), Physics::Rapier, 1);
        let start = GivenStart {
            positions: vec![(0, 50.0)],
            velocities: vec![(0, 70.0)],
            episode_numbers: vec![],
        };
        environment.reset_at(0, &mut stream(0, Purpose::Reset, 0, 0), &start);
        assert_eq!(environment.observations(), [50.0]);
        let mut sum = 0.0;
        for _ in 0..20 {
            environment.step(&[]);
            sum += environment.rewards()[0];
        }
        assert!((sum - 70.0).abs() < 1e-3, "{sum}");
        assert!((environment.observations()[0] - 120.0).abs() < 1e-3);
    }
}

#[allow(clippy::approx_constant, reason = "a range of nearly a full turn")]
const RANGES: [[f64; 2]; 9] = [
    [-1.0, 0.5],
    [0.0, 6.28],
    [0.0, TAU],
    [-3.0, 3.0],
    [-2.7, 2.7],
    [-10.0, 10.0],
    [0.0, 1000.0],
    [-1e9, 2.0],
    [95.0, 97.0],
];

/// A joint passes an end by at most what it moves in a substep, and bounces with at most a fifth of its
/// speed. Pushed against an end, it comes to rest there.
#[test]
fn ends_hold_at_any_range_and_speed() {
    let mut failures = Vec::new();
    for (rig, substep) in rigs(&HINGES).chain(rigs(&SLIDES)) {
        for [low, high] in RANGES {
            for rate in [0.7, 5.0, 30.0, -80.0, 500.0, -3000.0] {
                // An angle of 1e9 rad changes by 64 rad at least.
                if rate < 0.0 && low < -1e6 {
                    continue;
                }
                for push in [0.0, 5.0] {
                    let fields = format!("range: ({low:?}, {high:?})");
                    let rig = Rig {
                        fields: &fields,
                        actuators: PUSH,
                        ..rig
                    };
                    let start = if rate > 0.0 {
                        (high - 1.0).max(low)
                    } else {
                        (low + 1.0).min(high)
                    };
                    let force = (push * rate.signum()) as f32;
                    let mut bodies = rig.start(start, rate);
                    let mut passed = 0.0_f64;
                    for _ in 0..100 {
                        bodies.step(&[force]);
                        let (position, _) = state(&*bodies, 0);
                        passed = passed.max(position - high).max(low - position);
                    }
                    let (position, velocity) = state(&*bodies, 0);
                    let end = if rate > 0.0 { high } else { low };
                    // The push adds to the speed within the range of 1.
                    let speed = rate.abs() + 4.0 * f64::from(push > 0.0) * (50.0_f64 * 2.0).sqrt();
                    let tolerance = 1e-3 + 1e-6 * end.abs();
                    let resolution = 1e-7 * end.abs() / substep;
                    let is_far = passed > speed * substep * 1.01 + tolerance;
                    let is_fast = velocity.abs() > 0.2 * speed;
                    let ends_beyond =
                        position < low - tolerance - 0.2 || position > high + tolerance + 0.2;
                    let is_not_at_rest = push > 0.0
                        && (velocity.abs() > 1e-3 + resolution
                            || (position - end).abs() > 50.0 * substep * substep + tolerance);
                    if is_far || is_fast || ends_beyond || is_not_at_rest {
                        failures.push(format!("{} at {rate}, push {push}: passed {passed} ({}), {position} at {velocity}", rig.describe(), speed * substep));
                    }
                }
            }
        }
    }
    assert_none(&failures);
}

/// While a joint is pressed on an end, its velocity is 0 after every step.
#[test]
fn a_joint_that_rests_on_an_end_has_no_velocity() {
    let mut failures = Vec::new();
    for (rig, substep) in rigs(&HINGES).chain(rigs(&SLIDES)) {
        for push in [0.3_f64, -5.0, 50.0] {
            let rig = Rig {
                fields: "range: (-1.0, 0.5)",
                actuators: PUSH,
                ..rig
            };
            let end = if push > 0.0 { 0.5 } else { -1.0 };
            let mut bodies = rig.start(end, 0.0);
            for step in 0..60 {
                bodies.step(&[push as f32]);
                let (position, velocity) = state(&*bodies, 0);
                let acceleration = push.abs()
                    / if rig.kind.starts_with("Hinge") {
                        0.1
                    } else {
                        2.0
                    };
                if step > 40
                    && (velocity.abs() > 1e-4 * acceleration
                        || (position - end).abs() > acceleration * substep * substep + 1e-4)
                {
                    failures.push(format!(
                        "{} push {push}: {position} at {velocity}",
                        rig.describe()
                    ));
                }
            }
        }
    }
    assert_none(&failures);
}

/// J q̈ = kp (target − q) − kv q̇ and kv (target − q̇): a position servo reaches a target of several
/// turns, a velocity servo its speed.
#[test]
fn servos_drive_to_any_angle_and_speed() {
    let mut failures = Vec::new();
    let position = r#"(name: "aim", type: PositionServo(joint: "joint", kp: 10.0, kv: 2.0), gear: 2.0, control: Continuous(-100.0, 100.0))"#;
    let velocity = r#"(name: "go", type: VelocityServo(joint: "joint", kv: 5.0), control: Continuous(-100.0, 100.0))"#;
    let speed = r#"(name: "go", type: SpeedMotor(joint: "joint", speed: 80.0, max_force: 1000.0), control: Continuous(-1.0, 1.0))"#;
    for (rig, _) in rigs(&HINGES) {
        for control in [0.5, 1.5, -3.1, 10.0, -40.0] {
            let rig = Rig {
                actuators: position,
                ..rig
            };
            let mut bodies = rig.start(-4.0, 0.0);
            (0..400).for_each(|_| bodies.step(&[control as f32]));
            let (angle, rate) = state(&*bodies, 0);
            if (angle - 2.0 * control).abs() > 1e-2 || rate.abs() > 1e-2 {
                failures.push(format!(
                    "{} to {}: {angle} at {rate}",
                    rig.describe(),
                    2.0 * control
                ));
            }
        }
        for (actuators, control) in [(velocity, 80.0), (velocity, -33.0), (speed, 1.0)] {
            let expected = if control == 1.0 { 80.0 } else { control };
            let rig = Rig { actuators, ..rig };
            let mut bodies = rig.start(0.0, expected);
            (0..20).for_each(|_| bodies.step(&[control as f32]));
            let (angle, rate) = state(&*bodies, 0);
            let turned = expected * 20.0 * rig.control_step;
            if (angle - turned).abs() > 2e-3 * turned.abs()
                || (rate - expected).abs() > 1e-3 * expected.abs()
            {
                failures.push(format!(
                    "{} at {expected}: {angle}, expected {turned}; {rate}",
                    rig.describe()
                ));
            }
        }
    }
    assert_none(&failures);
}

/// q = q₀ + (q(0) − q₀) cos √(k / J) t: a spring whose rest is several turns away pulls the whole way.
#[test]
fn a_spring_pulls_over_several_turns() {
    for has_collider in [false, true] {
        for kind in HINGES {
            let rig = Rig {
                kind,
                has_collider,
                fields: "stiffness: 0.1, springref: 30.0",
                actuators: "",
                control_step: 0.01,
                solver: "iterations: 64",
            };
            let mut bodies = rig.start(-5.0, 0.0);
            for step in 1..=300 {
                bodies.step(&[]);
                let expected = 30.0 - 35.0 * (0.01 * f64::from(step)).cos();
                let (angle, _) = state(&*bodies, 0);
                assert!(
                    (angle - expected).abs() < 0.02,
                    "{kind} {has_collider} {step}: {angle}, expected {expected}"
                );
            }
        }
    }
}

/// The bits of a copy do not depend on the number of copies, on the others' speeds, or on being
/// saved and restored.
#[test]
fn fast_copies_are_independent() {
    for fields in ["", "range: (-10.0, 10.0)", "stiffness: 0.5"] {
        for has_collider in [false, true] {
            let rig = Rig {
                kind: HINGES[1],
                has_collider,
                fields,
                actuators: PUSH,
                control_step: 0.05,
                solver: "iterations: 4",
            };
            let rates = [70.0, 0.5, 12.0, -300.0, 6.0, 6.3];
            let mut together = rigid_bodies(&rig.task(), rates.len());
            (0..rates.len()).for_each(|copy| together.start(copy, &[0.1], &[rates[copy]]));
            let mut alone: Vec<_> = rates.iter().map(|&rate| rig.start(0.1, rate)).collect();
            for step in 0..40 {
                let push = (f64::from(step) * 0.3).sin() as f32;
                together.step(&vec![push; rates.len()]);
                for (copy, single) in alone.iter_mut().enumerate() {
                    single.step(&[push]);
                    if step % 7 == 3 {
                        let saved = single.save(0);
                        *single = rigid_bodies(&rig.task(), 1);
                        single.restore(0, &saved).unwrap();
                    }
                    let (one, other) = (
                        single.coordinates().get(0, 0),
                        together.coordinates().get(0, copy),
                    );
                    assert_eq!(
                        (one.0.to_bits(), one.1.to_bits()),
                        (other.0.to_bits(), other.1.to_bits()),
                        "{fields} {has_collider} {step} {copy}"
                    );
                }
            }
        }
    }
}

/// A start beyond a turn and outside of the range is brought back to the nearest end.
#[test]
fn a_start_outside_of_its_range_is_brought_back() {
    for (rig, _) in rigs(&HINGES).chain(rigs(&SLIDES)) {
        for start in [20.0, -7.0] {
            let rig = Rig {
                fields: "range: (-1.0, 0.5), damping: 0.5",
                ..rig
            };
            let mut bodies = rig.start(start, 0.0);
            (0..400).for_each(|_| bodies.step(&[]));
            let (position, velocity) = state(&*bodies, 0);
            assert!(
                (-1.01..0.51).contains(&position) && velocity.abs() < 0.05,
                "{} from {start}: {position} at {velocity}",
                rig.describe()
            );
        }
    }
}

/// A rod that whirls about its end keeps its energy, over and under the speed at which its steps are
/// computed with multibodies.
#[test]
fn a_whirling_rod_keeps_its_energy() {
    for (start, collider) in [(9.0, ""), (12.0, ""), (25.0, ""), (9.0, "c"), (25.0, "c")] {
        let collider = if collider.is_empty() {
            ""
        } else {
            "colliders: [(geom: Ball(radius: 0.01))]"
        };
        let task = parse_bodies(
            "rod",
            format!(
                r#"Environment(
                description: "A rod.", gravity: (0.0, -9.8), control_step: 0.05, time_limit: 100000, solver: (iterations: 8),
                bodies: [(name: "rod", mass: 1.0, com: (0.0, -0.5), inertia: 0.0833333333, {collider})],
                joints: [(name: "pivot", parent: "world", child: "rod", type: Hinge())],
                actuators: [], sensors: [], observations: [], reward: "0",
            )"#
            ),
        );
        let mut bodies = rigid_bodies(&task, 1);
        bodies.start(0, &[0.0], &[start]);
        let energy = |(angle, rate): (f64, f64)| rate * rate / 6.0 - 4.9 * angle.cos();
        let before = energy(state(&*bodies, 0));
        let mut worst = 0.0_f64;
        for _ in 0..400 {
            bodies.step(&[]);
            worst = worst.max((energy(state(&*bodies, 0)) - before).abs());
        }
        assert!(
            worst < 0.02 * before.abs() + 0.1,
            "{start} {collider}: {worst} of {before}"
        );
    }
}

/// A servo that drives beyond an end is held at most the distance beyond that its force moves the joint in a
/// substep, at rest.
#[test]
fn an_end_holds_a_servo() {
    let mut failures = Vec::new();
    // With the force at the end, N or N m, where the control is the end plus 3.
    let servos = [
        (r#"PositionServo(joint: "joint", kp: 10.0, kv: 2.0)"#, 30.0),
        (
            r#"PositionServo(joint: "joint", kp: 200.0, kv: 1.0)"#,
            600.0,
        ),
        (r#"VelocityServo(joint: "joint", kv: 5.0)"#, 0.0),
        (r#"VelocityServo(joint: "joint", kv: 500.0)"#, 0.0),
        (
            r#"SpeedMotor(joint: "joint", speed: 8.0, max_force: 5.0)"#,
            0.0,
        ),
        (
            r#"SpeedMotor(joint: "joint", speed: 80.0, max_force: 1000.0)"#,
            0.0,
        ),
    ];
    for (rig, substep) in rigs(&HINGES).chain(rigs(&SLIDES)) {
        for (servo, force) in servos {
            for [low, high] in [[-1.0, 0.5], [0.0, 6.28], [-10.0, 10.0]] {
                let actuator =
                    format!("(name: \"drive\", type: {servo}, control: Continuous(-100.0, 100.0))");
                let fields = format!("range: ({low:?}, {high:?})");
                let rig = Rig {
                    actuators: &actuator,
                    fields: &fields,
                    ..rig
                };
                let mut bodies = rig.start(high - 0.5, 0.0);
                (0..200).for_each(|_| bodies.step(&[(high + 3.0) as f32]));
                let (position, velocity) = state(&*bodies, 0);
                let inertia = if rig.kind.starts_with("Hinge") {
                    0.1
                } else {
                    2.0
                };
                let tolerance = 0.01 + force / inertia * substep * substep;
                if (position - high).abs() > tolerance || velocity.abs() > 0.01 {
                    failures.push(format!(
                        "{} {servo}: {position} at {velocity}",
                        rig.describe()
                    ));
                }
            }
        }
    }
    assert_none(&failures);
}

/// A chain that hangs on hard ends is at rest. With contacts, the passes over both ends leave up to 0.05 rad/s
/// inward of the 0.1 rad/s that gravity gives in a substep.
#[test]
fn a_chain_that_hangs_on_ends_has_no_velocity() {
    for collider in ["", "colliders: [(geom: Ball(radius: 0.02))]"] {
        for solver in [
            "iterations: 4, passes: 4",
            "iterations: 5, passes: 8",
            "iterations: 2, searches: 3, passes: 4",
        ] {
            let task = parse_bodies(
                "arm",
                format!(
                    r#"Environment(
                    description: "An arm.", gravity: (0.0, -9.8), control_step: 0.02, time_limit: 100000, solver: ({solver}),
                    bodies: [(name: "upper", mass: 1.0, com: (0.5, 0.0), inertia: 0.1, {collider}), (name: "lower", position: (1.0, 0.0), mass: 1.0, com: (0.5, 0.0), inertia: 0.1)],
                    joints: [
                        (name: "shoulder", parent: "world", child: "upper", type: Hinge(), range: (-0.3, 1.0)),
                        (name: "elbow", parent: "upper", child: "lower", type: Hinge(positive: Clockwise), range: (-1.0, 0.5)),
                    ],
                    actuators: [], sensors: [], observations: [], reward: "0",
                )"#
                ),
            );
            let mut bodies = rigid_bodies(&task, 1);
            bodies.start(0, &[0.0; 2], &[0.0; 2]);
            for step in 0..300 {
                bodies.step(&[]);
                for (joint, end) in [(0, -0.3), (1, 0.5)] {
                    let (position, velocity) = state(&*bodies, joint);
                    assert!(
                        step < 200 || (velocity.abs() < 0.05 && (position - end).abs() < 0.03),
                        "{collider} {solver} {step} {joint}: {position} at {velocity}"
                    );
                }
            }
        }
    }
}
