//! `Recording::open` and its episodes, for complete recordings, truncated recordings, and other
//! files.

use std::path::Path;

use seedbed::record::RecordedEpisode;
use seedbed::record::rerun::Recording;
use seedbed::record::rerun::RerunRecorder;
use seedbed::record::visitation::Axes;
use seedbed::run::recorder::{BonusRange, Recorder};
use seedbed::scenario::recording::RecordingSettings;

use super::synthetic_run::SyntheticRun;
use super::{record, record_rounds, set_file_length};

#[test]
fn read_episodes_equal_recorded_episodes() {
    let folder = tempfile::tempdir().unwrap();
    let run = SyntheticRun::new(3, 40);
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
    assert_eq!(read_sorted_episodes(&path), expected_episodes(&run, 40));
}

/// A recording that was not finished, or that ends within a message, is read up to its last
/// complete message. The test cuts the file 50 bytes after all rows of 20 rounds were written.
#[test]
fn complete_episodes_of_a_truncated_recording_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let run = SyntheticRun::new(2, 60);
    let mut recorder = RerunRecorder::create(
        &folder.path().join("run.rrd"),
        &run.run_info(),
        &RecordingSettings::default(),
    )
    .unwrap();
    record_rounds(&run.rounds[..20], &mut recorder);
    recorder.flush().unwrap();
    let part = folder.path().join("run.rrd.part");
    let length_after_flush = std::fs::metadata(&part).unwrap().len();
    record_rounds(&run.rounds[20..], &mut recorder);
    drop(recorder);
    assert_eq!(read_sorted_episodes(&part), expected_episodes(&run, 60));
    set_file_length(&part, length_after_flush + 50);
    assert_eq!(read_sorted_episodes(&part), expected_episodes(&run, 20));
}

#[test]
fn files_that_are_not_recordings_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("other.rrd");
    let open_error = |path: &Path| {
        Recording::open(path)
            .unwrap_err()
            .to_string()
            .replace(path.to_str().unwrap(), "FILE")
    };
    assert_eq!(
        open_error(&path),
        "cannot read FILE: No such file or directory (os error 2)"
    );
    std::fs::write(&path, "agent,episode,round\n0,0,0\n").unwrap();
    assert!(
        open_error(&path).starts_with("cannot read FILE: "),
        "{}",
        open_error(&path)
    );
    let stream = rerun::RecordingStreamBuilder::new("other")
        .save(&path)
        .unwrap();
    stream.log("words", &rerun::TextLog::new("hello")).unwrap();
    drop(stream);
    let not_a_run = "FILE is not a recording that this version of seedbed can read: it has no entity `/scenario/quantities`";
    assert_eq!(open_error(&path), not_a_run);
    let mut bytes = std::fs::read(&path).unwrap();
    bytes[4..8].copy_from_slice(&[0, 9, 0, 0]);
    std::fs::write(&path, bytes).unwrap();
    let old_version = "cannot read FILE: Data from Rerun version 0.9.0, which is incompatible with the local Rerun version 0.36.3";
    assert_eq!(open_error(&path), old_version);
}

/// All episodes of a recording, sorted by (agent, episode).
fn read_sorted_episodes(path: &Path) -> Vec<RecordedEpisode> {
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

/// The episodes of the first `rounds` rounds as a recording should have them, sorted by (agent,
/// episode).
fn expected_episodes(run: &SyntheticRun, rounds: usize) -> Vec<RecordedEpisode> {
    let episodes_with_step_data = run.rounds[..rounds].iter().flat_map(|round| {
        let step_data = round.step_data.clone();
        round.episodes.clone().into_iter().zip(step_data)
    });
    let mut expected_episodes: Vec<RecordedEpisode> = episodes_with_step_data
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
            info: Vec::new(),
            rewards: episode.rewards,
            intrinsic_rewards: step_data.intrinsic_rewards,
            advantages: Vec::new(),
            outcome: episode.outcome,
        })
        .collect();
    expected_episodes.sort_by_key(|episode| (episode.agent, episode.episode));
    expected_episodes
}
