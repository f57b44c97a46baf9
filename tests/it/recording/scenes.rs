//! Scenes: bodies in motion, what pushes them, and who is followed.

use seedbed::record::{BodyTrajectory, RecordingSettings, SceneSettings};
use seedbed_env::input::numbers::known_count;
use seedbed_env::{Force, ForceSource, Pose};
use seedbed_learn::experience::Episode;

use super::contents::Contents;
use super::record;
use super::synthetic_run::Run;

#[test]
fn the_filmed_episodes_move_and_leave_a_trace() {
    let folder = tempfile::tempdir().unwrap();
    let run = Run::new(2, 12);
    let contents = Contents::of(&record(&run, folder.path(), &RecordingSettings::default()));
    let filmed: usize = [0, 10]
        .iter()
        .map(|&round: &usize| run.rounds[round].episodes[0].length() + 1)
        .sum();
    assert_eq!(
        contents
            .times("/scene/agent_0/bodies/pole", "env_step")
            .len(),
        filmed
    );
    assert_eq!(contents.times("/scene/agent_0/trace", "episode"), [0, 10]);
    assert!(
        contents
            .times("/scene/agent_0/trace", "env_step")
            .is_empty()
    );
}

#[test]
fn scenes_of_several_agents_have_their_own_episodes_and_forces() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = Run::new(3, 12);
    for round in &mut run.rounds {
        round.body_trajectories = [0, 2].map(|agent| pushed(&round.episodes[agent])).to_vec();
    }
    let scene = SceneSettings {
        agents: vec![0.into(), 2.into()].into(),
        every: known_count(1),
    };
    let settings = RecordingSettings {
        scene: Some(scene),
        ..RecordingSettings::default()
    };
    let contents = Contents::of(&record(&run, folder.path(), &settings));
    assert!(contents.chunks("/scene/agent_1/bodies/pole").is_empty());
    for agent in [0, 2] {
        let rows: usize = run
            .rounds
            .iter()
            .map(|round| round.episodes[agent].length() + 1)
            .sum();
        let poses = contents.times(&format!("/scene/agent_{agent}/bodies/pole"), "env_step");
        assert_eq!(poses, (0..rows as i64).collect::<Vec<_>>());
        let action = format!("/scene/agent_{agent}/forces/action");
        assert_eq!(contents.times(&action, "env_step"), poses);
        let pushes = rows - run.rounds.len();
        assert_eq!(
            contents.numbers(&action, "Force:newtons"),
            vec![5.0; pushes],
            "no force led to a first row"
        );
        let contacts = format!("/scene/agent_{agent}/forces/contacts");
        assert_eq!(
            contents.times(&contacts, "env_step").len(),
            run.rounds.len(),
            "an empty row an episode"
        );
    }
}

/// Bodies that move 1 cm in every step, pushed by 5 N.
fn pushed(episode: &Episode) -> BodyTrajectory {
    let force = Force {
        source: ForceSource::Action,
        at: [0.5, 0.1],
        newtons: [3.0, -4.0],
    };
    let at = |step: usize| Pose {
        x: 0.01 * step as f32,
        ..Pose::default()
    };
    BodyTrajectory {
        agent: episode.agent,
        episode: episode.episode,
        poses: (0..=episode.length())
            .flat_map(|step| [Pose::default(), at(step), at(step)])
            .collect(),
        forces: vec![force; episode.length()],
        forces_per_row: std::iter::once(0)
            .chain(vec![1; episode.length()])
            .collect(),
    }
}

#[test]
fn a_tracked_body_is_followed() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = Run::new(2, 12);
    run.scene.tracked = Some(1);
    let contents = Contents::of(&record(&run, folder.path(), &RecordingSettings::default()));
    let followed = contents.times("/scene/agent_0/camera", "env_step");
    assert!(!followed.is_empty());
    assert_eq!(
        followed,
        contents.times("/scene/agent_0/bodies/cart", "env_step")
    );
}
