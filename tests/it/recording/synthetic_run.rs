//! A synthetic run, with episodes that were not produced by training, as input for recorders.

use seedbed::run::facts::{EpisodeDetails, EpisodeRow, RoundRow};
use seedbed::run::ranks::Ranks;
use seedbed::run::recorder::{BonusRange, Recorder, RoundRecord};
use seedbed::run::recorder::{Focus, RunInfo};
use seedbed_env::{Action, Choice, Pose, Quantity, Scene, SceneBody, Shape, Status, TaskSpec};
use seedbed_learn::experience::{Episode, StepData};
use seedbed_learn::team::Workers;

/// A synthetic cart-pole run whose episodes become longer from round to round.
pub(super) struct SyntheticRun {
    pub(super) agents: u32,
    pub(super) spec: TaskSpec,
    pub(super) scene: Scene,
    pub(super) rounds: Vec<SyntheticRound>,
}

pub(super) struct SyntheticRound {
    pub(super) round: u32,
    pub(super) episodes: Vec<Episode>,
    pub(super) episode_rows: Vec<EpisodeRow>,
    pub(super) round_rows: Vec<RoundRow>,
    pub(super) step_data: Vec<StepData>,
    pub(super) details: Vec<EpisodeDetails>,
}

impl SyntheticRound {
    pub(super) fn record(&self, recorder: &mut impl Recorder) {
        let round = RoundRecord {
            round: self.round,
            episodes: &self.episodes.iter().collect::<Vec<_>>(),
            episode_rows: &self.episode_rows,
            round_rows: &self.round_rows,
            step_data: &self.step_data,
            details: &self.details,
            workers: Workers::CURRENT_THREAD,
        };
        recorder
            .record_round(&round)
            .expect("the recording can be written");
    }
}

impl SyntheticRun {
    pub(super) fn new(agents: u32, rounds: u32) -> Self {
        let mut env_steps = 0;
        let rounds = (0..rounds)
            .map(|round| synthetic_round(agents, round, rounds, &mut env_steps))
            .collect();
        Self {
            agents,
            spec: cart_pole_spec(),
            scene: cart_and_pole(),
            rounds,
        }
    }

    pub(super) fn run_info(&self) -> RunInfo<'_> {
        RunInfo {
            name: "cartpole-made-up",
            focus: Focus::Learning,
            spec: &self.spec,
            scene: Some(&self.scene),
            agents: self.agents,
            ranks: Ranks::SINGLE,
            bonus: BonusRange::UpTo(0.01),
            max_episodes: self.rounds.len() as u32,
            run_seed: 7,
            scenario: "Scenario(\n    environment: \"cartpole\",\n    agents: (count: 4),\n)",
            properties: &[],
        }
    }
}

fn cart_pole_spec() -> TaskSpec {
    let quantity = |name: &str, unit: &str, end: f32| Quantity {
        name: name.into(),
        unit: unit.into(),
        range: [-end, end],
    };
    TaskSpec {
        name: "cartpole".to_owned(),
        description: "Keep a pole upright on a cart.".to_owned(),
        observations: vec![
            quantity("x", "m", 2.4),
            quantity("x_dot", "m/s", 3.0),
            quantity("theta", "rad", 0.209),
            quantity("theta_dot", "rad/s", 3.0),
        ],
        actions: vec![Action {
            quantity: quantity("force", "N", 10.0),
            choice: Choice::Discrete(vec![-10.0, 10.0]),
        }],
        control_step: 0.02,
        time_limit: 200,
        reward_threshold: Some(195.0),
        info: Vec::new(),
    }
}

fn cart_and_pole() -> Scene {
    let body = |name: &str, shapes| SceneBody {
        name: name.to_owned(),
        is_fixed: name == "rail",
        color: None,
        shapes,
        hinge: None,
    };
    Scene {
        bodies: vec![
            body("rail", vec![Shape::Polyline(vec![[-2.4, 0.0], [2.4, 0.0]])]),
            body(
                "cart",
                vec![Shape::Box {
                    center: [0.0, 0.0],
                    half_size: [0.25, 0.125],
                    angle: 0.0,
                }],
            ),
            body(
                "pole",
                vec![Shape::Capsule {
                    from: [0.0, 0.0],
                    to: [0.0, 1.0],
                    radius: 0.04,
                }],
            ),
        ],
        tracked: None,
        ropes: Vec::new(),
    }
}

/// A round in which the controllers of all agents have the skill `round / rounds`, at most 0.9.
fn synthetic_round(agents: u32, round: u32, rounds: u32, env_steps: &mut u64) -> SyntheticRound {
    let skill = (f64::from(round) / f64::from(rounds)).min(0.9);
    let played: Vec<(Episode, EpisodeDetails)> = (0..agents)
        .map(|agent| synthetic_episode(agent, round, skill))
        .collect();
    let row = |episode: &Episode| {
        *env_steps += episode.length() as u64;
        EpisodeRow {
            agent: episode.agent,
            episode: round,
            round,
            env_steps: *env_steps,
            r#return: episode.total_reward(),
            length: episode.length() as u32,
            outcome: episode.outcome,
            coverage: skill,
            visitation_entropy: 0.0,
            team_overlap: 1.0,
            effective_agents: 1.0,
        }
    };
    let episodes: Vec<Episode> = played.iter().map(|(episode, _)| episode.clone()).collect();
    SyntheticRound {
        round,
        episode_rows: episodes.iter().map(row).collect(),
        step_data: episodes.iter().map(synthetic_step_data).collect(),
        round_rows: (0..agents)
            .map(|agent| synthetic_round_row(agent, round, skill))
            .collect(),
        details: round
            .is_multiple_of(10)
            .then(|| played[0].1.clone())
            .into_iter()
            .collect(),
        episodes,
    }
}

fn synthetic_round_row(agent: u32, round: u32, skill: f64) -> RoundRow {
    let wave = ((round + 9 * agent) as f32 * 0.7).sin() * 0.05;
    let remaining_skill = 1.0 - skill as f32;
    RoundRow {
        agent,
        round,
        gradient_steps: Some(2.0),
        value_loss: Some(remaining_skill * remaining_skill + wave.abs()),
        policy_loss: Some(-0.02 * remaining_skill + 0.1 * wave),
        ratio_deviation: Some(1.1 + wave),
        largest_ratio: Some(2.0 + wave),
        intrinsic_reward: Some(0.01 + wave),
        prediction_error: Some(0.5 + wave),
        bonus_agreement: Some(0.3 + wave),
        clipped_fraction: Some(0.2 + wave),
        entropy: Some(0.69 * remaining_skill + wave.abs()),
        coverage: 0.4 * skill.sqrt() + 0.01 * f64::from(agent),
        visitation_entropy: 3.0 * skill + 0.01 * f64::from(agent),
        visitation_evenness: 0.5 * skill,
        team_coverage: 0.5 * skill.sqrt(),
        team_overlap: 0.8,
        effective_agents: 1.0 + f64::from(round),
        recent_overlap: Some(0.7),
        recent_effective_agents: Some(1.5 + f64::from(round)),
        first_coverage: Some(0.1 * skill),
        new_coverage: Some(0.01 * skill),
        new_coverage_rate: Some(0.02 * skill),
    }
}

/// An episode of a controller that pushes at random or according to a linear function of the state.
/// The larger `skill` is, the more often it uses the state.
fn synthetic_episode(agent: u32, round: u32, skill: f64) -> (Episode, EpisodeDetails) {
    let mut noise = UniformNoise((u64::from(agent) << 32) | (u64::from(round) << 8) | 1);
    let mut state = [0.0_f64; 4].map(|_| noise.uniform() * 0.05);
    let mut episode = Episode {
        agent,
        episode: round,
        round,
        observations: state.map(|x| x as f32).to_vec(),
        actions: Vec::new(),
        rewards: Vec::new(),
        log_probs: Vec::new(),
        outcome: Status::Truncated,
    };
    let mut details = EpisodeDetails {
        agent,
        episode: round,
        poses: poses(state).to_vec(),
        ..EpisodeDetails::default()
    };
    while episode.length() < 200 {
        let control_signal = 0.05 * (state[0] + 0.3 * f64::from(agent) - 0.5)
            + 0.1 * state[1]
            + state[2]
            + 0.3 * state[3];
        let uses_state = noise.uniform().abs() < skill + 0.1;
        let pushes_right = if uses_state {
            control_signal > 0.0
        } else {
            noise.uniform() > 0.0
        };
        state = next_state(state, if pushes_right { 10.0 } else { -10.0 });
        episode.actions.push(f32::from(u8::from(pushes_right)));
        episode.rewards.push(1.0);
        episode
            .log_probs
            .push(-(1.0 + noise.uniform().abs() as f32).ln());
        episode.observations.extend(state.map(|x| x as f32));
        details.poses.extend(poses(state));
        if state[0].abs() > 2.4 || state[2].abs() > 0.209 {
            episode.outcome = Status::Terminated;
            break;
        }
    }
    (episode, details)
}

fn synthetic_step_data(episode: &Episode) -> StepData {
    let steps = 0..episode.length();
    StepData {
        intrinsic_rewards: steps.clone().map(|t| 0.001 * (t % 10) as f32).collect(),
        advantages: steps.map(|t| t as f32 - 30.0).collect(),
        ..StepData::empty_for(episode)
    }
}

/// Poses of the bodies of [`cart_and_pole`] for a state.
fn poses([x, _, theta, _]: [f64; 4]) -> [Pose; 3] {
    let cart = Pose {
        x: x as f32,
        y: 0.1,
        angle: 0.0,
    };
    [
        Pose::default(),
        cart,
        Pose {
            angle: -theta as f32,
            ..cart
        },
    ]
}

/// One step of 0.02 s of the cart-pole equations.
fn next_state([x, v, theta, omega]: [f64; 4], force: f64) -> [f64; 4] {
    let push = (force + 0.05 * omega * omega * theta.sin()) / 1.1;
    let alpha = (9.8 * theta.sin() - theta.cos() * push)
        / (0.5 * (4.0 / 3.0 - 0.1 * theta.cos().powi(2) / 1.1));
    let a = push - 0.05 * alpha * theta.cos() / 1.1;
    [
        x + 0.02 * v,
        v + 0.02 * a,
        theta + 0.02 * omega,
        omega + 0.02 * alpha,
    ]
}

struct UniformNoise(u64);

impl UniformNoise {
    /// Draws a number uniformly from −1 to 1.
    fn uniform(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}
