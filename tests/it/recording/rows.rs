//! States and curves: the recording holds every number as it was.

use std::path::Path;

use seedbed::record::rerun::RerunRecorder;
use seedbed::record::{AxisChoice, EpisodeRow, Recorder, RecordingSettings, RoundRecord};
use seedbed::run::Plan;
use seedbed::run::trainer::Trainer;
use seedbed_env::input::numbers::{FiniteNumber, known, known_count};

use super::super::util::REPOSITORY;
use super::contents::Contents;
use super::synthetic_run::Run;
use super::{compare_raw, record};

#[test]
fn every_state_and_action_is_read_back_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let run = Run::new(4, 12);
    let path = record(&run, folder.path(), &RecordingSettings::default());
    assert!(!folder.path().join("run.rrd.part").exists());
    compare_raw(&run, &Contents::of(&path));
}

#[test]
fn curves_hold_the_rows_of_the_tables() {
    let folder = tempfile::tempdir().unwrap();
    let run = Run::new(3, 30);
    let contents = Contents::of(&record(&run, folder.path(), &RecordingSettings::default()));
    let returns: Vec<f64> = run
        .rounds
        .iter()
        .map(|round| round.episode_rows[1].r#return)
        .collect();
    assert_eq!(
        contents.numbers64("/curves/return/agent_1", "Scalars:scalars"),
        returns
    );
    let coverage: Vec<f64> = run
        .rounds
        .iter()
        .flat_map(|round| &round.round_rows)
        .map(|row| row.coverage)
        .collect();
    assert_eq!(
        contents.numbers64("/curves/coverage", "Scalars:scalars"),
        coverage
    );
    let effective: Vec<f64> = run
        .rounds
        .iter()
        .map(|round| round.round_rows[0].effective_agents)
        .collect();
    assert_eq!(
        contents.numbers64("/curves/effective_agents", "Scalars:scalars"),
        effective
    );
    let mean = |rows: &[EpisodeRow]| rows.iter().map(|row| row.r#return).sum::<f64>() / 3.0;
    let means: Vec<f64> = run
        .rounds
        .iter()
        .map(|round| mean(&round.episode_rows))
        .collect();
    assert_eq!(
        contents.numbers64("/curves/return/team_mean", "Scalars:scalars"),
        means
    );
    let last_25 = means[5..].iter().sum::<f64>() / 25.0;
    approx::assert_relative_eq!(
        contents.numbers64("/curves/return/team_mean_25", "Scalars:scalars")[29],
        last_25
    );
}

/// Every third episode is on record, on the agent's own steps of all episodes; the file says so.
#[test]
fn a_part_of_the_episodes_can_be_on_record() {
    let folder = tempfile::tempdir().unwrap();
    let run = Run::new(2, 8);
    let settings = RecordingSettings {
        raw_every: known_count(3),
        ..RecordingSettings::default()
    };
    let contents = Contents::of(&record(&run, folder.path(), &settings));
    let (mut steps, mut rewards, mut next) = (Vec::new(), Vec::<f32>::new(), 0);
    for round in &run.rounds {
        let rows = round.episodes[1].length() as i64 + 1;
        if round.round % 3 == 0 {
            steps.extend(next..next + rows);
            rewards.extend(&round.episodes[1].rewards);
        }
        next += rows;
    }
    assert_eq!(contents.times("/raw/agent_1", "env_step"), steps);
    assert_eq!(contents.numbers("/raw/agent_1", "State:reward"), rewards);
    assert_eq!(contents.words("/__properties/run", "raw_every"), ["3"]);
    assert_eq!(
        contents
            .numbers64("/curves/return/agent_1", "Scalars:scalars")
            .len(),
        8,
        "returns are of all episodes"
    );
}

/// The column is there with the axis, and only then.
#[test]
fn advantages_are_on_record_where_an_axis_tells_them() {
    let (folder, run) = (tempfile::tempdir().unwrap(), Run::new(2, 3));
    let recorded = |axes: Vec<AxisChoice>| {
        let settings = RecordingSettings {
            axes: axes.into(),
            ..RecordingSettings::default()
        };
        let contents = Contents::of(&record(&run, folder.path(), &settings));
        compare_raw(&run, &contents);
        contents
    };
    let advantage = AxisChoice::Advantage {
        from: known(-30.0),
        to: known::<FiniteNumber>(170.0).into(),
    };
    let with = recorded(vec![AxisChoice::Observations, advantage]);
    let given: Vec<f32> = run
        .rounds
        .iter()
        .flat_map(|round| &round.step_data[1].advantages)
        .copied()
        .collect();
    assert_eq!(with.numbers("/raw/agent_1", "State:advantage"), given);
    assert_eq!(
        with.rows_with("/raw/agent_1", "State:advantage"),
        with.rows_with("/raw/agent_1", "State:force")
    );
    let names = with.words("/visitation/axes/labels", "Points2D:labels");
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

/// Without a baseline, ratios, seeds and discount, an action's advantage is what its episode still
/// earned: from T down to 1, as each of the T steps of the cartpole earns 1.
#[test]
fn the_column_holds_what_agents_estimated() {
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
    let synthetic_run = Run::new(2, 2);
    let mut recorder =
        RerunRecorder::create(&path, &synthetic_run.about(), &plan.scenario.recording).unwrap();
    let mut expected = Vec::new();
    for number in 0..2 {
        let round = trainer.advance().unwrap();
        let episodes = trainer.newest_episodes();
        expected.extend((1..=episodes[1].length()).rev().map(|left| left as f32));
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
        Contents::of(&path).numbers("/raw/agent_1", "State:advantage"),
        expected
    );
}
