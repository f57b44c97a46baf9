//! Recorded states, actions, advantages and curves equal the values that were passed to the
//! recorder.

use std::path::Path;

use seedbed::record::rerun::RerunRecorder;
use seedbed::record::{AxisChoice, EpisodeRow, Recorder, RecordingSettings, RoundRecord};
use seedbed::run::Plan;
use seedbed::run::trainer::Trainer;
use seedbed_env::input::numbers::{FiniteNumber, known, known_count};

use super::super::util::REPOSITORY;
use super::contents::RecordingContents;
use super::synthetic_run::SyntheticRun;
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
    let returns: Vec<f64> = run
        .rounds
        .iter()
        .map(|round| round.episode_rows[1].r#return)
        .collect();
    assert_eq!(
        contents.f64_values("/curves/return/agent_1", "Scalars:scalars"),
        returns
    );
    let coverage: Vec<f64> = run
        .rounds
        .iter()
        .flat_map(|round| &round.round_rows)
        .map(|row| row.coverage)
        .collect();
    assert_eq!(
        contents.f64_values("/curves/coverage", "Scalars:scalars"),
        coverage
    );
    let effective: Vec<f64> = run
        .rounds
        .iter()
        .map(|round| round.round_rows[0].effective_agents)
        .collect();
    assert_eq!(
        contents.f64_values("/curves/effective_agents", "Scalars:scalars"),
        effective
    );
    let mean = |rows: &[EpisodeRow]| rows.iter().map(|row| row.r#return).sum::<f64>() / 3.0;
    let means: Vec<f64> = run
        .rounds
        .iter()
        .map(|round| mean(&round.episode_rows))
        .collect();
    assert_eq!(
        contents.f64_values("/curves/return/team_mean", "Scalars:scalars"),
        means
    );
    let last_25 = means[5..].iter().sum::<f64>() / 25.0;
    approx::assert_relative_eq!(
        contents.f64_values("/curves/return/team_mean_25", "Scalars:scalars")[29],
        last_25
    );
}

/// With `raw_every: 3`, `/raw` has every third episode. Step numbers count the steps of all
/// episodes, and the property `raw_every` is recorded.
#[test]
fn raw_every_records_every_nth_episode() {
    let folder = tempfile::tempdir().unwrap();
    let run = SyntheticRun::new(2, 8);
    let settings = RecordingSettings {
        raw_every: known_count(3),
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
        from: known(-30.0),
        to: known::<FiniteNumber>(170.0).into(),
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
    let names = with.texts("/visitation/axes/labels", "Points2D:labels");
    assert!(
        names.iter().any(|name| name.starts_with("advantage")),
        "{names:?}"
    );
    let without = recorded(vec![AxisChoice::Observations]);
    assert!(
        without
            .rows_with("/raw/agent_1", "State:advantage")
            .is_empty()
    );
}

/// Without baseline, importance ratios, seeds and discount, the advantage of an action is the
/// return from its step on. Each of the T steps has reward 1, so the advantages are T, T − 1, …, 1.
#[test]
fn the_advantage_column_has_the_estimates_of_the_agents() {
    let overrides = [
        "algorithm=SeedPg(value_data: Own, policy_data: Own, discount: 1, value_target: MonteCarlo(importance: Off), \
         advantage: MonteCarlo(baseline: Off), standardise: PerTrajectory)",
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
    for number in 0..2 {
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
                round: number,
                episodes: &episodes,
                episode_rows,
                round_rows,
                step_data: &round.step_data,
                body_trajectories: &[],
            })
            .unwrap();
    }
    recorder.finish().unwrap();
    assert_eq!(
        RecordingContents::read(&path).f32_values("/raw/agent_1", "State:advantage"),
        expected
    );
}
