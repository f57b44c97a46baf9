//! Numbers that are drawn at the start of each episode (`drawn_per_episode`), markers, and episodes
//! that start in a given state.

use seedbed_env::{
    Environment, GivenStart, Physics, Pose, StartNames, TaskDescription, build, parse,
};
use seedbed_random::{Purpose, Stream, stream};

/// A bead on a wire that has to come to a target.
fn bead() -> TaskDescription {
    let text = r#"Environment(
        description: "A bead.",
        gravity: (0.0, 0.0),
        control_step: 0.1,
        time_limit: 50,
        drawn_per_run: [(name: "level", value: WholeNumber(from: 5, to: 9))],
        drawn_per_episode: [
            (name: "target", value: Uniform(-1.0, 1.0)),
            (name: "wind", value: Normal(0.0, 0.5)),
        ],
        bodies: [(name: "bead", mass: 2.0, inertia: 1.0, geoms: [Ball(radius: 0.1)])],
        markers: [(name: "flag", geoms: [Ball(radius: 0.1)], x: "target", y: "level", angle: "2 * wind")],
        joints: [
            (name: "wire", parent: "world", child: "bead", type: Slide(axis: (1.0, 0.0)), force: "wind"),
        ],
        actuators: [(name: "pull", type: Signal, control: Continuous(-1.0, 1.0))],
        sensors: [
            (name: "x", type: JointPosition("wire")),
            (name: "v", type: JointVelocity("wire")),
            (name: "distance", type: Formula("target - x")),
        ],
        observations: [
            (name: "distance", range: (-2.0, 2.0)),
            (name: "target", range: (-1.0, 1.0)),
            (name: "v", range: (-1.0, 1.0)),
        ],
        reset: [(joint: "wire", position: Uniform(-1.0, 1.0))],
        reward: "10 * target + level",
    )"#;
    parse("bead", "bead", text.to_owned()).unwrap_or_else(|error| panic!("{error}"))
}

fn beads(copies: usize) -> Box<dyn Environment> {
    build(&bead(), Physics::Rapier, copies).unwrap()
}

fn resets() -> Stream {
    stream(3, Purpose::Reset, 0, 0)
}

fn target(environment: &dyn Environment, copy: usize) -> f32 {
    environment.observations()[3 * copy + 1]
}

/// Uniform in (−1, 1): mean 0 ± 5 σ / √1000 with σ = 2 / √12, and a variance of 1/3.
#[test]
fn each_episode_draws_its_numbers() {
    let (mut environment, mut random) = (beads(1), resets());
    let targets: Vec<f32> = (0..1000)
        .map(|_| {
            environment.reset(0, &mut random);
            target(&*environment, 0)
        })
        .collect();
    let mean = targets.iter().sum::<f32>() / 1000.0;
    let variance = targets.iter().map(|target| target * target).sum::<f32>() / 1000.0;
    assert!(
        mean.abs() < 0.1 && (variance - 1.0 / 3.0).abs() < 0.05,
        "{mean}, {variance}"
    );
    let mut again = beads(1);
    again.reset(0, &mut resets());
    assert_eq!(
        target(&*again, 0),
        targets[0],
        "the same stream draws the same numbers"
    );
}

/// Numbers are drawn after the coordinates: adding them to a task does not change its start states.
#[test]
fn start_states_do_not_depend_on_the_numbers() {
    let mut environment = beads(1);
    environment.reset(0, &mut resets());
    let text = r#"Environment(
        description: "A bead.", gravity: (0.0, 0.0), control_step: 0.1, time_limit: 50,
        bodies: [(name: "bead", mass: 2.0, inertia: 1.0)],
        joints: [(name: "wire", parent: "world", child: "bead", type: Slide(axis: (1.0, 0.0)))],
        actuators: [], sensors: [(name: "x", type: JointPosition("wire"))],
        observations: [(name: "x", range: (-1.0, 1.0))],
        reset: [(joint: "wire", position: Uniform(-1.0, 1.0))], reward: "0",
    )"#;
    let plain = parse("plain", "plain", text.to_owned()).unwrap_or_else(|error| panic!("{error}"));
    let mut plain = build(&plain, Physics::Rapier, 1).unwrap();
    plain.reset(0, &mut resets());
    let x = environment.coordinates(0).positions[0].1;
    assert_eq!(x as f32, plain.observations()[0]);
}

/// All kinds of formulas read the numbers, which stay as they are during the episode: the force
/// m v̇ = wind, the reward, observations and markers.
#[test]
fn formulas_read_the_numbers_of_the_episode() {
    let mut environment = beads(2);
    let mut random = resets();
    (0..2).for_each(|copy| environment.reset(copy, &mut random));
    for copy in 0..2 {
        let numbers = environment.coordinates(copy).episode_numbers;
        let [(0, target), (1, wind)] = numbers[..] else {
            panic!("{numbers:?}")
        };
        let mut poses = [Pose::default(); 2];
        environment.poses(copy, &mut poses);
        assert!((f64::from(poses[1].x) - target).abs() < 1e-6);
        assert!((f64::from(poses[1].angle) - 2.0 * wind).abs() < 1e-6);
        assert!((5.0..=9.0).contains(&poses[1].y), "{}", poses[1].y);
    }
    let before: Vec<_> = (0..2).map(|copy| environment.coordinates(copy)).collect();
    (0..10).for_each(|_| environment.step(&[0.0; 2]));
    for (copy, before) in before.iter().enumerate() {
        assert_eq!(
            environment.coordinates(copy).episode_numbers,
            before.episode_numbers
        );
        let wind = before.episode_numbers[1].1;
        let velocity = f64::from(environment.observations()[3 * copy + 2]);
        assert!((velocity - wind / 2.0).abs() < 1e-5, "{velocity}, {wind}");
        let reward = environment.rewards()[copy] - 10.0 * target(&*environment, copy);
        assert!(
            [5.0, 6.0, 7.0, 8.0, 9.0]
                .iter()
                .any(|level| (reward - level).abs() < 1e-5)
        );
    }
}

#[test]
fn a_restored_copy_has_the_numbers_of_its_episode() {
    let (mut environment, mut random) = (beads(2), resets());
    (0..2).for_each(|copy| environment.reset(copy, &mut random));
    let saved = environment.save(0);
    environment.restore(1, &saved).unwrap();
    assert_eq!(environment.coordinates(1), environment.coordinates(0));
    environment.step(&[0.0; 2]);
    assert_eq!(environment.rewards()[0], environment.rewards()[1]);
}

/// What is given is the start; what is not given is drawn or at rest at 0. The next reset draws all.
#[test]
fn an_episode_starts_in_a_given_state() {
    let (mut environment, mut random) = (beads(1), resets());
    let names = environment.start_names();
    let expected = StartNames {
        coordinates: vec!["wire".to_owned()],
        episode_numbers: vec!["target".to_owned(), "wind".to_owned()],
    };
    assert_eq!(names, expected);
    let start = GivenStart {
        positions: Vec::new(),
        velocities: vec![(0, 0.25)],
        episode_numbers: vec![(0, 0.75)],
    };
    environment.reset_at(0, &mut random, &start);
    let reached = environment.coordinates(0);
    assert_eq!(reached.positions, [(0, 0.0)]);
    assert_eq!(reached.velocities, [(0, 0.25)]);
    assert_eq!(reached.episode_numbers[0], (0, 0.75));
    assert!(reached.episode_numbers[1].1 != 0.0, "the wind is drawn");
    environment.reset(0, &mut random);
    let drawn = environment.coordinates(0);
    assert!(
        drawn.positions[0].1 != 0.0 && drawn.velocities == [(0, 0.0)],
        "{drawn:?}"
    );
}

/// A bead whose acceleration is a number that is drawn in each step.
fn shaken_beads(copies: usize) -> Box<dyn Environment> {
    let text = r#"Environment(
        description: "A bead.", gravity: (0.0, 0.0), control_step: 1.0, time_limit: 2000,
        drawn_per_step: [(name: "shake", value: Uniform(-1.0, 1.0))],
        bodies: [(name: "bead", mass: 1.0, inertia: 1.0)],
        joints: [
            (name: "wire", parent: "world", child: "bead", type: Slide(axis: (1.0, 0.0)), force: "shake"),
        ],
        actuators: [],
        sensors: [(name: "v", type: JointVelocity("wire"))],
        observations: [(name: "v", range: (-9.0, 9.0)), (name: "shake", range: (-1.0, 1.0))],
        reward: "shake",
    )"#;
    let task = parse("bead", "bead", text.to_owned()).unwrap_or_else(|error| panic!("{error}"));
    build(&task, Physics::Rapier, copies).unwrap()
}

/// The number is the force of the step, m v̇ = shake, is what the reward reads, and is observed.
/// Uniform numbers have mean 0 and variance 1/3, and neighboring ones are not correlated.
#[test]
fn each_step_draws_its_numbers() {
    let mut environment = shaken_beads(1);
    environment.reset(0, &mut resets());
    assert!(
        environment.observations()[1] != 0.0,
        "drawn for the first observation"
    );
    let (mut before, mut shakes) = (0.0, Vec::new());
    for _ in 0..1000 {
        environment.step(&[]);
        let (velocity, shake) = (environment.observations()[0], environment.observations()[1]);
        assert_eq!(environment.rewards(), [shake]);
        assert!(
            (velocity - before - shake).abs() < 1e-4,
            "{velocity}, {before}, {shake}"
        );
        before = velocity;
        shakes.push(shake);
    }
    let mean_of = |values: Vec<f32>| values.iter().sum::<f32>() / values.len() as f32;
    let mean = mean_of(shakes.clone());
    let variance = mean_of(shakes.iter().map(|shake| shake * shake).collect());
    let covariance = mean_of(shakes.windows(2).map(|pair| pair[0] * pair[1]).collect());
    assert!(mean.abs() < 0.09 && (variance - 1.0 / 3.0).abs() < 0.05 && covariance.abs() < 0.05);
}

/// Copies draw different numbers. A restored copy draws the same ones, and so does a copy that starts
/// from the same random stream.
#[test]
fn numbers_of_steps_follow_from_the_reset() {
    let (mut environment, mut random) = (shaken_beads(2), resets());
    (0..2).for_each(|copy| environment.reset(copy, &mut random));
    (0..3).for_each(|_| environment.step(&[]));
    assert_ne!(environment.rewards()[0], environment.rewards()[1]);
    let saved = environment.save(0);
    environment.restore(1, &saved).unwrap();
    environment.step(&[]);
    assert_eq!(environment.rewards()[0], environment.rewards()[1]);
    let mut again = shaken_beads(1);
    again.reset(0, &mut resets());
    (0..4).for_each(|_| again.step(&[]));
    assert_eq!(again.rewards()[0], environment.rewards()[0]);
}

/// A bead that starts anywhere but near the target, which is drawn as well.
fn distant_bead(redrawn_while: &str) -> Box<dyn Environment> {
    let text = format!(
        r#"Environment(
            description: "A bead.", gravity: (0.0, 0.0), control_step: 0.1, time_limit: 50,
            drawn_per_episode: [(name: "target", value: Uniform(-1.0, 1.0))],
            bodies: [(name: "bead", mass: 2.0, inertia: 1.0)],
            joints: [(name: "wire", parent: "world", child: "bead", type: Slide(axis: (1.0, 0.0)))],
            actuators: [], sensors: [(name: "x", type: JointPosition("wire"))],
            observations: [(name: "distance", value: "abs(target - x)", range: (0.0, 2.0))],
            reset: [(joint: "wire", position: Uniform(-1.0, 1.0))], reward: "0",
            redrawn_while: "{redrawn_while}",
        )"#
    );
    let task = parse("bead", "bead", text).unwrap_or_else(|error| panic!("{error}"));
    build(&task, Physics::Rapier, 1).unwrap()
}

/// The distance of two uniform numbers in (−1, 1) is more than 1 with probability 1/4.
#[test]
fn starts_are_drawn_again_while_the_formula_is_true() {
    for (formula, share) in [("false", 0.25), ("abs(target - x) < 1", 1.0)] {
        let (mut environment, mut random) = (distant_bead(formula), resets());
        let mut distant = 0;
        for _ in 0..400 {
            environment.reset(0, &mut random);
            distant += u32::from(environment.observations()[0] > 1.0);
        }
        let found = f64::from(distant) / 400.0;
        assert!((found - share).abs() < 0.1, "{formula}: {found}");
    }
    distant_bead("true").reset(0, &mut resets());
}
