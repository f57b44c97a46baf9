//! Tests of recordings: each is read back and compared with the recorded values.

#![allow(
    clippy::iter_over_hash_type,
    reason = "chunks of the viewer's format hold hash maps; the columns are sorted here"
)]
#![allow(
    clippy::struct_field_names,
    reason = "a round's rows are named as in the record"
)]

mod contents;
mod images;
mod reading;
mod rows;
mod scenes;
mod size;
mod synthetic_run;
mod trained;
mod writing;

use std::path::{Path, PathBuf};

use seedbed::record::rerun::RerunRecorder;
use seedbed::record::{Recorder, RecordingSettings};
use seedbed_env::Status;
use seedbed_learn::experience::Episode;

use self::contents::RecordingContents;
use self::synthetic_run::SyntheticRun;

fn record(run: &SyntheticRun, folder: &Path, settings: &RecordingSettings) -> PathBuf {
    let path = folder.join("run.rrd");
    let mut recorder = RerunRecorder::create(&path, &run.run_info(), settings).unwrap();
    run.rounds
        .iter()
        .for_each(|round| round.record(&mut recorder));
    recorder.finish().unwrap();
    path
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

fn assert_times(episodes: &[&Episode], contents: &RecordingContents, entity: &str) {
    let repeated = |value: fn(&Episode) -> u32| -> Vec<i64> {
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
        repeated(|episode| episode.episode)
    );
    assert_eq!(
        contents.times(entity, "round"),
        repeated(|episode| episode.round)
    );
}

/// Number of rows of episodes: one per step, and one for the last observation of each episode.
fn row_count(episodes: &[&Episode]) -> usize {
    episodes.iter().map(|episode| episode.length() + 1).sum()
}

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
    let mut rows = 0;
    for episode in episodes {
        rows += episode.length() + 1;
        last_rows.push(rows - 1);
    }
    assert_eq!(contents.rows_with(entity, "State:outcome"), last_rows);
    let others: Vec<usize> = (0..rows)
        .filter(|row| last_rows.binary_search(row).is_err())
        .collect();
    assert_eq!(contents.rows_with(entity, "State:force"), others);
}

/// The outcome of an episode as text, as in recordings.
fn outcome_text(episode: &Episode) -> &'static str {
    if episode.outcome == Status::Terminated {
        "terminated"
    } else {
        "truncated"
    }
}
