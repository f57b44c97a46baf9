//! Ground that is drawn at the start of each episode.

use seedbed_env::{Environment, Physics, build, parse};
use seedbed_random::{Purpose, Stream, stream};

/// A ball above ground of nine points. `terrain`: what the formula of the heights needs.
fn ball(terrain: &str, copies: usize) -> Box<dyn Environment> {
    let text = format!(
        r#"Environment(
            description: "A ball.", gravity: (0.0, -9.8), control_step: 0.02, time_limit: 1000,
            solver: (searches: 2),
            drawn_per_episode: [(name: "level", value: Uniform(1.0, 2.0))],
            colliders: [(name: "ground", geom: Terrain(from: -4.0, spacing: 1.0, points: 9, {terrain}))],
            bodies: [(name: "ball", position: (0.0, 4.0), mass: 1.0, colliders: [(name: "skin", geom: Ball(radius: 0.3))])],
            actuators: [],
            sensors: [
                (name: "y", type: JointPosition("ball.y")),
                (name: "touches", type: Contact("skin", "ground")),
                (name: "below", type: Ray(body: "ball", direction: (0.0, -1.0), length: 9.0)),
            ],
            observations: [
                (name: "y", range: (0.0, 5.0)), (name: "touches", range: (0.0, 1.0)), (name: "below", range: (0.0, 9.0)),
                (name: "level", range: (1.0, 2.0)),
            ],
            reward: "0",
        )"#
    );
    let task = parse("ball", "ball", text).unwrap_or_else(|error| panic!("{error}"));
    build(&task, Physics::Rapier, copies).unwrap()
}

fn resets() -> Stream {
    stream(5, Purpose::Reset, 0, 0)
}

/// Points are listed from right to left.
fn heights(environment: &dyn Environment, copy: usize) -> Vec<f32> {
    let lines = environment.terrain(copy);
    let [line] = &lines[..] else {
        panic!("{lines:?}")
    };
    for (index, [x, _]) in line.iter().rev().enumerate() {
        assert_eq!(*x, index as f32 - 4.0);
    }
    line.iter().rev().map(|[_, y]| *y).collect()
}

/// `start` at the first point, `next` at each further one, in the order of the list: the second value
/// reads the new value of the first one and its own old one.
#[test]
fn values_go_from_point_to_point() {
    let mut environment = ball(
        r#"values: [
            (name: "step", start: "10 * index + 1", next: "step + index"),
            (name: "sum", start: "step", next: "sum + 100 * step"),
        ], height: "level + sum / 1000""#,
        1,
    );
    environment.reset(0, &mut resets());
    let level = environment.observations()[3];
    let (mut step, mut sum, mut expected) = (1.0, 1.0, vec![]);
    for index in 0..9_u8 {
        if index > 0 {
            step += f32::from(index);
            sum += 100.0 * step;
        }
        expected.push(level + sum / 1000.0);
    }
    let found = heights(&*environment, 0);
    let is_near = |(a, b): (&f32, &f32)| (a - b).abs() < 1e-5;
    assert!(
        found.iter().zip(&expected).all(is_near),
        "{found:?}, {expected:?}"
    );
}

const BUMPS: &str = r#"drawn: [(name: "bump", value: Uniform(-0.2, 0.2))], height: "level + bump""#;

/// Bodies rest on the ground of their own episode, sensors and saved states know it, and the next
/// episode has another one.
#[test]
fn each_episode_has_ground_of_its_own() {
    let mut environment = ball(BUMPS, 2);
    let mut random = resets();
    (0..2).for_each(|copy| environment.reset(copy, &mut random));
    let first = [0, 1].map(|copy| heights(&*environment, copy));
    assert_ne!(first[0], first[1]);
    for (copy, ground) in first.iter().enumerate() {
        let [y, touches, below, level] = environment.observations()[4 * copy..][..4] else {
            panic!("four observations")
        };
        assert!(ground.iter().all(|height| (height - level).abs() <= 0.2));
        assert_eq!(touches, 0.0);
        assert!(
            (below - (y - ground[4])).abs() < 1e-4,
            "{below}, {ground:?}"
        );
    }
    let saved = environment.save(0);
    (0..150).for_each(|_| environment.step(&[]));
    for (copy, ground) in first.iter().enumerate() {
        let [y, touches, ..] = environment.observations()[4 * copy..][..4] else {
            panic!("four observations")
        };
        // The ball may have rolled into a valley.
        let lowest = ground.iter().copied().fold(f32::INFINITY, f32::min);
        let highest = ground.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        assert!(
            touches == 1.0 && lowest < y - 0.29 && y - 0.33 < highest,
            "{y}, {ground:?}"
        );
    }
    let rested = environment.observations()[..4].to_vec();
    environment.restore(1, &saved).unwrap();
    assert_eq!(heights(&*environment, 1), first[0]);
    (0..150).for_each(|_| environment.step(&[]));
    assert_eq!(
        environment.observations()[4..],
        rested,
        "the same bits on the same ground"
    );
    environment.reset(0, &mut random);
    assert_ne!(heights(&*environment, 0), first[0]);
}

/// Ground that is not a number ends in states that are not numbers, which runs report.
#[test]
fn ground_without_a_height_is_no_state() {
    let mut environment = ball(r#"height: "log(0 - index)""#, 1);
    environment.reset(0, &mut resets());
    assert!(environment.observations()[0].is_nan());
    environment.step(&[]);
    assert!(environment.observations()[0].is_nan());
}
