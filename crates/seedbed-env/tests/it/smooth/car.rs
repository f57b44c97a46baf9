//! The mountain car: Gym's update, its energy, its walls, and how it is drawn.

use seedbed_env::analytic::mountain_car::MountainCar;
use seedbed_env::description::Distribution;
use seedbed_env::{Environment, Physics, Pose};
use seedbed_random::{Purpose, stream};

use super::task;

/// Gym's `Continuous_MountainCarEnv.step`, written as it stands there, without the clipping of the
/// speed.
fn gyms_car([position, velocity]: [f64; 2], action: f64) -> [f64; 2] {
    let velocity = velocity + action * 0.0015 - 0.0025 * (3.0 * position).cos();
    let position = (position + velocity).clamp(-1.2, 0.6);
    [
        position,
        if position == -1.2 && velocity < 0.0 {
            0.0
        } else {
            velocity
        },
    ]
}

/// Runs an environment of one copy under `action` and calls `check` with each step's x, v.
fn drive(
    physics: Physics,
    from: f64,
    action: &dyn Fn(usize, [f64; 2]) -> f64,
    check: &mut dyn FnMut([f64; 2]),
) {
    let mut task = task("mountain_car_continuous");
    task.reset[0].position = Distribution::Constant(from);
    task.spec.time_limit = 100_000;
    let mut car = crate::build_bodies(&task, physics, 1);
    car.reset(0, &mut stream(0, Purpose::Reset, 0, 0));
    let seen = |car: &dyn Environment| {
        [
            f64::from(car.observations()[0]),
            f64::from(car.observations()[1]),
        ]
    };
    for step in 0..5000 {
        let action = action(step, seen(&*car));
        car.step(&[action as f32]);
        check(seen(&*car));
    }
}

/// Every step, also one that ends at a wall, is Gym's to the resolution of an f32.
#[test]
fn the_mountain_car_is_gyms() {
    for physics in [Physics::Rapier, Physics::Analytic] {
        for pushing in [0.0, 0.1] {
            // With this policy the car swings up to the left wall again and again, but never up to
            // the goal.
            let action = |_: usize, [_, v]: [f64; 2]| if v < 0.0 { -1.0 } else { pushing };
            let (mut before, mut step, mut stops) = ([f64::from(-0.5_f32), 0.0], 0, 0);
            drive(physics, -0.5, &action, &mut |found| {
                let exact = gyms_car(before, action(step, before));
                let error = (exact[0] - found[0]).abs().max((exact[1] - found[1]).abs());
                assert!(
                    error < 2e-7,
                    "{physics:?}: step {step}: {found:?} instead of {exact:?}"
                );
                stops += usize::from(exact == [-1.2, 0.0]);
                (before, step) = (found, step + 1);
            });
            assert!(stops > 10, "{stops} stops at the wall");
        }
    }
}

/// E = ½ v² + 0.0025 / 3 sin 3x. One semi-implicit Euler step of unit time keeps a modified energy
/// E − ½ v V′(x) + …: without a push E swings within ½ |v V′| ≤ ½ × 0.04 × 0.0025 = 5e-5 and comes
/// back, however long the car rolls. Explicit Euler, for comparison, would leave the valley within
/// 200 steps.
#[test]
fn a_rolling_car_keeps_its_energy() {
    let energy = |[x, v]: [f64; 2]| 0.5 * v * v + 0.0025 / 3.0 * (3.0 * x).sin();
    for physics in [Physics::Rapier, Physics::Analytic] {
        let (mut energies, from) = (Vec::new(), f64::from(-0.9_f32));
        drive(physics, from, &|_, _| 0.0, &mut |state| {
            energies.push(energy(state));
        });
        let before = energy([from, 0.0]);
        assert!(
            energies.iter().all(|energy| (energy - before).abs() < 5e-5),
            "{physics:?}"
        );
        let mean = |energies: &[f64]| energies.iter().sum::<f64>() / energies.len() as f64;
        let drift = mean(&energies[4000..]) - mean(&energies[..1000]);
        assert!(drift.abs() < 2e-6, "{physics:?}: {drift}");
    }
    let mut euler = [-0.9, 0.0];
    for _ in 0..200 {
        euler = [
            euler[0] + euler[1],
            euler[1] - 0.0025 * f64::cos(3.0 * euler[0]),
        ];
    }
    assert!(energy(euler) - energy([-0.9, 0.0]) > 1e-4, "{euler:?}");
}

/// What the task file says about Gym's clipped speed: at full power from the left wall, the car
/// stays below 0.07; at full power down from just below the goal, it reaches 0.081.
#[test]
fn only_a_run_down_from_the_goal_is_faster_than_gyms_clip() {
    let car = MountainCar::from_task(&task("mountain_car_continuous")).unwrap();
    let fastest = |from: f64, push: f64| {
        let mut state = [from, 0.0];
        let mut fastest = 0.0_f64;
        while state[0] > -1.2 - 1e-9 && state[0] < 0.45 && fastest - state[1].abs() < 0.02 {
            state = car.next_state(state, push * 0.0015 - 0.0025 * (3.0 * state[0]).cos());
            fastest = fastest.max(state[1].abs());
        }
        fastest
    };
    assert!(
        (0.068..0.07).contains(&fastest(-1.2, 1.0)),
        "{}",
        fastest(-1.2, 1.0)
    );
    assert!(
        (0.080..0.082).contains(&fastest(0.4499, -1.0)),
        "{}",
        fastest(0.4499, -1.0)
    );
}

/// The car is drawn on its hill, 0.45 sin 3x + 0.55, with the slope's angle, while its body moves
/// along x.
#[test]
fn the_car_is_drawn_on_its_hill() {
    let mut car = crate::build_bodies(&task("mountain_car_continuous"), Physics::Rapier, 3);
    (0..3).for_each(|copy| car.reset(copy, &mut stream(1, Purpose::Reset, copy as u32, 0)));
    (0..30).for_each(|_| car.step(&[1.0, 0.5, -1.0]));
    let mut poses = vec![Pose::default(); 2];
    for copy in 0..3 {
        car.poses(copy, &mut poses);
        let x = f64::from(car.observations()[2 * copy]);
        assert_eq!(f64::from(poses[1].x), x);
        assert!((f64::from(poses[1].y) - (0.45 * (3.0 * x).sin() + 0.55)).abs() < 1e-6);
        assert!((f64::from(poses[1].angle) - (1.35 * (3.0 * x).cos()).atan()).abs() < 1e-6);
    }
}
