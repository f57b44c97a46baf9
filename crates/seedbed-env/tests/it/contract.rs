//! What every task promises, for every file in `envs/` and for both kinds of physics.

use std::ops::Range;
use std::path::PathBuf;

use rand::RngExt;
use seedbed_env::{Choice, Environment, Physics, Pose, Status, TaskDescription, build, load};
use seedbed_random::{Purpose, Stream, stream};

/// The files of a folder of the repository that end in `.ron`, in order.
fn files(folder: &str) -> Vec<PathBuf> {
    let folder = crate::repository().join(folder);
    let mut files: Vec<_> = std::fs::read_dir(folder)
        .expect("the folder is there")
        .flatten()
        .map(|entry| entry.path())
        .collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension == "ron"));
    files.sort();
    files
}

/// Every task with every physics that it has: the tasks in `envs/`, and tasks for tests with joints
/// that no task in `envs/` uses.
fn tasks() -> Vec<(TaskDescription, Physics)> {
    let files = [files("envs"), files("crates/seedbed-env/tests/envs")].concat();
    let descriptions = files
        .iter()
        .map(|path| load(path).unwrap_or_else(|error| panic!("{error}")));
    let tasks: Vec<_> = descriptions
        .flat_map(|task| {
            let analytic = task
                .has_analytic_model()
                .then(|| (task.clone(), Physics::Analytic));
            [(task, Physics::Rapier)].into_iter().chain(analytic)
        })
        .collect();
    assert!(tasks.iter().any(|(task, _)| task.spec().name == "cartpole"));
    assert!(
        tasks
            .iter()
            .any(|(_, physics)| *physics == Physics::Analytic)
    );
    tasks
}

fn reset_stream(copy: usize, episode: u32) -> Stream {
    stream(7, Purpose::Reset, copy as u32, episode)
}

fn action_stream(copy: usize) -> Stream {
    stream(7, Purpose::Action, copy as u32, 0)
}

fn random_action(environment: &dyn Environment, random: &mut Stream) -> Vec<f32> {
    let choose = |action: &seedbed_env::Action| match &action.choice {
        Choice::Discrete(values) => random.random_range(0..values.len()) as f32,
        Choice::Continuous => {
            let [low, high] = action.quantity.range;
            low + (high - low) * random.random::<f32>()
        }
    };
    environment.spec().actions.iter().map(choose).collect()
}

fn new_environment(
    task: &TaskDescription,
    physics: Physics,
    copies: usize,
) -> Box<dyn Environment> {
    build(task, physics, copies).expect("the task has this physics")
}

/// Copies of one task. Each acts at random from a stream of its own, and restarts when its episode
/// has ended.
struct Crowd {
    environment: Box<dyn Environment>,
    random: Vec<Stream>,
    episodes: Vec<u32>,
}

impl Crowd {
    /// `stream_indices`: for each copy, the index of the random streams from which it draws.
    fn new(task: &TaskDescription, physics: Physics, stream_indices: &[usize]) -> Self {
        let mut environment = new_environment(task, physics, stream_indices.len());
        for (copy, &index) in stream_indices.iter().enumerate() {
            environment.reset(copy, &mut reset_stream(index, 0));
        }
        let random = stream_indices
            .iter()
            .map(|&index| action_stream(index))
            .collect();
        Self {
            environment,
            random,
            episodes: vec![0; stream_indices.len()],
        }
    }

    /// One step of all copies; `stream_indices` as in [`new`](Self::new). Copies whose index is not
    /// in `streams_to_restart` stay where they ended.
    fn step(&mut self, stream_indices: &[usize], streams_to_restart: &[usize]) {
        let rows: Vec<_> = self
            .random
            .iter_mut()
            .map(|random| random_action(&*self.environment, random))
            .collect();
        self.environment.step(&rows.concat());
        for (copy, index) in stream_indices.iter().enumerate() {
            if self.environment.statuses()[copy] != Status::Running
                && streams_to_restart.contains(index)
            {
                self.episodes[copy] += 1;
                self.environment
                    .reset(copy, &mut reset_stream(*index, self.episodes[copy]));
            }
        }
    }

    /// All that can be seen of a copy, as bits.
    fn bits(&self, copy: usize) -> Vec<u32> {
        let width = self.environment.spec().observation_width();
        let seen = &self.environment.observations()[copy * width..][..width];
        let bodies = self
            .environment
            .scene()
            .map_or(0, |scene| scene.bodies.len());
        let mut poses = vec![Pose::default(); bodies];
        if bodies > 0 {
            self.environment.poses(copy, &mut poses);
        }
        let poses = poses.iter().flat_map(|pose| [pose.x, pose.y, pose.angle]);
        let numbers = seen
            .iter()
            .copied()
            .chain([self.environment.rewards()[copy]])
            .chain(poses);
        numbers
            .map(f32::to_bits)
            .chain([self.environment.statuses()[copy] as u32])
            .collect()
    }
}

/// The tasks of rigid bodies. Tabular tasks are left out of tests of starts and of observations:
/// they always start in the same state, and random actions do not reach all of their states.
fn body_tasks() -> impl Iterator<Item = (TaskDescription, Physics)> {
    tasks()
        .into_iter()
        .filter(|(task, _)| task.body_task().is_some())
}

/// Whether copies have physics worlds of their own, which take about ten times as long as shared ones.
fn has_own_worlds(task: &TaskDescription) -> bool {
    let bodies = task.body_task();
    bodies.is_some_and(seedbed_env::description::BodyTask::needs_own_worlds)
}

/// Observations that random actions hardly ever change: the force of a rail's end, which the cart must
/// reach first, and the places of blocks that stick.
const RARE_OBSERVATIONS: &[(&str, Range<usize>)] = &[
    ("gym_inverted_double_pendulum", 8..9),
    ("plugs_2", 4..8),
    ("plugs_3", 4..8),
    ("plugs_easy", 4..8),
];

/// Observations of numbers that are drawn per episode differ between copies instead.
#[test]
fn observations_are_finite_and_none_is_constant() {
    for (task, physics) in body_tasks() {
        let is_drawn =
            |bodies: &seedbed_env::description::BodyTask| !bodies.episode_numbers.is_empty();
        let draws = task.body_task().is_some_and(is_drawn);
        let stream_indices: Vec<_> = (0..4).collect();
        let mut crowd = Crowd::new(&task, physics, &stream_indices);
        let width = task.spec().observation_width();
        let first = crowd.environment.observations().to_vec();
        let mut has_changed = vec![false; width];
        for _ in 0..500 {
            crowd.step(&stream_indices, &stream_indices);
            let seen = crowd.environment.observations();
            assert!(
                seen.iter().all(|value| value.is_finite()),
                "{}: {seen:?}",
                task.spec().name
            );
            let all_first = &first[..width];
            for (index, (seen, first)) in seen.iter().zip(&first).enumerate() {
                has_changed[index % width] |=
                    seen != first || (draws && *seen != all_first[index % width]);
            }
        }
        let name = task.spec().name.as_str();
        for (_, rare) in RARE_OBSERVATIONS.iter().filter(|(task, _)| *task == name) {
            has_changed[rare.clone()].fill(true);
        }
        assert!(
            has_changed.iter().all(|&has_changed| has_changed),
            "{}: an observation stays the same: {has_changed:?}",
            task.spec().name
        );
    }
}

#[test]
fn the_same_seeds_give_the_same_bits() {
    for (task, physics) in tasks() {
        let stream_indices = [0, 1, 2];
        let (mut one, mut other) = (
            Crowd::new(&task, physics, &stream_indices),
            Crowd::new(&task, physics, &stream_indices),
        );
        for _ in 0..300 {
            one.step(&stream_indices, &stream_indices);
            other.step(&stream_indices, &stream_indices);
            for copy in 0..stream_indices.len() {
                assert_eq!(
                    one.bits(copy),
                    other.bits(copy),
                    "{} {physics:?}",
                    task.spec().name
                );
            }
        }
    }
}

/// A copy has the same bits alone and anywhere in a batch of any size, whether the other copies go
/// on or have ended.
#[test]
fn a_copy_does_not_depend_on_the_others() {
    for (task, physics) in tasks() {
        let mut alone = Crowd::new(&task, physics, &[5]);
        let (sizes, steps): (&[usize], _) = if has_own_worlds(&task) {
            (&[2, 3, 8], 100)
        } else {
            (&[2, 3, 8, 16, 33, 64], 300)
        };
        let mut crowds: Vec<_> = sizes
            .iter()
            .map(|&copies| {
                let stream_indices: Vec<_> = (0..copies)
                    .map(|copy| if copy == copies / 2 { 5 } else { 100 + copy })
                    .collect();
                (Crowd::new(&task, physics, &stream_indices), stream_indices)
            })
            .collect();
        for step in 0..steps {
            alone.step(&[5], &[5]);
            for (crowd, stream_indices) in &mut crowds {
                // In every other batch only the compared copy restarts; all other copies end and
                // stay ended.
                let streams_to_restart = if stream_indices.len() % 2 == 0 {
                    stream_indices.clone()
                } else {
                    vec![5]
                };
                crowd.step(stream_indices, &streams_to_restart);
                assert_eq!(
                    crowd.bits(stream_indices.len() / 2),
                    alone.bits(0),
                    "{} {physics:?}: step {step}, {} copies",
                    task.spec().name,
                    stream_indices.len()
                );
            }
        }
    }
}

#[test]
fn a_reset_equals_a_fresh_build() {
    for (task, physics) in tasks() {
        let stream_indices = [0, 1, 2, 3];
        let mut used = Crowd::new(&task, physics, &stream_indices);
        (0..150).for_each(|_| used.step(&stream_indices, &[0, 2]));
        let mut new = new_environment(&task, physics, stream_indices.len());
        for copy in 0..stream_indices.len() {
            used.environment.reset(copy, &mut reset_stream(copy, 50));
            new.reset(copy, &mut reset_stream(copy, 50));
            used.random[copy] = action_stream(copy);
        }
        let mut new = Crowd {
            environment: new,
            random: stream_indices.map(action_stream).to_vec(),
            episodes: vec![50; 4],
        };
        used.episodes = vec![50; 4];
        for _ in 0..150 {
            for copy in 0..stream_indices.len() {
                assert_eq!(
                    used.bits(copy),
                    new.bits(copy),
                    "{} {physics:?}",
                    task.spec().name
                );
            }
            used.step(&stream_indices, &stream_indices);
            new.step(&stream_indices, &stream_indices);
        }
    }
}

#[test]
fn starts_are_drawn_at_random() {
    for (task, physics) in body_tasks() {
        let crowd = Crowd::new(&task, physics, &[0, 1]);
        assert_ne!(crowd.bits(0), crowd.bits(1), "{}", task.spec().name);
    }
}

#[test]
fn a_saved_environment_continues_to_the_same_bits() {
    for (task, physics) in tasks() {
        let stream_indices = [0, 1, 2, 3, 4];
        let mut one = Crowd::new(&task, physics, &stream_indices);
        (0..70).for_each(|_| one.step(&stream_indices, &[0, 1, 2]));
        let states: Vec<Vec<u8>> = (0..5).map(|copy| one.environment.save(copy)).collect();
        let mut other = Crowd {
            environment: new_environment(&task, physics, 5),
            random: one.random.clone(),
            episodes: one.episodes.clone(),
        };
        for (copy, state) in states.iter().enumerate() {
            other.environment.restore(copy, state).unwrap();
            assert_eq!(other.environment.save(copy), *state);
        }
        for _ in 0..150 {
            for copy in 0..stream_indices.len() {
                assert_eq!(
                    one.bits(copy),
                    other.bits(copy),
                    "{} {physics:?}",
                    task.spec().name
                );
            }
            one.step(&stream_indices, &stream_indices);
            other.step(&stream_indices, &stream_indices);
        }
    }
}

#[test]
fn a_foreign_state_is_refused() {
    for (task, physics) in tasks() {
        let bytes = new_environment(&task, physics, 2).save(1);
        let mut other = new_environment(&task, physics, 3);
        assert!(
            other
                .restore(0, &bytes[..bytes.len() / 2])
                .unwrap_err()
                .starts_with("not a saved state of an environment: ")
        );
        let mut renamed = task.clone();
        renamed.spec_mut().name = "other".to_owned();
        let refused = new_environment(&renamed, physics, 2)
            .restore(0, &bytes)
            .unwrap_err();
        assert_eq!(
            refused,
            format!(
                "the saved state is of task `{}`, expected `other`",
                task.spec().name
            )
        );
    }
}

/// Only a running copy moves. Each episode ends once: by termination, or exactly at the time limit.
#[test]
fn episodes_end_by_termination_or_by_the_time_limit() {
    // The limit must be short, because a double pendulum falls within a few steps.
    const LIMIT: u32 = 4;
    for (task, physics) in tasks() {
        let mut limited = task.clone();
        limited.spec_mut().time_limit = LIMIT;
        let stream_indices: Vec<_> = (0..32).collect();
        let mut crowd = Crowd::new(&limited, physics, &stream_indices);
        for step in 1..=LIMIT {
            let before: Vec<_> = stream_indices
                .iter()
                .map(|&copy| (crowd.environment.statuses()[copy], crowd.bits(copy)))
                .collect();
            crowd.step(&stream_indices, &[]);
            for (copy, (status, bits)) in before.into_iter().enumerate() {
                match (status, crowd.environment.statuses()[copy]) {
                    (Status::Running, Status::Truncated) => assert_eq!(step, LIMIT),
                    (Status::Running, Status::Running) => assert!(step < LIMIT),
                    (Status::Running, Status::Terminated) => assert_ne!(bits, crowd.bits(copy)),
                    (_, _) => assert_eq!(
                        bits,
                        crowd.bits(copy),
                        "{}: an ended copy moved",
                        task.spec().name
                    ),
                }
            }
        }
        assert!(
            crowd.environment.statuses().contains(&Status::Truncated),
            "{}",
            task.spec().name
        );
        assert!(!crowd.environment.statuses().contains(&Status::Running));
    }
}

/// Checks that observations and rewards stay finite for `steps` random steps in total, in 16
/// copies.
fn assert_finite(task: &TaskDescription, physics: Physics, steps: usize) {
    let stream_indices: Vec<_> = (0..16).collect();
    let mut crowd = Crowd::new(task, physics, &stream_indices);
    for step in 0..steps / stream_indices.len() {
        crowd.step(&stream_indices, &stream_indices);
        let numbers = crowd
            .environment
            .observations()
            .iter()
            .chain(crowd.environment.rewards());
        assert!(
            numbers.copied().all(f32::is_finite),
            "{} {physics:?}: step {step}",
            task.spec().name
        );
    }
}

/// A tenth as many for copies with worlds of their own.
#[test]
fn values_stay_finite_in_a_hundred_thousand_random_steps() {
    for (task, physics) in tasks() {
        let steps = if has_own_worlds(&task) {
            10_000
        } else {
            100_000
        };
        assert_finite(&task, physics, steps);
    }
}

/// Takes some minutes.
#[test]
#[ignore = "the same as the test before, ten times as long"]
fn values_stay_finite_in_a_million_random_steps() {
    for (task, physics) in tasks() {
        assert_finite(&task, physics, 1_000_000);
    }
}
