//! How large recordings are; `benches/recording.rs` measures how quickly they are made.

use std::path::Path;

use rerun::log::{Chunk, LogMsg};
use seedbed::record::RecordingSettings;
use seedbed_env::Quantity;

use super::contents::messages;
use super::record;
use super::synthetic_run::Run;

/// What an agent saw and did costs at most 45 bytes a state with four observations, an action, a
/// reward, its probability, a bonus and an outcome; a further observation at most 6.
#[test]
fn a_state_takes_few_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let run = Run::new(2, 400);
    let states: usize = run
        .rounds
        .iter()
        .flat_map(|round| &round.episodes)
        .map(|episode| episode.length() + 1)
        .sum();
    let narrow = raw_bytes(&record(&run, folder.path(), &RecordingSettings::default())) as f64
        / states as f64;
    let wide = raw_bytes(&record(
        &widened(run),
        folder.path(),
        &RecordingSettings::default(),
    )) as f64
        / states as f64;
    assert!(narrow <= 45.0, "{narrow} bytes a state");
    assert!(
        wide - narrow <= 6.0,
        "{} bytes for a further column",
        wide - narrow
    );
}

/// The same run with a fifth observation, as hard to compress as the others.
fn widened(mut run: Run) -> Run {
    let fifth = Quantity {
        name: "fifth".to_owned(),
        ..run.spec.observations[1].clone()
    };
    run.spec.observations.push(fifth);
    for episode in run.rounds.iter_mut().flat_map(|round| &mut round.episodes) {
        let wide = episode
            .observations
            .chunks_exact(4)
            .flat_map(|row| [row, &[row[1].sin() + row[3]]].concat());
        episode.observations = wide.collect();
    }
    run
}

/// Bytes that `/raw` takes in the file.
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
    let encoded = |messages: Vec<&LogMsg>| {
        rerun::external::re_log_encoding::rrd::Encoder::encode(messages.into_iter().map(Ok))
            .unwrap()
            .len() as u64
    };
    encoded(messages.iter().filter(is_raw).collect())
}
