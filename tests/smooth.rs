//! Smooth tasks, which have no contacts, against closed forms: how far rigid bodies are off, that the error falls as it should, what
//! they conserve, and what springs, dampers, friction, servos and ranges do.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::path::Path;

use rand::RngExt;
use seedbed::env::analytic::acrobot::Acrobot;
use seedbed::env::analytic::cartpole::CartPole;
use seedbed::env::analytic::mountain_car::MountainCar;
use seedbed::env::analytic::pendulum::Pendulum;
use seedbed::env::description::Description;
use seedbed::env::dynamics::Dynamics;
use seedbed::env::file::parse;
use seedbed::env::task::dynamics;
use seedbed::env::{Environment, Physics, build, load};
use seedbed::random::{Purpose, Stream, stream};

fn task(name: &str) -> Description {
    load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("envs").join(name).with_extension("ron"))
        .unwrap_or_else(|error| panic!("{error}"))
}

fn with_iterations(name: &str, iterations: u32) -> Description {
    let mut task = task(name);
    task.solver.iterations = iterations;
    task
}

fn rigid(task: &Description) -> Box<dyn Dynamics> {
    dynamics(task, Physics::Rapier, 1).expect("every task has rigid bodies")
}

fn random() -> Stream {
    stream(13, Purpose::Action, 0, 0)
}

/// Positions, then velocities of all joints.
fn state(bodies: &dyn Dynamics, joints: usize) -> Vec<f64> {
    let joint = |joint| bodies.joints().get(joint, 0);
    let positions = (0..joints).map(|index| f64::from(joint(index).0));
    positions.chain((0..joints).map(|index| f64::from(joint(index).1))).collect()
}

fn start(bodies: &mut dyn Dynamics, state: &[f64]) {
    let (positions, velocities) = state.split_at(state.len() / 2);
    bodies.start(0, positions, velocities);
}

/// Largest distances, joint by joint, between rigid bodies and the twin after one control step from `trials` random states; `most`
/// bounds the states, positions first.
fn one_step_errors(task: &Description, most: &[f64], trials: usize) -> Vec<f64> {
    let (mut bodies, mut twin) = (rigid(task), dynamics(task, Physics::Analytic, 1).unwrap());
    let (mut random, joints) = (random(), task.joints.len());
    let mut worst = vec![0.0_f64; 2 * joints];
    for _ in 0..trials {
        let before: Vec<_> = most.iter().map(|&most| f64::from(random.random_range(-most..most) as f32)).collect();
        let range = task.actuators[0].range;
        let control = random.random_range(range[0]..range[1]);
        for dynamics in [&mut bodies, &mut twin] {
            start(&mut **dynamics, &before);
            dynamics.step(&[control]);
        }
        let errors = state(&*bodies, joints).into_iter().zip(state(&*twin, joints)).map(|(found, exact)| (found - exact).abs());
        worst.iter_mut().zip(errors).for_each(|(worst, error)| *worst = worst.max(error));
    }
    worst
}

/// Semi-implicit Euler in n substeps puts a position off by ½ a t² / n: the error of one control step halves when n doubles, and at
/// the file's own n it is within what the file's comment says.
#[test]
fn one_step_errors_are_as_stated_and_halve_when_substeps_double() {
    for (name, most, stated) in [
        ("pendulum", vec![PI, 8.0], vec![7e-3]),
        ("acrobot", vec![PI, PI, 3.0, 5.0], vec![8e-3, 2e-2]),
        ("cartpole_swingup", vec![3.0, PI, 4.0, 6.0], vec![1e-3, 2e-3]),
        ("cartpole_swingup_concurrent", vec![3.0, PI, 4.0, 8.0], vec![2e-4, 4e-4]),
    ] {
        let own = task(name).solver.iterations;
        let [coarse, fine] = [own, 2 * own].map(|iterations| one_step_errors(&with_iterations(name, iterations), &most, 300));
        println!("{name}: {coarse:?}, {fine:?}");
        for (joint, &stated) in stated.iter().enumerate() {
            assert!(coarse[joint] < stated, "{name}: {coarse:?}");
            let ratio = coarse[joint] / fine[joint];
            assert!((1.8..2.2).contains(&ratio), "{name}: joint {joint}: a ratio of {ratio}");
        }
    }
}

/// Gym's own step of 0.05 s (`newthdot = thdot + (3 g / (2 l) sin θ + 3 u / (m l²)) dt; newth = th + newthdot dt`) is about five
/// times as far off as five substeps, and the equations are Gym's.
#[test]
fn a_pendulum_is_four_times_closer_than_gyms() {
    let task = task("pendulum");
    let (equations, mut random) = (Pendulum::of(&task).unwrap(), random());
    let mut worst = 0.0_f64;
    for _ in 0..300 {
        let (theta, rate, torque) =
            (random.random_range(-PI..PI), random.random_range(-8.0..8.0), random.random_range(-2.0..2.0));
        let gyms = 3.0 * 10.0 / 2.0 * f64::sin(theta) + 3.0 * torque;
        assert!((equations.acceleration(theta, torque) - gyms).abs() < 1e-12);
        let rate_after = rate + gyms * 0.05;
        let exact = (0..50).fold([theta, rate], |state, _| equations.runge_kutta(state, torque, 0.001));
        worst = worst.max((theta + rate_after * 0.05 - exact[0]).abs());
    }
    let ratio = worst / one_step_errors(&task, &[PI, 8.0], 300)[0];
    assert!((4.0..6.0).contains(&ratio), "{ratio}");
}

/// Gym's `_dsdt` with `book_or_nips = "book"`, written as it stands there, for masses, lengths and inertias of 1 and centres at 0.5.
#[test]
fn the_acrobots_equations_are_gyms() {
    let equations = Acrobot::of(&task("acrobot")).unwrap();
    let mut random = random();
    for _ in 0..1000 {
        let [theta1, theta2] = [0; 2].map(|_| random.random_range(-PI..PI));
        let [rate1, rate2] = [0; 2].map(|_| random.random_range(-9.0..9.0_f64));
        let torque = random.random_range(-1.0..1.0);
        let d1 = 0.25 + (1.0 + 0.25 + theta2.cos()) + 2.0;
        let d2 = 0.25 + 0.5 * theta2.cos() + 1.0;
        let phi2 = 0.5 * 9.8 * (theta1 + theta2 - FRAC_PI_2).cos();
        let phi1 =
            -0.5 * rate2 * rate2 * theta2.sin() - rate2 * rate1 * theta2.sin() + 1.5 * 9.8 * (theta1 - FRAC_PI_2).cos() + phi2;
        let second = (torque + d2 / d1 * phi1 - 0.5 * rate1 * rate1 * theta2.sin() - phi2) / (0.25 + 1.0 - d2 * d2 / d1);
        let first = -(d2 * second + phi1) / d1;
        let [alpha, beta] = equations.accelerations(equations.physical(&[theta1, theta2, rate1, rate2]), [0.0, torque]);
        assert!((alpha - first).abs() < 1e-11 && (beta - alpha - second).abs() < 1e-11, "{alpha}, {beta}: {first}, {second}");
    }
}

/// Five seconds of swinging from a moderate height, without torque, at the file's own substeps.
#[test]
fn free_swings_stay_near_the_truth() {
    for (name, steps, from, stated) in
        [("pendulum", 100, vec![2.0, 0.0], vec![0.05]), ("acrobot", 25, vec![0.8, 0.0, 0.0, 0.0], vec![0.03, 0.08])]
    {
        let task = task(name);
        let (mut bodies, mut twin) = (rigid(&task), dynamics(&task, Physics::Analytic, 1).unwrap());
        start(&mut *bodies, &from);
        start(&mut *twin, &from);
        let mut worst = vec![0.0_f64; from.len() / 2];
        for _ in 0..steps {
            bodies.step(&[0.0]);
            twin.step(&[0.0]);
            let pairs = state(&*bodies, worst.len()).into_iter().zip(state(&*twin, worst.len()));
            worst.iter_mut().zip(pairs).for_each(|(worst, (found, exact))| *worst = worst.max((found - exact).abs()));
        }
        println!("{name}: {worst:?}");
        assert!(worst.iter().zip(&stated).all(|(found, most)| found < most), "{name}: {worst:?}");
    }
}

/// Without torque and friction T + V stays, over 20 s and through full turns.
#[test]
fn free_swings_keep_their_energy() {
    let pendulum = task("pendulum");
    let equations = Pendulum::of(&pendulum).unwrap();
    let change = energy_change(&pendulum, &[1.0, 5.0], 400, &|state| equations.energy([state[0], state[1]]));
    assert!(change < 0.5, "pendulum: {change} J of 7");
    let acrobot = task("acrobot");
    let equations = Acrobot::of(&acrobot).unwrap();
    let change = energy_change(&acrobot, &[1.5, 0.5, 0.0, 0.0], 100, &|state| equations.energy(equations.physical(state)));
    assert!(change < 0.3, "acrobot: {change} J of 1, of a swing of 20");
    for name in ["cartpole_continuous", "cartpole_swingup", "cartpole_swingup_concurrent"] {
        let task = task(name);
        let equations = CartPole::of(&task).unwrap();
        // Angles grow clockwise in some files; the energy of a pole that starts at rest does not tell.
        let angle = if name == "cartpole_swingup" { -1.0 } else { 1.0 };
        let energy = |state: &[f64]| equations.energy([state[0], angle * state[1], state[2], angle * state[3]]);
        let change = energy_change(&task, &[0.0, 1.0, 0.0, 0.0], 400, &energy);
        assert!(change < 0.02, "{name}: {change} J of 0.5");
    }
}

/// Largest distance from the initial energy while nothing drives the bodies.
fn energy_change(task: &Description, from: &[f64], steps: usize, energy: &dyn Fn(&[f64]) -> f64) -> f64 {
    let mut bodies = rigid(task);
    start(&mut *bodies, from);
    let before = energy(from);
    let mut worst = 0.0_f64;
    for _ in 0..steps {
        bodies.step(&vec![0.0; task.actuators.len()]);
        worst = worst.max((energy(&state(&*bodies, from.len() / 2)) - before).abs());
    }
    println!("{}: {worst} J of {before} J", task.spec.name);
    worst
}

/// The twins' Runge–Kutta steps keep the energy to 1e-6 J over 20 s.
#[test]
fn the_twins_are_exact() {
    let pendulum = Pendulum::of(&task("pendulum")).unwrap();
    let acrobot = Acrobot::of(&task("acrobot")).unwrap();
    let (mut swing, mut chain) = ([1.0, 5.0], [1.5, 2.0, 0.0, 0.0]);
    let before = (pendulum.energy(swing), acrobot.energy(chain));
    for _ in 0..4000 {
        swing = pendulum.runge_kutta(swing, 0.0, 0.005);
        chain = acrobot.runge_kutta(chain, [0.0; 2], 0.005);
        assert!((pendulum.energy(swing) - before.0).abs() < 1e-6);
        assert!((acrobot.energy(chain) - before.1).abs() < 1e-6);
    }
}

/// Gym's `Continuous_MountainCarEnv.step`, written as it stands there, without the clipping of the speed.
fn gyms_car([position, velocity]: [f64; 2], action: f64) -> [f64; 2] {
    let velocity = velocity + action * 0.0015 - 0.0025 * (3.0 * position).cos();
    let position = (position + velocity).clamp(-1.2, 0.6);
    [position, if position == -1.2 && velocity < 0.0 { 0.0 } else { velocity }]
}

/// Runs an environment of one copy under `action` and calls `check` with each step's x, v.
fn drive(physics: Physics, from: f64, action: &dyn Fn(usize, [f64; 2]) -> f64, check: &mut dyn FnMut([f64; 2])) {
    let mut task = task("mountain_car_continuous");
    task.reset[0].position = seedbed::env::description::Distribution::Constant(from);
    task.spec.time_limit = 100_000;
    let mut car = build(&task, physics, 1).unwrap();
    car.reset(0, &mut stream(0, Purpose::Reset, 0, 0));
    let seen = |car: &dyn Environment| [f64::from(car.observations()[0]), f64::from(car.observations()[1])];
    for step in 0..5000 {
        let action = action(step, seen(&*car));
        car.step(&[action as f32]);
        check(seen(&*car));
    }
}

/// Every step of random and of full-power driving, walls included, is Gym's to the resolution of an f32.
#[test]
fn the_mountain_car_is_gyms() {
    for physics in [Physics::Rapier, Physics::Analytic] {
        for pushing in [0.0, 0.1] {
            // So that the car swings up to the left wall again and again, but not up to the goal.
            let action = |_: usize, [_, v]: [f64; 2]| if v < 0.0 { -1.0 } else { pushing };
            let (mut before, mut step, mut stops) = ([f64::from(-0.5_f32), 0.0], 0, 0);
            drive(physics, -0.5, &action, &mut |found| {
                let exact = gyms_car(before, action(step, before));
                let error = (exact[0] - found[0]).abs().max((exact[1] - found[1]).abs());
                assert!(error < 2e-7, "{physics:?}: step {step}: {found:?} instead of {exact:?}");
                stops += usize::from(exact == [-1.2, 0.0]);
                (before, step) = (found, step + 1);
            });
            assert!(stops > 10, "{stops} stops at the wall");
        }
    }
}

/// E = ½ v² + 0.0025 / 3 sin 3x. One semi-implicit Euler step of unit time keeps a modified energy E − ½ v V′(x) + …: without a push E
/// swings within ½ |v V′| ≤ ½ × 0.04 × 0.0025 = 5e-5 and comes back, however long the car rolls. Explicit Euler, for comparison, would
/// leave the valley within 200 steps.
#[test]
fn a_rolling_car_keeps_its_energy() {
    let energy = |[x, v]: [f64; 2]| 0.5 * v * v + 0.0025 / 3.0 * (3.0 * x).sin();
    for physics in [Physics::Rapier, Physics::Analytic] {
        let (mut all, from) = (Vec::new(), f64::from(-0.9_f32));
        drive(physics, from, &|_, _| 0.0, &mut |state| all.push(energy(state)));
        let before = energy([from, 0.0]);
        assert!(all.iter().all(|energy| (energy - before).abs() < 5e-5), "{physics:?}");
        let mean = |energies: &[f64]| energies.iter().sum::<f64>() / energies.len() as f64;
        let drift = mean(&all[4000..]) - mean(&all[..1000]);
        assert!(drift.abs() < 2e-6, "{physics:?}: {drift}");
    }
    let mut euler = [-0.9, 0.0];
    for _ in 0..200 {
        euler = [euler[0] + euler[1], euler[1] - 0.0025 * f64::cos(3.0 * euler[0])];
    }
    assert!(energy(euler) - energy([-0.9, 0.0]) > 1e-4, "{euler:?}");
}

/// The file's claim about Gym's clipped speed: full power from the left wall stays below 0.07, a full-power run down from just below the
/// goal reaches 0.081.
#[test]
fn only_a_run_down_from_the_goal_is_faster_than_gyms_clip() {
    let car = MountainCar::of(&task("mountain_car_continuous")).unwrap();
    let fastest = |from: f64, push: f64| {
        let mut state = [from, 0.0];
        let mut fastest = 0.0_f64;
        while state[0] > -1.2 - 1e-9 && state[0] < 0.45 && fastest - state[1].abs() < 0.02 {
            state = car.next(state, push * 0.0015 - 0.0025 * (3.0 * state[0]).cos());
            fastest = fastest.max(state[1].abs());
        }
        fastest
    };
    assert!((0.068..0.07).contains(&fastest(-1.2, 1.0)), "{}", fastest(-1.2, 1.0));
    assert!((0.080..0.082).contains(&fastest(0.4499, -1.0)), "{}", fastest(0.4499, -1.0));
}

/// The rail takes up no horizontal force: without damping, momentum Σ m ẋ of cart and poles grows by F t. Gym's masses: 10.47, 4.199,
/// 4.199 kg; centres 0.3 m above their hinges, the upper hinge 0.6 m above the lower.
#[test]
fn a_push_gives_the_double_pendulum_its_momentum() {
    let mut task = frictionless("double_pendulum_cart");
    (task.solver.iterations, task.solver.passes) = (64, 4);
    let mut bodies = rigid(&task);
    start(&mut *bodies, &[0.0, 0.3, -0.5, 0.1, 0.5, -0.2]);
    let [cart, pole, pole2] = [0, 1, 2].map(|body| task.bodies[body].inertial.mass);
    let momentum = |state: &[f64]| {
        let (first, second) = (state[1], state[1] + state[2]);
        let (spin, spin2) = (state[4], state[4] + state[5]);
        let elbow = state[3] + 0.6 * first.cos() * spin;
        cart * state[3] + pole * (state[3] + 0.3 * first.cos() * spin) + pole2 * (elbow + 0.3 * second.cos() * spin2)
    };
    let before = momentum(&state(&*bodies, 3));
    for step in 1..=10 {
        bodies.step(&[0.1]);
        let gained = momentum(&state(&*bodies, 3)) - before;
        let expected = 50.0 * 0.05 * f64::from(step);
        assert!((gained - expected).abs() < 0.05, "after {step} steps: {gained} N s instead of {expected}");
    }
}

/// A task without ranges and passive forces.
fn frictionless(name: &str) -> Description {
    let mut task = task(name);
    for joint in &mut task.joints {
        joint.range = None;
        joint.passive = seedbed::env::description::Passive::default();
    }
    task
}

/// T + V of the double pendulum: ½ Σ m v² + ½ Σ I ω² + Σ m g y, over 10 s from hanging out to the side.
#[test]
fn a_free_double_pendulum_keeps_its_energy() {
    let task = frictionless("double_pendulum_cart");
    let inertial = |body: usize| task.bodies[body].inertial;
    let energy = |state: &[f64]| {
        let (first, second) = (state[1], state[1] + state[2]);
        let (spin, spin2) = (state[4], state[4] + state[5]);
        let at = |length: f64, angle: f64, rate: f64| [length * angle.cos() * rate, -length * angle.sin() * rate];
        let sum = |a: [f64; 2], b: [f64; 2]| [a[0] + b[0], a[1] + b[1]];
        let base = [state[3], 0.0];
        let elbow = sum(base, at(0.6, first, spin));
        let speeds = [base, sum(base, at(0.3, first, spin)), sum(elbow, at(0.3, second, spin2))];
        let kinetic = (0..3).map(|body| 0.5 * inertial(body).mass * (speeds[body][0].powi(2) + speeds[body][1].powi(2)));
        let turning = 0.5 * inertial(1).inertia * (spin * spin + spin2 * spin2);
        let heights = [0.0, 0.3 * first.cos(), 0.6 * first.cos() + 0.3 * second.cos()];
        let potential = (0..3).map(|body| inertial(body).mass * 9.81 * heights[body]);
        kinetic.sum::<f64>() + turning + potential.sum::<f64>()
    };
    let change = energy_change(&task, &[0.0, 2.0, 0.3, 0.0, 0.0, 0.0], 200, &energy);
    assert!(change < 1.0, "{change} J of a swing of 60 J");
}

/// Every chain at rest where its links hang stays there.
#[test]
fn hanging_chains_stay() {
    for (name, hanging) in
        [("pendulum", vec![PI, 0.0]), ("acrobot", vec![0.0; 4]), ("double_pendulum_cart", vec![0.0, PI, 0.0, 0.0, 0.0, 0.0])]
    {
        let mut bodies = rigid(&task(name));
        start(&mut *bodies, &hanging);
        (0..200).for_each(|_| bodies.step(&[0.0]));
        let moved = state(&*bodies, hanging.len() / 2).iter().zip(&hanging).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
        assert!(moved < 5e-5, "{name}: {moved}");
    }
}

/// A body of 2 kg and 0.5 kg m² on one joint, which `joint` describes, with the given actuators and no gravity.
fn rig(kind: &str, joint: &str, actuators: &str, solver: &str, gravity: &str, com: &str) -> Description {
    let text = format!(
        r#"Environment(
            description: "One body on one joint.", gravity: {gravity}, control_step: 0.02, time_limit: 1000, solver: ({solver}),
            bodies: [(name: "body", mass: 2.0, inertia: 0.5, com: {com})],
            joints: [(name: "joint", parent: "world", child: "body", type: {kind}, {joint})],
            actuators: [{actuators}],
            sensors: [(name: "q", type: JointPosition("joint"))],
            observations: [(name: "q", range: (-1.0, 1.0))],
            reward: "q",
        )"#
    );
    parse("rig", "rig", text).unwrap_or_else(|error| panic!("{error}"))
}

const PUSH: &str = r#"(name: "push", type: JointForce("joint"), control: Continuous(-10.0, 10.0))"#;
const LEVEL: &str = "Slide(axis: (1.0, 0.0))";
const SLOPE: &str = "Slide(axis: (0.8, 0.6))";

/// Every way in which a single joint is held, and its inertia without gravity: 2 kg, or 0.5 kg m² about the centre of mass.
const KINDS: [(&str, f64); 4] = [(LEVEL, 2.0), (SLOPE, 2.0), ("Hinge()", 0.5), ("Hinge(positive: Clockwise)", 0.5)];

fn weightless(kind: &str, joint: &str, actuators: &str) -> Description {
    rig(kind, joint, actuators, "iterations: 32, passes: 4", "(0.0, 0.0)", "(0.0, 0.0)")
}

/// The state after each of `steps` control steps under a constant control.
fn run(task: &Description, from: [f64; 2], control: f32, steps: usize) -> Vec<[f64; 2]> {
    let mut bodies = rigid(task);
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
fn damping_decays_as_it_should() {
    for (kind, inertia) in KINDS {
        let states = run(&weightless(kind, "damping: 1.5", PUSH), [0.1, 3.0], 0.0, 50);
        for (step, state) in (1..).zip(&states) {
            let expected = 3.0 * (-1.5 / inertia * 0.02 * f64::from(step)).exp();
            assert!((state[1] - expected).abs() < 3e-3, "{kind}: {} instead of {expected}", state[1]);
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
        // Implicit Euler damps by ½ ω² h t with the substep h; the phase is off in second order only.
        let decay = 0.5 * omega * omega * 0.02 / 32.0;
        for (step, state) in (1..).zip(&states) {
            let time = 0.02 * f64::from(step);
            let expected = 0.2 + 0.5 * (-decay * time).exp() * (omega * time).cos();
            assert!((state[0] - expected).abs() < 0.01, "{kind}: {} instead of {expected} after {time} s", state[0]);
        }
    }
}

/// A force below the friction moves nothing; above it the rest accelerates: m v̇ = F − f. A moving body loses f t of momentum and stops.
#[test]
fn dry_friction_holds_slides_and_stops() {
    for (kind, inertia) in KINDS {
        let task = weightless(kind, "frictionloss: 2.0", PUSH);
        let held = run(&task, [0.3, 0.0], 1.9, 100)[99];
        assert!((held[0] - 0.3).abs() < 1e-5 && held[1].abs() < 1e-5, "{kind}: {held:?}");
        let sliding = run(&task, [0.0, 0.0], 3.0, 25)[24];
        assert!((sliding[1] - 0.5 / inertia).abs() < 1e-3, "{kind}: {sliding:?}");
        let stopping = run(&task, [0.0, 0.5 / inertia], 0.0, 24)[23];
        assert!(stopping[1].abs() < 1e-5, "{kind}: {stopping:?}");
        let coasting = run(&task, [0.0, 1.0 / inertia], 0.0, 12)[11];
        assert!((coasting[1] - (1.0 - 2.0 * 0.24) / inertia).abs() < 1e-3, "{kind}: {coasting:?}");
    }
}

/// A rotor of armature a: (m + a) v̇ = F; and it has no weight: a falling slide falls with g m / (m + a).
#[test]
fn an_armature_adds_inertia_without_weight() {
    for (kind, inertia) in KINDS {
        let state = run(&weightless(kind, "armature: 1.5", PUSH), [0.0, 0.0], 3.0, 25)[24];
        let expected = 3.0 * 0.5 / (inertia + 1.5);
        assert!((state[1] - expected).abs() < 1e-3, "{kind}: {} instead of {expected}", state[1]);
    }
    let falling = rig("Slide(axis: (0.0, 1.0))", "armature: 2.0", PUSH, "iterations: 4", "(0.0, -10.0)", "(0.0, 0.0)");
    let state = run(&falling, [0.0, 0.0], 0.0, 50)[49];
    assert!((state[1] + 5.0).abs() < 1e-4, "{state:?}");
}

/// A velocity servo under a load comes to where kv (target − q̇) = load; a position servo to where kp (target − q) = load. Here the load
/// is friction of the drive's own making: a damper for the one, a spring for the other.
#[test]
fn servos_settle_where_their_gains_say() {
    let velocity = r#"(name: "push", type: VelocityServo(joint: "joint", kv: 6.0), control: Continuous(-5.0, 5.0), gear: 2.0)"#;
    let position = r#"(name: "push", type: PositionServo(joint: "joint", kp: 90.0, kv: 12.0), control: Continuous(-5.0, 5.0))"#;
    for (kind, _) in KINDS {
        // 6 (2 × 0.5 − q̇) = 3 q̇
        let state = run(&weightless(kind, "damping: 3.0", velocity), [0.0, 0.0], 0.5, 200)[199];
        assert!((state[1] - 2.0 / 3.0).abs() < 2e-3, "{kind}: {state:?}");
        // 90 (0.8 − q) = 30 (q − 0.2)
        let state = run(&weightless(kind, "stiffness: 30.0, springref: 0.2", position), [0.0, 0.0], 0.8, 400)[399];
        assert!((state[0] - 0.65).abs() < 1e-3 && state[1].abs() < 1e-3, "{kind}: {state:?}");
    }
}

/// As long as a servo asks for more than its limit, it pushes with its limit: v = F t / m.
#[test]
fn servos_push_no_harder_than_their_limit() {
    let servo =
        r#"(name: "push", type: VelocityServo(joint: "joint", kv: 50.0, force_limit: 1.0), control: Continuous(-50.0, 50.0))"#;
    for (kind, inertia) in KINDS {
        let state = run(&weightless(kind, "", servo), [0.0, 0.0], 20.0, 50)[49];
        assert!((state[1] - 1.0 / inertia).abs() < 1e-3, "{kind}: {state:?}");
    }
}

/// Several actuators act on one joint together: a force of 2 N and a velocity servo of kv 4 told to rest come to 0.5 m/s.
#[test]
fn actuators_add_up() {
    let both = format!(
        r#"{PUSH}, (name: "brake", type: VelocityServo(joint: "joint", kv: 4.0), control: Continuous(-1.0, 1.0)),
           (name: "hold", type: JointForce("joint"), control: Discrete([0.0, 1.0, 2.0]), gear: -1.0)"#
    );
    for (kind, _) in KINDS {
        let mut environment = build(&weightless(kind, "", &both), Physics::Rapier, 1).unwrap();
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

/// Pushed or falling against either end of its range, a joint overshoots by millimetres, comes to rest there, and gives back at most a
/// fifth of its speed; on a leaf's rail it stops dead.
#[test]
fn ranges_hold() {
    for (kind, _) in KINDS {
        for direction in [1.0, -1.0] {
            let task = weightless(kind, "range: (-0.3, 0.5)", PUSH);
            let states = run(&task, [0.0, 2.0 * direction], (3.0 * direction) as f32, 300);
            let end = if direction > 0.0 { 0.5 } else { 0.3 };
            let overshoot = states.iter().map(|state| direction * state[0] - end).fold(f64::MIN, f64::max);
            let bounce = states.iter().map(|state| -direction * state[1]).fold(f64::MIN, f64::max);
            assert!(overshoot < 6e-3 && bounce < 0.2 * 4.0, "{kind}: overshoot {overshoot}, bounce {bounce}");
            let last = states[299];
            assert!((direction * last[0] - end).abs() < 2e-3 && last[1].abs() < 0.02, "{kind}: {last:?}");
            if kind == LEVEL {
                assert!(overshoot <= 1e-7 && bounce <= 0.0, "{overshoot}, {bounce}");
            }
        }
    }
}

/// A pendulum that falls onto the end of its range stays there: the hinge's own constraint and the range's have to agree.
#[test]
fn a_range_holds_a_falling_pendulum() {
    let task = rig("Hinge()", "range: (-2.0, 1.0)", PUSH, "iterations: 32, passes: 4", "(0.0, -9.81)", "(0.0, 0.7)");
    let states = run(&task, [0.1, 0.0], 0.0, 400);
    assert!(states.iter().all(|state| state[0] < 1.01), "{states:?}");
    assert!((states[399][0] - 1.0).abs() < 5e-3 && states[399][1].abs() < 0.01, "{:?}", states[399]);
}

/// A cart that carries a pole is held by a constraint, not stopped dead: the pole's momentum has to go somewhere.
#[test]
fn a_range_holds_a_cart_with_poles() {
    let mut bodies = rigid(&task("double_pendulum_cart"));
    start(&mut *bodies, &[0.0; 6]);
    for _ in 0..100 {
        bodies.step(&[1.0]);
        let x = state(&*bodies, 3)[0];
        assert!(x < 1.06, "{x}");
    }
    let x = state(&*bodies, 3)[0];
    assert!((x - 1.0).abs() < 0.02, "{x}");
}

/// Two bodies welded together swing as one with the mass, centre and inertia of both; one welded to the world stands still.
#[test]
fn a_weld_makes_two_bodies_one() {
    let two = parse(
        "two",
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
    .unwrap_or_else(|error| panic!("{error}"));
    // Centre at (3 × 0.1, −0.5 − 3 × 1) / 4 = (0.075, −0.875); each body's inertia and m d² about it.
    let inertia = 0.1 + (0.075_f64.powi(2) + 0.375_f64.powi(2)) + 0.2 + 3.0 * (0.025_f64.powi(2) + 0.125_f64.powi(2));
    let one = rig("Hinge()", "", PUSH, "iterations: 32", "(0.0, -9.81)", "(0.075, -0.875)");
    let mut one = one;
    one.bodies[0].inertial.mass = 4.0;
    one.bodies[0].inertial.inertia = inertia;
    let (mut welded, mut single) = (rigid(&two), rigid(&one));
    welded.start(0, &[0.0, 1.0, 0.0], &[0.0; 3]);
    single.start(0, &[1.0], &[0.0]);
    let mut poses = vec![seedbed::env::Pose::default(); 3];
    for _ in 0..100 {
        welded.step(&[0.5]);
        single.step(&[0.5]);
        let (found, expected) = (welded.joints().get(1, 0).0, single.joints().get(0, 0).0);
        assert!((found - expected).abs() < 0.02, "{found} instead of {expected}");
        welded.poses(0, &mut poses);
        assert!((poses[2].angle - poses[1].angle - 0.7).sin().abs() < 1e-2, "{poses:?}");
        assert!((poses[0].x - 0.2).abs() + (poses[0].y - 0.1).abs() + (poses[0].angle - 0.4).abs() < 1e-6, "{poses:?}");
    }
}

/// A wrapped angle is the unwrapped one without full turns, in (−π, π], however far the hinge has turned.
#[test]
fn a_wrapped_angle_stays_within_half_a_turn() {
    let mut task = weightless("Hinge()", "", PUSH);
    task.sensors[0].reading = seedbed::env::description::Reading::WrappedJointPosition(0);
    task.reset = vec![seedbed::env::description::Start {
        coordinate: 0,
        position: seedbed::env::description::Distribution::Uniform { low: -50.0, high: 50.0 },
        velocity: seedbed::env::description::Distribution::Constant(0.0),
    }];
    let mut plain = task.clone();
    plain.sensors[0].reading = seedbed::env::description::Reading::JointPosition(0);
    let [mut wrapped, mut counted] = [&task, &plain].map(|task| build(task, Physics::Rapier, 1).unwrap());
    for episode in 0..1000 {
        wrapped.reset(0, &mut stream(0, Purpose::Reset, 0, episode));
        counted.reset(0, &mut stream(0, Purpose::Reset, 0, episode));
        let (angle, full) = (f64::from(wrapped.observations()[0]), f64::from(counted.observations()[0]));
        assert!(angle > -PI - 1e-6 && angle < PI + 1e-6, "{angle}");
        let turns = (full - angle) / TAU;
        assert!((turns - turns.round()).abs() < 1e-6, "{full} became {angle}");
    }
}

/// The car is drawn on its hill, 0.45 sin 3x + 0.55, with the slope's angle, while its body moves along x.
#[test]
fn the_car_is_drawn_on_its_hill() {
    let mut car = build(&task("mountain_car_continuous"), Physics::Rapier, 3).unwrap();
    (0..3).for_each(|copy| car.reset(copy, &mut stream(1, Purpose::Reset, copy as u32, 0)));
    (0..30).for_each(|_| car.step(&[1.0, 0.5, -1.0]));
    let mut poses = vec![seedbed::env::Pose::default(); 2];
    for copy in 0..3 {
        car.poses(copy, &mut poses);
        let x = f64::from(car.observations()[2 * copy]);
        assert_eq!(f64::from(poses[1].x), x);
        assert!((f64::from(poses[1].y) - (0.45 * (3.0 * x).sin() + 0.55)).abs() < 1e-6);
        assert!((f64::from(poses[1].angle) - (1.35 * (3.0 * x).cos()).atan()).abs() < 1e-6);
    }
}
