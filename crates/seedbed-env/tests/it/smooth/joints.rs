//! What acts along single joints: dampers, springs, dry friction, armatures, servos, ranges, welds.

use std::f64::consts::{PI, TAU};

use seedbed_env::description::{BodyTask, Distribution, Measurement, StartCoordinate};
use seedbed_env::{Physics, Pose};
use seedbed_random::{Purpose, stream};

use super::{rigid_bodies, start, state, task};
use crate::{build_bodies, parse_bodies};

/// A body of 2 kg and 0.5 kg m² on one joint of the type `kind`. `joint_fields` are further fields
/// of the joint, `solver` the fields of the solver.
fn rig(
    kind: &str,
    joint_fields: &str,
    actuators: &str,
    solver: &str,
    gravity: &str,
    com: &str,
) -> BodyTask {
    let text = format!(
        r#"Environment(
            description: "One body on one joint.", gravity: {gravity}, control_step: 0.02, time_limit: 1000, solver: ({solver}),
            bodies: [(name: "body", mass: 2.0, inertia: 0.5, com: {com})],
            joints: [(name: "joint", parent: "world", child: "body", type: {kind}, {joint_fields})],
            actuators: [{actuators}],
            sensors: [(name: "q", type: JointPosition("joint"))],
            observations: [(name: "q", range: (-1.0, 1.0))],
            reward: "q",
        )"#
    );
    parse_bodies("rig", text)
}

const PUSH: &str = r#"(name: "push", type: JointForce("joint"), control: Continuous(-10.0, 10.0))"#;

const LEVEL: &str = "Slide(axis: (1.0, 0.0))";

const SLOPE: &str = "Slide(axis: (0.8, 0.6))";

/// Every kind of joint that Rapier represents differently, and the inertia of the body along its
/// coordinate: 2 kg, or 0.5 kg m².
const KINDS: [(&str, f64); 4] = [
    (LEVEL, 2.0),
    (SLOPE, 2.0),
    ("Hinge()", 0.5),
    ("Hinge(positive: Clockwise)", 0.5),
];

/// The same rig without gravity.
fn weightless(kind: &str, joint_fields: &str, actuators: &str) -> BodyTask {
    rig(
        kind,
        joint_fields,
        actuators,
        "iterations: 32, passes: 4",
        "(0.0, 0.0)",
        "(0.0, 0.0)",
    )
}

/// Position and velocity after each of `steps` control steps under a constant control.
fn run(task: &BodyTask, from: [f64; 2], control: f32, steps: usize) -> Vec<[f64; 2]> {
    let mut bodies = rigid_bodies(task);
    start(&mut *bodies, &from);
    let mut step = || {
        bodies.step(&[control]);
        let state = state(&*bodies, 1);
        [state[0], state[1]]
    };
    (0..steps).map(|_| step()).collect()
}

/// m v̇ = −b v: v = v₀ e^(−b t / m).
#[test]
fn damping_slows_a_joint_exponentially() {
    for (kind, inertia) in KINDS {
        let states = run(&weightless(kind, "damping: 1.5", PUSH), [0.1, 3.0], 0.0, 50);
        for (step, state) in (1..).zip(&states) {
            let expected = 3.0 * (-1.5 / inertia * 0.02 * f64::from(step)).exp();
            assert!(
                (state[1] - expected).abs() < 3e-3,
                "{kind}: {} instead of {expected}",
                state[1]
            );
        }
    }
}

/// m q̈ = −k (q − q₀): q − q₀ = (q(0) − q₀) cos ωt with ω² = k / m.
#[test]
fn a_spring_has_its_frequency() {
    for (kind, inertia) in KINDS {
        let task = weightless(kind, "stiffness: 8.0, springref: 0.2", PUSH);
        let states = run(&task, [0.7, 0.0], 0.0, 200);
        let omega = (8.0 / inertia).sqrt();
        // Implicit Euler damps by ½ ω² h t with the substep h; the phase is off in second order
        // only.
        let decay = 0.5 * omega * omega * 0.02 / 32.0;
        for (step, state) in (1..).zip(&states) {
            let time = 0.02 * f64::from(step);
            let expected = 0.2 + 0.5 * (-decay * time).exp() * (omega * time).cos();
            assert!(
                (state[0] - expected).abs() < 0.01,
                "{kind}: {} instead of {expected} after {time} s",
                state[0]
            );
        }
    }
}

/// A force below the friction f moves nothing; a larger force F accelerates by m v̇ = F − f. A
/// moving body loses f t of momentum and stops.
#[test]
fn dry_friction_holds_slides_and_stops() {
    for (kind, inertia) in KINDS {
        let task = weightless(kind, "frictionloss: 2.0", PUSH);
        let held = run(&task, [0.3, 0.0], 1.9, 100)[99];
        assert!(
            (held[0] - 0.3).abs() < 1e-5 && held[1].abs() < 1e-5,
            "{kind}: {held:?}"
        );
        let sliding = run(&task, [0.0, 0.0], 3.0, 25)[24];
        assert!(
            (sliding[1] - 0.5 / inertia).abs() < 1e-3,
            "{kind}: {sliding:?}"
        );
        let stopping = run(&task, [0.0, 0.5 / inertia], 0.0, 24)[23];
        assert!(stopping[1].abs() < 1e-5, "{kind}: {stopping:?}");
        let coasting = run(&task, [0.0, 1.0 / inertia], 0.0, 12)[11];
        assert!(
            (coasting[1] - (1.0 - 2.0 * 0.24) / inertia).abs() < 1e-3,
            "{kind}: {coasting:?}"
        );
    }
}

/// A rotor of armature a adds inertia: (m + a) v̇ = F. It has no weight: a vertical slide falls with
/// g m / (m + a).
#[test]
fn an_armature_adds_inertia_without_weight() {
    for (kind, inertia) in KINDS {
        let state = run(
            &weightless(kind, "armature: 1.5", PUSH),
            [0.0, 0.0],
            3.0,
            25,
        )[24];
        let expected = 3.0 * 0.5 / (inertia + 1.5);
        assert!(
            (state[1] - expected).abs() < 1e-3,
            "{kind}: {} instead of {expected}",
            state[1]
        );
    }
    let falling = rig(
        "Slide(axis: (0.0, 1.0))",
        "armature: 2.0",
        PUSH,
        "iterations: 4",
        "(0.0, -10.0)",
        "(0.0, 0.0)",
    );
    let state = run(&falling, [0.0, 0.0], 0.0, 50)[49];
    assert!((state[1] + 5.0).abs() < 1e-4, "{state:?}");
}

/// Under a load, a velocity servo settles at kv (target − q̇) = load, and a position servo at
/// kp (target − q) = load. Here the load is a damper for the velocity servo and a spring for the
/// position servo.
#[test]
fn servos_settle_where_their_gains_say() {
    let velocity = r#"(name: "push", type: VelocityServo(joint: "joint", kv: 6.0), control: Continuous(-5.0, 5.0), gear: 2.0)"#;
    let position = r#"(name: "push", type: PositionServo(joint: "joint", kp: 90.0, kv: 12.0), control: Continuous(-5.0, 5.0))"#;
    for (kind, _) in KINDS {
        // 6 (2 × 0.5 − q̇) = 3 q̇
        let state = run(
            &weightless(kind, "damping: 3.0", velocity),
            [0.0, 0.0],
            0.5,
            200,
        )[199];
        assert!((state[1] - 2.0 / 3.0).abs() < 2e-3, "{kind}: {state:?}");
        // 90 (0.8 − q) = 30 (q − 0.2)
        let state = run(
            &weightless(kind, "stiffness: 30.0, springref: 0.2", position),
            [0.0, 0.0],
            0.8,
            400,
        )[399];
        assert!(
            (state[0] - 0.65).abs() < 1e-3 && state[1].abs() < 1e-3,
            "{kind}: {state:?}"
        );
    }
}

/// As long as a servo asks for more than its limit, it pushes with its limit: v = F t / m.
#[test]
fn servos_push_no_harder_than_their_limit() {
    let servo = r#"(name: "push", type: VelocityServo(joint: "joint", kv: 50.0, force_limit: 1.0), control: Continuous(-50.0, 50.0))"#;
    for (kind, inertia) in KINDS {
        let state = run(&weightless(kind, "", servo), [0.0, 0.0], 20.0, 50)[49];
        assert!((state[1] - 1.0 / inertia).abs() < 1e-3, "{kind}: {state:?}");
    }
}

/// Several actuators act on one joint together: forces of 2 N in total and a velocity servo with kv
/// 4 and target 0 lead to 0.5 m/s.
#[test]
fn actuators_add_up() {
    let both = format!(
        r#"{PUSH}, (name: "brake", type: VelocityServo(joint: "joint", kv: 4.0), control: Continuous(-1.0, 1.0)),
           (name: "hold", type: JointForce("joint"), control: Discrete([0.0, 1.0, 2.0]), gear: -1.0)"#
    );
    for (kind, _) in KINDS {
        let mut environment = build_bodies(&weightless(kind, "", &both), Physics::Rapier, 1);
        environment.reset(0, &mut stream(0, Purpose::Reset, 0, 0));
        // Three actions: 4 N, the servo's target, and the third of the discrete forces, −2 N.
        let mut before = 0.0;
        for _ in 0..400 {
            before = environment.observations()[0];
            environment.step(&[4.0, 0.0, 2.0]);
        }
        let speed = (environment.observations()[0] - before) / 0.02;
        assert!((speed - 0.5).abs() < 2e-3, "{kind}: {speed}");
    }
}

/// A joint that is pushed or falls against an end of its range overshoots by millimeters, settles
/// at that end, and rebounds with at most a fifth of its speed. The slider of a body without
/// children stops without rebound.
#[test]
fn a_joint_stays_within_its_range() {
    for (kind, _) in KINDS {
        for direction in [1.0, -1.0] {
            let task = weightless(kind, "range: (-0.3, 0.5)", PUSH);
            let states = run(&task, [0.0, 2.0 * direction], (3.0 * direction) as f32, 300);
            let end = if direction > 0.0 { 0.5 } else { 0.3 };
            let overshoot = states
                .iter()
                .map(|state| direction * state[0] - end)
                .fold(f64::MIN, f64::max);
            let bounce = states
                .iter()
                .map(|state| -direction * state[1])
                .fold(f64::MIN, f64::max);
            assert!(
                overshoot < 6e-3 && bounce < 0.2 * 4.0,
                "{kind}: overshoot {overshoot}, bounce {bounce}"
            );
            let last = states[299];
            assert!(
                (direction * last[0] - end).abs() < 2e-3 && last[1].abs() < 0.02,
                "{kind}: {last:?}"
            );
            if kind == LEVEL {
                assert!(overshoot <= 1e-7 && bounce <= 0.0, "{overshoot}, {bounce}");
            }
        }
    }
}

/// A pendulum that falls onto the end of its range stays there: the hinge's own constraint and the
/// range's have to agree.
#[test]
fn a_range_holds_a_falling_pendulum() {
    let task = rig(
        "Hinge()",
        "range: (-2.0, 1.0)",
        PUSH,
        "iterations: 32, passes: 4",
        "(0.0, -9.81)",
        "(0.0, 0.7)",
    );
    let states = run(&task, [0.1, 0.0], 0.0, 400);
    assert!(states.iter().all(|state| state[0] < 1.01), "{states:?}");
    assert!(
        (states[399][0] - 1.0).abs() < 5e-3 && states[399][1].abs() < 0.01,
        "{:?}",
        states[399]
    );
}

/// A cart that carries poles is held at the end of its range by a constraint. It is not stopped
/// directly, because the poles keep their momentum.
#[test]
fn a_range_holds_a_cart_with_poles() {
    let mut bodies = rigid_bodies(&task("double_pendulum_cart"));
    start(&mut *bodies, &[0.0; 6]);
    for _ in 0..100 {
        bodies.step(&[1.0]);
        let x = state(&*bodies, 3)[0];
        assert!(x < 1.06, "{x}");
    }
    let x = state(&*bodies, 3)[0];
    assert!((x - 1.0).abs() < 0.02, "{x}");
}

/// A post that is welded to the world, and a pendulum of two welded bodies on it.
fn welded_pendulum() -> BodyTask {
    parse_bodies(
        "two",
        r#"Environment(
            description: "A post, and a pendulum of two welded bodies.", gravity: (0.0, -9.81), control_step: 0.02, time_limit: 100,
            solver: (iterations: 32, passes: 8),
            bodies: [
                (name: "post", position: (0.2, 0.1), angle: 0.4, mass: 1.0, inertia: 1.0),
                (name: "rod", mass: 1.0, com: (0.0, -0.5), inertia: 0.1),
                (name: "bob", position: (0.1, -1.0), angle: 0.7, mass: 3.0, inertia: 0.2),
            ],
            joints: [
                (name: "post", parent: "world", child: "post", type: Weld),
                (name: "hinge", parent: "post", child: "rod", type: Hinge()),
                (name: "weld", parent: "rod", child: "bob", type: Weld),
            ],
            actuators: [(name: "torque", type: JointForce("hinge"), control: Continuous(-1.0, 1.0))],
            sensors: [(name: "q", type: JointPosition("hinge"))],
            observations: [(name: "q", range: (-1.0, 1.0))],
            reward: "0",
        )"#
        .to_owned(),
    )
}

/// A pendulum of one body with the mass, center of mass and inertia of rod and bob of
/// [`welded_pendulum`].
fn equivalent_pendulum() -> BodyTask {
    // Center of mass at (3 × 0.1, −0.5 − 3 × 1) / 4 = (0.075, −0.875); each body's inertia and m d²
    // about it.
    let inertia = 0.1
        + (0.075_f64.powi(2) + 0.375_f64.powi(2))
        + 0.2
        + 3.0 * (0.025_f64.powi(2) + 0.125_f64.powi(2));
    let mut task = rig(
        "Hinge()",
        "",
        PUSH,
        "iterations: 32",
        "(0.0, -9.81)",
        "(0.075, -0.875)",
    );
    task.bodies[0].inertial.mass = 4.0;
    task.bodies[0].inertial.inertia = inertia;
    task
}

/// Two bodies that are welded together swing as one with the mass, center of mass and inertia of
/// both; a body that is welded to the world stands still.
#[test]
fn a_weld_makes_two_bodies_one() {
    let (mut welded, mut single) = (
        rigid_bodies(&welded_pendulum()),
        rigid_bodies(&equivalent_pendulum()),
    );
    welded.start(0, &[0.0, 1.0, 0.0], &[0.0; 3]);
    single.start(0, &[1.0], &[0.0]);
    let mut poses = vec![Pose::default(); 3];
    for _ in 0..100 {
        welded.step(&[0.5]);
        single.step(&[0.5]);
        let (found, expected) = (
            welded.coordinates().get(1, 0).0,
            single.coordinates().get(0, 0).0,
        );
        assert!(
            (found - expected).abs() < 0.02,
            "{found} instead of {expected}"
        );
        welded.poses(0, &mut poses);
        let [post, rod, bob] = poses[..] else {
            panic!("expected three bodies")
        };
        assert!(
            (bob.angle - rod.angle - 0.7).sin().abs() < 1e-2,
            "{poses:?}"
        );
        assert!(
            (post.x - 0.2).abs() + (post.y - 0.1).abs() + (post.angle - 0.4).abs() < 1e-6,
            "{poses:?}"
        );
    }
}

/// A wrapped angle is the unwrapped one without full turns, in (−π, π], however far the hinge has
/// turned.
#[test]
fn a_wrapped_angle_stays_within_half_a_turn() {
    let mut task = weightless("Hinge()", "", PUSH);
    task.sensors[0].measurement = Measurement::WrappedJointPosition(0);
    task.reset = vec![StartCoordinate {
        coordinate: 0,
        position: Distribution::Uniform {
            low: -50.0,
            high: 50.0,
        },
        velocity: Distribution::Constant(0.0),
    }];
    let mut plain = task.clone();
    plain.sensors[0].measurement = Measurement::JointPosition(0);
    let [mut wrapped, mut counted] =
        [&task, &plain].map(|task| build_bodies(task, Physics::Rapier, 1));
    for episode in 0..1000 {
        wrapped.reset(0, &mut stream(0, Purpose::Reset, 0, episode));
        counted.reset(0, &mut stream(0, Purpose::Reset, 0, episode));
        let (angle, unwrapped) = (
            f64::from(wrapped.observations()[0]),
            f64::from(counted.observations()[0]),
        );
        assert!(angle > -PI - 1e-6 && angle < PI + 1e-6, "{angle}");
        let turns = (unwrapped - angle) / TAU;
        assert!(
            (turns - turns.round()).abs() < 1e-6,
            "{unwrapped} became {angle}"
        );
    }
}
