//! Deep sea as an environment for agents that do not know its tables.

use seedbed_env::tabular::TaskFamily;
use seedbed_env::{Environment, Physics, Status, TaskDescription, build, parse};
use seedbed_random::{Purpose, stream};

/// A task of deep sea with these fields of `DeepSea(…)` and of the file.
fn sea(sea_fields: &str, file_fields: &str) -> TaskDescription {
    let text = format!(
        "TabularEnvironment(description: \"\", task: DeepSea({sea_fields}), {file_fields})"
    );
    parse("sea", "test", text).unwrap_or_else(|error| panic!("{error}"))
}

fn started(task: &TaskDescription, copies: usize) -> Box<dyn Environment> {
    let mut environment = build(task, Physics::Rapier, copies).unwrap();
    (0..copies)
        .for_each(|copy| environment.reset(copy, &mut stream(0, Purpose::Reset, copy as u32, 0)));
    environment
}

/// As in bsuite's `DeepSea(size=3, randomize_actions=False)`, a move to the right costs 0.01 / 3,
/// and the third move to the right in a row finds the treasure.
#[test]
fn the_treasure_is_in_the_lower_right_corner() {
    let task = sea("size: 3, randomized: false", "observation: Place");
    let mut environment = started(&task, 2);
    let cost = (-0.01_f64 / 3.0) as f32;
    for (step, (actions, rewards, places)) in [
        ([1.0, 1.0], [cost, cost], [1.0, 1.0, 1.0, 1.0]),
        ([1.0, 0.0], [cost, 0.0], [2.0, 2.0, 2.0, 0.0]),
        (
            [1.0, 1.0],
            [(1.0 - 0.01_f64 / 3.0) as f32, cost],
            [3.0, 0.0, 3.0, 0.0],
        ),
    ]
    .into_iter()
    .enumerate()
    {
        environment.step(&actions);
        assert_eq!(environment.rewards(), rewards, "step {step}");
        let scaled = places
            .iter()
            .zip([3.0, 2.0, 3.0, 2.0])
            .map(|(place, largest)| place / largest);
        assert_eq!(
            environment.observations(),
            scaled.collect::<Vec<f32>>(),
            "step {step}"
        );
    }
    assert_eq!(environment.statuses(), [Status::Terminated; 2]);
}

/// Cells come row by row: (0,0), (1,0), (1,1), (2,0), (2,1), (2,2). In the terminal state all are
/// 0.
#[test]
fn each_cell_has_an_observation_of_its_own() {
    let task = sea("size: 3, randomized: false", "");
    let names: Vec<&str> = task
        .spec()
        .observations
        .iter()
        .map(|quantity| quantity.name.as_str())
        .collect();
    assert_eq!(
        names[..3],
        ["row_0_column_0", "row_1_column_0", "row_1_column_1"]
    );
    let mut environment = started(&task, 1);
    assert_eq!(environment.observations(), [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    environment.step(&[1.0]);
    assert_eq!(environment.observations(), [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
    environment.step(&[0.0]);
    assert_eq!(environment.observations(), [0.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
    environment.step(&[0.0]);
    assert_eq!(environment.observations(), [0.0; 6]);
}

/// The only sequence of ten actions that finds the treasure is not ten times action 1, and depends
/// only on `drawn_with`.
#[test]
fn which_action_moves_right_is_drawn_with_the_seed_of_the_file() {
    let path = |drawn_with: u64| {
        let task = sea(
            "size: 10",
            &format!("observation: Place, drawn_with: {drawn_with}"),
        );
        let last_moved_right = |actions: &[f32]| {
            let mut environment = started(&task, 1);
            for action in actions {
                environment.step(&[*action]);
            }
            environment.rewards()[0] != 0.0
        };
        let mut found: Vec<f32> = Vec::new();
        for _ in 0..10 {
            let action = f32::from(u8::from(last_moved_right(
                &[found.as_slice(), &[1.0]].concat(),
            )));
            found.push(action);
        }
        found
    };
    assert_eq!(path(3), path(3));
    assert_ne!(path(3), path(4));
    assert_ne!(path(3), [1.0; 10]);
}

/// A move to the right that slips half the time has a cost half the time. Of 2,000 moves, the share
/// that has a cost is 0.5 ± 0.045 (4 standard deviations).
#[test]
fn moves_to_the_right_slip() {
    let task = sea("size: 2, randomized: false, slip: 0.5", "");
    let mut environment = started(&task, 2000);
    environment.step(&[1.0; 2000]);
    let moved = environment
        .rewards()
        .iter()
        .filter(|reward| **reward != 0.0)
        .count();
    assert!((910..1090).contains(&moved), "{moved}");
}

/// For each of the 55 cells of a sea of 10 rows that is drawn per run, the index of the action that
/// moves to the right, in the run with this run seed. Outcomes of an action are left and right.
fn right_actions(run_seed: u64) -> Vec<usize> {
    let task = sea("size: 10", "drawn_per_run: true");
    let task = task.for_run(run_seed);
    let TaskDescription::Tabular(task) = task.as_ref() else {
        panic!("deep sea is tabular");
    };
    let cells = task.true_mdp.probabilities.chunks(4);
    cells
        .map(|cell| match cell {
            [1.0, 0.0, 0.0, 1.0] => 1,
            [0.0, 1.0, 1.0, 0.0] => 0,
            other => panic!("one action moves to the left, one to the right: {other:?}"),
        })
        .collect()
}

/// Return of a single episode of a sea of 10 rows in the run with this run seed, where the action in
/// each step is that of `choose(row, column)`. `reset_seed` is the seed of the start.
fn episode_return(run_seed: u64, reset_seed: u64, choose: &dyn Fn(usize, usize) -> usize) -> f64 {
    let task = sea("size: 10", "observation: Place, drawn_per_run: true");
    let mut environment = build(&task.for_run(run_seed), Physics::Rapier, 1).unwrap();
    environment.reset(0, &mut stream(reset_seed, Purpose::Reset, 0, 0));
    let mut total = 0.0;
    while environment.statuses()[0] == Status::Running {
        let place = environment.observations();
        let [row, column] = [place[0] * 10.0, place[1] * 9.0].map(|it| it.round() as usize);
        environment.step(&[choose(row, column) as f32]);
        total += f64::from(environment.rewards()[0]);
    }
    total
}

/// 55 fair draws: both actions occur at least 10 times with probability 1 − 1e-6, and two run seeds
/// differ.
#[test]
fn which_action_moves_right_is_drawn_with_the_run_seed() {
    for run_seed in 0..20 {
        let actions = right_actions(run_seed);
        assert_eq!(actions.len(), 55);
        assert!(
            (10..=45).contains(&actions.iter().sum::<usize>()),
            "{actions:?}"
        );
        assert_eq!(actions, right_actions(run_seed));
        assert_ne!(actions, right_actions(run_seed + 1));
    }
}

/// The permuted actions that move to the right have the optimal return 1 − 0.01, whatever the random
/// numbers of the episode. Ten times the same action reaches the treasure with probability 2⁻¹⁰; with
/// these ten run seeds it never does.
#[test]
fn only_the_permuted_actions_reach_the_treasure() {
    for run_seed in 0..10 {
        let right = right_actions(run_seed);
        let moves_right = |row: usize, column: usize| right[row * (row + 1) / 2 + column];
        for reset_seed in [0, 5] {
            let best = episode_return(run_seed, reset_seed, &moves_right);
            assert!((best - 0.99).abs() < 1e-6, "{best}");
        }
        for action in [0, 1] {
            let constant = episode_return(run_seed, 0, &|_, _| action);
            assert!(
                constant <= 0.0,
                "run seed {run_seed}, action {action}: {constant}"
            );
        }
    }
}

/// Teams with tabular models and agents that do not know the tables have the same MDP in the run
/// with the same run seed.
#[test]
fn a_task_that_is_drawn_per_run_is_that_of_teams_with_tabular_models() {
    let family = TaskFamily::DeepSea(seedbed_env::tabular::DeepSea::default());
    let task = sea("", "drawn_per_run: true");
    for run_seed in [0, 7] {
        let drawn = task.for_run(run_seed);
        let TaskDescription::Tabular(drawn) = drawn.as_ref() else {
            panic!("deep sea is tabular");
        };
        let expected = family.draw_mdp(&family.model(run_seed), run_seed);
        assert_eq!(drawn.true_mdp, expected);
    }
}

/// Without `drawn_per_run` the task does not depend on the run seed, and is that of `drawn_with`.
#[test]
fn a_task_that_is_not_drawn_per_run_is_the_same_in_all_runs() {
    let task = sea("size: 10", "drawn_with: 3");
    assert_eq!(task.for_run(0).as_ref(), &task);
    assert_eq!(task.for_run(8).as_ref(), &task);
    let other = sea("size: 10", "drawn_per_run: true");
    let (TaskDescription::Tabular(task), TaskDescription::Tabular(other)) = (&task, &other) else {
        panic!("deep sea is tabular");
    };
    assert_eq!(task.true_mdp, other.for_run(3).true_mdp);
}
