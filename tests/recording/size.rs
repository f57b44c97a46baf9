//! How large recordings are, and how quickly they are made.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use rerun::StoreKind;
use rerun::log::{Chunk, LogMsg};
use seedbed::env::Quantity;
use seedbed::record::rerun::RerunRecorder;
use seedbed::record::{Recorder, RecordingSettings};

use super::contents::messages;
use super::made_up::Run;
use super::record;

/// What an agent saw and did costs at most 45 bytes a state with four observations, an action, a reward, its probability, a bonus and an
/// outcome; a further observation at most 6.
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
    println!(
        "{narrow:.2} bytes a state, {:.2} for a further column",
        wide - narrow
    );
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

/// For looking at, and for measuring: `RECORDING=out.rrd AGENTS=4 ROUNDS=200 cargo test --release -- --ignored --nocapture`.
#[test]
#[ignore = "measures"]
fn a_long_recording_is_small_and_quick() {
    let number = |name: &str, default: u32| {
        std::env::var(name).map_or(default, |text| text.parse().unwrap())
    };
    let run = Run::new(number("AGENTS", 4), number("ROUNDS", 200));
    let path: PathBuf =
        std::env::var("RECORDING").map_or(std::env::temp_dir().join("long.rrd"), Into::into);
    let start = std::time::Instant::now();
    let mut recorder =
        RerunRecorder::create(&path, &run.about(), &RecordingSettings::default()).unwrap();
    let created = start.elapsed();
    run.rounds
        .iter()
        .for_each(|round| round.record(&mut recorder));
    recorder.finish().unwrap();
    let seconds = start.elapsed().as_secs_f64();
    let states = run
        .rounds
        .iter()
        .flat_map(|round| &round.episodes)
        .map(|episode| episode.length() + 1)
        .sum::<usize>() as f64;
    let bytes = std::fs::metadata(&path).unwrap().len() as f64;
    println!(
        "{states} states, {bytes} bytes: {:.1} B and {:.3} µs a state, {created:?} to begin",
        bytes / states,
        1e6 * seconds / states
    );
    let mut sizes: BTreeMap<String, (usize, u64)> = BTreeMap::new();
    for message in messages(&path) {
        let LogMsg::ArrowMsg(store, arrow) = &message else {
            continue;
        };
        let chunk = Chunk::from_arrow_msg(arrow).unwrap();
        let kind = if store.kind() == StoreKind::Blueprint {
            "blueprint".to_owned()
        } else {
            kind(&chunk.entity_path().to_string())
        };
        let encoded = rerun::external::re_log_encoding::rrd::Encoder::encode([Ok(&message)])
            .unwrap()
            .len() as u64;
        let entry = sizes.entry(kind).or_default();
        *entry = (entry.0 + 1, entry.1 + encoded);
    }
    for (kind, (count, bytes)) in sizes {
        println!(
            "{kind:40} {count:6} messages, {:6.2} B a state (with a file's head and index each)",
            bytes as f64 / states
        );
    }
}

fn kind(entity: &str) -> String {
    entity.replace(|character: char| character.is_ascii_digit(), "")
}
