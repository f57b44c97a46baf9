//! Rigid bodies against closed forms: how large their errors are, that the errors fall with the
//! number of substeps, and what must be conserved.

use rand::RngExt;
use seedbed_env::analytic::cartpole::CartPole;
use seedbed_env::build_dynamics;
use seedbed_env::description::BodyTask;
use seedbed_env::dynamics::Dynamics;
use seedbed_env::{Physics, Status};
use seedbed_random::{Purpose, Stream, stream};

/// x, θ, ẋ, θ̇.
type State = [f64; 4];

const NAMES: [&str; 4] = ["x", "theta", "x_dot", "theta_dot"];

fn task(path: &str) -> BodyTask {
    crate::load_bodies(path)
}

/// The cart-pole with this number of substeps per control step.
fn cart_pole(substeps: u32) -> BodyTask {
    let mut task = task("envs/cartpole.ron");
    task.solver.substeps = substeps;
    task
}

fn rigid_bodies(task: &BodyTask, copies: usize) -> Box<dyn Dynamics> {
    build_dynamics(task, Physics::Rapier, copies).expect("every task has rigid bodies")
}

/// The exact equations of a cart-pole.
fn exact_equations(task: &BodyTask) -> CartPole {
    CartPole::from_task(task).expect("the task is a cart-pole")
}

fn start(dynamics: &mut dyn Dynamics, copy: usize, [x, theta, speed, rate]: State) {
    dynamics.start(copy, &[x, theta], &[speed, rate]);
}

fn state(dynamics: &dyn Dynamics, copy: usize) -> State {
    let ((x, speed), (theta, rate)) = (
        dynamics.coordinates().get(0, copy),
        dynamics.coordinates().get(1, copy),
    );
    [x, theta, speed, rate].map(f64::from)
}

/// One control step by the exact equations: 200 Runge–Kutta steps of 1e-4 s, whose error is below
/// 1e-12.
fn exact_state(equations: &CartPole, start: State, force: f64) -> State {
    (0..200).fold(start, |state, _| {
        equations.runge_kutta(state, force, 0.0, 1e-4)
    })
}

fn random() -> Stream {
    stream(11, Purpose::Action, 0, 0)
}

fn difference(a: State, b: State) -> State {
    std::array::from_fn(|i| (a[i] - b[i]).abs())
}

fn larger(a: State, b: State) -> State {
    std::array::from_fn(|i| a[i].max(b[i]))
}

/// A random state in the range that a controlled pole reaches, rounded to f32 as the states of
/// rigid bodies are.
fn random_state(random: &mut Stream) -> State {
    [2.0, 0.5, 2.0, 2.0].map(|max| f64::from(random.random_range(-max..max) as f32))
}

fn random_force(random: &mut Stream) -> f64 {
    if random.random() { 10.0 } else { -10.0 }
}

/// Largest errors of one control step over 500 random states.
fn one_step_error(substeps: u32) -> State {
    let (task, mut random) = (cart_pole(substeps), random());
    let (equations, mut bodies) = (exact_equations(&task), rigid_bodies(&task, 1));
    (0..500).fold([0.0; 4], |worst, _| {
        let (before, force) = (random_state(&mut random), random_force(&mut random));
        start(&mut *bodies, 0, before);
        bodies.step(&[force as f32]);
        larger(
            worst,
            difference(state(&*bodies, 0), exact_state(&equations, before, force)),
        )
    })
}

/// Rapier integrates each of n substeps by semi-implicit Euler, whose positions after a time t are
/// off by ½ a t² / n: first order, so the error halves when n doubles. Velocities are closer still
/// (their errors cancel where accelerations hardly change) down to a floor of rounding: a joint's
/// gap of one f32 step of x, 1.2e-7 m, is closed within a substep of 0.02 s / n and turns the pole
/// at 0.5 m.
#[test]
fn the_error_of_one_step_halves_when_substeps_double() {
    let errors = [4, 8, 16, 32].map(one_step_error);
    for (coarse, fine) in errors.iter().zip(&errors[1..]) {
        for i in [0, 1] {
            let ratio = coarse[i] / fine[i];
            assert!(
                (1.95..2.05).contains(&ratio),
                "{}: {} and {}, a ratio of {ratio}",
                NAMES[i],
                coarse[i],
                fine[i]
            );
        }
    }
    for (i, max_error) in [5.5e-4, 1.1e-3, 4e-4, 3e-3].into_iter().enumerate() {
        assert!(
            errors.iter().all(|error| error[i] < max_error),
            "{}: {errors:?}",
            NAMES[i]
        );
    }
}

/// One step of Gym's explicit Euler integration is off by ½ a t², four times as much as four
/// substeps of rigid bodies.
#[test]
fn one_step_is_four_times_closer_than_gyms() {
    let (equations, mut random) = (exact_equations(&cart_pole(4)), random());
    let gym = (0..500).fold([0.0; 4], |worst, _| {
        let (before, force) = (random_state(&mut random), random_force(&mut random));
        larger(
            worst,
            difference(
                equations.gym_euler(before, force, 0.02),
                exact_state(&equations, before, force),
            ),
        )
    });
    let bodies = one_step_error(4);
    assert!(
        (0..2).all(|i| (3.9..4.1).contains(&(gym[i] / bodies[i]))),
        "{gym:?}, {bodies:?}"
    );
    assert!(
        (2..4).all(|i| bodies[i] < 0.6 * gym[i]),
        "{gym:?}, {bodies:?}"
    );
}

/// Ten trials of 500 steps: a random force of ±10 N plus a stabilizing feedback on each simulator's
/// own state, so that errors neither blow up with the unstable pole nor vanish. Largest distances
/// from the exact motion.
fn closed_loop_error(advance: &mut dyn FnMut(State, f64, bool) -> State) -> State {
    let equations = exact_equations(&cart_pole(4));
    let mut random = random();
    let mut worst = [0.0; 4];
    for _ in 0..10 {
        let mut exact = std::array::from_fn(|_| f64::from(random.random_range(-0.05_f32..0.05)));
        let mut simulated = exact;
        for step in 0..500 {
            let push = random_force(&mut random);
            let force = |[x, theta, speed, rate]: State| {
                push + 2.0 * x + 40.0 * theta + 4.0 * speed + 8.0 * rate
            };
            exact = exact_state(&equations, exact, force(exact));
            simulated = advance(simulated, force(simulated), step == 0);
            worst = larger(worst, difference(exact, simulated));
        }
    }
    worst
}

fn closed_loop_error_of_bodies(substeps: u32) -> State {
    let mut bodies = rigid_bodies(&cart_pole(substeps), 1);
    closed_loop_error(&mut |before, force, first| {
        if first {
            start(&mut *bodies, 0, before);
        }
        bodies.step(&[force as f32]);
        state(&*bodies, 0)
    })
}

/// A run of 500 steps by rigid bodies stays closer to the exact motion than Gym's explicit Euler, in each
/// coordinate and velocity.
#[test]
fn a_controlled_run_is_closer_to_the_truth_than_gym() {
    let equations = exact_equations(&cart_pole(4));
    let gym = closed_loop_error(&mut |state, force, _| equations.gym_euler(state, force, 0.02));
    for (substeps, factor) in [(4, 2.0), (16, 8.0)] {
        let bodies = closed_loop_error_of_bodies(substeps);
        for (i, name) in NAMES.into_iter().enumerate() {
            assert!(
                bodies[i] * factor <= gym[i],
                "{name} with {substeps} substeps: {} against Gym's {}",
                bodies[i],
                gym[i]
            );
        }
    }
}

/// [`CartPole::accelerations`] are those of `CartPoleEnv.step` in Gymnasium's cartpole.py, written
/// as they stand there: `temp = (force + polemass_length θ̇² sin θ) / total_mass`,
/// `thetaacc = (g sin θ − cos θ temp) / (length (4/3 − masspole cos² θ / total_mass))`,
/// `xacc = temp − polemass_length thetaacc cos θ / total_mass`.
#[test]
fn the_equations_are_gyms() {
    let (equations, mut random) = (exact_equations(&cart_pole(4)), random());
    for _ in 0..1000 {
        let ([_, theta, _, rate], force) = (random_state(&mut random), random_force(&mut random));
        let temp = (force + 0.05 * rate * rate * theta.sin()) / 1.1;
        let angular_acceleration = (9.8 * theta.sin() - theta.cos() * temp)
            / (0.5 * (4.0 / 3.0 - 0.1 * theta.cos().powi(2) / 1.1));
        let acceleration = temp - 0.05 * angular_acceleration * theta.cos() / 1.1;
        let found = equations.accelerations(theta, rate, force, 0.0);
        assert!(
            (found[0] - acceleration).abs() < 1e-12
                && (found[1] - angular_acceleration).abs() < 1e-12,
            "{found:?}"
        );
    }
}

/// Start angles θ of free swings, rad.
const START_ANGLES: [f64; 4] = [0.3, 1.0, 2.0, 3.0];

/// Without force and friction T + V is constant over 20 s; explicit Euler gains 1.5 J in that time.
#[test]
fn a_free_swing_keeps_its_energy() {
    let task = cart_pole(4);
    let equations = exact_equations(&task);
    let mut bodies = rigid_bodies(&task, START_ANGLES.len());
    START_ANGLES
        .iter()
        .enumerate()
        .for_each(|(copy, &theta)| start(&mut *bodies, copy, [0.0, theta, 0.0, 0.0]));
    for _ in 0..1000 {
        bodies.step(&[0.0; START_ANGLES.len()]);
        for (copy, &theta) in START_ANGLES.iter().enumerate() {
            let change =
                equations.energy(state(&*bodies, copy)) - equations.energy([0.0, theta, 0.0, 0.0]);
            assert!(change.abs() < 0.01, "from {theta} rad: {change} J");
        }
    }
}

/// The analytic model's Runge–Kutta steps keep the energy to 1e-6 J over 20 s, and every control
/// step is within the resolution of an f32 of the exact motion.
#[test]
fn the_analytic_model_is_exact() {
    let task = cart_pole(4);
    let equations = exact_equations(&task);
    let mut exact = build_dynamics(&task, Physics::Analytic, 1).unwrap();
    for theta in START_ANGLES {
        let mut swing = [0.0, theta, 0.0, 0.0];
        let energy = equations.energy(swing);
        for _ in 0..4000 {
            swing = equations.runge_kutta(swing, 0.0, 0.0, 0.005);
            assert!(
                (equations.energy(swing) - energy).abs() < 1e-6,
                "from {theta} rad"
            );
        }
    }
    let mut random = random();
    for _ in 0..500 {
        let (before, force) = (random_state(&mut random), random_force(&mut random));
        start(&mut *exact, 0, before);
        exact.step(&[force as f32]);
        let error = difference(state(&*exact, 0), exact_state(&equations, before, force));
        assert!(error.into_iter().all(|error| error < 2.5e-7), "{error:?}");
    }
}

/// A hanging pole at rest moves by less than 1e-5, because π is rounded to f32; a pole that stands
/// exactly upright does not move at all.
#[test]
fn poles_in_equilibrium_stay() {
    let mut bodies = rigid_bodies(&cart_pole(4), 2);
    let hanging = f64::from(std::f32::consts::PI);
    start(&mut *bodies, 0, [0.0; 4]);
    start(&mut *bodies, 1, [0.3, hanging, 0.0, 0.0]);
    for _ in 0..1000 {
        bodies.step(&[0.0, 0.0]);
    }
    assert_eq!(state(&*bodies, 0), [0.0; 4]);
    let moved = difference(state(&*bodies, 1), [f64::from(0.3_f32), hanging, 0.0, 0.0]);
    assert!(moved.into_iter().all(|moved| moved < 1e-5), "{moved:?}");
}

/// The rail takes up no horizontal force, so momentum (M + m) ẋ + m l cos θ θ̇ grows by F t, with M
/// + m = 1.1 kg, m l = 0.05 kg m.
#[test]
fn a_force_gives_both_masses_their_momentum() {
    let mut bodies = rigid_bodies(&cart_pole(4), 1);
    start(&mut *bodies, 0, [0.0, 2.5, 0.0, 1.0]);
    let momentum = |[_, theta, speed, rate]: State| 1.1 * speed + 0.05 * theta.cos() * rate;
    let before = momentum(state(&*bodies, 0));
    for step in 1..=50 {
        bodies.step(&[3.0]);
        let gained = momentum(state(&*bodies, 0)) - before;
        assert!(
            (gained - 3.0 * 0.02 * f64::from(step)).abs() < 2e-3,
            "after {step} steps: {gained} N s"
        );
    }
}

/// Small swings about hanging: det(K − ω² 𝐌) = 0 with 𝐌 = [[M + m, m l], [m l, I + m l²]] and K =
/// diag(0, m g l) gives ω² = (M + m) m g l / ((M + m)(I + m l²) − (m l)²). With m = 0.1, l = 0.5, I
/// = m (2l)² / 12: ω² = 15.77…, a period of 1.58 s.
#[test]
fn a_small_swing_has_the_period_of_the_poles_inertia() {
    let inertia = 0.1 / 12.0 + 0.1 * 0.25;
    let expected =
        std::f64::consts::TAU / (1.1 * 0.05 * 9.8 / (1.1 * inertia - 0.05_f64.powi(2))).sqrt();
    let mut bodies = rigid_bodies(&cart_pole(16), 1);
    start(
        &mut *bodies,
        0,
        [0.0, std::f64::consts::PI - 0.02, 0.0, 0.0],
    );
    let mut crossings = Vec::new();
    let mut before = -0.02;
    for step in 1..=1000 {
        bodies.step(&[0.0]);
        let angle = state(&*bodies, 0)[1] - std::f64::consts::PI;
        if before < 0.0 && angle >= 0.0 {
            crossings.push(0.02 * (f64::from(step) - angle / (angle - before)));
        }
        before = angle;
    }
    let period = (crossings[crossings.len() - 1] - crossings[0]) / (crossings.len() - 1) as f64;
    assert!(
        (period / expected - 1.0).abs() < 1e-3,
        "{period} s instead of {expected} s"
    );
}

/// Full turns are counted: the angle of a pole that spins fast keeps growing.
#[test]
fn a_hinge_counts_full_turns() {
    let mut bodies = rigid_bodies(&cart_pole(16), 1);
    start(&mut *bodies, 0, [0.0, 0.0, 0.0, 40.0]);
    let mut angle = 0.0;
    for _ in 0..500 {
        bodies.step(&[0.0]);
        let turned = state(&*bodies, 0)[1] - angle;
        assert!(turned > 0.5 && turned < 1.0, "{turned} rad in one step");
        angle += turned;
    }
    assert!(angle > 60.0 * std::f64::consts::TAU);
}

/// With nearly massless bodies on it, a trolley of mass m accelerates along the slope by (F + m
/// g·t) / m, where t is the direction of the slope and F the force along it.
#[test]
fn a_slide_falls_along_its_slope() {
    let mut task = task("crates/seedbed-env/tests/envs/crane.ron");
    for body in &mut task.bodies[1..] {
        body.inertial.mass = 1e-4;
        body.inertial.inertia = 1e-5;
    }
    let mut bodies = rigid_bodies(&task, 1);
    bodies.start(0, &[0.0; 4], &[0.0; 4]);
    let along = 0.5 * 0.3_f64.cos() - 9.81 * 0.3_f64.sin() + 30.0 * 0.1 / 2.0;
    (0..50).for_each(|_| bodies.step(&[0.1, 0.0, 0.0]));
    let (_, speed) = bodies.coordinates().get(0, 0);
    assert!(
        (f64::from(speed) - along * 0.5).abs() < 2e-3,
        "{speed} m/s instead of {}",
        along * 0.5
    );
}

/// With random pushes, the mean length of about 4,000 episodes of rigid bodies lies within the 95 %
/// interval of the mean with the exact equations.
#[test]
fn random_episodes_are_as_long_as_the_analytic_ones() {
    let task = cart_pole(4);
    let [exact, bodies] =
        [Physics::Analytic, Physics::Rapier].map(|physics| episode_lengths(&task, physics));
    let mean = |lengths: &[f64]| lengths.iter().sum::<f64>() / lengths.len() as f64;
    let variance = exact
        .iter()
        .map(|length| (length - mean(&exact)).powi(2))
        .sum::<f64>()
        / (exact.len() - 1) as f64;
    let half_width = 1.96 * (variance / exact.len() as f64).sqrt();
    assert!(
        (mean(&exact) - mean(&bodies)).abs() < half_width,
        "exact {} ± {half_width}, bodies {}",
        mean(&exact),
        mean(&bodies)
    );
}

/// Lengths of 63 × 64 episodes; starts and pushes are the same for any physics.
fn episode_lengths(task: &BodyTask, physics: Physics) -> Vec<f64> {
    const COPIES: usize = 64;
    let mut environment = crate::build_bodies(task, physics, COPIES);
    let mut lengths = Vec::new();
    for round in 0..63 {
        let mut pushes: Vec<_> = (0..COPIES as u32)
            .map(|copy| stream(3, Purpose::Action, copy, round))
            .collect();
        for copy in 0..COPIES {
            environment.reset(copy, &mut stream(3, Purpose::Reset, copy as u32, round));
        }
        let mut length = vec![0.0; COPIES];
        while environment.statuses().contains(&Status::Running) {
            length
                .iter_mut()
                .zip(environment.statuses())
                .for_each(|(n, &status)| *n += f64::from(u8::from(status == Status::Running)));
            let actions: Vec<_> = pushes
                .iter_mut()
                .map(|push| f32::from(u8::from(push.random::<bool>())))
                .collect();
            environment.step(&actions);
        }
        lengths.extend(length);
    }
    lengths
}

/// The bits of fixed runs, the same on every machine. They change only when Rapier, its settings or
/// a task file do.
#[test]
fn fixed_runs_have_golden_bits() {
    assert_eq!(
        format!("{:016x}", hash_of_run(&cart_pole(4), 2, 1)),
        GOLDEN_CART_POLE
    );
    assert_eq!(
        format!(
            "{:016x}",
            hash_of_run(&task("crates/seedbed-env/tests/envs/crane.ron"), 4, 3)
        ),
        GOLDEN_CRANE
    );
    // Six joints and a free body; four actuators and a formula force.
    assert_eq!(
        format!(
            "{:016x}",
            hash_of_run(&task("crates/seedbed-env/tests/envs/workshop.ron"), 9, 5)
        ),
        GOLDEN_WORKSHOP
    );
}

const GOLDEN_CART_POLE: &str = "e307e24cf556cf26";
const GOLDEN_WORKSHOP: &str = "b2eb109ddad0445d";
const GOLDEN_CRANE: &str = "a14095ec7bf718a7";

/// FNV-1a over the joint coordinates of 200 steps under a fixed pattern of controls.
fn hash_of_run(task: &BodyTask, joints: usize, actuators: usize) -> u64 {
    let mut bodies = rigid_bodies(task, 1);
    bodies.start(0, &vec![0.02; joints], &vec![-0.03; joints]);
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    for step in 0..200_u32 {
        let control = if step * step % 7 < 3 { 0.8 } else { -0.7 };
        bodies.step(&vec![control; actuators]);
        let coordinates = (0..joints).map(|joint| bodies.coordinates().get(joint, 0));
        for byte in coordinates
            .flat_map(|(position, velocity)| [position, velocity])
            .flat_map(f32::to_le_bytes)
        {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }
    hash
}

/// Start of the states below.
const GYM_START: State = [0.01, 0.03, -0.02, 0.04];

/// Forces, N, and the states after them, from [`GYM_START`], by the formulas of `CartPoleEnv.step`
/// in `gymnasium/envs/classic_control/cartpole.py` (`kinematics_integrator == "euler"`), computed in
/// Python with 64 bits:
///
/// ```text
/// temp = (F + 0.05 θ̇² sin θ) / 1.1
/// θ̈ = (9.8 sin θ − cos θ temp) / (0.5 (4/3 − 0.1 cos² θ / 1.1)),   ẍ = temp − 0.05 θ̈ cos θ / 1.1
/// x ← x + 0.02 ẋ,   ẋ ← ẋ + 0.02 ẍ,   θ ← θ + 0.02 θ̇,   θ̇ ← θ̇ + 0.02 θ̈
/// ```
///
/// The states of Gymnasium 1.4.0 itself under these forces differ from those of the formulas by at
/// most 4e-16.
#[rustfmt::skip]
const GYM_STATES: [(f64, State); 24] = [
    (10.0, [0.009_600_000_000, 0.030_800_000_000, 0.174_679_195_748, -0.243_068_717_960]),
    (10.0, [0.013_093_583_915, 0.025_938_625_641, 0.369_347_976_058, -0.525_879_628_050]),
    (-10.0, [0.020_480_543_436, 0.015_421_033_080, 0.173_870_812_605, -0.225_137_416_092]),
    (10.0, [0.023_957_959_688, 0.010_918_284_758, 0.368_769_010_175, -0.512_916_347_803]),
    (-10.0, [0.031_333_339_892, 0.000_659_957_802, 0.173_494_992_751, -0.216_812_868_357]),
    (-10.0, [0.034_803_239_747, -0.003_676_299_565, -0.021_636_386_742, 0.076_078_164_720]),
    (10.0, [0.034_370_512_012, -0.002_154_736_271, 0.173_538_073_749, -0.217_762_377_293]),
    (-10.0, [0.037_841_273_487, -0.006_509_983_817, -0.021_553_008_904, 0.074_240_075_374]),
    (10.0, [0.037_410_213_309, -0.005_025_182_309, 0.173_661_662_022, -0.220_489_647_878]),
    (10.0, [0.040_883_446_549, -0.009_434_975_267, 0.368_855_081_490, -0.514_753_477_633]),
    (10.0, [0.048_260_548_179, -0.019_730_044_819, 0.564_108_625_288, -0.810_394_599_080]),
    (-10.0, [0.059_542_720_685, -0.035_937_936_801, 0.369_262_466_899, -0.523_982_503_002]),
    (-10.0, [0.066_927_970_023, -0.046_417_586_861, 0.174_664_232_442, -0.242_837_108_122]),
    (-10.0, [0.070_421_254_672, -0.051_274_329_024, -0.019_765_017_596, 0.034_850_765_983]),
    (10.0, [0.070_025_954_320, -0.050_577_313_704, 0.176_053_297_063, -0.273_558_725_734]),
    (-10.0, [0.073_547_020_261, -0.056_048_488_219, -0.018_311_879_480, 0.002_752_828_131]),
    (10.0, [0.073_180_782_671, -0.055_993_431_656, 0.177_567_228_470, -0.307_074_078_107]),
    (10.0, [0.076_732_127_241, -0.062_134_913_218, 0.373_440_493_356, -0.616_876_978_007]),
    (-10.0, [0.084_200_937_108, -0.074_472_452_778, 0.179_239_092_939, -0.344_392_930_691]),
    (10.0, [0.087_785_718_967, -0.081_360_311_392, 0.375_337_101_344, -0.659_599_297_060]),
    (-10.0, [0.095_292_460_994, -0.094_552_297_333, 0.181_436_047_218, -0.393_603_381_646]),
    (-10.0, [0.098_921_181_938, -0.102_424_364_966, -0.012_225_914_938, -0.132_164_968_343]),
    (10.0, [0.098_676_663_639, -0.105_067_664_333, 0.184_202_702_136, -0.455_323_871_895]),
    (-10.0, [0.102_360_717_682, -0.114_174_141_771, -0.009_288_984_114, -0.197_519_957_759]),
];

/// Both sides round differently in the last bits of an f64; the table is rounded to 12 decimals.
#[test]
fn eulers_method_gives_the_states_of_gym() {
    let equations = exact_equations(&task("envs/cartpole_gym.ron"));
    let mut current = GYM_START;
    for (step, (force, expected)) in GYM_STATES.into_iter().enumerate() {
        current = equations.gym_euler(current, force, 0.02);
        let error = difference(current, expected);
        assert!(
            error.iter().all(|error| *error < 1e-12),
            "{step}: {error:?}"
        );
    }
}

/// One copy, and 19 copies in groups of which the last is not full, of the analytic model with
/// `integrator: Euler`. Its coordinates are rounded to f32: 3e-8 below 0.5, 6e-8 below 1.
#[test]
fn the_task_of_gym_has_the_states_of_gym_for_any_number_of_copies() {
    let task = task("envs/cartpole_gym.ron");
    for copies in [1, 19] {
        let mut dynamics = build_dynamics(&task, Physics::Analytic, copies).unwrap();
        (0..copies).for_each(|copy| start(&mut *dynamics, copy, GYM_START));
        for (step, (force, expected)) in GYM_STATES.into_iter().enumerate() {
            dynamics.step(&vec![force as f32; copies]);
            for copy in 0..copies {
                let error = difference(state(&*dynamics, copy), expected);
                assert!(
                    error.iter().all(|error| *error < 6e-8),
                    "step {step}, copy {copy} of {copies}: {error:?}"
                );
            }
        }
    }
}

/// The default integrator does not have Gym's error: over one step, Gym's positions are off by
/// ½ a t², here 2e-3 m of cart motion at 9.8 m/s².
#[test]
fn the_default_integrator_is_not_eulers() {
    let mut dynamics = build_dynamics(&cart_pole(4), Physics::Analytic, 1).unwrap();
    start(&mut *dynamics, 0, GYM_START);
    let (force, expected) = GYM_STATES[0];
    dynamics.step(&[force as f32]);
    let error = difference(state(&*dynamics, 0), expected);
    assert!((1.9e-3..2.0e-3).contains(&error[0]), "{error:?}");
}
