//! Joints at the ends of their ranges.

use std::f64::consts::TAU;

use super::{HINGES, PUSH, Rig, SLIDES, assert_none, rigid_bodies, rigs, state};
use crate::parse_bodies;

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
            for rate in [0.7_f64, 5.0, 30.0, -80.0, 500.0, -3000.0] {
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
                    for _ in 0..200 {
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
            for [low, high] in [[-1.0, 0.5], [0.0, 6.2], [-10.0, 10.0]] {
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

/// A chain that hangs on hard ends, without contacts, is at rest.
#[test]
fn a_chain_that_hangs_on_ends_has_no_velocity() {
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
                    bodies: [(name: "upper", mass: 1.0, com: (0.5, 0.0), inertia: 0.1), (name: "lower", position: (1.0, 0.0), mass: 1.0, com: (0.5, 0.0), inertia: 0.1)],
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
        let max_rate = 0.01;
        for step in 0..300 {
            bodies.step(&[]);
            for (joint, end) in [(0, -0.3), (1, 0.5)] {
                let (position, velocity) = state(&*bodies, joint);
                assert!(
                    step < 200 || (velocity.abs() < max_rate && (position - end).abs() < 0.03),
                    "{solver} {step} {joint}: {position} at {velocity}"
                );
            }
        }
    }
}
