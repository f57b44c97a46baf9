//! Bodies with several joints, and forces along coordinates of free bodies, against closed forms and
//! against the same system described otherwise.

use std::f64::consts::TAU;

use seedbed_env::description::BodyTask;
use seedbed_env::dynamics::Dynamics;
use seedbed_env::{Physics, build_dynamics};

use crate::parse_bodies;

const CONTROL_STEP: f64 = 0.01;

fn task(gravity: &str, fields: &str) -> BodyTask {
    let text = format!(
        r#"Environment(
            description: "A test.", gravity: {gravity}, control_step: {CONTROL_STEP}, time_limit: 100000,
            solver: (iterations: 64), {fields} sensors: [], observations: [], reward: "0",
        )"#
    );
    parse_bodies("test", text)
}

/// The bodies of a task at a start, after some control steps with these controls.
fn moved(task: &BodyTask, start: [&[f64]; 2], controls: &[f32], seconds: f64) -> Box<dyn Dynamics> {
    let mut bodies = build_dynamics(task, Physics::Rapier, 1).expect("every task has rigid bodies");
    bodies.start(0, start[0], start[1]);
    (0..(seconds / CONTROL_STEP).round() as u32).for_each(|_| bodies.step(controls));
    bodies
}

fn coordinate(bodies: &dyn Dynamics, index: usize) -> (f64, f64) {
    let (position, velocity) = bodies.coordinates().get(index, 0);
    (f64::from(position), f64::from(velocity))
}

/// A body with an arm whose center of mass is neither at its origin nor at the anchor of its joints.
/// `root_joints`: joints between the world and the body.
fn body_with_arm(root_joints: &str) -> BodyTask {
    let fields = r#"
        bodies: [
            (name: "root", position: (0.2, 3.0), angle: 0.3, mass: 1.0, com: (0.1, -0.05), inertia: 0.03),
            (name: "arm", position: (0.5, 3.0), angle: -0.2, mass: 0.5, com: (0.25, 0.0), inertia: 0.01),
        ],
        joints: [ROOT
            (name: "shoulder", parent: "root", child: "arm", type: Hinge(), damping: 0.05),
        ],
        actuators: [(name: "torque", type: JointForce("shoulder"), control: Continuous(-9.0, 9.0))],
    "#;
    task("(1.0, -9.8)", &fields.replace("ROOT", root_joints))
}

/// Two slides and a hinge let a body move freely, whatever the directions of the slides: its joints'
/// coordinates follow from those of a free body. The slides turn by the angle of the frame at
/// coordinate 0, 0.3 rad, so that u along the axis (1, 0) of the body is along (cos 0.3, sin 0.3).
#[test]
fn a_body_with_two_slides_and_a_hinge_moves_like_a_free_one() {
    let (start, rates) = ([0.2, 3.0, 0.3], [1.0, 2.0, 1.5]);
    let free = moved(
        &body_with_arm(""),
        [
            &[0.1, start[0], start[1], start[2]],
            &[-2.0, rates[0], rates[1], rates[2]],
        ],
        &[0.7],
        0.5,
    );
    let free: Vec<_> = (0..4).map(|index| coordinate(&*free, index)).collect();
    for [first, second, turn] in [
        ["(1.0, 0.0)", "(0.0, 1.0)", "Hinge()"],
        ["(0.0, 1.0)", "(1.0, 0.0)", "Hinge()"],
        ["(0.6, 0.8)", "(0.8, -0.6)", "Hinge(positive: Clockwise)"],
    ] {
        let joints = format!(
            r#"(name: "a", parent: "world", child: "root", type: Slide(axis: {first})),
               (name: "b", parent: "world", child: "root", type: Slide(axis: {second})),
               (name: "turn", parent: "world", child: "root", type: {turn}),"#
        );
        let sign = if turn == "Hinge()" { 1.0 } else { -1.0 };
        let axes = [first, second].map(axis_in_world);
        let along = |[x, y]: [f64; 2], [right, up]: [f64; 2]| x * right + y * up;
        let rate = |axis| along(axis, [rates[0], rates[1]]);
        let jointed = moved(
            &body_with_arm(&joints),
            [
                &[0.0, 0.0, 0.0, 0.1],
                &[rate(axes[0]), rate(axes[1]), sign * rates[2], -2.0],
            ],
            &[0.7],
            0.5,
        );
        let ((x, right), (y, up), (angle, spin)) = (free[1], free[2], free[3]);
        for (index, axis) in axes.into_iter().enumerate() {
            let (position, velocity) = coordinate(&*jointed, index);
            let moved_by = along(axis, [x - start[0], y - start[1]]);
            assert!(
                (position - moved_by).abs() < 5e-5,
                "{first}: {position}, {moved_by}"
            );
            let rate = along(axis, [right, up]);
            assert!(
                (velocity - rate).abs() < 1e-4,
                "{first}: {velocity}, {rate}"
            );
        }
        let (turned, turn_rate) = coordinate(&*jointed, 2);
        assert!(
            (sign * turned - (angle - start[2])).abs() < 5e-5,
            "{first}: {turned}, {angle}"
        );
        assert!(
            (sign * turn_rate - spin).abs() < 2e-4,
            "{first}: {turn_rate}, {spin}"
        );
        let (arm, arm_rate) = coordinate(&*jointed, 3);
        assert!((arm - free[0].0).abs() < 5e-5 && (arm_rate - free[0].1).abs() < 5e-4);
    }
}

/// A direction of the body's frame, which is turned by 0.3 rad.
fn axis_in_world(axis: &str) -> [f64; 2] {
    let numbers: Vec<f64> = axis
        .trim_matches(['(', ')'])
        .split(", ")
        .map(|number| number.parse().unwrap())
        .collect();
    let (sine, cosine) = 0.3_f64.sin_cos();
    [
        cosine * numbers[0] - sine * numbers[1],
        sine * numbers[0] + cosine * numbers[1],
    ]
}

/// A rod whose pivot slides without friction along a level rail: its center of mass stays above one
/// point of the rail, and it turns about it. With a small angle the rail carries the weight, whose
/// moment about the center of mass is −m g l θ: the frequency is √(m g l / I) / 2 π, where I is the
/// inertia about the center of mass (not about the pivot).
#[test]
fn a_rod_on_a_sliding_pivot_swings_about_its_center_of_mass() {
    let rod = task(
        "(0.0, -9.8)",
        r#"bodies: [(name: "rod", mass: 0.4, com: (0.0, -0.5), inertia: 0.02)],
        joints: [
            (name: "rail", parent: "world", child: "rod", type: Slide(axis: (1.0, 0.0))),
            (name: "pivot", parent: "world", child: "rod", type: Hinge()),
        ],
        actuators: [],"#,
    );
    let half_period = TAU / 2.0 / (0.4 * 9.8 * 0.5 / 0.02_f64).sqrt();
    let swung = moved(&rod, [&[0.0, 0.01], &[0.0, 0.0]], &[], half_period);
    let time = (half_period / CONTROL_STEP).round() * CONTROL_STEP;
    let expected = 0.01 * (TAU / 2.0 * time / half_period).cos();
    let ((x, _), (angle, _)) = (coordinate(&*swung, 0), coordinate(&*swung, 1));
    assert!(
        (angle / expected - 1.0).abs() < 0.01,
        "{angle} rad instead of {expected} rad"
    );
    // The center of mass is where it was: x + 0.5 sin θ does not change.
    assert!((x + 0.5 * angle - 0.005).abs() < 1e-5, "{x} m, {angle} rad");
}

/// Each coordinate has its own damping, spring, force and range: v = F/c (1 − exp(−c t / m)) along
/// the first, x = x₀ cos(√(k / m) t) along the second; the hinge turns to the end of its range.
#[test]
fn each_coordinate_of_a_body_has_its_own_forces() {
    let body = task(
        "(0.0, 0.0)",
        r#"bodies: [(name: "block", mass: 2.0, inertia: 0.1)],
        joints: [
            (name: "a", parent: "world", child: "block", type: Slide(axis: (1.0, 0.0)), damping: 4.0),
            (name: "b", parent: "world", child: "block", type: Slide(axis: (0.0, 1.0)), stiffness: 8.0),
            (name: "turn", parent: "world", child: "block", type: Hinge(), range: (-0.5, 0.5)),
        ],
        actuators: [
            (name: "pull", type: JointForce("a"), control: Continuous(-9.0, 9.0)),
            (name: "torque", type: JointForce("turn"), control: Continuous(-9.0, 9.0)),
        ],"#,
    );
    let moved = moved(&body, [&[0.0, 0.3, 0.0], &[0.0; 3]], &[6.0, 0.1], 1.0);
    let (_, velocity) = coordinate(&*moved, 0);
    let expected = 6.0 / 4.0 * (1.0 - (-4.0 / 2.0_f64).exp());
    assert!(
        (velocity / expected - 1.0).abs() < 2e-3,
        "{velocity} m/s, {expected} m/s"
    );
    let (height, _) = coordinate(&*moved, 1);
    let expected = 0.3 * (8.0_f64 / 2.0).sqrt().cos();
    assert!(
        (height / expected - 1.0).abs() < 2e-2,
        "{height} m, {expected} m"
    );
    let (angle, _) = coordinate(&*moved, 2);
    assert!((angle - 0.5).abs() < 5e-3, "{angle} rad");
}

/// Forces along the coordinates of a free body act at the origin of its frame, which is 0.3 m from
/// its center of mass: p = F t, and the angular momentum about the center of mass is that of the
/// force's arm, L = −0.3 F_y t as long as the body has hardly turned, plus that of the torque.
#[test]
fn forces_along_coordinates_of_a_free_body_act_at_its_origin() {
    let puck = task(
        "(0.0, 0.0)",
        r#"bodies: [(name: "puck", mass: 0.5, com: (0.3, 0.0), inertia: 2.0)],
        actuators: [
            (name: "x", type: JointForce("puck.x"), control: Continuous(-9.0, 9.0)),
            (name: "y", type: JointForce("puck.y"), control: Continuous(-9.0, 9.0), gear: 2.0),
            (name: "turn", type: JointForce("puck.angle"), control: Continuous(-9.0, 9.0)),
        ],"#,
    );
    let time = 0.05;
    let moved = moved(&puck, [&[0.0; 3], &[0.0; 3]], &[1.0, 2.0, 0.5], time);
    let rates: Vec<_> = (0..3).map(|index| coordinate(&*moved, index).1).collect();
    let spin = (0.5 - 0.3 * 4.0) / 2.0 * time;
    assert!((rates[2] / spin - 1.0).abs() < 1e-3, "{rates:?}");
    let center = [rates[0], rates[1] + 0.3 * rates[2]];
    assert!(
        (center[0] / (1.0 / 0.5 * time) - 1.0).abs() < 5e-3,
        "{rates:?}"
    );
    assert!(
        (center[1] / (4.0 / 0.5 * time) - 1.0).abs() < 5e-3,
        "{rates:?}"
    );
}

/// Two bodies in a chain that turn about their centers of mass at the same point, so that only the
/// rotations couple: with rotors a₁, a₂ the mass matrix is [[I₁ + I₂ + a₁, I₂], [I₂, I₂ + a₂]]. A torque τ
/// of the second joint accelerates it by τ (I₁ + I₂ + a₁) / det, and the first by −τ I₂ / det.
#[test]
fn an_armature_below_another_hinge_is_that_of_its_joint() {
    let chain = task(
        "(0.0, 0.0)",
        r#"bodies: [(name: "first", mass: 1.0, inertia: 0.3), (name: "second", mass: 1.0, inertia: 0.2)],
        joints: [
            (name: "a", parent: "world", child: "first", type: Hinge(), armature: 0.1),
            (name: "b", parent: "first", child: "second", type: Hinge(), armature: 0.5),
        ],
        actuators: [(name: "torque", type: JointForce("b"), control: Continuous(-9.0, 9.0))],"#,
    );
    let moved = moved(&chain, [&[0.0; 2], &[0.0; 2]], &[1.5], 1.0);
    let determinant = 0.6 * 0.7 - 0.2 * 0.2;
    let expected = [-1.5 * 0.2 / determinant, 1.5 * 0.6 / determinant];
    for (index, expected) in expected.into_iter().enumerate() {
        let (_, velocity) = coordinate(&*moved, index);
        assert!(
            (velocity / expected - 1.0).abs() < 1e-3,
            "{velocity}, {expected}"
        );
    }
}

/// A soft end of a hinge's range yields under a lasting torque by its acceleration over ω².
#[test]
fn a_soft_end_of_a_hinge_holds() {
    let wheel = task(
        "(0.0, 0.0)",
        r#"bodies: [(name: "wheel", mass: 1.0, inertia: 0.5)],
        joints: [(name: "axle", parent: "world", child: "wheel", type: Hinge(), range: (-1.0, 1.0),
            range_softness: (natural_frequency: 8.0, damping_ratio: 1.0))],
        actuators: [(name: "torque", type: JointForce("axle"), control: Continuous(-999.0, 999.0))],"#,
    );
    let pressed = moved(&wheel, [&[0.9], &[0.0]], &[60.0], 2.0);
    let expected = 1.0 + 60.0 / 0.5 / (TAU * 8.0).powi(2);
    let (angle, _) = coordinate(&*pressed, 0);
    assert!(
        (angle - expected).abs() < 0.01,
        "{angle} rad, {expected} rad"
    );
}

/// A body that slides along x and y without contacts: F / m along x, with damping and an inelastic wall
/// along y, as with two bodies that slide along one axis each.
#[test]
fn a_body_on_two_rails_moves_like_two_bodies_on_one() {
    let fields = |second_child: &str| {
        format!(
            r#"bodies: [(name: "point", position: (0.5, -0.2), mass: 2.0, inertia: 0.1), (name: "other", position: (0.5, -0.2), mass: 2.0, inertia: 0.1)],
            joints: [
                (name: "a", parent: "world", child: "point", type: Slide(axis: (-1.0, 0.0)), damping: 0.5),
                (name: "b", parent: "world", child: "{second_child}", type: Slide(axis: (0.0, 1.0)), range: (-0.3, 0.3), stiffness: 3.0),
                (name: "rest", parent: "world", child: "{}", type: Slide(axis: (1.0, 0.0))),
            ],
            actuators: [
                (name: "x", type: JointForce("a"), control: Continuous(-9.0, 9.0)),
                (name: "y", type: JointForce("b"), control: Continuous(-9.0, 9.0)),
            ],"#,
            "other"
        )
    };
    let start: [&[f64]; 2] = [&[0.1, 0.2, 0.0], &[1.0, -0.5, 0.0]];
    let on_two_rails = task("(0.0, 0.0)", &fields("point"));
    assert!(!on_two_rails.needs_own_worlds());
    let one = moved(&on_two_rails, start, &[1.0, 4.0], 1.0);
    let two = moved(
        &task("(0.0, 0.0)", &fields("other")),
        start,
        &[1.0, 4.0],
        1.0,
    );
    for index in 0..2 {
        assert_eq!(
            one.coordinates().get(index, 0),
            two.coordinates().get(index, 0)
        );
    }
    assert_eq!(
        one.coordinates().get(1, 0),
        (0.3, 0.0),
        "it stands at the wall"
    );
}
