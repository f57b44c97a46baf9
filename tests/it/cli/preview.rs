//! `seedbed preview`.

use std::fs;
use std::path::Path;

use seedbed::record::recording::Recording;
use seedbed_env::{Physics, Scene, build, parse};

use crate::util::{ball_above_ground, run_successful, seedbed, stderr, stdout};

#[test]
fn preview_records_a_task_without_training() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("new").join("look.rrd");
    let output = seedbed(&[
        "preview",
        "cartpole",
        "--episodes",
        "2",
        "--film",
        "--out",
        path.to_str().unwrap(),
    ]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert_eq!(
        stdout(&output)
            .lines()
            .filter(|line| line.starts_with("episode "))
            .count(),
        2
    );
    assert!(path.metadata().unwrap().len() > 10_000);
    let film = std::fs::read(path.with_extension("gif")).unwrap();
    assert!(film.starts_with(b"GIF89a"));

    let mistyped = seedbed(&["preview", "cartpol"]);
    assert_eq!(mistyped.status.code(), Some(2));
    assert!(
        stderr(&mistyped).ends_with("  = help: did you mean `cartpole`?\n"),
        "{}",
        stderr(&mistyped)
    );
}

/// A scenario is previewed in its own task, and what does not hold in it is said at once.
#[test]
fn scenarios_are_previewed_in_their_task() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("weak.ron");
    let task = r#"Environment(
        description: "A winch.", gravity: (0.0, -9.81), control_step: 0.02, time_limit: 5, solver: (passes: 1),
        bodies: [
            (name: "arm", mass: 1, geoms: [Ball(radius: 0.1)]),
            (name: "load", mass: 1, geoms: [Ball(radius: 0.1)]),
        ],
        joints: [
            (name: "swing", parent: "world", child: "arm", type: Hinge()),
            (name: "hoist", parent: "arm", child: "load", type: Slide(axis: (0.0, 1.0))),
        ],
        actuators: [(name: "winch", type: VelocityServo(joint: "hoist", kv: 100.0), control: Continuous(-1.0, 1.0))],
        sensors: [(name: "height", type: JointPosition("hoist"))],
        observations: [(name: "height", range: (-1.0, 1.0))],
        reward: "0",
    )"#;
    fs::write(&path, task).unwrap();
    let scenario = folder.path().join("scenario.ron");
    let text = r#"Scenario(environment: "weak.ron", agents: (count: 1, seeds: Normal(sigma: 0)), algorithm: Random, stop: Episodes(1))"#;
    fs::write(&scenario, text).unwrap();
    let out = folder.path().join("look.rrd");
    let out = out.to_str().unwrap();
    for file in [&path, &scenario] {
        let output = seedbed(&["preview", file.to_str().unwrap(), "--out", out]);
        assert!(output.status.success(), "{output:?}");
        let warning = "warning: servo `winch` hardly holds joint `hoist` between two bodies";
        assert!(stderr(&output).contains(warning), "{output:?}");
        assert!(stdout(&output).contains("episode 2: 5 steps"), "{output:?}");
    }
}

fn scene_of(task: &str) -> Scene {
    let task = parse("ball", "ball.ron", task.to_owned()).unwrap();
    let environment = build(&task, Physics::Rapier, 1).unwrap();
    environment.scene().unwrap().clone()
}

/// The bytes of the film of a preview of two episodes, whose ground has these heights at all points.
fn film_above_ground(folder: &Path, formula: &str, heights: [f32; 11]) -> Vec<u8> {
    fs::create_dir(folder).unwrap();
    let (task, recording) = (folder.join("ball.ron"), folder.join("ball.rrd"));
    let text = ball_above_ground(formula);
    fs::write(&task, &text).unwrap();
    let [task, out] = [&task, &recording].map(|path| path.to_str().unwrap());
    run_successful(&["preview", task, "--episodes", "2", "--film", "--out", out]);
    let scenes = Recording::open(&recording).unwrap();
    let scenes = scenes.scenes(0, &scene_of(&text)).unwrap();
    assert_eq!(scenes.len(), 2);
    for scene in scenes {
        let [line] = &scene.terrain[..] else {
            panic!("{:?}", scene.terrain);
        };
        let found = line.iter().rev().map(|[_, y]| *y);
        assert!(found.eq(heights), "{line:?}");
        assert_eq!((line[10][0], line[0][0]), (-0.5, 0.5));
    }
    fs::read(recording.with_extension("gif")).unwrap()
}

/// Ground that rises and ground that falls have the same bounds and do not touch the ball, so that only
/// the drawing of the ground differs.
#[test]
fn the_ground_of_each_episode_is_recorded_and_filmed() {
    let folder = tempfile::tempdir().unwrap();
    let rising = std::array::from_fn(|index| 0.0625 * index as f32);
    let mut falling = rising;
    falling.reverse();
    let [one, again, other] = [
        ("one", "0.0625 * index", rising),
        ("again", "0.0625 * index", rising),
        ("other", "0.625 - 0.0625 * index", falling),
    ]
    .map(|(name, formula, heights)| film_above_ground(&folder.path().join(name), formula, heights));
    assert!(one == again && one != other);
}
