//! Prints a hash of the bits of some episodes of each task, with which the tests of the Python package
//! compare theirs: `cargo xtask bless` writes them to `python/tests/golden_episodes.txt`.
//!
//! A line has the task, its physics, the run seed and agent that name the random stream of start states,
//! and the hash of all observations, rewards and ends of episodes. Agent 0 plays several episodes, others
//! play one.

use std::error::Error;
use std::path::{Path, PathBuf};

use seedbed_env::{Choice, Environment, Physics, Status, TaskDescription, TaskSpec, build, load};
use seedbed_random::{Purpose, stream};

/// Number of steps per line.
const STEPS: usize = 120;

/// Run seeds and agents of the random streams.
const STREAMS: [(u64, u32); 3] = [(7, 0), (7, 2), (u64::MAX, 0)];

fn main() -> Result<(), Box<dyn Error>> {
    let repository = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    for file in task_files(&repository.join("envs"))? {
        let task = load(&file)?;
        print_lines(&task, Physics::Rapier)?;
        if task.has_analytic_model() {
            print_lines(&task, Physics::Analytic)?;
        }
    }
    Ok(())
}

fn task_files(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.extension().is_some_and(|extension| extension == "ron") {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

fn print_lines(task: &TaskDescription, physics: Physics) -> Result<(), Box<dyn Error>> {
    for (run_seed, agent) in STREAMS {
        let task = task.for_run(run_seed);
        let mut environment = build(&task, physics, 1)?;
        let hash = hash_of_episodes(&mut *environment, run_seed, agent);
        let (name, physics) = (&task.spec().name, format!("{physics:?}").to_lowercase());
        println!("{name} {physics} {run_seed} {agent} {hash:016x}");
    }
    Ok(())
}

/// Hash of the bits of consecutive episodes.
fn hash_of_episodes(environment: &mut dyn Environment, run_seed: u64, agent: u32) -> u64 {
    let mut random = stream(run_seed, Purpose::Reset, agent, 0);
    let mut hash = 0;
    environment.reset(0, &mut random);
    environment
        .observations()
        .iter()
        .for_each(|value| add(&mut hash, value.to_bits()));
    for step in 0..STEPS {
        environment.step(&actions(environment.spec(), step));
        environment
            .observations()
            .iter()
            .for_each(|value| add(&mut hash, value.to_bits()));
        add(&mut hash, environment.rewards()[0].to_bits());
        let status = environment.statuses()[0];
        add(&mut hash, u32::from(status == Status::Terminated));
        if status != Status::Running && agent > 0 {
            break;
        }
        if status != Status::Running {
            environment.reset(0, &mut random);
            environment
                .observations()
                .iter()
                .for_each(|value| add(&mut hash, value.to_bits()));
        }
    }
    hash
}

/// Some action for each step.
fn actions(spec: &TaskSpec, step: usize) -> Vec<f32> {
    let components = spec.actions.iter().enumerate();
    let value = |(index, action): (usize, &seedbed_env::Action)| match &action.choice {
        Choice::Discrete(values) => ((step / 3 + index) % values.len()) as f32,
        Choice::Continuous => {
            let [low, high] = action.quantity.range;
            let eighths = ((5 * step + 3 * index) % 9) as f32;
            low + (high - low) * (eighths / 8.0)
        }
    };
    components.map(value).collect()
}

/// A step of a multiplicative hash.
fn add(hash: &mut u64, bits: u32) {
    *hash = hash
        .wrapping_mul(6_364_136_223_846_793_005)
        .wrapping_add(u64::from(bits) + 1);
}
