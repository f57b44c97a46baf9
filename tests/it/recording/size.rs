//! Size of recordings in bytes per state. `benches/recording.rs` measures the speed of recording.

use std::path::Path;

use rerun::log::{Chunk, LogMsg};
use seedbed::scenario::recording::RecordingSettings;
use seedbed_env::Quantity;

use super::contents::messages;
use super::record;
use super::synthetic_run::SyntheticRun;
use super::trained::{load_plan, run_and_read_recording};

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

/// Sixteen random agents whose episodes have about 22 states, in 300 rounds with twelve checkpoints:
/// everything that a recording has takes at most 60 bytes per state.
#[test]
fn recordings_of_short_episodes_take_few_bytes_per_state() {
    let overrides = [
        "agents.count=16",
        "algorithm=Random",
        "stop=Episodes(300)",
        "checkpoint_every=25",
        "checkpoint_share=1",
    ];
    let folder = tempfile::tempdir().unwrap();
    let contents = run_and_read_recording(&load_plan(&overrides), folder.path(), 2);
    let states: usize = (0..16)
        .map(|agent| {
            contents
                .times(&format!("/raw/agent_{agent}"), "env_step")
                .len()
        })
        .sum();
    let bytes = std::fs::metadata(folder.path().join("run.rrd"))
        .unwrap()
        .len();
    assert!(states > 100_000, "{states} states");
    let bytes_per_state = bytes as f64 / states as f64;
    assert!(bytes_per_state <= 60.0, "{bytes_per_state} bytes per state");
}

/// A recording of eight times as many agents takes at most eight times as many bytes, and five
/// percent more.
#[test]
fn the_size_of_a_recording_is_linear_in_the_number_of_agents() {
    let folder = tempfile::tempdir().unwrap();
    let [few, many] = [40, 320].map(|agents| {
        let run = SyntheticRun::new(agents, 2);
        let path = record(&run, folder.path(), &RecordingSettings::default());
        std::fs::metadata(path).unwrap().len() as f64
    });
    assert!(many <= 1.05 * 8.0 * few, "{few} and {many} bytes");
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
