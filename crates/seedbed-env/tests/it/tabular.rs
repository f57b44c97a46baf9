//! Deep sea as an environment for agents that do not know its tables.

use seedbed_env::random::{Purpose, stream};
use seedbed_env::{Environment, Physics, Status, TaskDescription, build, parse};

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
    let task = sea("size: 3, randomised: false", "observation: Place");
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
    let task = sea("size: 3, randomised: false", "");
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
    let task = sea("size: 2, randomised: false, slip: 0.5", "");
    let mut environment = started(&task, 2000);
    environment.step(&[1.0; 2000]);
    let moved = environment
        .rewards()
        .iter()
        .filter(|reward| **reward != 0.0)
        .count();
    assert!((910..1090).contains(&moved), "{moved}");
}
