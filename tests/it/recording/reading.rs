//! Recordings as seedbed reads them: whole, cut off, and files that are none.

use std::fs::File;
use std::path::Path;

use seedbed::record::RecordedEpisode;
use seedbed::record::rerun::Recording;
use seedbed::record::rerun::RerunRecorder;
use seedbed::record::visitation::Axes;
use seedbed::record::{BonusRange, Recorder, RecordingSettings};

use super::record;
use super::synthetic_run::Run;

#[test]
fn episodes_are_read_back_as_they_were() {
    let folder = tempfile::tempdir().unwrap();
    let run = Run::new(3, 40);
    let path = record(&run, folder.path(), &RecordingSettings::default());
    let recording = Recording::open(&path).unwrap();
    assert_eq!(
        (recording.observations(), recording.bonus()),
        (&run.spec.observations[..], BonusRange::UpTo(0.01))
    );
    assert_eq!(recording.actions(), [run.spec.actions[0].quantity.clone()]);
    assert_eq!(
        recording.axes(),
        Axes::of(
            &run.spec,
            &RecordingSettings::default().axes,
            BonusRange::UpTo(0.01)
        )
    );
    let property = |name: &str| recording.properties().get(name).map(String::as_str);
    assert_eq!(
        [property("agents"), property("RecordingInfo:name")],
        [Some("3"), Some("cartpole-made-up")]
    );
    assert_eq!(read_back(&path), played(&run, 40));
}

/// Without its end, and in the middle of a message, what is complete is read: rows reach the file
/// in pieces of 2,048 an agent.
#[test]
fn a_killed_recording_is_read_as_far_as_it_goes() {
    let folder = tempfile::tempdir().unwrap();
    let run = Run::new(2, 60);
    let mut recorder = RerunRecorder::create(
        &folder.path().join("run.rrd"),
        &run.about(),
        &RecordingSettings::default(),
    )
    .unwrap();
    run.rounds[..20]
        .iter()
        .for_each(|round| round.record(&mut recorder));
    recorder.checkpoint().unwrap();
    let part = folder.path().join("run.rrd.part");
    let length = std::fs::metadata(&part).unwrap().len();
    run.rounds[20..]
        .iter()
        .for_each(|round| round.record(&mut recorder));
    drop(recorder);
    assert_eq!(read_back(&part), played(&run, 60));
    File::options()
        .write(true)
        .open(&part)
        .unwrap()
        .set_len(length + 50)
        .unwrap();
    assert_eq!(read_back(&part), played(&run, 20));
}

#[test]
fn other_files_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("other.rrd");
    let refusal = |path: &Path| {
        Recording::open(path)
            .unwrap_err()
            .to_string()
            .replace(path.to_str().unwrap(), "FILE")
    };
    assert_eq!(
        refusal(&path),
        "cannot read FILE: No such file or directory (os error 2)"
    );
    std::fs::write(&path, "agent,episode,round\n0,0,0\n").unwrap();
    assert!(
        refusal(&path).starts_with("cannot read FILE: "),
        "{}",
        refusal(&path)
    );
    let stream = rerun::RecordingStreamBuilder::new("other")
        .save(&path)
        .unwrap();
    stream.log("words", &rerun::TextLog::new("hello")).unwrap();
    drop(stream);
    let none = "FILE is not a recording that this version of seedbed can read: it has no entity `/scenario/quantities`";
    assert_eq!(refusal(&path), none);
    let mut bytes = std::fs::read(&path).unwrap();
    bytes[4..8].copy_from_slice(&[0, 9, 0, 0]);
    std::fs::write(&path, bytes).unwrap();
    let old = "cannot read FILE: Data from Rerun version 0.9.0, which is incompatible with the local Rerun version 0.36.3";
    assert_eq!(refusal(&path), old);
}

/// By (agent, episode).
fn read_back(path: &Path) -> Vec<RecordedEpisode> {
    let episodes = Recording::open(path).unwrap().episodes().unwrap();
    let mut episodes: Vec<RecordedEpisode> = episodes.collect::<Result<_, _>>().unwrap();
    assert!(
        episodes
            .iter()
            .all(|episode| episode.observations.len() == 4 * (episode.length() + 1))
    );
    episodes.sort_by_key(|episode| (episode.agent, episode.episode));
    episodes
}

fn played(run: &Run, rounds: usize) -> Vec<RecordedEpisode> {
    let all = run.rounds[..rounds].iter().flat_map(|round| {
        let step_data = round.step_data.clone();
        round.episodes.clone().into_iter().zip(step_data)
    });
    let mut played: Vec<RecordedEpisode> = all
        .map(|(episode, step_data)| RecordedEpisode {
            agent: episode.agent,
            episode: episode.episode,
            round: episode.round,
            observations: episode.observations,
            actions: episode
                .actions
                .iter()
                .map(|&action| if action == 0.0 { -10.0 } else { 10.0 })
                .collect(),
            rewards: episode.rewards,
            intrinsic_rewards: step_data.intrinsic_rewards,
            outcome: episode.outcome,
        })
        .collect();
    played.sort_by_key(|episode| (episode.agent, episode.episode));
    played
}
