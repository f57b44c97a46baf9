//! Bodies that fly, fall, touch, slide and bounce, against closed forms.

use seedbed_env::build_dynamics;
use seedbed_env::description::BodyTask;
use seedbed_env::dynamics::Dynamics;
use seedbed_env::kinematics::{Frame, KinematicTree};
use seedbed_env::{Force, ForceSource, Physics, Pose};
use seedbed_random::{Purpose, stream};

use crate::{build_bodies, parse_bodies};

const CONTROL_STEP: f64 = 0.01;
const SUBSTEPS: f64 = 4.0;

/// A task without actions and rewards. `fields` are the bodies, joints, colliders and sensors of
/// the file.
fn task(gravity: &str, fields: &str) -> BodyTask {
    let text = format!(
        r#"Environment(
            description: "A test.", gravity: {gravity}, control_step: {CONTROL_STEP}, time_limit: 100000,
            solver: (iterations: {SUBSTEPS}), {fields}
            actuators: [], observations: [], reward: "0",
        )"#
    );
    parse_bodies("test", text)
}

fn bodies(task: &BodyTask) -> Box<dyn Dynamics> {
    build_dynamics(task, Physics::Rapier, 1).expect("every task has rigid bodies")
}

/// Steps without actuators.
fn run(bodies: &mut dyn Dynamics, seconds: f64) {
    (0..(seconds / CONTROL_STEP).round() as u32).for_each(|_| bodies.step(&[]));
}

fn coordinate(bodies: &dyn Dynamics, index: usize) -> (f64, f64) {
    let (position, velocity) = bodies.coordinates().get(index, 0);
    (f64::from(position), f64::from(velocity))
}

/// Semi-implicit Euler with a substep h gives exactly v = v₀ − g t and y = v₀ t − ½ g t² − ½ g t h.
/// A rotation advances by arctan(ω h): Rapier turns the unit vector of the angle along its tangent,
/// and normalizes it.
#[test]
fn a_free_body_falls_along_a_parabola() {
    let task = task(
        "(0.0, -9.8)",
        r#"bodies: [(name: "ball", mass: 2.0, com: (0.3, 0.0), inertia: 0.5)], sensors: [],"#,
    );
    let mut falling = bodies(&task);
    // The frame's origin is 0.3 m behind the center of mass, which moves at (1 − 0, 2 + 0.3 × 5)
    // m/s.
    falling.start(0, &[0.0, 10.0, 0.0], &[1.0, 2.0, 5.0]);
    run(&mut *falling, 1.0);
    let ((x, _), (y, _), (angle, spin)) = (
        coordinate(&*falling, 0),
        coordinate(&*falling, 1),
        coordinate(&*falling, 2),
    );
    let (sine, cosine) = angle.sin_cos();
    let (right, up) = (x + 0.3 * cosine - 0.3, y + 0.3 * sine - 10.0);
    let expected_up = 3.5 - 0.5 * 9.8 * (1.0 + CONTROL_STEP / SUBSTEPS);
    let expected_angle = (1.0 / CONTROL_STEP * SUBSTEPS) * (5.0 * CONTROL_STEP / SUBSTEPS).atan();
    assert!(
        (angle - expected_angle).abs() < 1e-5 && (spin - 5.0).abs() < 1e-5,
        "{angle} rad, {spin} rad/s"
    );
    assert!(
        (right - 1.0).abs() < 1e-4 && (up - expected_up).abs() < 2e-4,
        "{right} m, {up} m instead of {expected_up} m"
    );
}

/// Three links that fly, joined by two hinges. No link has the origin of its frame at its center of
/// mass.
const CHAIN: &str = r#"
    bodies: [
        (name: "root", position: (0.0, 5.0), mass: 1.0, com: (0.1, 0.05), inertia: 0.03),
        (name: "arm", position: (0.5, 5.0), angle: 0.4, mass: 0.5, com: (0.25, 0.0), inertia: 0.01),
        (name: "hand", position: (1.0, 5.2), mass: 0.3, com: (0.2, -0.1), inertia: 0.008),
    ],
    joints: [
        (name: "shoulder", parent: "root", child: "arm", type: Hinge()),
        (name: "elbow", parent: "arm", child: "hand", type: Hinge(positive: Clockwise)),
    ],
    sensors: [],
"#;

/// Momentum (kg m/s), angular momentum about the common center of mass (kg m²/s), kinetic energy
/// (J), and that center (m).
struct Motion {
    momentum: [f64; 2],
    angular_momentum: f64,
    energy: f64,
    center: [f64; 2],
}

fn motion(task: &BodyTask, bodies: &dyn Dynamics) -> Motion {
    let frames = KinematicTree::new(task).frames_of(bodies.coordinates(), 0);
    let moving_bodies: Vec<_> = task
        .bodies
        .iter()
        .zip(&frames)
        .map(|(body, frame)| (body.inertial, frame))
        .collect();
    let total_mass: f64 = moving_bodies
        .iter()
        .map(|(inertial, _)| inertial.mass)
        .sum();
    let motion_at = |frame: &Frame, com| (frame.point(com), frame.velocity_at(frame.point(com)));
    let mass_sum = |value: &dyn Fn([f64; 2], [f64; 2]) -> f64| -> f64 {
        moving_bodies
            .iter()
            .map(|(inertial, frame)| {
                let (p, v) = motion_at(frame, inertial.com);
                inertial.mass * value(p, v)
            })
            .sum()
    };
    let center = [
        mass_sum(&|p, _| p[0]) / total_mass,
        mass_sum(&|p, _| p[1]) / total_mass,
    ];
    let inertia_sum = |value: &dyn Fn(f64) -> f64| -> f64 {
        moving_bodies
            .iter()
            .map(|(inertial, frame)| inertial.inertia * value(frame.angular_velocity))
            .sum()
    };
    Motion {
        momentum: [mass_sum(&|_, v| v[0]), mass_sum(&|_, v| v[1])],
        angular_momentum: mass_sum(&|p, v| (p[0] - center[0]) * v[1] - (p[1] - center[1]) * v[0])
            + inertia_sum(&|rate| rate),
        energy: mass_sum(&|_, v| 0.5 * (v[0] * v[0] + v[1] * v[1]))
            + inertia_sum(&|rate| 0.5 * rate * rate),
        center,
    }
}

/// Start velocities of the chain's coordinates: shoulder, elbow, then x, y and angle of the root.
const START_VELOCITIES: [f64; 5] = [2.0, -1.0, 0.5, 3.0, 1.5];

/// In flight the momentum of the whole chain changes by m g t, and the center of mass follows a
/// parabola, whatever the links do.
#[test]
fn the_center_of_mass_of_a_flying_chain_follows_a_parabola() {
    let task = task("(0.0, -9.8)", CHAIN);
    let mut chain = bodies(&task);
    chain.start(0, &[0.3, -0.5, 0.0, 5.0, 0.2], &START_VELOCITIES);
    let before = motion(&task, &*chain);
    run(&mut *chain, 0.5);
    let after = motion(&task, &*chain);
    let weight = 1.8 * 9.8;
    let expected = [before.momentum[0], before.momentum[1] - weight * 0.5];
    for axis in [0, 1] {
        assert!(
            (after.momentum[axis] - expected[axis]).abs() < 0.02,
            "{:?} instead of {expected:?}",
            after.momentum
        );
        let mean = 0.5 * (before.momentum[axis] + after.momentum[axis]) / 1.8;
        let moved = after.center[axis] - before.center[axis];
        assert!(
            (moved - 0.5 * mean).abs() < 0.01,
            "{moved} m instead of {} m",
            0.5 * mean
        );
    }
}

/// Without gravity, energy and angular momentum are constant, up to the first order of the substep.
#[test]
fn a_flying_chain_keeps_energy_and_angular_momentum() {
    let task = task("(0.0, 0.0)", CHAIN);
    let mut chain = bodies(&task);
    chain.start(0, &[0.3, -0.5, 0.0, 5.0, 0.2], &START_VELOCITIES);
    let before = motion(&task, &*chain);
    run(&mut *chain, 2.0);
    let after = motion(&task, &*chain);
    assert!(
        (after.energy / before.energy - 1.0).abs() < 0.02,
        "{} J to {} J",
        before.energy,
        after.energy
    );
    assert!(
        (after.angular_momentum / before.angular_momentum - 1.0).abs() < 0.02,
        "{} to {}",
        before.angular_momentum,
        after.angular_momentum
    );
}

/// A rod on a hinge at the world is a physical pendulum: its period at small swings is 2π √((I + m
/// l²) / (m g l)).
#[test]
fn a_multibody_pendulum_has_the_period_of_its_inertia() {
    let task = task(
        "(0.0, -9.8)",
        r#"
        bodies: [(name: "rod", mass: 2.0, com: (0.0, -0.5), inertia: 0.1, colliders: [(geom: Ball(center: (0.0, -1.0), radius: 0.01))])],
        joints: [(name: "hinge", parent: "world", child: "rod", type: Hinge())],
        sensors: [],"#,
    );
    let expected = std::f64::consts::TAU * ((0.1 + 2.0 * 0.25_f64) / (2.0 * 9.8 * 0.5)).sqrt();
    let mut rod = bodies(&task);
    rod.start(0, &[0.02], &[0.0]);
    let (mut before, mut crossings) = (0.02, Vec::new());
    for step in 1..1500 {
        run(&mut *rod, CONTROL_STEP);
        let (angle, _) = coordinate(&*rod, 0);
        if before > 0.0 && angle <= 0.0 {
            crossings.push(CONTROL_STEP * (f64::from(step) - angle / (angle - before)));
        }
        before = angle;
    }
    let period = (crossings[crossings.len() - 1] - crossings[0]) / (crossings.len() - 1) as f64;
    assert!(
        (period / expected - 1.0).abs() < 2e-3,
        "{period} s instead of {expected} s"
    );
}

/// A box of 3 kg that has lain on the ground for 10 s, and its task.
fn lying_box() -> (BodyTask, Box<dyn Dynamics>) {
    let task = task(
        "(0.0, -9.8)",
        r#"
        colliders: [(name: "ground", geom: HalfSpace(normal: (0.0, 1.0)))],
        bodies: [(name: "block", position: (0.0, 0.2), mass: 3.0, colliders: [(name: "sides", geom: Box(half_size: (0.3, 0.2)))])],
        sensors: [(name: "touches", type: Contact("sides", "ground"))],"#,
    );
    let mut lying = bodies(&task);
    lying.start(0, &[0.0, 0.2, 0.0], &[0.0; 3]);
    run(&mut *lying, 10.0);
    (task, lying)
}

/// The contact forces of the latest step, and their sum, N.
fn contact_forces(bodies: &dyn Dynamics) -> (Vec<Force>, [f32; 2]) {
    let mut forces = Vec::new();
    bodies.contact_forces(0, &mut forces);
    let total = forces.iter().fold([0.0; 2], |[x, y], force| {
        [x + force.newtons[0], y + force.newtons[1]]
    });
    (forces, total)
}

/// A box that lies on the ground stays where it is and touches the ground; a box in the air does
/// not touch it.
#[test]
fn a_box_at_rest_stays_and_touches_the_ground() {
    let (task, lying) = lying_box();
    let [x, y, angle] = [0, 1, 2].map(|index| coordinate(&*lying, index).0);
    assert!(
        x.abs() < 1e-4 && (y - 0.2).abs() < 1.5e-3 && angle.abs() < 1e-4,
        "{x} m, {y} m, {angle} rad"
    );
    let geometry = seedbed_env::physics::Geometry::new(&task, 1);
    assert!(geometry.touch(
        0,
        [1, 0],
        &KinematicTree::new(&task).frames_of(lying.coordinates(), 0)
    ));
    assert!(!geometry.touch(0, [1, 0], &[Frame::at([0.0, 0.21], 0.0)]));
    assert!(
        geometry.touch(0, [1, 0], &[Frame::at([0.0, 0.21], 0.1)]),
        "turned by 0.1 rad, its corner is 0.03 m lower"
    );
}

/// The ground carries the weight of a box, 3 kg × 9.8 m/s², at the lower corners of the box.
#[test]
fn the_ground_carries_a_box_at_its_corners() {
    let (_, lying) = lying_box();
    let (forces, total) = contact_forces(&*lying);
    assert!(
        (total[1] - 29.4).abs() < 0.3 && total[0].abs() < 0.1,
        "{total:?} N"
    );
    for force in &forces {
        assert!(
            (force.at[0].abs() - 0.3).abs() < 0.02 && force.at[1].abs() < 0.01,
            "{force:?}"
        );
        assert_eq!(force.source, ForceSource::Contact);
    }
}

/// Friction holds a block on a slope of 20°: the contact forces, friction included, add up to the
/// opposite of the weight.
#[test]
fn friction_is_part_of_a_contact_force() {
    let (sine, cosine) = (-20.0_f64.to_radians().sin(), 20.0_f64.to_radians().cos());
    let task = task(
        "(0.0, -9.8)",
        &format!(
            r#"
        colliders: [(geom: HalfSpace(normal: ({sine}, {cosine})), friction: 1.0)],
        bodies: [(name: "block", mass: 3.0, colliders: [(geom: Box(half_size: (0.3, 0.05)))])],
        sensors: [],"#
        ),
    );
    let mut lying = bodies(&task);
    lying.start(
        0,
        &[0.05 * sine, 0.05 * cosine, 20.0_f64.to_radians()],
        &[0.0; 3],
    );
    run(&mut *lying, 2.0);
    let (_, total) = contact_forces(&*lying);
    assert!(
        (total[1] - 29.4).abs() < 0.5 && total[0].abs() < 0.5,
        "{total:?} N"
    );
}

/// A cart with a pole, and a ship, each pushed by one actuator.
const PUSHED_BODIES: &str = r#"Environment(
    description: "A test.", gravity: (0.0, 0.0), control_step: 0.01, time_limit: 100, solver: (iterations: 4),
    bodies: [
        (name: "cart", mass: 1.0, inertia: 1.0, geoms: [Box(half_size: (0.2, 0.1))]),
        (name: "pole", mass: 1000.0, com: (0.0, 0.5), inertia: 1000.0),
        (name: "ship", position: (5.0, 0.0), mass: 1000.0, inertia: 1000.0),
    ],
    joints: [
        (name: "rail", parent: "world", child: "cart", type: Slide(axis: (1.0, 0.0))),
        (name: "hinge", parent: "cart", child: "pole", type: Hinge(positive: Clockwise)),
    ],
    actuators: [
        (name: "push", type: JointForce("rail"), gear: 2.0, control: Continuous(-1.0, 1.0)),
        (name: "turn", type: JointForce("hinge"), control: Continuous(-9.0, 9.0)),
        (name: "jet", type: BodyForce(body: "ship", at: (0.0, 1.0), direction: (0.0, -1.0)), control: Continuous(0.0, 7.0)),
    ],
    sensors: [], observations: [], reward: "0",
)"#;

/// The force of an action is drawn on a cart along its rail, on a hinge as the force at the center
/// of mass with the same torque, and on a body at the point of application.
#[test]
fn actions_are_drawn_as_forces() {
    let task = parse_bodies("test", PUSHED_BODIES.to_owned());
    let mut environment = build_bodies(&task, Physics::Rapier, 2);
    environment.reset(1, &mut stream(0, Purpose::Reset, 0, 0));
    let bodies = environment.scene().expect("it has a shape").bodies.len();
    let mut poses = vec![Pose::default(); bodies];
    let mut seen = |environment: &dyn seedbed_env::Environment| {
        let mut forces = Vec::new();
        environment.poses(1, &mut poses);
        environment.forces(1, &poses, &mut forces);
        forces
    };
    assert_eq!(seen(&*environment), []);
    environment.step(&[0.0, 0.0, 0.0, 0.5, 3.0, 7.0]);
    let forces = seen(&*environment);
    // 0.5 × 2 N; clockwise 3 N m at 0.5 m: 6 N to the right; 7 N downwards, 1 m above the ship's
    // origin. Bodies hardly moved.
    let expected = [
        ([0.0, 0.0], [1.0, 0.0]),
        ([0.0, 0.5], [6.0, 0.0]),
        ([5.0, 1.0], [0.0, -7.0]),
    ];
    assert_eq!(forces.len(), 3, "{forces:?}");
    for (force, (at, newtons)) in forces.iter().zip(expected) {
        let off = |found: [f32; 2], expected: [f32; 2]| {
            (found[0] - expected[0]).hypot(found[1] - expected[1])
        };
        assert!(
            off(force.at, at) < 0.01 && off(force.newtons, newtons) < 0.01,
            "{force:?}, expected {at:?} {newtons:?}"
        );
    }
}

/// How far (m) and how fast (m/s) a box has slid down a slope of angle `slope` after a second.
fn slide(slope: f64, friction: f64) -> (f64, f64) {
    let (sine, cosine) = slope.sin_cos();
    let rest = format!(
        r#"
        colliders: [(geom: HalfSpace(normal: ({sine}, {cosine})), friction: 0.0)],
        bodies: [(name: "block", mass: 3.0, colliders: [(geom: Box(half_size: (0.3, 0.05)), friction: {friction})])],
        sensors: [],"#
    );
    let mut sliding = bodies(&task("(0.0, -9.8)", &rest));
    sliding.start(0, &[0.05 * sine, 0.05 * cosine, -slope], &[0.0; 3]);
    run(&mut *sliding, 1.0);
    let along =
        |(x, dx): (f64, f64), (y, dy): (f64, f64)| (x * cosine - y * sine, dx * cosine - dy * sine);
    along(coordinate(&*sliding, 0), coordinate(&*sliding, 1))
}

/// Coulomb: a block on a slope α stays iff tan α ≤ μ; otherwise it slides with g (sin α − μ cos α).
#[test]
fn a_block_slips_iff_the_slope_is_steeper_than_its_friction() {
    for slope in [0.2, 0.5, 0.8] {
        let (moved, speed) = slide(slope, 1.05 * slope.tan());
        assert!(
            moved.abs() < 2e-3 && speed.abs() < 2e-3,
            "{slope} rad: it slid {moved} m"
        );
        let friction = 0.7 * slope.tan();
        let (_, speed) = slide(slope, friction);
        let expected = 9.8 * (slope.sin() - friction * slope.cos());
        assert!(
            (speed / expected - 1.0).abs() < 0.02,
            "{slope} rad: {speed} m/s instead of {expected} m/s"
        );
    }
}

/// A ball that falls from h hits the ground with √(2 g h), leaves it with e times that speed, and
/// rises to e² h.
#[test]
fn a_ball_bounces_as_high_as_its_restitution_says() {
    for restitution in [0.0, 0.5, 0.8, 1.0] {
        let rest = format!(
            r#"
            colliders: [(geom: HalfSpace(normal: (0.0, 1.0)), restitution: {restitution})],
            bodies: [(name: "ball", mass: 1.0, colliders: [(geom: Ball(radius: 0.1))])],
            sensors: [],"#
        );
        let mut ball = bodies(&task("(0.0, -9.8)", &rest));
        ball.start(0, &[0.0, 1.1, 0.0], &[0.0; 3]);
        let mut highest = 0.0_f64;
        let mut has_hit = false;
        for _ in 0..100 {
            run(&mut *ball, CONTROL_STEP);
            let (y, rate) = coordinate(&*ball, 1);
            has_hit |= rate >= 0.0;
            highest = highest.max(if has_hit { y - 0.1 } else { 0.0 });
        }
        let expected = restitution * restitution;
        assert!(
            (highest - expected).abs() < 0.06,
            "restitution {restitution}: {highest} m instead of {expected} m"
        );
    }
}

/// A ball at 60 m/s passes another one at a distance of 1 cm.
#[test]
fn a_ball_with_restitution_does_not_bounce_off_what_it_misses() {
    let rest = r#"
        colliders: [(geom: Ball(radius: 0.1), restitution: 0.9)],
        bodies: [(name: "ball", mass: 1.0, colliders: [(geom: Ball(radius: 0.1))])],
        sensors: [],"#;
    let mut ball = bodies(&task("(0.0, 0.0)", rest));
    ball.start(0, &[-2.5, 0.21, 0.0], &[60.0, 0.0, 0.0]);
    run(&mut *ball, 0.1);
    let [(x, x_rate), (y, y_rate)] = [0, 1].map(|axis| coordinate(&*ball, axis));
    assert!((x - 3.5).abs() < 1e-4 && (x_rate - 60.0).abs() < 1e-4);
    assert!((y - 0.21).abs() < 1e-4 && y_rate.abs() < 1e-4);
}

/// MuJoCo's rule: two surfaces touch iff the `conaffinity` of one has a bit of the `contype` of the
/// other.
#[test]
fn bodies_pass_through_surfaces_of_other_collision_groups() {
    for (contype, conaffinity, stays) in [
        (1, 1, true),
        (1, 0, true),
        (2, 1, true),
        (2, 0, false),
        (2, 4, false),
    ] {
        let rest = format!(
            r#"
            colliders: [(geom: HalfSpace(normal: (0.0, 1.0)))],
            bodies: [(name: "ball", mass: 1.0, colliders: [
                (geom: Ball(radius: 0.1), contype: {contype}, conaffinity: {conaffinity})
            ])],
            sensors: [],"#
        );
        let mut ball = bodies(&task("(0.0, -9.8)", &rest));
        ball.start(0, &[0.0, 0.1, 0.0], &[0.0; 3]);
        run(&mut *ball, 0.5);
        assert_eq!(
            coordinate(&*ball, 1).0 > 0.0,
            stays,
            "contype {contype}, conaffinity {conaffinity}"
        );
    }
}

/// An eye, turned by a right angle, with four rays that start 0.5 m right of its origin in its own
/// frame.
fn eye_with_rays() -> BodyTask {
    let ray = |name: &str, direction: &str| {
        format!(
            r#"(name: "{name}", type: Ray(body: "eye", from: (0.5, 0.0), direction: {direction}, length: 10.0)),"#
        )
    };
    let rays = [
        ray("ahead", "(1.0, 0.0)"),
        ray("left", "(0.0, 1.0)"),
        ray("right", "(0.0, -2.0)"),
        ray("back", "(-1.0, 0.0)"),
        ray("east", "(1.0, 0.0), frame: World"),
        ray("second_group_left", "(0.0, 1.0), conaffinity: 2"),
        ray("second_group_ahead", "(1.0, 0.0), conaffinity: 2"),
    ];
    let names = [
        "ahead",
        "left",
        "right",
        "back",
        "east",
        "second_group_left",
        "second_group_ahead",
    ]
    .map(|name| format!(r#"(name: "{name}", range: (0.0, 10.0)),"#));
    let text = format!(
        r#"Environment(
            description: "Rays.", gravity: (0.0, 0.0), control_step: 0.01, time_limit: 10,
            colliders: [
                (geom: HalfSpace(point: (0.0, 4.0), normal: (0.0, -1.0))),
                (geom: Ball(center: (-3.0, 1.5), radius: 0.5), contype: 2),
                (geom: Box(center: (2.0, 1.5), half_size: (0.25, 0.25), angle: 0.7853981633974483)),
            ],
            bodies: [(name: "eye", position: (0.0, 1.0), angle: 1.5707963267948966, mass: 1.0,
                colliders: [(geom: Ball(radius: 0.6))])],
            actuators: [], sensors: [{}], observations: [{}], reward: "0",
        )"#,
        rays.concat(),
        names.concat()
    );
    parse_bodies("rays", text)
}

/// The rays measure the distances that are computed by hand.
#[test]
fn rays_measure_distances() {
    let mut environment = build_bodies(&eye_with_rays(), Physics::Rapier, 1);
    environment.reset(0, &mut stream(0, Purpose::Reset, 0, 0));
    // From (0, 1.5): up to the half-space at 4; to −x, the ball's near side at −2.5; to +x, the
    // turned box's corner at 2 − 0.25 √2; down, nothing but the body's own ball. East is +x; of the
    // second group there is only the ball.
    for (found, expected) in environment.observations().iter().zip([
        2.5,
        2.5,
        2.0 - 0.25 * std::f32::consts::SQRT_2,
        10.0,
        2.0 - 0.25 * std::f32::consts::SQRT_2,
        2.5,
        10.0,
    ]) {
        assert!(
            (found - expected).abs() < 1e-5,
            "{found} m instead of {expected} m"
        );
    }
}

/// The file places a free body at (0.5, 2) with angle 1. A reset that gives only its height leaves
/// the other positions as in the file.
#[test]
fn a_start_without_a_position_is_where_the_file_places_the_body() {
    let text = r#"Environment(
        description: "A stone.", gravity: (0.0, 0.0), control_step: 0.01, time_limit: 10,
        bodies: [(name: "peg", mass: 1.0, inertia: 1.0), (name: "stone", position: (0.5, 2.0), angle: 1.0, mass: 1.0, inertia: 1.0)],
        joints: [(name: "nail", parent: "world", child: "peg", type: Hinge())],
        reset: [
            (joint: "nail", velocity: Constant(1.0)), (joint: "stone.x", velocity: Constant(1.0)),
            (joint: "stone.y", position: Constant(3.0)), (joint: "stone.angle", velocity: Constant(1.0)),
        ],
        sensors: [(name: "turn", type: JointPosition("nail")), (name: "x", type: JointPosition("stone.x")),
            (name: "y", type: JointPosition("stone.y")), (name: "angle", type: JointPosition("stone.angle"))],
        observations: [(name: "turn", range: (-1.0, 1.0)), (name: "x", range: (-1.0, 1.0)), (name: "y", range: (-1.0, 1.0)),
            (name: "angle", range: (-1.0, 1.0))],
        actuators: [], reward: "0",
    )"#;
    let mut environment = build_bodies(&parse_bodies("stone", text.to_owned()), Physics::Rapier, 1);
    environment.reset(0, &mut stream(0, Purpose::Reset, 0, 0));
    assert_eq!(environment.observations(), [0.0, 0.5, 3.0, 1.0]);
}

/// A wheel of 0.1 kg m² on a hinge through its center of mass, in a world with contacts.
/// `joint_fields` are further fields of the joint.
fn wheel(joint_fields: &str, actuators: &str) -> BodyTask {
    let text = format!(
        r#"Environment(
            description: "A wheel.", gravity: (0.0, -9.8), control_step: {CONTROL_STEP}, time_limit: 100000,
            solver: (iterations: {SUBSTEPS}),
            bodies: [(name: "wheel", mass: 2.0, inertia: 0.1, colliders: [(geom: Ball(radius: 0.1))])],
            joints: [(name: "axle", parent: "world", child: "wheel", type: Hinge(positive: Clockwise), {joint_fields})],
            actuators: [{actuators}], sensors: [], observations: [], reward: "0",
        )"#
    );
    parse_bodies("wheel", text)
}

/// J q̈ = −c q̇ − k (q − q₀) with the rotor's inertia in J: for J = 0.1 + 0.15, c = 0.2, k = 4, the
/// decay is c / 2 J = 0.4 1/s and the frequency √(k / J − 0.4²). Implicit Euler damps a little
/// more: by k h / 2 J = 0.02 1/s.
#[test]
fn a_spring_swings_as_its_stiffness_damping_and_armature_say() {
    let task = wheel(
        "stiffness: 4.0, springref: 0.5, damping: 0.2, armature: 0.15",
        "",
    );
    let mut wheel = bodies(&task);
    wheel.start(0, &[1.5], &[0.0]);
    let (decay, frequency): (f64, f64) = (0.4, (16.0_f64 - 0.16).sqrt());
    for step in 1..=200 {
        run(&mut *wheel, CONTROL_STEP);
        let time = CONTROL_STEP * f64::from(step);
        let swing = (frequency * time).cos() + decay / frequency * (frequency * time).sin();
        let expected = 0.5 + (-decay * time).exp() * swing;
        let (angle, _) = coordinate(&*wheel, 0);
        assert!(
            (angle - expected).abs() < 0.03,
            "after {time} s: {angle} rad instead of {expected} rad"
        );
    }
}

/// Dry friction of 0.3 N m takes ω = 0.3 / 0.1 × t off a wheel's speed, and then holds it.
#[test]
fn dry_friction_brakes_a_joint_evenly_and_then_holds_it() {
    let mut wheel = bodies(&wheel("frictionloss: 0.3", ""));
    wheel.start(0, &[0.0], &[3.0]);
    run(&mut *wheel, 0.5);
    let (_, rate) = coordinate(&*wheel, 0);
    assert!((rate - 1.5).abs() < 0.02, "{rate} rad/s");
    run(&mut *wheel, 1.5);
    let (angle, rate) = coordinate(&*wheel, 0);
    assert!(
        rate.abs() < 1e-3 && (angle - 1.5).abs() < 0.02,
        "expected ω² J / 2 M = 1.5 rad at rest, found {angle} rad at {rate} rad/s"
    );
}

/// A joint stops at the end of its range and stays within it, up to a hundredth of a radian.
#[test]
fn a_joint_stops_at_its_range() {
    let push = r#"(name: "push", type: JointForce("axle"), control: Continuous(-1.0, 1.0))"#;
    let mut wheel = bodies(&wheel("range: (-0.4, 0.7)", push));
    for (force, end) in [(1.0_f32, 0.7), (-1.0, -0.4)] {
        wheel.start(0, &[0.0], &[0.0]);
        (0..300).for_each(|_| wheel.step(&[force]));
        let (angle, rate) = coordinate(&*wheel, 0);
        assert!(
            (angle - end).abs() < 0.01 && rate.abs() < 0.05,
            "{angle} rad instead of {end} rad, {rate} rad/s"
        );
    }
}

/// A position servo with critical damping and a velocity servo with limited force both reach their
/// targets.
#[test]
fn servos_reach_their_targets() {
    let position = r#"(name: "aim", type: PositionServo(joint: "axle", kp: 10.0, kv: 2.0), control: Continuous(-2.0, 2.0))"#;
    let mut aiming = bodies(&wheel("", position));
    aiming.start(0, &[0.0], &[0.0]);
    (0..200).for_each(|_| aiming.step(&[1.2]));
    let (angle, rate) = coordinate(&*aiming, 0);
    assert!(
        (angle - 1.2).abs() < 1e-3 && rate.abs() < 1e-3,
        "{angle} rad, {rate} rad/s"
    );
    let velocity = r#"(name: "go", type: VelocityServo(joint: "axle", kv: 5.0, force_limit: 0.2), control: Continuous(-5.0, 5.0))"#;
    let mut going = bodies(&wheel("", velocity));
    going.start(0, &[0.0], &[0.0]);
    (0..50).for_each(|_| going.step(&[-3.0]));
    let (_, rate) = coordinate(&*going, 0);
    assert!(
        (rate + 1.0).abs() < 0.01,
        "expected −1 rad/s after 0.5 s under −0.2 N m, found {rate} rad/s"
    );
    (0..150).for_each(|_| going.step(&[-3.0]));
    let (_, rate) = coordinate(&*going, 0);
    assert!((rate + 3.0).abs() < 0.01, "{rate} rad/s");
}

/// A force at a point accelerates a body by F / m and turns it by r × F / I about its center of
/// mass. A force in the body's frame turns with the body.
#[test]
fn a_body_force_pushes_and_turns() {
    let text = |frame: &str| {
        format!(
            r#"Environment(
                description: "A disc.", gravity: (0.0, 0.0), control_step: {CONTROL_STEP}, time_limit: 1000,
                solver: (iterations: {SUBSTEPS}),
                bodies: [(name: "disc", mass: 2.0, com: (0.5, 0.0), inertia: 0.4, forces: [(y: "-push", frame: {frame})])],
                actuators: [
                    (name: "thrust", type: BodyForce(body: "disc", at: (0.5, 0.2), direction: (1.0, 0.0), frame: {frame}),
                     control: Continuous(-5.0, 5.0)),
                    (name: "push", type: Signal, control: Continuous(-5.0, 5.0)),
                ],
                sensors: [], observations: [], reward: "0",
            )"#
        )
    };
    // The disc starts turned by a right angle: what is 0.2 m above its center of mass is 0.2 m to
    // the left in the world.
    let quarter = std::f64::consts::FRAC_PI_2;
    for (frame, velocity, spin) in [
        ("World", [0.05, -0.02], 0.0),
        ("Local", [0.02, 0.05], -0.05),
    ] {
        let mut disc = bodies(&parse_bodies("disc", text(frame)));
        disc.start(0, &[0.0, 0.0, quarter], &[0.0; 3]);
        disc.step(&[10.0, 4.0, 0.0, -4.0]);
        let [(_, right), (_, up), (_, turn)] = [0, 1, 2].map(|index| coordinate(&*disc, index));
        // The center of mass is 0.5 m above the frame's origin in the world: the origin is faster
        // to the right by ω × 0.5.
        let center = [right - turn * 0.5, up];
        assert!(
            (center[0] - velocity[0]).abs() < 1e-4 && (center[1] - velocity[1]).abs() < 1e-4,
            "{frame}: {center:?}"
        );
        assert!((turn - spin).abs() < 1e-4, "{frame}: {turn} rad/s");
    }
}

/// A weight beyond what numbers of single precision can express: Rapier cannot compute with it. The
/// motion is not finite, and the next episode begins like any other.
#[test]
fn a_motion_that_cannot_be_computed_is_not_finite() {
    let text = r#"Environment(
        description: "A test.", gravity: (3e38, 0.0), control_step: 10.0, time_limit: 16,
        bodies: [
            (name: "block", mass: 1.0, colliders: [(geom: Ball(radius: 0.1))]),
        ],
        joints: [(name: "rail", parent: "world", child: "block", type: Slide(axis: (1.0, 0.0)), range: (-1.5, 2.0))],
        actuators: [(name: "servo", type: VelocityServo(joint: "rail", kv: 1.2), control: Continuous(2.8, 3.1))],
        sensors: [], observations: [], reward: "0",
    )"#;
    let task = parse_bodies("test", text.to_owned());
    let mut bodies = bodies(&task);
    for _ in 0..2 {
        bodies.start(0, &[0.3], &[3.4]);
        assert_eq!(bodies.coordinates().get(0, 0), (0.3, 3.4));
        for _ in 0..5 {
            bodies.step(&[3.0]);
        }
        let (position, velocity) = coordinate(&*bodies, 0);
        assert!(
            position.is_nan() && velocity.is_nan(),
            "{position} {velocity}"
        );
    }
}

/// A motor of at most 0.4 N m at half its control accelerates the wheel by 0.5 × 0.4 / 0.1 = 2 rad/s² up
/// to 3 rad/s, which it keeps; against the direction of motion it brakes with the force of its control,
/// and without control it does nothing.
#[test]
fn a_speed_motor_drives_to_its_speed_with_the_force_of_its_control() {
    let motor = r#"(name: "motor", type: SpeedMotor(joint: "axle", speed: 3.0, max_force: 0.4), control: Continuous(-1.0, 1.0))"#;
    let with_contacts = wheel("", motor);
    let mut without_contacts = with_contacts.clone();
    without_contacts.colliders.clear();
    for task in [with_contacts, without_contacts] {
        let mut wheel = bodies(&task);
        wheel.start(0, &[0.0], &[0.0]);
        let mut speed_after = |control: f32, steps: u32| {
            (0..steps).for_each(|_| wheel.step(&[control]));
            coordinate(&*wheel, 0).1
        };
        let speeds = [
            speed_after(0.5, 100),
            speed_after(0.5, 100),
            speed_after(0.0, 50),
            speed_after(-0.25, 100),
            speed_after(-1.0, 200),
        ];
        for (speed, expected) in speeds.into_iter().zip([2.0, 3.0, 3.0, 2.0, -3.0]) {
            assert!((speed - expected).abs() < 2e-3, "{speeds:?}");
        }
    }
}
