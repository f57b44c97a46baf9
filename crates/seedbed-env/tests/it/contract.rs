//! What every task promises, for every file in `envs/` and for both kinds of physics.

use std::path::PathBuf;

use rand::RngExt;
use seedbed_env::random::{Purpose, Stream, stream};
use seedbed_env::{Choice, Environment, Physics, Pose, Status, TaskDescription, build, load};

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

/// Every task with every physics that it has: those of users, and some whose joints those do not
/// use.
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

fn fresh(task: &TaskDescription, physics: Physics, copies: usize) -> Box<dyn Environment> {
    build(task, physics, copies).expect("the task has this physics")
}

/// One copy among others: each copy acts at random from a stream of its own and restarts when
/// its episode has ended.
struct Crowd {
    environment: Box<dyn Environment>,
    random: Vec<Stream>,
    episodes: Vec<u32>,
}

impl Crowd {
    /// `stream_indices` are the random streams from which the copies draw.
    fn new(task: &TaskDescription, physics: Physics, stream_indices: &[usize]) -> Self {
        let mut environment = fresh(task, physics, stream_indices.len());
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

    /// One step of all; `stream_indices` as before. Copies whose stream is not in `streams_to_restart` stay where they
    /// ended.
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

/// Tabular tasks start in one state, and chance alone does not bring an agent to all of their
/// states.
fn tasks_of_bodies() -> impl Iterator<Item = (TaskDescription, Physics)> {
    tasks()
        .into_iter()
        .filter(|(task, _)| task.bodies().is_some())
}

#[test]
fn observations_are_finite_and_none_is_constant() {
    for (task, physics) in tasks_of_bodies() {
        let names: Vec<_> = (0..4).collect();
        let mut crowd = Crowd::new(&task, physics, &names);
        let width = task.spec().observation_width();
        let first = crowd.environment.observations()[..width].to_vec();
        let mut moved = vec![false; width];
        for _ in 0..500 {
            crowd.step(&names, &names);
            let seen = crowd.environment.observations();
            assert!(
                seen.iter().all(|value| value.is_finite()),
                "{}: {seen:?}",
                task.spec().name
            );
            moved
                .iter_mut()
                .enumerate()
                .for_each(|(index, moved)| *moved |= seen[index] != first[index]);
        }
        assert!(
            moved.iter().all(|&moved| moved),
            "{}: an observation stays the same: {moved:?}",
            task.spec().name
        );
    }
}

#[test]
fn the_same_seeds_give_the_same_bits() {
    for (task, physics) in tasks() {
        let names = [0, 1, 2];
        let (mut one, mut other) = (
            Crowd::new(&task, physics, &names),
            Crowd::new(&task, physics, &names),
        );
        for _ in 0..300 {
            one.step(&names, &names);
            other.step(&names, &names);
            for copy in names {
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

/// A copy has the same bits alone, anywhere in a batch of any size, and whether the others go on,
/// end early or were never started.
#[test]
fn a_copy_does_not_depend_on_the_others() {
    for (task, physics) in tasks() {
        let mut alone = Crowd::new(&task, physics, &[5]);
        let mut crowds: Vec<_> = [2, 3, 8, 16, 33, 64]
            .into_iter()
            .map(|copies| {
                let names: Vec<_> = (0..copies)
                    .map(|copy| if copy == copies / 2 { 5 } else { 100 + copy })
                    .collect();
                (Crowd::new(&task, physics, &names), names)
            })
            .collect();
        for step in 0..300 {
            alone.step(&[5], &[5]);
            for (crowd, names) in &mut crowds {
                // In every other batch only our copy starts again, so that it ends up alone among
                // idle ones.
                let streams_to_restart = if names.len() % 2 == 0 {
                    names.clone()
                } else {
                    vec![5]
                };
                crowd.step(names, &streams_to_restart);
                assert_eq!(
                    crowd.bits(names.len() / 2),
                    alone.bits(0),
                    "{} {physics:?}: step {step}, {} copies",
                    task.spec().name,
                    names.len()
                );
            }
        }
    }
}

#[test]
fn a_reset_equals_a_fresh_build() {
    for (task, physics) in tasks() {
        let names = [0, 1, 2, 3];
        let mut used = Crowd::new(&task, physics, &names);
        (0..150).for_each(|_| used.step(&names, &[0, 2]));
        let mut new = fresh(&task, physics, names.len());
        for copy in names {
            used.environment.reset(copy, &mut reset_stream(copy, 50));
            new.reset(copy, &mut reset_stream(copy, 50));
            used.random[copy] = action_stream(copy);
        }
        let mut new = Crowd {
            environment: new,
            random: names.map(action_stream).to_vec(),
            episodes: vec![50; 4],
        };
        used.episodes = vec![50; 4];
        for _ in 0..150 {
            for copy in names {
                assert_eq!(
                    used.bits(copy),
                    new.bits(copy),
                    "{} {physics:?}",
                    task.spec().name
                );
            }
            used.step(&names, &names);
            new.step(&names, &names);
        }
    }
}

#[test]
fn starts_are_drawn_at_random() {
    for (task, physics) in tasks_of_bodies() {
        let crowd = Crowd::new(&task, physics, &[0, 1]);
        assert_ne!(crowd.bits(0), crowd.bits(1), "{}", task.spec().name);
    }
}

#[test]
fn a_saved_environment_continues_to_the_same_bits() {
    for (task, physics) in tasks() {
        let names = [0, 1, 2, 3, 4];
        let mut one = Crowd::new(&task, physics, &names);
        (0..70).for_each(|_| one.step(&names, &[0, 1, 2]));
        let bytes = one.environment.save();
        let mut other = Crowd {
            environment: fresh(&task, physics, 5),
            random: one.random.clone(),
            episodes: one.episodes.clone(),
        };
        other.environment.restore(&bytes).unwrap();
        assert_eq!(other.environment.save(), bytes);
        for _ in 0..150 {
            for copy in names {
                assert_eq!(
                    one.bits(copy),
                    other.bits(copy),
                    "{} {physics:?}",
                    task.spec().name
                );
            }
            one.step(&names, &names);
            other.step(&names, &names);
        }
    }
}

#[test]
fn a_foreign_state_is_refused() {
    for (task, physics) in tasks() {
        let bytes = fresh(&task, physics, 2).save();
        let mut other = fresh(&task, physics, 3);
        assert_eq!(
            other.restore(&bytes),
            Err("the saved state has another number of copies".to_owned())
        );
        assert!(
            other
                .restore(&bytes[..bytes.len() / 2])
                .unwrap_err()
                .starts_with("not a saved state of an environment: ")
        );
        let mut renamed = task.clone();
        renamed.spec_mut().name = "other".to_owned();
        let refused = fresh(&renamed, physics, 2).restore(&bytes).unwrap_err();
        assert_eq!(
            refused,
            format!(
                "the saved state is of task `{}`, expected `other`",
                task.spec().name
            )
        );
    }
}

/// Only a running copy moves; each ends once, by its own end or by the time limit, exactly then.
#[test]
fn episodes_end_by_themselves_or_by_the_time_limit() {
    // A double pendulum falls within few steps.
    const LIMIT: u32 = 4;
    for (task, physics) in tasks() {
        let mut limited = task.clone();
        limited.spec_mut().time_limit = LIMIT;
        let names: Vec<_> = (0..32).collect();
        let mut crowd = Crowd::new(&limited, physics, &names);
        for step in 1..=LIMIT {
            let before: Vec<_> = names
                .iter()
                .map(|&copy| (crowd.environment.statuses()[copy], crowd.bits(copy)))
                .collect();
            crowd.step(&names, &[]);
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

/// Whether a task stays finite under this many random steps in all, in 16 copies.
fn assert_finite(task: &TaskDescription, physics: Physics, steps: usize) {
    let names: Vec<_> = (0..16).collect();
    let mut crowd = Crowd::new(task, physics, &names);
    for step in 0..steps / names.len() {
        crowd.step(&names, &names);
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

#[test]
fn nothing_is_lost_in_a_hundred_thousand_random_steps() {
    for (task, physics) in tasks() {
        assert_finite(&task, physics, 100_000);
    }
}

/// Takes some minutes.
#[test]
#[ignore = "the same as the test before, ten times as long"]
fn nothing_is_lost_in_a_million_random_steps() {
    for (task, physics) in tasks() {
        assert_finite(&task, physics, 1_000_000);
    }
}
