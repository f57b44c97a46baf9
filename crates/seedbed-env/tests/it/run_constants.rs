//! Numbers of tasks of rigid bodies that are drawn once per run (`drawn_per_run`).

use seedbed_env::{Environment, Physics, Status, TaskDescription, build, load, parse};
use seedbed_random::{Purpose, stream};

/// A bead on a wire. The constants are visible in every kind of formula.
fn bead() -> TaskDescription {
    let text = r#"Environment(
        description: "A bead.",
        gravity: (0.0, 0.0),
        control_step: 0.1,
        time_limit: 50,
        drawn_per_run: [
            (name: "goal", value: WholeNumber(from: 0, to: 7)),
            (name: "wind", value: Uniform(-1.0, 1.0)),
        ],
        bodies: [(name: "bead", mass: 2.0, inertia: 1.0, geoms: [Ball(radius: 0.1)], drawn: (y: "goal"))],
        joints: [
            (name: "wire", parent: "world", child: "bead", type: Slide(axis: (1.0, 0.0)), force: "wind"),
        ],
        actuators: [(name: "pull", type: Signal, control: Continuous(-1.0, 1.0))],
        sensors: [
            (name: "x", type: JointPosition("wire")),
            (name: "v", type: JointVelocity("wire")),
            (name: "twice", type: Formula("2 * goal")),
        ],
        observations: [
            (name: "v", range: (-1.0, 1.0)),
            (name: "goal", range: (0.0, 7.0)),
            (name: "sum", value: "goal + twice", range: (0.0, 21.0)),
        ],
        reward: "10 * goal + pull",
        terminated: "goal < 1 && x != previous(x)",
    )"#;
    parse("bead", "bead", text.to_owned()).unwrap_or_else(|error| panic!("{error}"))
}

/// Values of the constants in the run with this run seed.
fn constants(task: &TaskDescription, run_seed: u64) -> Vec<f32> {
    let task = task.for_run(run_seed);
    let bodies = task.body_task().expect("the task has rigid bodies");
    bodies
        .run_constants
        .iter()
        .map(|constant| constant.value)
        .collect()
}

fn reset_all(environment: &mut dyn Environment) {
    for copy in 0..environment.copies() {
        environment.reset(copy, &mut stream(1, Purpose::Reset, copy as u32, 0));
    }
}

/// The standard deviation of the number of 10,000 runs with one of n equally probable values is
/// √(10,000 (1/n) (1 − 1/n)). Counts differ from 10,000 / n by at most five standard deviations.
#[test]
fn each_corridor_is_the_goal_of_equally_many_runs() {
    let path = crate::repository().join("envs/corridors_noisy.ron");
    let task = load(&path).unwrap_or_else(|error| panic!("{error}"));
    let (mut goals, mut pairs) = ([0_u32; 8], [[0_u32; 8]; 8]);
    for run_seed in 0..10_000 {
        let values = constants(&task, run_seed);
        let [goal, noise_turns] = [values[0], values[1]].map(|value| value as usize);
        assert_eq!(values, [goal as f32, noise_turns as f32]);
        goals[goal] += 1;
        pairs[goal][(goal + noise_turns) % 8] += 1;
    }
    let assert_near = |count: u32, n: f64| {
        let deviation = (1e4 / n * (1.0 - 1.0 / n)).sqrt();
        assert!(
            (f64::from(count) - 1e4 / n).abs() < 5.0 * deviation,
            "{count} of 10,000 / {n}"
        );
    };
    for count in goals {
        assert_near(count, 8.0);
    }
    for (goal, counts) in pairs.iter().enumerate() {
        for (noisy, &count) in counts.iter().enumerate() {
            if noisy == goal {
                assert_eq!(count, 0, "the goal is never noisy");
            } else {
                assert_near(count, 56.0);
            }
        }
    }
}

#[test]
fn a_check_or_a_build_without_a_run_has_the_values_of_run_seed_0() {
    let task = bead();
    assert_eq!(task.for_run(0).as_ref(), &task);
    assert_ne!(task.for_run(1).as_ref(), &task);
    assert_eq!(task.for_run(1).for_run(0).as_ref(), &task);
}

#[test]
fn every_kind_of_formula_reads_the_constants_of_the_run() {
    for run_seed in 0..20 {
        let task = bead();
        let values = constants(&task, run_seed);
        let (goal, wind) = (values[0], values[1]);
        let task = task.for_run(run_seed);
        let mut environment = build(&task, Physics::Rapier, 2).unwrap();
        reset_all(&mut *environment);
        assert_eq!(environment.observations()[..3], [0.0, goal, 3.0 * goal]);
        environment.step(&[0.5, -0.5]);
        // From rest: a force of `wind` on 2 kg for 0.1 s.
        let speed = environment.observations()[0];
        assert!(
            (speed - wind * 0.05).abs() < 1e-6,
            "{speed} in a wind of {wind}"
        );
        assert_eq!(
            environment.rewards(),
            [10.0 * goal + 0.5, 10.0 * goal - 0.5]
        );
        let ends = if goal == 0.0 {
            Status::Terminated
        } else {
            Status::Running
        };
        assert_eq!(environment.statuses(), [ends; 2]);
        let mut poses = [seedbed_env::Pose::default()];
        environment.poses(1, &mut poses);
        assert_eq!(poses[0].y, goal);
    }
}

/// What can be seen of some episodes of a copy, as bits.
fn episodes(environment: &mut dyn Environment, copy: usize) -> Vec<u32> {
    let mut seen = Vec::new();
    for episode in 0..3 {
        environment.reset(copy, &mut stream(1, Purpose::Reset, 0, episode));
        while environment.statuses()[copy] == Status::Running {
            environment.step(&vec![0.25; environment.copies()]);
            let observation = &environment.observations()[3 * copy..][..3];
            let numbers = observation.iter().chain([&environment.rewards()[copy]]);
            seen.extend(numbers.map(|number| number.to_bits()));
        }
    }
    seen
}

#[test]
fn runs_in_one_batch_have_constants_of_their_own() {
    let task = bead();
    let mut environment = build(&task, Physics::Rapier, 6).unwrap();
    let alone = |run_seed| {
        let mut environment = build(&task.for_run(run_seed), Physics::Rapier, 1).unwrap();
        episodes(&mut *environment, 0)
    };
    for seeds in [[3, 4, 5], [3, 9, 5]] {
        for (place, run_seed) in seeds.into_iter().enumerate() {
            environment.set_run(2 * place..2 * place + 2, run_seed);
        }
        for copy in 0..6 {
            let run_seed = seeds[copy / 2];
            assert_eq!(
                episodes(&mut *environment, copy),
                alone(run_seed),
                "run {run_seed}"
            );
        }
    }
    assert_ne!(alone(3), alone(4));
    assert_ne!(alone(4), alone(9));
}

#[test]
fn a_state_of_another_run_is_refused() {
    let task = bead();
    let built = |run_seed| {
        let mut environment = build(&task.for_run(run_seed), Physics::Rapier, 1).unwrap();
        reset_all(&mut *environment);
        environment
    };
    let other_goal = (1..100).find(|&seed| constants(&task, seed)[0] != constants(&task, 0)[0]);
    let state = built(0).save(0);
    assert_eq!(built(0).restore(0, &state), Ok(()));
    let mut other = built(other_goal.unwrap());
    let before = other.save(0);
    let [saved, own] = [0, other_goal.unwrap()].map(|seed| constants(&task, seed)[0]);
    assert_eq!(
        other.restore(0, &state).unwrap_err(),
        format!(
            "the saved state is of a run in which `goal` is {saved}, but it is {own} in this run: \
             expected a state of a run with the same run seed"
        )
    );
    assert_eq!(other.save(0), before);
}
