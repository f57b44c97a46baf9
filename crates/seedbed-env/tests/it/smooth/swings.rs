//! Pendulums, chains and carts with poles against their equations, and what they conserve.

use std::f64::consts::{FRAC_PI_2, PI};

use rand::RngExt;
use seedbed_env::Physics;
use seedbed_env::analytic::acrobot::Acrobot;
use seedbed_env::analytic::cartpole::CartPole;
use seedbed_env::analytic::pendulum::Pendulum;
use seedbed_env::build_dynamics;
use seedbed_env::description::{BodyTask, PassiveForces};

use super::{random, rigid_bodies, start, state, task, with_substeps};

/// Largest distances between rigid bodies and the analytic model after one control step from
/// `trials` random states. `max_state` bounds the states; positions come first, then velocities,
/// here and in the result.
fn one_step_errors(task: &BodyTask, max_state: &[f64], trials: usize) -> Vec<f64> {
    let (mut bodies, mut exact) = (
        rigid_bodies(task),
        build_dynamics(task, Physics::Analytic, 1).unwrap(),
    );
    let (mut random, joints) = (random(), task.joints.len());
    let mut worst = vec![0.0_f64; 2 * joints];
    for _ in 0..trials {
        let before: Vec<_> = max_state
            .iter()
            .map(|&max| f64::from(random.random_range(-max..max) as f32))
            .collect();
        let range = task.actuators[0].range;
        let control = random.random_range(range[0]..range[1]);
        for dynamics in [&mut bodies, &mut exact] {
            start(&mut **dynamics, &before);
            dynamics.step(&[control]);
        }
        let errors = state(&*bodies, joints)
            .into_iter()
            .zip(state(&*exact, joints))
            .map(|(found, exact)| (found - exact).abs());
        worst
            .iter_mut()
            .zip(errors)
            .for_each(|(worst, error)| *worst = worst.max(error));
    }
    worst
}

/// Semi-implicit Euler in n substeps puts a position off by ½ a t² / n: the error of one control
/// step halves when n doubles, and at the file's own n it is within what the file's comment says.
#[test]
fn one_step_errors_are_as_stated_and_halve_when_substeps_double() {
    for (name, max_state, stated) in [
        ("pendulum", vec![PI, 8.0], vec![7e-3]),
        ("acrobot", vec![PI, PI, 3.0, 5.0], vec![8e-3, 2e-2]),
        (
            "cartpole_swingup",
            vec![3.0, PI, 4.0, 6.0],
            vec![1e-3, 2e-3],
        ),
        (
            "cartpole_swingup_concurrent",
            vec![3.0, PI, 4.0, 8.0],
            vec![2e-4, 4e-4],
        ),
    ] {
        let substeps = task(name).solver.substeps;
        let [coarse, fine] = [substeps, 2 * substeps]
            .map(|substeps| one_step_errors(&with_substeps(name, substeps), &max_state, 300));
        for (joint, &stated) in stated.iter().enumerate() {
            assert!(coarse[joint] < stated, "{name}: {coarse:?}");
            let ratio = coarse[joint] / fine[joint];
            assert!(
                (1.8..2.2).contains(&ratio),
                "{name}: joint {joint}: a ratio of {ratio}"
            );
        }
    }
}

/// Gym's own step of 0.05 s
/// (`newthdot = thdot + (3 g / (2 l) sin θ + 3 u / (m l²)) dt; newth = th + newthdot dt`) is about
/// five times as far off as five substeps, and the equations are Gym's.
#[test]
fn a_pendulum_is_about_five_times_closer_than_gyms() {
    let task = task("pendulum");
    let (equations, mut random) = (Pendulum::from_task(&task).unwrap(), random());
    let mut worst = 0.0_f64;
    for _ in 0..300 {
        let (theta, rate, torque) = (
            random.random_range(-PI..PI),
            random.random_range(-8.0..8.0),
            random.random_range(-2.0..2.0),
        );
        let gyms = 3.0 * 10.0 / 2.0 * f64::sin(theta) + 3.0 * torque;
        assert!((equations.acceleration(theta, torque) - gyms).abs() < 1e-12);
        let rate_after = rate + gyms * 0.05;
        let exact = (0..50).fold([theta, rate], |state, _| {
            equations.runge_kutta(state, torque, 0.001)
        });
        worst = worst.max((theta + rate_after * 0.05 - exact[0]).abs());
    }
    let ratio = worst / one_step_errors(&task, &[PI, 8.0], 300)[0];
    assert!((4.0..6.0).contains(&ratio), "{ratio}");
}

/// Gym's `_dsdt` with `book_or_nips = "book"`, written as it stands there, for masses, lengths and
/// inertias of 1 and centers at 0.5.
#[test]
fn the_acrobots_equations_are_gyms() {
    let equations = Acrobot::from_task(&task("acrobot")).unwrap();
    let mut random = random();
    for _ in 0..1000 {
        let [theta1, theta2] = [0; 2].map(|_| random.random_range(-PI..PI));
        let [rate1, rate2] = [0; 2].map(|_| random.random_range(-9.0..9.0_f64));
        let torque = random.random_range(-1.0..1.0);
        let d1 = 0.25 + (1.0 + 0.25 + theta2.cos()) + 2.0;
        let d2 = 0.25 + 0.5 * theta2.cos() + 1.0;
        let phi2 = 0.5 * 9.8 * (theta1 + theta2 - FRAC_PI_2).cos();
        let phi1 = -0.5 * rate2 * rate2 * theta2.sin() - rate2 * rate1 * theta2.sin()
            + 1.5 * 9.8 * (theta1 - FRAC_PI_2).cos()
            + phi2;
        let second = (torque + d2 / d1 * phi1 - 0.5 * rate1 * rate1 * theta2.sin() - phi2)
            / (0.25 + 1.0 - d2 * d2 / d1);
        let first = -(d2 * second + phi1) / d1;
        let [alpha, beta] = equations.accelerations(
            equations.state_of_joints(&[theta1, theta2, rate1, rate2]),
            [0.0, torque],
        );
        assert!(
            (alpha - first).abs() < 1e-11 && (beta - alpha - second).abs() < 1e-11,
            "{alpha}, {beta}: {first}, {second}"
        );
    }
}

/// Free swings of 5 s from a moderate height, at the file's own substeps, stay within the stated
/// distance from the analytic model.
#[test]
fn free_swings_stay_near_the_truth() {
    for (name, steps, from, stated) in [
        ("pendulum", 100, vec![2.0, 0.0], vec![0.05]),
        ("acrobot", 25, vec![0.8, 0.0, 0.0, 0.0], vec![0.03, 0.08]),
    ] {
        let task = task(name);
        let (mut bodies, mut exact) = (
            rigid_bodies(&task),
            build_dynamics(&task, Physics::Analytic, 1).unwrap(),
        );
        start(&mut *bodies, &from);
        start(&mut *exact, &from);
        let mut worst = vec![0.0_f64; from.len() / 2];
        for _ in 0..steps {
            bodies.step(&[0.0]);
            exact.step(&[0.0]);
            let pairs = state(&*bodies, worst.len())
                .into_iter()
                .zip(state(&*exact, worst.len()));
            worst
                .iter_mut()
                .zip(pairs)
                .for_each(|(worst, (found, exact))| *worst = worst.max((found - exact).abs()));
        }
        assert!(
            worst
                .iter()
                .zip(&stated)
                .all(|(found, stated)| found < stated),
            "{name}: {worst:?}"
        );
    }
}

/// Without torque and friction T + V is constant over 20 s and through full turns.
#[test]
fn free_swings_keep_their_energy() {
    let pendulum = task("pendulum");
    let equations = Pendulum::from_task(&pendulum).unwrap();
    let change = max_energy_change(&pendulum, &[1.0, 5.0], 400, &|state| {
        equations.energy([state[0], state[1]])
    });
    assert!(change < 0.5, "pendulum: {change} J");
    let acrobot = task("acrobot");
    let equations = Acrobot::from_task(&acrobot).unwrap();
    let change = max_energy_change(&acrobot, &[1.5, 0.5, 0.0, 0.0], 100, &|state| {
        equations.energy(equations.state_of_joints(state))
    });
    assert!(change < 0.3, "acrobot: {change} J");
    for name in [
        "cartpole_continuous",
        "cartpole_swingup",
        "cartpole_swingup_concurrent",
    ] {
        let task = task(name);
        let equations = CartPole::from_task(&task).unwrap();
        // The model measures angles clockwise, but in this file they grow counter-clockwise.
        let angle_sign = if name == "cartpole_swingup" {
            -1.0
        } else {
            1.0
        };
        let energy = |state: &[f64]| {
            equations.energy([
                state[0],
                angle_sign * state[1],
                state[2],
                angle_sign * state[3],
            ])
        };
        let change = max_energy_change(&task, &[0.0, 1.0, 0.0, 0.0], 400, &energy);
        assert!(change < 0.02, "{name}: {change} J");
    }
}

/// Largest distance from the initial energy, J, while nothing drives the bodies.
fn max_energy_change(
    task: &BodyTask,
    from: &[f64],
    steps: usize,
    energy: &dyn Fn(&[f64]) -> f64,
) -> f64 {
    let mut bodies = rigid_bodies(task);
    start(&mut *bodies, from);
    let before = energy(from);
    let mut worst = 0.0_f64;
    for _ in 0..steps {
        bodies.step(&vec![0.0; task.actuators.len()]);
        worst = worst.max((energy(&state(&*bodies, from.len() / 2)) - before).abs());
    }
    worst
}

/// The analytic models' Runge–Kutta steps keep the energy to 1e-6 J over 20 s.
#[test]
fn the_analytic_models_are_exact() {
    let pendulum = Pendulum::from_task(&task("pendulum")).unwrap();
    let acrobot = Acrobot::from_task(&task("acrobot")).unwrap();
    let (mut swing, mut chain) = ([1.0, 5.0], [1.5, 2.0, 0.0, 0.0]);
    let before = (pendulum.energy(swing), acrobot.energy(chain));
    for _ in 0..4000 {
        swing = pendulum.runge_kutta(swing, 0.0, 0.005);
        chain = acrobot.runge_kutta(chain, [0.0; 2], 0.005);
        assert!((pendulum.energy(swing) - before.0).abs() < 1e-6);
        assert!((acrobot.energy(chain) - before.1).abs() < 1e-6);
    }
}

/// The rail takes up no horizontal force: without damping, momentum Σ m ẋ of cart and poles grows
/// by F t. Gym's masses: 10.47, 4.199, 4.199 kg; centers 0.3 m above their hinges, the upper hinge
/// 0.6 m above the lower.
#[test]
fn a_push_gives_the_double_pendulum_its_momentum() {
    let mut task = frictionless("double_pendulum_cart");
    (task.solver.substeps, task.solver.solver_iterations) = (64, 4);
    let mut bodies = rigid_bodies(&task);
    start(&mut *bodies, &[0.0, 0.3, -0.5, 0.1, 0.5, -0.2]);
    let [cart, pole, pole2] = [0, 1, 2].map(|body| task.bodies[body].inertial.mass);
    let momentum = |state: &[f64]| {
        let (first, second) = (state[1], state[1] + state[2]);
        let (spin, spin2) = (state[4], state[4] + state[5]);
        let elbow = state[3] + 0.6 * first.cos() * spin;
        cart * state[3]
            + pole * (state[3] + 0.3 * first.cos() * spin)
            + pole2 * (elbow + 0.3 * second.cos() * spin2)
    };
    let before = momentum(&state(&*bodies, 3));
    for step in 1..=10 {
        bodies.step(&[0.1]);
        let gained = momentum(&state(&*bodies, 3)) - before;
        let expected = 50.0 * 0.05 * f64::from(step);
        assert!(
            (gained - expected).abs() < 0.05,
            "after {step} steps: {gained} N s instead of {expected}"
        );
    }
}

/// A task without ranges and passive forces.
fn frictionless(name: &str) -> BodyTask {
    let mut task = task(name);
    for joint in &mut task.joints {
        joint.range = None;
        joint.passive_forces = PassiveForces::default();
    }
    task
}

/// T + V = ½ Σ m v² + ½ Σ I ω² + Σ m g y of the double pendulum is constant over 10 s of a swing
/// from the side.
#[test]
fn a_free_double_pendulum_keeps_its_energy() {
    let task = frictionless("double_pendulum_cart");
    let inertial = |body: usize| task.bodies[body].inertial;
    let energy = |state: &[f64]| {
        let (first, second) = (state[1], state[1] + state[2]);
        let (spin, spin2) = (state[4], state[4] + state[5]);
        let at = |length: f64, angle: f64, rate: f64| {
            [length * angle.cos() * rate, -length * angle.sin() * rate]
        };
        let sum = |a: [f64; 2], b: [f64; 2]| [a[0] + b[0], a[1] + b[1]];
        let base = [state[3], 0.0];
        let elbow = sum(base, at(0.6, first, spin));
        let speeds = [
            base,
            sum(base, at(0.3, first, spin)),
            sum(elbow, at(0.3, second, spin2)),
        ];
        let kinetic = (0..3).map(|body| {
            0.5 * inertial(body).mass * (speeds[body][0].powi(2) + speeds[body][1].powi(2))
        });
        let turning = 0.5 * inertial(1).inertia * (spin * spin + spin2 * spin2);
        let heights = [
            0.0,
            0.3 * first.cos(),
            0.6 * first.cos() + 0.3 * second.cos(),
        ];
        let potential = (0..3).map(|body| inertial(body).mass * 9.81 * heights[body]);
        kinetic.sum::<f64>() + turning + potential.sum::<f64>()
    };
    let change = max_energy_change(&task, &[0.0, 2.0, 0.3, 0.0, 0.0, 0.0], 200, &energy);
    assert!(change < 1.0, "{change} J");
}

/// A chain that hangs at rest stays at rest.
#[test]
fn hanging_chains_stay() {
    for (name, hanging) in [
        ("pendulum", vec![PI, 0.0]),
        ("acrobot", vec![0.0; 4]),
        ("double_pendulum_cart", vec![0.0, PI, 0.0, 0.0, 0.0, 0.0]),
    ] {
        let mut bodies = rigid_bodies(&task(name));
        start(&mut *bodies, &hanging);
        (0..200).for_each(|_| bodies.step(&[0.0]));
        let moved = state(&*bodies, hanging.len() / 2)
            .iter()
            .zip(&hanging)
            .fold(0.0_f64, |max, (a, b)| max.max((a - b).abs()));
        assert!(moved < 5e-5, "{name}: {moved}");
    }
}
