//! Recorded states, actions, advantages and curves equal the values that were passed to the
//! recorder.

use std::path::Path;

use seedbed::record::rerun::RerunRecorder;
use seedbed::run::Plan;
use seedbed::run::recorder::{Recorder, RoundRecord};
use seedbed::run::training::Trainer;
use seedbed::scenario::recording::{AxisChoice, RecordingSettings};
use seedbed_input::numbers::{FiniteNumber, ranged_count, ranged_number};
use seedbed_learn::team::Workers;

use super::super::util::REPOSITORY;
use super::contents::RecordingContents;
use super::synthetic_run::{SyntheticRound, SyntheticRun};
use super::{assert_raw_rows, record};

#[test]
fn recorded_states_and_actions_are_unchanged() {
    let folder = tempfile::tempdir().unwrap();
    let run = SyntheticRun::new(4, 12);
    let path = record(&run, folder.path(), &RecordingSettings::default());
    assert!(!folder.path().join("run.rrd.part").exists());
    assert_raw_rows(&run, &RecordingContents::read(&path));
}

#[test]
fn recorded_curves_equal_the_table_columns() {
    let folder = tempfile::tempdir().unwrap();
    let run = SyntheticRun::new(3, 30);
    let contents =
        RecordingContents::read(&record(&run, folder.path(), &RecordingSettings::default()));
    let curve = |name: &str| contents.f64_values(&format!("/curves/{name}"), "Scalars:scalars");
    let value_per_round =
        |value: fn(&SyntheticRound) -> f64| -> Vec<f64> { run.rounds.iter().map(value).collect() };
    assert_eq!(
        curve("return/agent_1"),
        value_per_round(|round| round.episode_rows[1].r#return)
    );
    let coverage: Vec<f64> = run
        .rounds
        .iter()
        .flat_map(|round| &round.round_rows)
        .map(|row| row.coverage)
        .collect();
    assert_eq!(curve("coverage"), coverage);
    assert_eq!(
        curve("effective_agents"),
        value_per_round(|round| round.round_rows[0].effective_agents)
    );
    let team_means = value_per_round(|round| {
        let returns = round.episode_rows.iter().map(|row| row.r#return);
        returns.sum::<f64>() / 3.0
    });
    assert_eq!(curve("return/team_mean"), team_means);
    let mean_of_last_25 = team_means[5..].iter().sum::<f64>() / 25.0;
    approx::assert_relative_eq!(curve("return/team_mean_25")[29], mean_of_last_25);
}

/// With `raw_every: 3`, `/raw` has every third episode. Step numbers also count the steps of
/// episodes that are not recorded. The recording has the property `raw_every`.
#[test]
fn raw_every_records_every_nth_episode() {
    let folder = tempfile::tempdir().unwrap();
    let run = SyntheticRun::new(2, 8);
    let settings = RecordingSettings {
        raw_every: ranged_count(3),
        ..RecordingSettings::default()
    };
    let contents = RecordingContents::read(&record(&run, folder.path(), &settings));
    let (mut steps, mut rewards, mut next_step) = (Vec::new(), Vec::<f32>::new(), 0);
    for round in &run.rounds {
        let rows = round.episodes[1].length() as i64 + 1;
        if round.round % 3 == 0 {
            steps.extend(next_step..next_step + rows);
            rewards.extend(&round.episodes[1].rewards);
        }
        next_step += rows;
    }
    assert_eq!(contents.times("/raw/agent_1", "env_step"), steps);
    assert_eq!(contents.f32_values("/raw/agent_1", "State:reward"), rewards);
    assert_eq!(contents.texts("/__properties/run", "raw_every"), ["3"]);
    assert_eq!(
        contents
            .f64_values("/curves/return/agent_1", "Scalars:scalars")
            .len(),
        8,
        "the curve must have the returns of all episodes"
    );
}

/// The column `advantage` is recorded if an axis shows advantages, and only then.
#[test]
fn advantages_are_recorded_only_if_an_axis_shows_them() {
    let (folder, run) = (tempfile::tempdir().unwrap(), SyntheticRun::new(2, 3));
    let recorded = |axes: Vec<AxisChoice>| {
        let settings = RecordingSettings {
            axes: axes.into(),
            ..RecordingSettings::default()
        };
        let contents = RecordingContents::read(&record(&run, folder.path(), &settings));
        assert_raw_rows(&run, &contents);
        contents
    };
    let advantage = AxisChoice::Advantage {
        from: ranged_number(-30.0),
        to: ranged_number::<FiniteNumber>(170.0).into(),
    };
    let with = recorded(vec![AxisChoice::Observations, advantage]);
    let expected: Vec<f32> = run
        .rounds
        .iter()
        .flat_map(|round| &round.step_data[1].advantages)
        .copied()
        .collect();
    assert_eq!(with.f32_values("/raw/agent_1", "State:advantage"), expected);
    assert_eq!(
        with.rows_with("/raw/agent_1", "State:advantage"),
        with.rows_with("/raw/agent_1", "State:force")
    );
    let axis_names = with.texts("/visitation/axes/labels", "Points2D:labels");
    assert!(
        axis_names.iter().any(|name| name.starts_with("advantage")),
        "{axis_names:?}"
    );
    let without = recorded(vec![AxisChoice::Observations]);
    assert!(
        without
            .rows_with("/raw/agent_1", "State:advantage")
            .is_empty()
    );
}

/// Without baseline, importance ratios, agent seeds and discount, the advantage of an action is the
/// sum of the rewards from its step on. Each of the T steps has reward 1, so the advantages are T,
/// T − 1, …, 1.
#[test]
fn the_advantage_column_has_the_estimates_of_the_agents() {
    let overrides = [
        "algorithm=SeedPg(value_data: Own, policy_data: Own, discount: 1, value_target: MonteCarlo(importance: Off), \
         advantage: MonteCarlo(baseline: Off), standardize: PerTrajectory)",
        "agents=(count: 2, seeds: Normal(sigma: 0))",
        "recording.axes=[Advantage(from: 0, to: 200)]",
    ];
    let scenario = Path::new(REPOSITORY).join("scenarios/cartpole.ron");
    let plan = Plan::load(&scenario, &overrides.map(ToOwned::to_owned)).unwrap();
    let mut trainer = Trainer::from_scenario(&plan.scenario, &plan.description, 1).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.rrd");
    let synthetic_run = SyntheticRun::new(2, 2);
    let mut recorder =
        RerunRecorder::create(&path, &synthetic_run.run_info(), &plan.scenario.recording).unwrap();
    let mut expected = Vec::new();
    for round_number in 0..2 {
        let round = trainer.advance().unwrap();
        let episodes = trainer.newest_episodes();
        expected.extend(
            (1..=episodes[1].length())
                .rev()
                .map(|steps_to_go| steps_to_go as f32),
        );
        let (episode_rows, round_rows) = (&round.rows.episodes[..], &round.rows.updates[..]);
        recorder
            .record_round(&RoundRecord {
                round: round_number,
                episodes: &episodes,
                episode_rows,
                round_rows,
                step_data: &round.step_data,
                details: &[],
                workers: Workers::CURRENT_THREAD,
            })
            .unwrap();
    }
    recorder.finish().unwrap();
    assert_eq!(
        RecordingContents::read(&path).f32_values("/raw/agent_1", "State:advantage"),
        expected
    );
}
