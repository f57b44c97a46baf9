//! Size of recordings in bytes per state. `benches/recording.rs` measures the speed of recording.

use std::path::Path;

use rerun::log::{Chunk, LogMsg};
use seedbed::record::RecordingSettings;
use seedbed_env::Quantity;

use super::contents::messages;
use super::record;
use super::synthetic_run::SyntheticRun;

/// A row of `/raw` with four observations, action, reward, log-probability and intrinsic reward
/// takes at most 45 bytes; a fifth observation takes at most 6 further bytes.
#[test]
fn raw_data_takes_few_bytes_per_state() {
    let folder = tempfile::tempdir().unwrap();
    let run = SyntheticRun::new(2, 400);
    let states: usize = run
        .rounds
        .iter()
        .flat_map(|round| &round.episodes)
        .map(|episode| episode.length() + 1)
        .sum();
    let bytes_per_state = raw_bytes(&record(&run, folder.path(), &RecordingSettings::default()))
        as f64
        / states as f64;
    let bytes_with_fifth_observation = raw_bytes(&record(
        &with_fifth_observation(run),
        folder.path(),
        &RecordingSettings::default(),
    )) as f64
        / states as f64;
    assert!(bytes_per_state <= 45.0, "{bytes_per_state} bytes per state");
    assert!(
        bytes_with_fifth_observation - bytes_per_state <= 6.0,
        "{} bytes per state for the fifth observation",
        bytes_with_fifth_observation - bytes_per_state
    );
}

/// Adds a fifth observation to a run, which compresses as badly as the others.
fn with_fifth_observation(mut run: SyntheticRun) -> SyntheticRun {
    let fifth = Quantity {
        name: "fifth".to_owned(),
        ..run.spec.observations[1].clone()
    };
    run.spec.observations.push(fifth);
    for episode in run.rounds.iter_mut().flat_map(|round| &mut round.episodes) {
        let extended_observations = episode
            .observations
            .chunks_exact(4)
            .flat_map(|row| [row, &[row[1].sin() + row[3]]].concat());
        episode.observations = extended_observations.collect();
    }
    run
}

/// Total size of all messages of `/raw` in a file, in bytes.
fn raw_bytes(path: &Path) -> u64 {
    let is_raw = |message: &&LogMsg| match message {
        LogMsg::ArrowMsg(_, arrow) => Chunk::from_arrow_msg(arrow)
            .unwrap()
            .entity_path()
            .to_string()
            .starts_with("/raw/"),
        _ => false,
    };
    let messages = messages(path);
    let encoded_length = |messages: Vec<&LogMsg>| {
        rerun::external::re_log_encoding::rrd::Encoder::encode(messages.into_iter().map(Ok))
            .unwrap()
            .len() as u64
    };
    encoded_length(messages.iter().filter(is_raw).collect())
}
