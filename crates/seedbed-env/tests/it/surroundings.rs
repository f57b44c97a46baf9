//! Ropes, fluids, forces of contacts and how soft contacts and ranges are, against closed forms.

use std::f64::consts::TAU;

use seedbed_env::{Environment, GivenStart, Physics};
use seedbed_random::{Purpose, stream};

use crate::{build_bodies, parse_bodies};

const CONTROL_STEP: f64 = 0.01;

/// One copy of a task without actuators, at its start.
fn started(fields: &str, start: &GivenStart) -> Box<dyn Environment> {
    let text = format!(
        r#"Environment(
            description: "A test.", gravity: (0.0, -9.8), control_step: {CONTROL_STEP}, time_limit: 100000,
            {fields} actuators: [], reward: "0",
        )"#
    );
    let mut environment = build_bodies(&parse_bodies("test", text), Physics::Rapier, 1);
    environment.reset_at(0, &mut stream(0, Purpose::Reset, 0, 0), start);
    environment
}

fn at(positions: &[f64]) -> GivenStart {
    GivenStart {
        positions: positions.iter().copied().enumerate().collect(),
        ..GivenStart::default()
    }
}

fn run(environment: &mut dyn Environment, seconds: f64) {
    (0..(seconds / CONTROL_STEP).round() as u32).for_each(|_| environment.step(&[]));
}

/// A ball on a rope of 1 m that hangs from the world.
const BALL_ON_A_ROPE: &str = r#"
    bodies: [(name: "ball", mass: 0.2, inertia: 0.001)],
    ropes: [(name: "rope", from: (body: "world", at: (0.0, 2.0)), to: (body: "ball"), length: 1.0)],
    sensors: [
        (name: "x", type: JointPosition("ball.x")),
        (name: "y", type: JointPosition("ball.y")),
    ],
    observations: [(name: "x", range: (-1.0, 1.0)), (name: "y", range: (0.0, 2.0))],
"#;

/// While the rope is slack the ball falls freely: y = y₀ − ½ g t².
#[test]
fn a_slack_rope_does_nothing() {
    let mut ball = started(BALL_ON_A_ROPE, &at(&[0.0, 2.0]));
    run(&mut *ball, 0.4);
    let fallen = 2.0 - ball.observations()[1];
    assert!(
        (fallen / (0.5 * 9.8 * 0.16) - 1.0).abs() < 0.01,
        "{fallen} m"
    );
}

/// A taut rope is a pendulum of its length, whose period is 2 π √(L / g) for small angles.
#[test]
fn a_taut_rope_is_a_pendulum() {
    let mut ball = started(BALL_ON_A_ROPE, &at(&[0.05, 1.0]));
    let period = TAU * (1.0 / 9.8_f64).sqrt();
    run(&mut *ball, 0.5 * period);
    let (x, y) = (ball.observations()[0], ball.observations()[1]);
    assert!((x + 0.05).abs() < 2e-3, "{x} m after half a period");
    assert!((x.hypot(2.0 - y) - 1.0).abs() < 5e-3, "{y} m");
}

/// A ball that is thrown against the end of its rope stays within its length.
#[test]
fn a_rope_holds_a_falling_ball() {
    let mut ball = started(BALL_ON_A_ROPE, &at(&[0.6, 2.0]));
    let mut longest = 0.0_f32;
    for _ in 0..300 {
        ball.step(&[]);
        let (x, y) = (ball.observations()[0], ball.observations()[1]);
        longest = longest.max(x.hypot(2.0 - y));
    }
    assert!((1.0..1.01).contains(&longest), "{longest} m");
}

/// A ball with two slides on a rope under a cup with two slides that is held by strong springs: the ball
/// swings like a pendulum, whose period is 2 π √(L / g), and its weight pulls the cup down.
#[test]
fn a_rope_between_bodies_with_joints_is_a_pendulum() {
    let fields = r#"solver: (iterations: 4, searches: 4),
        bodies: [(name: "cup", mass: 1.0, inertia: 0.1), (name: "ball", position: (0.0, -1.0), mass: 0.2, inertia: 0.001)],
        joints: [
            (name: "cup_x", parent: "world", child: "cup", type: Slide(axis: (1.0, 0.0)), stiffness: 1e5, damping: 50.0),
            (name: "cup_y", parent: "world", child: "cup", type: Slide(axis: (0.0, 1.0)), stiffness: 1e5, damping: 50.0),
            (name: "ball_x", parent: "world", child: "ball", type: Slide(axis: (1.0, 0.0))),
            (name: "ball_y", parent: "world", child: "ball", type: Slide(axis: (0.0, 1.0))),
        ],
        ropes: [(name: "rope", from: (body: "cup"), to: (body: "ball"), length: 1.0)],
        sensors: [(name: "x", type: JointPosition("ball_x")), (name: "y", type: JointPosition("ball_y")), (name: "cup", type: JointPosition("cup_y"))],
        observations: [(name: "x", range: (-1.0, 1.0)), (name: "y", range: (-1.0, 1.0)), (name: "cup", range: (-1.0, 1.0))],"#;
    let mut ball = started(fields, &at(&[0.0, 0.0, 0.05, 0.0]));
    run(&mut *ball, 0.5 * TAU * (1.0 / 9.8_f64).sqrt());
    let [x, y, cup] = ball.observations()[..3] else {
        panic!("three observations")
    };
    assert!((x + 0.05).abs() < 3e-3 && y.abs() < 5e-3, "{x} m, {y} m");
    let expected = -1.2 * 9.8 / 1e5;
    assert!((cup / expected - 1.0).abs() < 0.2, "{cup} m, {expected} m");
}

/// The equation m v̇ = m g − ½ ρ A v² has the solution v = u tanh(g t / u), u = √(2 m g / (ρ A)).
/// Here A = 0.5 m × 0.2 m is the face below.
#[test]
fn a_box_sinks_at_its_terminal_velocity() {
    let mut sinking = started(
        r#"fluid: (density: 1000.0), solver: (searches: 4),
        bodies: [(name: "brick", mass: 50.0, inertia: 1.0, fluid_box: (0.5, 0.1, 0.2))],
        sensors: [(name: "v", type: JointVelocity("brick.y"))], observations: [(name: "v", range: (-9.0, 0.0))],"#,
        &GivenStart::default(),
    );
    let terminal = (2.0 * 50.0 * 9.8 / (1000.0 * 0.1_f64)).sqrt();
    for _ in 0..5 {
        run(&mut *sinking, 0.1);
    }
    let expected = terminal * (9.8 * 0.5 / terminal).tanh();
    let speed = f64::from(-sinking.observations()[0]);
    assert!(
        (speed / expected - 1.0).abs() < 5e-3,
        "{speed} m/s, {expected} m/s"
    );
    run(&mut *sinking, 2.0);
    let speed = f64::from(-sinking.observations()[0]);
    assert!(
        (speed / terminal - 1.0).abs() < 1e-3,
        "{speed} m/s, {terminal} m/s"
    );
}

/// Viscosity alone: ω = ω₀ exp(−π d³ β t / I), with the mean length d = 0.4 m.
#[test]
fn a_viscous_fluid_slows_a_rotation_exponentially() {
    let start = GivenStart {
        velocities: vec![(2, 3.0)],
        ..GivenStart::default()
    };
    let mut spinning = started(
        r#"fluid: (density: 0.0, viscosity: 2.0), solver: (searches: 4),
        bodies: [(name: "brick", mass: 1.0, inertia: 0.8, fluid_box: (0.5, 0.4, 0.3))],
        sensors: [(name: "spin", type: JointVelocity("brick.angle"))], observations: [(name: "spin", range: (-9.0, 9.0))],"#,
        &start,
    );
    run(&mut *spinning, 1.0);
    let expected = 3.0 * (-std::f64::consts::PI * 0.064 * 2.0 / 0.8_f64).exp();
    let spin = f64::from(spinning.observations()[0]);
    assert!(
        (spin / expected - 1.0).abs() < 2e-3,
        "{spin} rad/s, {expected} rad/s"
    );
}

/// Two boxes on each other at rest: the floor carries both weights, the lower box that of the upper.
#[test]
fn contact_forces_at_rest_are_weights() {
    let mut stack = started(
        r#"solver: (iterations: 4, searches: 2),
        colliders: [(name: "floor", geom: HalfSpace(normal: (0.0, 1.0)))],
        bodies: [
            (name: "lower", position: (0.0, 0.5), mass: 3.0, colliders: [(name: "lower", geom: Box(half_size: (0.5, 0.5)))]),
            (name: "upper", position: (0.0, 1.5), mass: 2.0, colliders: [(name: "upper", geom: Box(half_size: (0.5, 0.5)))]),
        ],
        sensors: [
            (name: "below", type: ContactForce("floor", "lower")),
            (name: "between", type: ContactForce("upper", "lower")),
            (name: "apart", type: ContactForce("upper", "floor")),
        ],
        observations: [
            (name: "below", range: (0.0, 99.0)), (name: "between", range: (0.0, 99.0)), (name: "apart", range: (0.0, 99.0)),
        ],"#,
        &GivenStart::default(),
    );
    assert_eq!(stack.observations(), [0.0; 3], "nothing has pressed yet");
    run(&mut *stack, 1.0);
    let [below, between, apart] = stack.observations() else {
        panic!("three observations")
    };
    assert!((below / (5.0 * 9.8) - 1.0).abs() < 0.01, "{below} N");
    assert!((between / (2.0 * 9.8) - 1.0).abs() < 0.01, "{between} N");
    assert!(*apart == 0.0, "{apart} N");
}

/// The center of mass of a subtree is that of its bodies, weighted by mass; nothing above or beside
/// it counts.
#[test]
fn a_subtree_is_a_body_and_what_hangs_on_it() {
    let start = GivenStart {
        positions: vec![(0, 0.4), (1, -0.7), (2, 0.2)],
        velocities: vec![(0, 1.0), (1, 2.0), (2, -3.0)],
        ..GivenStart::default()
    };
    let chain = started(
        r#"bodies: [
            (name: "trunk", mass: 9.0, com: (0.0, 1.0), inertia: 1.0),
            (name: "arm", position: (0.0, 2.0), mass: 2.0, com: (0.5, 0.0), inertia: 0.1),
            (name: "hand", position: (1.0, 2.0), mass: 0.5, com: (0.2, 0.1), inertia: 0.1),
        ],
        joints: [
            (name: "foot", parent: "world", child: "trunk", type: Hinge()),
            (name: "shoulder", parent: "trunk", child: "arm", type: Hinge()),
            (name: "wrist", parent: "arm", child: "hand", type: Hinge()),
        ],
        sensors: [
            (name: "x", type: SubtreePosition(body: "arm", axis: X)),
            (name: "v", type: SubtreeVelocity(body: "arm", axis: Y)),
            (name: "arm_x", type: BodyPosition(body: "arm", axis: X, at: (0.5, 0.0))),
            (name: "hand_x", type: BodyPosition(body: "hand", axis: X, at: (0.2, 0.1))),
            (name: "arm_v", type: BodyVelocity(body: "arm", axis: Y, at: (0.5, 0.0))),
            (name: "hand_v", type: BodyVelocity(body: "hand", axis: Y, at: (0.2, 0.1))),
        ],
        observations: [
            (name: "position", value: "x - (2 * arm_x + 0.5 * hand_x) / 2.5", range: (-1.0, 1.0)),
            (name: "velocity", value: "v - (2 * arm_v + 0.5 * hand_v) / 2.5", range: (-1.0, 1.0)),
            (name: "x", range: (-1.0, 1.0)), (name: "v", range: (-1.0, 1.0)),
        ],"#,
        &start,
    );
    let [position, velocity, x, v] = chain.observations() else {
        panic!("four observations")
    };
    assert!(position.abs() < 1e-6 && velocity.abs() < 1e-6);
    assert!(x.abs() > 0.1 && v.abs() > 0.1, "{x} m, {v} m/s");
}

/// How deep a block at rest sinks into the floor beyond what Rapier allows, m.
fn depth(softness: &str) -> f32 {
    let fields = format!(
        r#"{softness} solver: (iterations: 4, searches: 2),
        colliders: [(geom: HalfSpace(normal: (0.0, 1.0)))],
        bodies: [(name: "block", position: (0.0, 0.5), mass: 3.0, colliders: [(geom: Box(half_size: (0.5, 0.5)))])],
        sensors: [(name: "y", type: JointPosition("block.y"))], observations: [(name: "y", range: (0.0, 1.0))],"#
    );
    let mut block = started(&fields, &GivenStart::default());
    run(&mut *block, 3.0);
    0.5 - block.observations()[0]
}

/// A lasting load presses a contact in by its acceleration over ω². Rapier's contacts come within a
/// quarter of it; the default, 60 Hz, by less than the 1 mm that it tolerates.
#[test]
fn a_soft_contact_yields_like_a_spring() {
    assert!(depth("") < 1e-3, "{} m", depth(""));
    for frequency in [3.0, 10.0, 30.0_f32] {
        let fields =
            format!("contact_softness: (natural_frequency: {frequency:?}, damping_ratio: 1.0),");
        let expected = 9.8 / (std::f32::consts::TAU * frequency).powi(2);
        let found = depth(&fields);
        assert!(
            (found / expected - 1.0).abs() < 0.3,
            "{frequency} Hz: {found} m, {expected} m"
        );
    }
}

/// How far a joint overshoots the end of its range under its weight, m. `collider`: a task with
/// contacts has another solver.
fn overshoot(softness: &str, iterations: u32, collider: &str) -> f32 {
    let fields = format!(
        r#"solver: (iterations: {iterations}), {collider}
        bodies: [(name: "bead", mass: 2.0, inertia: 1.0)],
        joints: [(name: "wire", parent: "world", child: "bead", type: Slide(axis: (0.0, 1.0)), range: (-1.0, 1.0), {softness})],
        sensors: [(name: "y", type: JointPosition("wire"))], observations: [(name: "y", range: (-1.0, 1.0))],"#
    );
    let mut bead = started(&fields, &at(&[-0.99]));
    run(&mut *bead, 3.0);
    -1.0 - bead.observations()[0]
}

/// A lasting load presses the end of a range in by its acceleration over ω², however many substeps.
#[test]
fn a_soft_range_yields_like_a_spring() {
    for collider in [
        "",
        "colliders: [(geom: HalfSpace(point: (9.0, -9.0), normal: (0.0, 1.0)))],",
    ] {
        let hard = overshoot("", 8, collider);
        assert!((-1e-4..3e-3).contains(&hard), "{hard} m, {collider}");
        for (frequency, iterations) in [(3.0, 8), (3.0, 64), (20.0, 8), (20.0, 64_u32)] {
            let softness =
                format!("range_softness: (natural_frequency: {frequency:?}, damping_ratio: 2.0)");
            let expected = 9.8 / (std::f32::consts::TAU * frequency).powi(2);
            let found = overshoot(&softness, iterations, collider);
            assert!(
                (found / expected - 1.0).abs() < 0.1,
                "{frequency} Hz, {iterations} iterations {collider}: {found} m, {expected} m"
            );
        }
    }
}
