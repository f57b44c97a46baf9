//! Joints and free bodies that turn fast or far, and joints at the ends of their ranges, against
//! closed forms: with and without contacts, at several speeds, control steps and substeps.

mod ends;

use seedbed_env::description::BodyTask;
use seedbed_env::dynamics::Dynamics;
use seedbed_env::{GivenStart, Physics, build_dynamics};
use seedbed_random::{Purpose, stream};

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
