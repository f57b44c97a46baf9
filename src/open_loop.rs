//! Open-loop noise: what is found by actions that do not depend on what is seen. A task of exploration must be hard for
//! all of it, before anything is trained.

use rayon::prelude::*;

use crate::scenario::{Rounding, Threshold};
use seedbed_env::gymnasium::{EnvironmentFailure, catch_failure};
use seedbed_env::{Environment, Physics, Status, TaskDescription, build};
use seedbed_input::InputError;
use seedbed_input::numbers::ranged_number;
use seedbed_learn::agent::action_selection::ActionNoise;
use seedbed_learn::agent::{ActScratch, ActionRandom, Agent};
use seedbed_learn::algorithms::random::RandomAgent;
use seedbed_random::{Purpose, stream};

/// Episodes that are played at the same time.
const MAX_COPIES: u32 = 32;

/// The kinds of noise that a task is tried with: none, of which actions are uniform, and with correlation times from half a second to
/// five seconds.
#[must_use]
pub fn kinds_of_noise() -> Vec<Option<ActionNoise>> {
    let mut kinds = vec![None, Some(ActionNoise::White), Some(ActionNoise::Pink)];
    for seconds in [0.5, 1.0, 2.0, 5.0] {
        let time = ranged_number(seconds);
        kinds.push(Some(ActionNoise::OrnsteinUhlenbeck { time }));
    }
    kinds.push(Some(ActionNoise::Constant));
    kinds
}

/// How many episodes are played, and what they must reach.
#[derive(Clone, Copy, Debug)]
pub struct OpenLoopPlan {
    /// Run seeds, which draw the constants of a task: those from the first on.
    pub first_seed: u64,
    /// Number of run seeds.
    pub runs: u32,
    /// Number of episodes for each run seed.
    pub episodes: u32,
    /// Return that an episode at the goal has at least.
    pub goal: f64,
}

/// What one kind of noise found with one run seed.
#[derive(Clone, Debug, PartialEq)]
pub struct OpenLoopRun {
    /// Number of episodes at the goal.
    pub goals: u32,
    /// Number of episodes.
    pub episodes: u32,
    /// Mean return.
    pub mean_return: f64,
    /// Largest return.
    pub best_return: f64,
}

impl OpenLoopRun {
    /// Probability that at least one of `attempts` episodes is at the goal, estimated without bias: the share of all
    /// choices of `attempts` of the episodes that have one, `1 − C(n − g, m) / C(n, m)`. `None` if fewer were played.
    #[must_use]
    pub fn probability_to_find(&self, attempts: u32) -> Option<f64> {
        let others = self.episodes - self.goals;
        (attempts <= self.episodes).then(|| {
            let missed = (0..attempts).map(|taken| {
                f64::from(others.saturating_sub(taken)) / f64::from(self.episodes - taken)
            });
            1.0 - missed.product::<f64>()
        })
    }
}

/// Why episodes could not be played.
#[derive(Debug, thiserror::Error)]
pub enum OpenLoopError {
    /// The task cannot be built.
    #[error(transparent)]
    Task(#[from] InputError),
    /// An environment of Gymnasium failed.
    #[error("{0}")]
    Environment(EnvironmentFailure),
}

/// Plays episodes with one kind of noise, for each run seed; calls `on_run` when those of one have ended.   → `[runs]`
///
/// # Errors
/// The task cannot be built or played.
pub fn play(
    description: &TaskDescription,
    noise: Option<ActionNoise>,
    plan: &OpenLoopPlan,
    on_run: impl Fn() + Sync,
) -> Result<Vec<OpenLoopRun>, OpenLoopError> {
    let seeds = plan.first_seed..plan.first_seed + u64::from(plan.runs);
    let seeds: Vec<u64> = seeds.collect();
    let runs = seeds.par_iter().map(|&seed| {
        let task = description.for_run(seed);
        let copies = plan.episodes.min(MAX_COPIES) as usize;
        let mut environment = build(&task, Physics::Rapier, copies)?;
        let played = catch_failure(|| play_run(&mut *environment, noise, seed, plan));
        on_run();
        played.map_err(OpenLoopError::Environment)
    });
    runs.collect()
}

fn play_run(
    environment: &mut dyn Environment,
    noise: Option<ActionNoise>,
    seed: u64,
    plan: &OpenLoopPlan,
) -> OpenLoopRun {
    let width = environment.spec().action_width();
    let mut returns = Vec::with_capacity(plan.episodes as usize);
    let mut actions = vec![0.0; environment.copies() * width];
    let agent = RandomAgent::new(noise, environment.spec());
    let (mut scratch, mut log_probs) = (ActScratch::default(), vec![0.0; width]);
    let mut copies: Vec<PlayedCopy> = Vec::new();
    for copy in 0..environment.copies() {
        copies.push(PlayedCopy::begin(environment, seed, copy, copy as u32));
    }
    let mut next_episode = copies.len() as u32;
    while returns.len() < plan.episodes as usize {
        for (played, action) in copies.iter_mut().zip(actions.chunks_exact_mut(width)) {
            let random = &mut played.random;
            agent.act(&[], random, &mut scratch, action, &mut log_probs);
        }
        environment.step(&actions);
        for (copy, played) in copies.iter_mut().enumerate() {
            if !played.is_playing {
                continue;
            }
            played.episode_return += f64::from(environment.rewards()[copy]);
            if environment.statuses()[copy] == Status::Running {
                continue;
            }
            returns.push(played.episode_return);
            played.is_playing = next_episode < plan.episodes;
            if played.is_playing {
                *played = PlayedCopy::begin(environment, seed, copy, next_episode);
                next_episode += 1;
            }
        }
    }
    summarize(&returns, plan.goal)
}

fn summarize(returns: &[f64], goal: f64) -> OpenLoopRun {
    let threshold = Threshold {
        r#return: goal,
        window: 1,
    };
    let reaches = |value: &&f64| threshold.is_reached_by(&[**value], Rounding::SingleRewards);
    OpenLoopRun {
        goals: returns.iter().filter(reaches).count() as u32,
        episodes: returns.len() as u32,
        mean_return: returns.iter().sum::<f64>() / returns.len() as f64,
        best_return: returns.iter().copied().fold(f64::NEG_INFINITY, f64::max),
    }
}

/// A copy of the task, whose episodes have random streams of their own.
struct PlayedCopy {
    random: ActionRandom,
    is_playing: bool,
    episode_return: f64,
}

impl PlayedCopy {
    /// Begins an episode in the copy with this number.
    fn begin(environment: &mut dyn Environment, seed: u64, copy: usize, episode: u32) -> Self {
        environment.reset(copy, &mut stream(seed, Purpose::Reset, 0, episode));
        Self {
            random: stream(seed, Purpose::Trial, 0, episode).into(),
            is_playing: true,
            episode_return: 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(goals: u32, episodes: u32) -> OpenLoopRun {
        OpenLoopRun {
            goals,
            episodes,
            mean_return: 0.0,
            best_return: 0.0,
        }
    }

    /// One of 4 episodes is at the goal: 2 of them have it with probability 1/2, 4 always. Two of 5: of the 10 pairs, 3 have
    /// none.
    #[test]
    fn the_probability_to_find_counts_choices_of_episodes() {
        assert_eq!(run(1, 4).probability_to_find(2), Some(0.5));
        assert_eq!(run(1, 4).probability_to_find(4), Some(1.0));
        assert_eq!(run(0, 4).probability_to_find(4), Some(0.0));
        let pairs = run(2, 5).probability_to_find(2).unwrap();
        assert!((pairs - 0.7).abs() < 1e-12);
        assert_eq!(run(1, 4).probability_to_find(5), None);
    }

    /// A puck with drag is pushed for 10 s. A constant push of a newtons moves it by about 9a meters. It passes 6 m if
    /// |a| > 0.67, which half of all normal numbers are. White noise, with a new push every 0.05 s, moves it by about
    /// 0.05 √200 = 0.7 m, never by 6 m. The standard error of a share of 1,000 episodes is 0.016.
    #[test]
    fn a_constant_push_goes_farther_than_white_noise() {
        let task = seedbed_env::parse(
            "puck",
            "puck.ron",
            r#"Environment(
                description: "A puck with drag.", gravity: (0.0, 0.0), control_step: 0.05, time_limit: 200, reward_threshold: 1,
                bodies: [(name: "puck", mass: 1.0, inertia: 0.005, forces: [(x: "-x_dot", y: "-y_dot")])],
                actuators: [(name: "push", type: BodyForce(body: "puck", direction: (1.0, 0.0)), control: Continuous(-1.0, 1.0))],
                sensors: [(name: "x", type: JointPosition("puck.x")), (name: "x_dot", type: JointVelocity("puck.x")), (name: "y_dot", type: JointVelocity("puck.y"))],
                observations: [(name: "x", range: (-9.0, 9.0))],
                reward: "if abs(x) > 6 { 1 } else { 0 }",
                terminated: "abs(x) > 6",
            )"#
            .to_owned(),
        );
        let task = task.unwrap();
        let plan = OpenLoopPlan {
            first_seed: 0,
            runs: 2,
            episodes: 500,
            goal: 1.0,
        };
        let share = |noise| {
            let runs = play(&task, noise, &plan, || {}).unwrap();
            runs.iter().map(|run| f64::from(run.goals)).sum::<f64>() / 1000.0
        };
        let [uniform, white, .., slow, constant] = kinds_of_noise()[..] else {
            panic!("at least four kinds");
        };
        assert_eq!((share(white), share(uniform)), (0.0, 0.0));
        let (slow, constant) = (share(slow), share(constant));
        assert!((constant - 0.505).abs() < 0.065, "{constant}");
        assert!(slow > 0.05 && slow < constant, "{slow}");
    }
}
