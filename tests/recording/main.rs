//! Recordings are read back and compared with what was recorded, number by number.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![allow(
    clippy::iter_over_hash_type,
    reason = "chunks of the viewer's format hold hash maps; the columns are sorted here"
)]
#![allow(
    clippy::struct_field_names,
    reason = "a round's rows are named as in the record"
)]

mod contents;
mod made_up;
mod pictures;
mod reading;
mod rows;
mod scenes;
mod size;
mod trained;
mod writing;

use std::path::{Path, PathBuf};

use seedbed::env::Status;
use seedbed::experience::Episode;
use seedbed::record::rerun::RerunRecorder;
use seedbed::record::{Recorder, RecordingSettings};

use self::contents::Contents;
use self::made_up::Run;

fn record(run: &Run, folder: &Path, settings: &RecordingSettings) -> PathBuf {
    let path = folder.join("run.rrd");
    let mut recorder = RerunRecorder::create(&path, &run.about(), settings).unwrap();
    run.rounds
        .iter()
        .for_each(|round| round.record(&mut recorder));
    recorder.finish().unwrap();
    path
}

/// Each row of `/raw/agent_K` exactly once, in order, with every number unchanged.
fn compare_raw(run: &Run, contents: &Contents) {
    for agent in 0..run.agents as usize {
        let entity = format!("/raw/agent_{agent}");
        let episodes: Vec<&Episode> = run
            .rounds
            .iter()
            .map(|round| &round.episodes[agent])
            .collect();
        let rows: usize = episodes.iter().map(|episode| episode.length() + 1).sum();
        assert_eq!(
            contents.times(&entity, "env_step"),
            (0..rows as i64).collect::<Vec<_>>()
        );
        let repeated = |value: fn(&Episode) -> u32| -> Vec<i64> {
            episodes
                .iter()
                .flat_map(|episode| vec![i64::from(value(episode)); episode.length() + 1])
                .collect()
        };
        assert_eq!(
            contents.times(&entity, "episode"),
            repeated(|episode| episode.episode)
        );
        assert_eq!(
            contents.times(&entity, "round"),
            repeated(|episode| episode.round)
        );
        for (index, name) in ["x", "x_dot", "theta", "theta_dot"].iter().enumerate() {
            let given: Vec<f32> = episodes
                .iter()
                .flat_map(|e| e.observations.iter().skip(index).step_by(4))
                .copied()
                .collect();
            assert_eq!(contents.numbers(&entity, &format!("State:{name}")), given);
        }
        let forces = episodes
            .iter()
            .flat_map(|e| &e.actions)
            .map(|&action| if action == 0.0 { -10.0 } else { 10.0 });
        assert_eq!(
            contents.numbers(&entity, "State:force"),
            forces.collect::<Vec<f32>>()
        );
        let rewards = episodes
            .iter()
            .flat_map(|e| &e.rewards)
            .copied()
            .collect::<Vec<f32>>();
        assert_eq!(contents.numbers(&entity, "State:reward"), rewards);
        let log_probs = episodes
            .iter()
            .flat_map(|e| &e.log_probs)
            .copied()
            .collect::<Vec<f32>>();
        assert_eq!(contents.numbers(&entity, "State:log_prob"), log_probs);
        let bonuses = episodes
            .iter()
            .flat_map(|e| &e.intrinsic_rewards)
            .copied()
            .collect::<Vec<f32>>();
        assert_eq!(contents.numbers(&entity, "State:intrinsic_reward"), bonuses);
        let word = |status| {
            if status == Status::Terminated {
                "terminated"
            } else {
                "truncated"
            }
        };
        let outcomes: Vec<String> = episodes
            .iter()
            .map(|episode| word(episode.outcome).to_owned())
            .collect();
        assert_eq!(contents.words(&entity, "State:outcome"), outcomes);
        let last_rows: Vec<usize> = episodes
            .iter()
            .scan(0, |row, e| {
                *row += e.length() + 1;
                Some(*row - 1)
            })
            .collect();
        assert_eq!(contents.rows_with(&entity, "State:outcome"), last_rows);
        let others: Vec<usize> = (0..rows)
            .filter(|row| last_rows.binary_search(row).is_err())
            .collect();
        assert_eq!(contents.rows_with(&entity, "State:force"), others);
    }
}
