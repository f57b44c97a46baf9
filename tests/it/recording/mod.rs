//! Tests of recordings: the tests read a recording and compare it with the values that were
//! recorded.

#![allow(
    clippy::iter_over_hash_type,
    reason = "chunks of recordings have hash maps; the tests sort the columns"
)]
#![allow(
    clippy::struct_field_names,
    reason = "the rows of a round have the names of `RoundRecord`"
)]

pub(crate) mod contents;
mod damaged;
mod images;
mod reading;
mod rows;
mod scenes;
mod size;
mod synthetic_run;
mod trained;
mod writing;

use std::fs::File;
use std::path::{Path, PathBuf};

use seedbed::record::rerun::RerunRecorder;
use seedbed::run::recorder::Recorder;
use seedbed::scenario::recording::RecordingSettings;
use seedbed_env::Status;
use seedbed_learn::experience::Episode;

use self::contents::RecordingContents;
use self::synthetic_run::{SyntheticRound, SyntheticRun};

/// Records a run in `run.rrd` in a folder, and returns the path of the recording.
fn record(run: &SyntheticRun, folder: &Path, settings: &RecordingSettings) -> PathBuf {
    let path = folder.join("run.rrd");
    let mut recorder = RerunRecorder::create(&path, &run.run_info(), settings).unwrap();
    record_rounds(&run.rounds, &mut recorder);
    recorder.finish().unwrap();
    path
}

fn record_rounds(rounds: &[SyntheticRound], recorder: &mut RerunRecorder) {
    for round in rounds {
        round.record(recorder);
    }
}

/// Shortens or extends a file.
fn set_file_length(path: &Path, bytes: u64) {
    let file = File::options().write(true).open(path).unwrap();
    file.set_len(bytes).unwrap();
}

/// Asserts that `/raw/agent_K` has each row exactly once, in order, with unchanged values.
fn assert_raw_rows(run: &SyntheticRun, contents: &RecordingContents) {
    for agent in 0..run.agents as usize {
        let episodes: Vec<&Episode> = run
            .rounds
            .iter()
            .map(|round| &round.episodes[agent])
            .collect();
        let entity = format!("/raw/agent_{agent}");
        assert_times(&episodes, contents, &entity);
        assert_values(&episodes, contents, &entity);
        let step_data = run.rounds.iter().map(|round| &round.step_data[agent]);
        let intrinsic_rewards: Vec<f32> = step_data
            .flat_map(|data| data.intrinsic_rewards.iter().copied())
            .collect();
        assert_eq!(
            contents.f32_values(&entity, "State:intrinsic_reward"),
            intrinsic_rewards
        );
        assert_outcomes(&episodes, contents, &entity);
    }
}

/// Asserts that each row of an agent has the right step, episode and round.
fn assert_times(episodes: &[&Episode], contents: &RecordingContents, entity: &str) {
    let once_per_row = |value: fn(&Episode) -> u32| -> Vec<i64> {
        episodes
            .iter()
            .flat_map(|episode| vec![i64::from(value(episode)); episode.length() + 1])
            .collect()
    };
    assert_eq!(
        contents.times(entity, "env_step"),
        (0..row_count(episodes) as i64).collect::<Vec<_>>()
    );
    assert_eq!(
        contents.times(entity, "episode"),
        once_per_row(|episode| episode.episode)
    );
    assert_eq!(
        contents.times(entity, "round"),
        once_per_row(|episode| episode.round)
    );
}

/// Number of rows of episodes: one per step, and one for the last observation of each episode.
fn row_count(episodes: &[&Episode]) -> usize {
    episodes.iter().map(|episode| episode.length() + 1).sum()
}

/// Asserts that observations, actions, rewards and log-probabilities are unchanged.
fn assert_values(episodes: &[&Episode], contents: &RecordingContents, entity: &str) {
    let column = |name: &str| contents.f32_values(entity, &format!("State:{name}"));
    let joined = |values: fn(&Episode) -> &Vec<f32>| -> Vec<f32> {
        episodes
            .iter()
            .flat_map(|episode| values(episode))
            .copied()
            .collect()
    };
    let observations = joined(|episode| &episode.observations);
    for (index, name) in ["x", "x_dot", "theta", "theta_dot"].iter().enumerate() {
        let expected: Vec<f32> = observations
            .iter()
            .skip(index)
            .step_by(4)
            .copied()
            .collect();
        assert_eq!(column(name), expected);
    }
    let actions = joined(|episode| &episode.actions);
    let forces = actions
        .iter()
        .map(|&action| if action == 0.0 { -10.0 } else { 10.0 });
    assert_eq!(column("force"), forces.collect::<Vec<f32>>());
    assert_eq!(column("reward"), joined(|episode| &episode.rewards));
    assert_eq!(column("log_prob"), joined(|episode| &episode.log_probs));
}

/// Asserts that the last row of each episode has an outcome, and every other row has an action.
fn assert_outcomes(episodes: &[&Episode], contents: &RecordingContents, entity: &str) {
    let outcomes: Vec<String> = episodes
        .iter()
        .map(|episode| outcome_text(episode).to_owned())
        .collect();
    assert_eq!(contents.texts(entity, "State:outcome"), outcomes);
    let mut last_rows = Vec::new();
    let mut row_count = 0;
    for episode in episodes {
        row_count += episode.length() + 1;
        last_rows.push(row_count - 1);
    }
    assert_eq!(contents.rows_with(entity, "State:outcome"), last_rows);
    let other_rows: Vec<usize> = (0..row_count)
        .filter(|row| last_rows.binary_search(row).is_err())
        .collect();
    assert_eq!(contents.rows_with(entity, "State:force"), other_rows);
}

/// The outcome of an episode as text, as in recordings.
fn outcome_text(episode: &Episode) -> &'static str {
    if episode.outcome == Status::Terminated {
        "terminated"
    } else {
        "truncated"
    }
}
