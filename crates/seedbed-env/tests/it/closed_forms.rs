//! Unusual tasks against closed forms: flat impacts, soft ends under large loads, ropes, very weak and very
//! strong numbers, directions that turn.

use std::f64::consts::{PI, TAU};

use seedbed_env::{Environment, GivenStart, Physics, parse, physics_warnings};
use seedbed_random::{Purpose, stream};

use crate::{build_bodies, parse_bodies};

/// The text of a task without gravity that observes nothing; `fields` may replace what it has.
fn text(fields: &str) -> String {
    let mut text =
        "Environment(description: \"A test.\", time_limit: 100000, reward: \"0\",".to_owned();
    for (name, default) in [
        ("gravity", "(0.0, 0.0)"),
        ("control_step", "0.02"),
        ("actuators", "[]"),
        ("sensors", "[]"),
        ("observations", "[]"),
    ] {
        if !fields.contains(&format!("{name}:")) {
            text += &format!("{name}: {default},");
        }
    }
    text + fields + ")"
}

/// One copy at a start of named coordinates.
fn started(
    fields: &str,
    positions: &[(&str, f64)],
    velocities: &[(&str, f64)],
) -> Box<dyn Environment> {
    let task = parse_bodies("test", text(fields));
    let mut environment = build_bodies(&task, Physics::Rapier, 1);
    let names = environment.start_names().coordinates;
    let indexed = |given: &[(&str, f64)]| {
        let index = |name: &str| names.iter().position(|known| known == name).unwrap();
        given
            .iter()
            .map(|&(name, value)| (index(name), value))
            .collect()
    };
    let start = GivenStart {
        positions: indexed(positions),
        velocities: indexed(velocities),
        ..GivenStart::default()
    };
    environment.reset_at(0, &mut stream(0, Purpose::Reset, 0, 0), &start);
    environment
}

fn run(environment: &mut dyn Environment, steps: u32) {
    let actions = vec![1.0; environment.spec().action_width()];
    (0..steps).for_each(|_| environment.step(&actions));
}

/// Position and velocity of a coordinate.
fn state(environment: &dyn Environment, name: &str) -> (f64, f64) {
    let names = environment.start_names().coordinates;
    let index = names.iter().position(|known| known == name).unwrap();
    let GivenStart {
        positions,
        velocities,
        ..
    } = environment.coordinates(0);
    (positions[index].1, velocities[index].1)
}

const SOLVERS: [&str; 3] = [
    "(iterations: 4)",
    "(iterations: 5, searches: 3, passes: 2)",
    "(iterations: 64, searches: 8, passes: 20)",
];

/// Whatever hits a wall with a flat face at v returns at e v and does not turn.
#[test]
fn flat_faces_bounce_as_their_restitution_says() {
    for solver in SOLVERS {
        for shape in [
            "Box(half_size: (0.5, 0.1))",
            "Box(half_size: (0.1, 0.1))",
            "Capsule(from: (-0.2, 0.0), to: (0.2, 0.0), radius: 0.1)",
            "Convex([(-0.3, -0.1), (0.1, -0.1), (0.0, 0.4)])",
            "Ball(radius: 0.1)",
        ] {
            for restitution in [0.3, 0.8, 1.0] {
                let fields = format!(
                    r#"solver: {solver}, colliders: [(geom: HalfSpace(normal: (0.0, 1.0)), friction: 0.0)],
                    bodies: [(name: "b", mass: 2.0, colliders: [(geom: {shape}, restitution: {restitution:?}, friction: 0.0)])],"#
                );
                let mut body = started(&fields, &[("b.y", 0.7)], &[("b.y", -3.0)]);
                run(&mut *body, 25);
                let ((_, speed), (_, spin)) = (state(&*body, "b.y"), state(&*body, "b.angle"));
                assert!(
                    (speed - 3.0 * restitution).abs() < 1e-3 && spin.abs() < 1e-3,
                    "{solver} {shape} {restitution}: {speed} m/s, {spin} rad/s"
                );
            }
        }
    }
}

/// A box flies at one at rest: m₁ v₁ + m₂ v₂ = m₁ v, v₂ − v₁ = e v. None turns if their faces meet in front of
/// the centers of mass.
#[test]
fn flat_faces_of_two_bodies_bounce() {
    for solver in SOLVERS {
        for heavy in [1.0, 3.0] {
            let fields = format!(
                r#"solver: {solver}, bodies: [
                    (name: "a", mass: 1.0, colliders: [(geom: Box(half_size: (0.2, 0.3)), restitution: 0.6, friction: 0.0)]),
                    (name: "b", mass: {heavy:?}, colliders: [(geom: Box(half_size: (0.2, 0.5)), friction: 0.0)]),
                ],"#
            );
            let mut bodies = started(&fields, &[("b.x", 1.0)], &[("a.x", 4.0)]);
            run(&mut *bodies, 20);
            let speeds = ["a.x", "b.x"].map(|name| state(&*bodies, name).1);
            let second = 1.6 * 4.0 / (1.0 + heavy);
            let spins = ["a.angle", "b.angle"].map(|name| state(&*bodies, name).1);
            assert!(
                (speeds[1] - second).abs() < 1e-3
                    && (speeds[0] - (4.0 - heavy * second)).abs() < 1e-3 * heavy
                    && spins.iter().all(|spin| spin.abs() < 1e-3),
                "{solver} {heavy}: {speeds:?} m/s, {spins:?} rad/s"
            );
        }
    }
}

/// A box with restitution that has bounced lies on its face in the end, without moving.
#[test]
fn a_bouncing_box_comes_to_rest() {
    let fields = r#"gravity: (0.0, -9.8), colliders: [(geom: HalfSpace(normal: (0.0, 1.0)))],
        bodies: [(name: "b", mass: 2.0, colliders: [(geom: Box(half_size: (0.3, 0.1)), restitution: 0.4)])],"#;
    let mut body = started(fields, &[("b.y", 0.6)], &[]);
    run(&mut *body, 400);
    let [(y, rate), (angle, spin)] = ["b.y", "b.angle"].map(|name| state(&*body, name));
    assert!(
        (y - 0.1).abs() < 2e-3 && rate.abs() < 1e-3,
        "{y} m, {rate} m/s"
    );
    assert!(
        angle.abs() < 1e-3 && spin.abs() < 1e-3,
        "{angle} rad, {spin} rad/s"
    );
}

fn soft_slide(damping_ratio: f64, force: f64) -> String {
    format!(
        r#"bodies: [(name: "a", mass: 2.0, inertia: 2.0)], joints: [(name: "x", parent: "world", child: "a",
            type: Slide(axis: (1.0, 0.0)), force: "{force}", range: (-1.0, 1.0),
            range_softness: (natural_frequency: 2.0, damping_ratio: {damping_ratio:?}))],"#
    )
}

/// A load presses the soft end of a slide in by its acceleration over ω², however large it is.
#[test]
fn soft_ends_of_slides_hold_any_load() {
    for force in [10.0, 150.0, 200.0, 1000.0, 1e5] {
        for damping_ratio in [0.3, 1.0, 3.0] {
            let mut slide = started(&soft_slide(damping_ratio, force), &[], &[]);
            run(&mut *slide, 1000);
            let (position, rate) = state(&*slide, "x");
            let expected = force / 2.0 / (TAU * 2.0).powi(2);
            assert!(
                ((position - 1.0) / expected - 1.0).abs() < 1e-2 && rate.abs() < 1e-3 * force,
                "{force} N, {damping_ratio}: {position} m, {expected} m, {rate} m/s"
            );
        }
    }
}

/// A load presses the soft end of a hinge in by its acceleration over ω², whatever the damping ratio.
#[test]
fn soft_ends_of_hinges_hold_loads_at_any_damping_ratio() {
    for damping_ratio in [0.02, 0.1, 0.3, 0.354, 0.49, 0.5, 0.51, 1.0, 3.0] {
        for solver in ["iterations: 4", "iterations: 3, searches: 7, passes: 3"] {
            for kind in ["Hinge()", "Hinge(positive: Clockwise)"] {
                let fields = format!(
                    r#"solver: ({solver}), bodies: [(name: "a", mass: 2.0, inertia: 2.0)],
                    joints: [(name: "x", parent: "world", child: "a", type: {kind}, force: "10", range: (-1.0, 1.0),
                        range_softness: (natural_frequency: 2.0, damping_ratio: {damping_ratio:?}))],"#
                );
                let mut hinge = started(&fields, &[], &[]);
                run(&mut *hinge, 1500);
                let (position, _) = state(&*hinge, "x");
                let expected = 5.0 / (TAU * 2.0).powi(2);
                assert!(
                    ((position - 1.0) / expected - 1.0).abs() < 1e-2,
                    "{damping_ratio} {solver} {kind}: {position} rad, {expected} rad"
                );
            }
        }
    }
}

/// A joint on a soft end, at which a load changes like a wave: its velocity is the rate of its position. Under a
/// lasting load it is 0, also if an episode starts there.
#[test]
fn velocities_on_soft_ends_are_rates_of_positions() {
    for (kind, damping_ratio) in [
        ("Hinge()", 1.0),
        ("Hinge(positive: Clockwise)", 0.2),
        ("Slide(axis: (0.0, 1.0))", 3.0),
    ] {
        let fields = |force: &str| {
            format!(
                r#"control_step: 0.005, colliders: [(geom: Ball(center: (99.0, 0.0), radius: 1.0))],
                bodies: [(name: "a", mass: 2.0, inertia: 2.0), (name: "clock", mass: 1.0, inertia: 1.0)],
                joints: [
                    (name: "x", parent: "world", child: "a", type: {kind}, force: "{force}", range: (-1.0, 1.0),
                        range_softness: (natural_frequency: 2.0, damping_ratio: {damping_ratio:?})),
                    (name: "t", parent: "world", child: "clock", type: Slide(axis: (1.0, 0.0))),
                ],
                sensors: [(name: "time", type: JointPosition("t"))],"#
            )
        };
        let mut joint = started(
            &fields("-40 - 60 * sin(3 * time)"),
            &[("x", -1.0)],
            &[("t", 1.0)],
        );
        let mut states = Vec::new();
        for _ in 0..1000 {
            run(&mut *joint, 1);
            states.push(state(&*joint, "x"));
        }
        let on_end = states.windows(3).filter(|window| window[1].0 < -1.02);
        let errors: Vec<_> = on_end
            .map(|window| (window[2].0 - window[0].0) / 0.01 - window[1].1)
            .collect();
        let mean = errors.iter().map(|error| error.abs()).sum::<f64>() / errors.len() as f64;
        // The velocity is that of the last of four substeps: half of one earlier, at up to 50 per s².
        assert!(
            errors.len() > 300 && mean < 0.035,
            "{kind}: {mean}, {} steps",
            errors.len()
        );
        let mut still = started(&fields("-10"), &[("x", -1.0)], &[]);
        run(&mut *still, 4000);
        let (position, rate) = state(&*still, "x");
        assert!(
            position < -1.03 && rate.abs() < 1e-4,
            "{kind}: {position} at {rate}"
        );
        let mut again = started(&fields("-10"), &[("x", position)], &[("x", rate)]);
        for _ in 0..10 {
            run(&mut *again, 1);
            let (now, rate) = state(&*again, "x");
            assert!(
                (now - position).abs() < 1e-5 && rate.abs() < 1e-3,
                "{kind}: {now} at {rate}"
            );
        }
    }
}

/// A damped spring of ω, ζ that is hit at v yields by v / ω exp(−ζ φ / s) with s = √(1 − ζ²), tan φ = s / ζ.
#[test]
fn soft_ends_of_slides_stop_any_speed() {
    for speed in [1.0, 20.0, 50.0] {
        let fields = soft_slide(0.3, 0.0) + "solver: (iterations: 32),";
        let mut slide = started(&fields, &[("x", 0.99)], &[("x", speed)]);
        let mut deepest = 0.0_f64;
        for _ in 0..20 {
            run(&mut *slide, 1);
            deepest = deepest.max(state(&*slide, "x").0 - 1.0);
        }
        let s = (1.0 - 0.3_f64 * 0.3).sqrt();
        let expected = speed / (TAU * 2.0) * (-0.3 / s * (s / 0.3).atan()).exp();
        assert!(
            (deepest / expected - 1.0).abs() < 0.05,
            "{speed} m/s: {deepest} m, {expected} m"
        );
    }
}

/// A bead that circles on a rope keeps its speed; twice as many substeps halve what it loses.
#[test]
fn ropes_take_less_speed_with_more_iterations() {
    let lost = |iterations: u32| {
        let fields = format!(
            r#"solver: (iterations: {iterations}), bodies: [(name: "b", mass: 1.0, inertia: 1.0)],
            ropes: [(name: "r", from: (body: "world"), to: (body: "b"), length: 1.0)],"#
        );
        let mut bead = started(&fields, &[("b.x", 1.0)], &[("b.y", 5.0)]);
        run(&mut *bead, 50);
        let [(_, right), (_, up)] = ["b.x", "b.y"].map(|name| state(&*bead, name));
        5.0 - right.hypot(up)
    };
    let losses = [8, 16, 32, 64].map(lost);
    assert!(losses[0] < 0.4, "{losses:?}");
    for pair in losses.windows(2) {
        assert!((pair[0] / pair[1] - 2.0).abs() < 0.4, "{losses:?}");
    }
}

/// Springs and dampers that hardly act do not hold a joint: v = F t / m.
#[test]
fn weak_springs_and_dampers_lock_nothing() {
    for fields in [
        "damping: 1e-16",
        "damping: 1e-20",
        "stiffness: 1e-20",
        "damping: 1e-37",
        "frictionloss: 1e-20",
    ] {
        for kind in ["Hinge()", "Slide(axis: (0.6, 0.8))"] {
            let fields = format!(
                r#"bodies: [(name: "a", mass: 1.0, inertia: 1.0)],
                joints: [(name: "j", parent: "world", child: "a", type: {kind}, force: "1", {fields})],"#
            );
            let mut joint = started(&fields, &[], &[]);
            run(&mut *joint, 50);
            let (_, rate) = state(&*joint, "j");
            assert!((rate - 1.0).abs() < 1e-5, "{fields}: {rate}");
        }
    }
    // A spring of 1e-12 N m/rad on an inertia of 1e-12 kg m² about its rest: 1 − cos t.
    let fields = r#"control_step: 4e-4, bodies: [(name: "a", mass: 1e-6, inertia: 1e-12)],
        joints: [(name: "j", parent: "world", child: "a", type: Hinge(), stiffness: 1e-12, springref: 1.0)],"#;
    let mut spring = started(fields, &[], &[]);
    run(&mut *spring, 2500);
    let (angle, _) = state(&*spring, "j");
    assert!((angle - (1.0 - 1.0_f64.cos())).abs() < 1e-3, "{angle} rad");
}

fn error_of(fields: &str) -> String {
    parse("test", "test.ron", text(fields))
        .unwrap_err()
        .to_string()
}

#[test]
fn servos_that_are_too_weak_are_refused() {
    let fields = |gains: &str| {
        format!(
            r#"bodies: [(name: "a", mass: 1.0, inertia: 1.0)], joints: [(name: "j", parent: "world", child: "a", type: Hinge())],
            actuators: [(name: "u", type: PositionServo(joint: "j", {gains}), control: Continuous(-1.0, 1.0))],"#
        )
    };
    let error = error_of(&fields("kp: 1e-20"));
    assert!(
        error.contains(
            "the servo of joint `j` is too weak for single precision: expected kp h² + kv h of at least 1e-20 in a \
             substep h of 5e-3 s"
        ),
        "{error}"
    );
    assert!(parse("test", "test.ron", text(&fields("kp: 1e-20, kv: 1e-16"))).is_ok());
}

/// Masses and forces that are all larger by the same factor change no motion.
#[test]
fn heavy_bodies_move_as_light_ones_with_light_forces() {
    for mass in [1.0, 1e9, 1e12, 1e15] {
        let double = 2.0 * mass;
        let slide = |fields: &str, actuators: &str| {
            format!(
                r#"bodies: [(name: "a", mass: {mass:?}, inertia: {mass:?})],
                joints: [(name: "j", parent: "world", child: "a", type: Slide(axis: (1.0, 0.0)), {fields})],
                actuators: [{actuators}],"#
            )
        };
        let motor = format!(
            r#"(name: "u", type: SpeedMotor(joint: "j", speed: 1.0, max_force: {double:?}), control: Continuous(-1.0, 1.0))"#
        );
        let cases = [
            (
                slide(&format!("frictionloss: {double:?}, force: \"{mass}\""), ""),
                0.0,
            ),
            (
                slide(&format!("frictionloss: {mass:?}, force: \"{double}\""), ""),
                1.0,
            ),
            (slide("", &motor), 1.0),
            (slide(&format!("force: \"{mass}\""), ""), 1.0),
        ];
        for (fields, expected) in cases {
            for colliders in [
                "",
                r"colliders: [(geom: Ball(center: (99.0, 0.0), radius: 1.0))],",
            ] {
                let mut body = started(&(fields.clone() + colliders), &[], &[]);
                run(&mut *body, 50);
                let (_, rate) = state(&*body, "j");
                assert!(
                    (rate - expected).abs() < 1e-4,
                    "{fields} {colliders}: {rate} m/s"
                );
            }
        }
    }
    let error = error_of(r#"bodies: [(name: "wall", mass: 1e30, inertia: 1.0)],"#);
    assert!(
        error.contains("body `wall` has the mass 1e30 kg"),
        "{error}"
    );
    let error = error_of(
        r#"bodies: [(name: "a", mass: 1.0, inertia: 1.0)],
        joints: [(name: "j", parent: "world", child: "a", type: Hinge(), armature: 1e30)],"#,
    );
    assert!(
        error.contains("expected at most 1e15 kg or kg m²"),
        "{error}"
    );
}

/// A force F along a slide on a rod that turns at ω: s̈ = F / m + s ω², (I + m s²) ω constant, by the classic
/// Runge–Kutta method. Twice as many substeps halve the error.
#[test]
fn a_force_along_a_slide_turns_with_it() {
    let (force, mass, inertia) = (3.0, 0.5, 1.02);
    let momentum = 2.0 * (inertia + mass * 0.3 * 0.3);
    let rate = |[s, v, _]: [f64; 3]| {
        let spin = momentum / (inertia + mass * s * s);
        [v, force / mass + s * spin * spin, spin]
    };
    let (mut exact, h) = ([0.3, 0.0, 0.0], 1e-4);
    let ahead = |x: [f64; 3], k: [f64; 3], h: f64| std::array::from_fn(|i| x[i] + h * k[i]);
    for _ in 0..5000 {
        let k1 = rate(exact);
        let k2 = rate(ahead(exact, k1, h / 2.0));
        let k3 = rate(ahead(exact, k2, h / 2.0));
        let k4 = rate(ahead(exact, k3, h));
        exact =
            std::array::from_fn(|i| exact[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]));
    }
    let error = |iterations: u32| {
        let fields = format!(
            r#"control_step: 0.1, solver: (iterations: {iterations}),
            bodies: [(name: "a", mass: 1.0, inertia: 1.0), (name: "b", mass: 0.5, inertia: 0.02)],
            joints: [
                (name: "j", parent: "world", child: "a", type: Hinge()),
                (name: "s", parent: "a", child: "b", type: Slide(axis: (1.0, 0.0)), force: "3"),
            ],"#
        );
        let mut rod = started(&fields, &[("s", 0.3)], &[("j", 2.0)]);
        run(&mut *rod, 5);
        let [(angle, _), (s, _)] = ["j", "s"].map(|name| state(&*rod, name));
        (angle - exact[2]).abs().max((s - exact[0]).abs())
    };
    let errors = [16, 32, 64].map(error);
    assert!(errors[0] < 0.02, "{errors:?}");
    assert!(
        errors
            .windows(2)
            .all(|pair| (pair[0] / pair[1] - 2.0).abs() < 0.3),
        "{errors:?}"
    );
}

/// A body at rest stays where it is, at whatever angle the file places it.
#[test]
fn angles_far_from_0_are_those_of_the_file() {
    for angle in [3.0, 1e5 + 0.3, 1e8 + 0.3, -1e30] {
        for colliders in ["", "colliders: [(geom: Ball(radius: 0.1))]"] {
            let fields = format!(
                r#"bodies: [(name: "a", mass: 1.0, inertia: 0.1, angle: {angle:?}, {colliders})],
                joints: [(name: "j", parent: "world", child: "a", type: Hinge())],"#
            );
            let mut body = started(&fields, &[], &[]);
            run(&mut *body, 3);
            let (position, _) = state(&*body, "j");
            assert!(position.abs() < 1e-6, "{angle} {colliders}: {position} rad");
        }
    }
    // A box of 2 m × 0.2 m at 1e8 rad touches a ray as far away as its angle says.
    let (sine, cosine) = 1e8_f64.sin_cos();
    let fields = r#"bodies: [(name: "a", mass: 1.0, inertia: 0.1)],
        colliders: [(geom: Box(half_size: (1.0, 0.1), angle: 1e8))],
        sensors: [(name: "d", type: Ray(body: "a", from: (0.0, 0.0), direction: DIRECTION, length: 9.0))],
        observations: [(name: "d", range: (0.0, 9.0))],"#;
    let direction = format!("({}, {})", -cosine, -sine);
    let fields = fields.replace("DIRECTION", &direction);
    let ray = started(&fields, &[("a.x", 3.0 * cosine), ("a.y", 3.0 * sine)], &[]);
    assert!(
        (ray.observations()[0] - 2.0).abs() < 1e-3,
        "{:?}",
        ray.observations()
    );
}

#[test]
fn wrapped_angles_are_within_half_a_turn() {
    let fields = r#"bodies: [(name: "a", mass: 1.0, inertia: 1.0)],
        joints: [(name: "j", parent: "world", child: "a", type: Hinge())],
        sensors: [(name: "w", type: WrappedJointPosition("j"))], observations: [(name: "w", range: (-4.0, 4.0))],"#;
    let turns = (-2000..2000).map(|turn| (f64::from(turn) + 0.5) * TAU);
    let others = [-9_402.786_812_194_25, 1e7, 1e12, -3e38, 3.0, -PI, PI];
    for angle in turns.chain(others) {
        let single = f64::from(angle as f32);
        let wrapped = started(fields, &[("j", angle)], &[]).observations()[0];
        let pi = std::f32::consts::PI;
        assert!(wrapped > -pi && wrapped <= pi, "{angle}: {wrapped}");
        let off = (single - f64::from(wrapped)).rem_euclid(TAU);
        let tolerance = 1e-6 + 1e-7 * single.abs();
        assert!(
            off.min(TAU - off) < tolerance,
            "{angle}: {wrapped}, off by {off}"
        );
    }
}

/// Axes with six digits, as MJCF models have them, are perpendicular.
#[test]
fn axes_with_six_digits_are_perpendicular() {
    let fields = |other: &str| {
        format!(
            r#"bodies: [(name: "p", mass: 1.0, inertia: 1.0)], joints: [
                (name: "x", parent: "world", child: "p", type: Slide(axis: (0.866025, 0.5))),
                (name: "y", parent: "world", child: "p", type: Slide(axis: {other})),
            ],"#
        )
    };
    let mut body = started(&fields("(-0.5, 0.866026)"), &[], &[("x", 1.0), ("y", 2.0)]);
    run(&mut *body, 50);
    assert!((state(&*body, "x").0 - 1.0).abs() < 1e-5 && (state(&*body, "y").0 - 2.0).abs() < 1e-5);
    assert!(error_of(&fields("(-0.5, 0.8661)")).contains("perpendicular"));
}

const BALL_AND_WALL: &str = r#"bodies: [
    (name: "ball", mass: 1.0, ccd: true, colliders: [(geom: Ball(radius: 0.1))]),
    (name: "wall", position: (2.0, 0.0), mass: 1e5, ccd: CCD, colliders: [(geom: Box(half_size: (0.05, 5.0)))]),
],"#;

/// `ccd` does not search for contacts between two bodies that both have it, and says so.
#[test]
fn ccd_of_both_bodies_is_reported() {
    let warning = |ccd: &str| {
        let fields = BALL_AND_WALL.replace("CCD", ccd);
        let mut bodies = started(&fields, &[], &[("ball.x", 500.0)]);
        run(&mut *bodies, 10);
        bodies.physics_warning(0).map(|warning| warning.message)
    };
    assert_eq!(warning("false"), None);
    let warning = warning("true").unwrap();
    assert!(
        warning.ends_with(
            "or remove `ccd` of one of the two: bodies that both have it do not see each other"
        ),
        "{warning}"
    );
}

/// A body that is deep in a half-space is pushed out slowly, which is reported with or without `ccd`.
#[test]
fn whoever_is_deep_in_a_half_space_is_reported() {
    for ccd in ["true", "false"] {
        for (speed, is_deep) in [(1.0, false), (4.0, false), (100.0, true), (500.0, true)] {
            let fields = format!(
                r#"colliders: [(geom: HalfSpace(point: (2.0, 0.0), normal: (-1.0, 0.0)))],
                bodies: [(name: "ball", mass: 1.0, ccd: {ccd}, colliders: [(geom: Ball(radius: 0.1))])],"#
            );
            let mut ball = started(&fields, &[], &[("ball.x", speed)]);
            run(&mut *ball, 100);
            let warning = ball.physics_warning(0).map(|warning| warning.message);
            assert_eq!(warning.is_some(), is_deep, "{ccd} {speed}: {warning:?}");
        }
    }
}

/// How far a heavy box sinks on a light one, m, and what is reported before.
fn stack(heavy: f64, fields: &str) -> (f64, Vec<String>) {
    let fields = format!(
        r#"gravity: (0.0, -9.81), colliders: [(geom: HalfSpace(normal: (0.0, 1.0)))], {fields}
        bodies: [
            (name: "light", position: (0.0, 0.1), mass: 0.1, colliders: [(geom: Box(half_size: (0.3, 0.1)))]),
            (name: "heavy", position: (0.0, 0.4), mass: {heavy:?}, colliders: [(geom: Box(half_size: (0.3, 0.2)))]),
        ],"#
    );
    let description = parse("test", "test.ron", text(&fields)).unwrap();
    let warnings = physics_warnings(&description, Physics::Rapier);
    let mut boxes = started(&fields, &[("light.y", 0.1), ("heavy.y", 0.4)], &[]);
    run(&mut *boxes, 300);
    (0.4 - state(&*boxes, "heavy.y").0, warnings)
}

/// A heavy box sinks into a light one as far as the warning says, and less with the softness that it names.
#[test]
fn a_heavy_body_on_a_light_one_is_reported_with_what_mends_it() {
    for (ratio, expected) in [(10.0, 7e-3), (50.0, 3.4e-2), (100.0, 6.9e-2)] {
        let (sink, warnings) = stack(0.1 * ratio, "solver: (searches: 4),");
        assert!((sink / expected - 1.0).abs() < 0.1, "{ratio}: {sink} m");
        assert_eq!(warnings.len(), usize::from(ratio > 60.0), "{warnings:?}");
    }
    let (_, warnings) = stack(100.0, "");
    assert_eq!(
        warnings,
        [
            "body `heavy` has 1000 times the mass of body `light`: where it lies on it, contacts yield by 6.9e-1 m; expected \
          masses more alike, or `contact_softness: (natural_frequency: 158, damping_ratio: 10)` with at least 3 \
          `solver.searches`"
        ]
    );
    let mended =
        "contact_softness: (natural_frequency: 158.0, damping_ratio: 10.0), solver: (searches: 3),";
    let (sink, warnings) = stack(100.0, mended);
    assert!(
        (sink - 0.04).abs() < 5e-3 && warnings.is_empty(),
        "{sink} m, {warnings:?}"
    );
}
