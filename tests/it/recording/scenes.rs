//! Recorded scenes: poses of bodies, forces, traces, and the camera.

use seedbed::record::recording::Recording;
use seedbed::run::facts::EpisodeDetails;
use seedbed::scenario::recording::{RecordingSettings, SceneSettings};
use seedbed_env::{Force, ForceSource, Pose, SceneRope, SceneRopeEnd};
use seedbed_input::numbers::ranged_count;
use seedbed_learn::experience::Episode;

use super::contents::RecordingContents;
use super::record;
use super::synthetic_run::SyntheticRun;

/// The synthetic run has body trajectories of agent 0 in every tenth round: rounds 0 and 10.
#[test]
fn recorded_scenes_have_poses_and_traces() {
    let folder = tempfile::tempdir().unwrap();
    let run = SyntheticRun::new(2, 12);
    let contents =
        RecordingContents::read(&record(&run, folder.path(), &RecordingSettings::default()));
    let expected_rows: usize = [0, 10]
        .iter()
        .map(|&round: &usize| run.rounds[round].episodes[0].length() + 1)
        .sum();
    assert_eq!(
        contents
            .times("/scene/agent_0/bodies/pole", "env_step")
            .len(),
        expected_rows
    );
    assert_eq!(contents.times("/scene/agent_0/trace", "episode"), [0, 10]);
    assert!(
        contents
            .times("/scene/agent_0/trace", "env_step")
            .is_empty()
    );
}

/// The poses are read back as they were recorded, up to the rounding of rotations.
#[test]
fn recorded_scenes_are_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let run = SyntheticRun::new(2, 12);
    let path = record(&run, folder.path(), &RecordingSettings::default());
    let recording = Recording::open(&path).unwrap();
    let scenes = recording.scenes(0, &run.scene).unwrap();
    let recorded: Vec<&EpisodeDetails> = [0, 10]
        .iter()
        .map(|&round: &usize| &run.rounds[round].details[0])
        .collect();
    assert_eq!(scenes.len(), recorded.len());
    for (scene, trajectory) in scenes.iter().zip(recorded) {
        assert_eq!(scene.episode, trajectory.episode);
        assert_eq!(scene.poses.len(), trajectory.poses.len());
        for (found, expected) in scene.poses.iter().zip(&trajectory.poses) {
            assert_eq!((found.x, found.y), (expected.x, expected.y));
            assert!((found.angle - expected.angle).abs() < 1e-6);
        }
    }
    assert!(recording.scenes(1, &run.scene).unwrap().is_empty());
}

/// The ground is in the first row of each recorded episode, with heights that increase downwards.
#[test]
fn the_ground_of_recorded_episodes_is_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = SyntheticRun::new(2, 12);
    let line = |level: f32| vec![[1.5, level], [0.5, 0.25], [-0.5, level]];
    let lines = [vec![line(-1.0), line(2.0)], vec![line(3.0), Vec::new()]];
    for (round, lines) in [0, 10].into_iter().zip(&lines) {
        run.rounds[round].details[0].terrain = lines.clone();
    }
    let path = record(&run, folder.path(), &RecordingSettings::default());
    let recording = Recording::open(&path).unwrap();
    let found = recording.scenes(0, &run.scene).unwrap();
    let found: Vec<_> = found.into_iter().map(|scene| scene.terrain).collect();
    assert_eq!(found, lines);

    let contents = RecordingContents::read(&path);
    let entity = "/scene/agent_0/terrain";
    let steps_before: usize = run.rounds[..10]
        .iter()
        .map(|round| round.episodes[0].length() + 1)
        .sum();
    assert_eq!(contents.times(entity, "env_step"), [0, steps_before as i64]);
    assert_eq!(contents.times(entity, "episode"), [0, 10]);
    assert_eq!(contents.times(entity, "round"), [0, 10]);
    assert_eq!(
        contents.list_length_by_row(entity, "LineStrips2D:strips"),
        [Some(2); 2]
    );
    assert_eq!(
        contents.list_length_by_row(entity, "LineStrips2D:colors"),
        [Some(1); 2]
    );
    assert_eq!(
        contents.strips(entity)[0],
        [[1.5, 1.0], [0.5, -0.25], [-0.5, 1.0]]
    );
}

/// A rope from a point of the world to the upper end of the pole, which is the third body.
#[test]
fn ropes_are_recorded_at_each_step() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = SyntheticRun::new(2, 12);
    let end = |body, at| SceneRopeEnd { body, at };
    run.scene.ropes = vec![SceneRope([end(None, [0.5, 2.0]), end(Some(2), [0.0, 1.0])])];
    let path = record(&run, folder.path(), &RecordingSettings::default());

    let contents = RecordingContents::read(&path);
    let (entity, pole) = ("/scene/agent_0/ropes", "/scene/agent_0/bodies/pole");
    assert_eq!(
        contents.times(entity, "env_step"),
        contents.times(pole, "env_step")
    );
    let poses = [0, 10].map(|round: usize| &run.rounds[round].details[0].poses);
    let poles = poses.into_iter().flatten().skip(2).step_by(3);
    let expected: Vec<_> = poles
        .map(|pose| {
            let (sin, cos) = pose.angle.sin_cos();
            vec![[0.5, -2.0], [pose.x - sin, -(pose.y + cos)]]
        })
        .collect();
    assert_eq!(contents.strips(entity), expected);
}

#[test]
fn recordings_of_tasks_without_ropes_have_none() {
    let folder = tempfile::tempdir().unwrap();
    let run = SyntheticRun::new(2, 12);
    let path = record(&run, folder.path(), &RecordingSettings::default());
    assert!(!RecordingContents::read(&path).has_entity("/scene/agent_0/ropes"));
}

#[test]
fn recordings_of_tasks_without_terrain_have_no_ground() {
    let folder = tempfile::tempdir().unwrap();
    let run = SyntheticRun::new(2, 12);
    let path = record(&run, folder.path(), &RecordingSettings::default());
    let contents = RecordingContents::read(&path);
    assert!(!contents.has_entity("/scene/agent_0/terrain"));
    let scenes = Recording::open(&path).unwrap().scenes(0, &run.scene);
    assert!(scenes.unwrap().iter().all(|scene| scene.terrain.is_empty()));
}

#[test]
fn each_recorded_agent_has_its_own_poses_and_forces() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = SyntheticRun::new(3, 12);
    for round in &mut run.rounds {
        round.details = [0, 2]
            .map(|agent| trajectory_with_forces(&round.episodes[agent]))
            .to_vec();
    }
    let scene = SceneSettings {
        agents: vec![0.into(), 2.into()].into(),
        every: ranged_count(1),
    };
    let settings = RecordingSettings {
        scene: Some(scene),
        ..RecordingSettings::default()
    };
    let contents = RecordingContents::read(&record(&run, folder.path(), &settings));
    assert!(contents.chunks("/scene/agent_1/bodies/pole").is_empty());
    for agent in [0, 2] {
        let row_count: usize = run
            .rounds
            .iter()
            .map(|round| round.episodes[agent].length() + 1)
            .sum();
        let pose_steps = contents.times(&format!("/scene/agent_{agent}/bodies/pole"), "env_step");
        assert_eq!(pose_steps, (0..row_count as i64).collect::<Vec<_>>());
        let action = format!("/scene/agent_{agent}/forces/action");
        assert_eq!(contents.times(&action, "env_step"), pose_steps);
        let action_force_count = row_count - run.rounds.len();
        assert_eq!(
            contents.f32_values(&action, "Force:newtons"),
            vec![5.0; action_force_count],
            "the first state of an episode has no force"
        );
        let contacts = format!("/scene/agent_{agent}/forces/contacts");
        assert_eq!(
            contents.times(&contacts, "env_step").len(),
            run.rounds.len(),
            "one empty row per episode"
        );
    }
}

/// A trajectory of two bodies that move 1 cm per step under a force of 5 N.
fn trajectory_with_forces(episode: &Episode) -> EpisodeDetails {
    let force = Force {
        source: ForceSource::Action,
        at: [0.5, 0.1],
        newtons: [3.0, -4.0],
    };
    let pose_at = |step: usize| Pose {
        x: 0.01 * step as f32,
        ..Pose::default()
    };
    EpisodeDetails {
        agent: episode.agent,
        episode: episode.episode,
        poses: (0..=episode.length())
            .flat_map(|step| [Pose::default(), pose_at(step), pose_at(step)])
            .collect(),
        forces: vec![force; episode.length()],
        forces_per_row: std::iter::once(0)
            .chain(vec![1; episode.length()])
            .collect(),
        ..EpisodeDetails::default()
    }
}

#[test]
fn the_camera_follows_the_tracked_body() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = SyntheticRun::new(2, 12);
    run.scene.tracked = Some(1);
    let contents =
        RecordingContents::read(&record(&run, folder.path(), &RecordingSettings::default()));
    let camera_steps = contents.times("/scene/agent_0/camera", "env_step");
    assert!(!camera_steps.is_empty());
    assert_eq!(
        camera_steps,
        contents.times("/scene/agent_0/bodies/cart", "env_step")
    );
}
