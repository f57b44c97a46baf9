//! Open-loop noise: what is found by actions that do not depend on what is seen. A task of exploration must be hard for
//! all of it, before anything is trained.

use std::fmt;

use rand::RngExt;
use rayon::prelude::*;

use crate::scenario::{Rounding, Threshold};
use seedbed_env::gymnasium::{EnvironmentFailure, catch_failure};
use seedbed_env::{Action, Choice, Environment, Physics, Status, TaskDescription, build};
use seedbed_input::InputError;
use seedbed_learn::math::ln;
use seedbed_learn::rl::correlated_noise::{CorrelatedNoise, Correlation};
use seedbed_random::{Purpose, Stream, stream};

/// Episodes that are played at the same time.
const MAX_COPIES: u32 = 32;

/// How actions are drawn. A continuous action is the middle of its range plus half of the range times noise of mean 0
/// and variance 1, and is kept in its range. A discrete action is drawn uniformly and then repeated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OpenLoopNoise {
    /// Uniform over the range or the choices in each step, as the algorithm `Random`.
    Uniform,
    /// White noise; a new choice in each step.
    White,
    /// Pink noise (Eberhard et al. 2023); choices are repeated for n steps with a probability in proportion to 1/n²
    /// (Dabney et al. 2021).
    Pink,
    /// Noise of Ornstein and Uhlenbeck with a correlation time in s; choices are kept with probability exp(−step/time).
    OrnsteinUhlenbeck(f32),
    /// One action for the whole episode.
    Constant,
}

impl OpenLoopNoise {
    /// Every kind, with correlation times from half a second to five seconds.
    pub const ALL: [Self; 8] = [
        Self::Uniform,
        Self::White,
        Self::Pink,
        Self::OrnsteinUhlenbeck(0.5),
        Self::OrnsteinUhlenbeck(1.0),
        Self::OrnsteinUhlenbeck(2.0),
        Self::OrnsteinUhlenbeck(5.0),
        Self::Constant,
    ];
}

impl fmt::Display for OpenLoopNoise {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Uniform => formatter.write_str("uniform"),
            Self::White => formatter.write_str("white"),
            Self::Pink => formatter.write_str("pink"),
            Self::OrnsteinUhlenbeck(time) => write!(formatter, "Ornstein-Uhlenbeck, {time} s"),
            Self::Constant => formatter.write_str("one action per episode"),
        }
    }
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

/// Plays episodes with one kind of noise, for each run seed: `[runs]`.
///
/// # Errors
/// The task cannot be built or played.
pub fn play(
    description: &TaskDescription,
    noise: OpenLoopNoise,
    plan: &OpenLoopPlan,
) -> Result<Vec<OpenLoopRun>, OpenLoopError> {
    let seeds = plan.first_seed..plan.first_seed + u64::from(plan.runs);
    let seeds: Vec<u64> = seeds.collect();
    let runs = seeds.par_iter().map(|&seed| {
        let task = description.for_run(seed);
        let copies = plan.episodes.min(MAX_COPIES) as usize;
        let mut environment = build(&task, Physics::Rapier, copies)?;
        let played = catch_failure(|| play_run(&mut *environment, noise, seed, plan));
        played.map_err(OpenLoopError::Environment)
    });
    runs.collect()
}

fn play_run(
    environment: &mut dyn Environment,
    noise: OpenLoopNoise,
    seed: u64,
    plan: &OpenLoopPlan,
) -> OpenLoopRun {
    let width = environment.spec().action_width();
    let mut returns = Vec::with_capacity(plan.episodes as usize);
    let mut actions = vec![0.0; environment.copies() * width];
    let mut copies: Vec<PlayedCopy> = Vec::new();
    for copy in 0..environment.copies() {
        let mut played = PlayedCopy::new(environment, noise, seed);
        played.begin(environment, copy, copy as u32);
        copies.push(played);
    }
    let mut next_episode = copies.len() as u32;
    while returns.len() < plan.episodes as usize {
        for (played, action) in copies.iter_mut().zip(actions.chunks_exact_mut(width)) {
            played.act(action);
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
                played.begin(environment, copy, next_episode);
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
    noise: OpenLoopNoise,
    seed: u64,
    random: Stream,
    components: Vec<Action>,
    correlated: CorrelatedNoise,
    numbers: Vec<f32>,
    /// The present choice of each discrete component, and for how many steps it is repeated.
    choices: Vec<(f32, u32)>,
    /// Time between two actions, s.
    control_step: f32,
    is_playing: bool,
    episode_return: f64,
}

impl PlayedCopy {
    fn new(environment: &dyn Environment, noise: OpenLoopNoise, seed: u64) -> Self {
        let spec = environment.spec();
        let control_step = spec.control_step as f32;
        let correlation = match noise {
            OpenLoopNoise::Uniform | OpenLoopNoise::White => Correlation::White,
            OpenLoopNoise::Pink => Correlation::Pink {
                steps: spec.time_limit,
            },
            OpenLoopNoise::OrnsteinUhlenbeck(time) => Correlation::OrnsteinUhlenbeck {
                time: time / control_step,
            },
            OpenLoopNoise::Constant => Correlation::Constant,
        };
        Self {
            noise,
            seed,
            random: stream(seed, Purpose::Trial, 0, 0),
            components: spec.actions.clone(),
            correlated: CorrelatedNoise::new(correlation, spec.action_width()),
            numbers: vec![0.0; spec.action_width()],
            choices: vec![(0.0, 0); spec.action_width()],
            control_step,
            is_playing: false,
            episode_return: 0.0,
        }
    }

    fn begin(&mut self, environment: &mut dyn Environment, copy: usize, episode: u32) {
        environment.reset(copy, &mut stream(self.seed, Purpose::Reset, 0, episode));
        self.random = stream(self.seed, Purpose::Trial, 0, episode);
        self.correlated.begin(&mut self.random);
        self.choices.fill((0.0, 0));
        (self.is_playing, self.episode_return) = (true, 0.0);
    }

    /// Writes the next action.
    fn act(&mut self, action: &mut [f32]) {
        self.correlated.write(&mut self.numbers);
        for (index, action) in action.iter_mut().enumerate() {
            let [low, high] = self.components[index].quantity.range;
            *action = match &self.components[index].choice {
                Choice::Discrete(values) => self.choose(index, values.len()),
                Choice::Continuous if self.noise == OpenLoopNoise::Uniform => {
                    self.random.random_range(low..=high)
                }
                Choice::Continuous => {
                    let middle = 0.5 * (low + high);
                    (middle + 0.5 * (high - low) * self.numbers[index]).clamp(low, high)
                }
            };
        }
        self.correlated.advance(&mut self.random);
    }

    fn choose(&mut self, index: usize, choices: usize) -> f32 {
        let (_, left) = self.choices[index];
        if left == 0 {
            let choice = self.random.random_range(0..choices) as f32;
            self.choices[index] = (choice, self.repeats());
        }
        let (choice, left) = &mut self.choices[index];
        *left = left.saturating_sub(1);
        *choice
    }

    /// For how many steps a new choice is repeated.
    fn repeats(&mut self) -> u32 {
        match self.noise {
            OpenLoopNoise::Uniform | OpenLoopNoise::White => 1,
            OpenLoopNoise::Pink => zeta_of_two(self.random.random()),
            OpenLoopNoise::OrnsteinUhlenbeck(time) => {
                // ln(u) / ln(exp(−step/time)) is exponential with mean time/step.
                let uniform: f32 = 1.0 - self.random.random::<f32>();
                1 + (-ln(uniform) * time / self.control_step) as u32
            }
            OpenLoopNoise::Constant => u32::MAX,
        }
    }
}

/// The number n whose probability is in proportion to 1/n², for a number that is uniform in [0, 1). At most 10,000, which has
/// the rest of the probability.
fn zeta_of_two(uniform: f64) -> u32 {
    let total = std::f64::consts::PI.powi(2) / 6.0;
    let (mut n, mut below) = (1_u32, 1.0 / total);
    while uniform >= below && n < 10_000 {
        n += 1;
        below += 1.0 / (f64::from(n).powi(2) * total);
    }
    n
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

    /// 6/π² = 0.608 for 1, and 0.152 for 2.
    #[test]
    fn repeats_have_the_probabilities_of_the_zeta_distribution() {
        for (uniform, expected) in [(0.0, 1), (0.607, 1), (0.609, 2), (0.759, 2), (0.761, 3)] {
            assert_eq!(zeta_of_two(uniform), expected, "{uniform}");
        }
        assert_eq!(zeta_of_two(1.0 - 1e-12), 10_000);
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
            let runs = play(&task, noise, &plan).unwrap();
            runs.iter().map(|run| f64::from(run.goals)).sum::<f64>() / 1000.0
        };
        assert_eq!(share(OpenLoopNoise::White), 0.0);
        assert_eq!(share(OpenLoopNoise::Uniform), 0.0);
        let constant = share(OpenLoopNoise::Constant);
        assert!((constant - 0.505).abs() < 0.065, "{constant}");
        let slow = share(OpenLoopNoise::OrnsteinUhlenbeck(5.0));
        assert!(slow > 0.05 && slow < constant, "{slow}");
        assert_eq!(share(OpenLoopNoise::Constant), constant, "the same bits");
    }
}
