//! Tasks with contacts as a whole: a good policy solves them, random actions do not, and no body
//! passes through a wall.

use rand::RngExt;
use seedbed_env::{Environment, Physics, Status, TaskDescription, build, load};
use seedbed_random::{Purpose, Stream, stream};

fn task(name: &str) -> TaskDescription {
    let path = crate::repository().join(format!("envs/{name}.ron"));
    load(&path).unwrap_or_else(|error| panic!("{error}"))
}

fn environment(name: &str, copies: usize) -> Box<dyn Environment> {
    build(&task(name), Physics::Rapier, copies).expect("every task has rigid bodies")
}

/// Returns and lengths of `episodes` episodes in one copy under `policy`, which maps an observation
/// to an action.
fn play(name: &str, episodes: u32, policy: &dyn Fn(&[f32]) -> Vec<f32>) -> Vec<(f32, u32)> {
    play_in(&mut *environment(name, 1), episodes, policy)
}

/// Like [`play`], in the only copy of an environment.
fn play_in(
    environment: &mut dyn Environment,
    episodes: u32,
    policy: &dyn Fn(&[f32]) -> Vec<f32>,
) -> Vec<(f32, u32)> {
    let episode = |episode| {
        environment.reset(0, &mut stream(5, Purpose::Reset, 0, episode));
        let (mut total, mut steps) = (0.0, 0);
        while environment.statuses()[0] == Status::Running {
            let action = policy(environment.observations());
            environment.step(&action);
            total += environment.rewards()[0];
            steps += 1;
        }
        (total, steps)
    };
    (0..episodes).map(episode).collect()
}

/// `heuristic` of Gymnasium's lunar_lander.py, which lands with over 200 points according to its
/// documentation.
fn gyms_heuristic(s: &[f32]) -> Vec<f32> {
    let target = (s[0] * 0.5 + s[2]).clamp(-0.4, 0.4);
    let hover_target = 0.55 * s[0].abs();
    let landed = s[6] + s[7] > 0.5;
    let turn = if landed {
        0.0
    } else {
        (target - s[4]) * 0.5 - s[5]
    };
    let hover = if landed {
        -s[3] * 0.5
    } else {
        (hover_target - s[1]) * 0.5 - s[3] * 0.5
    };
    if hover > turn.abs() && hover > 0.05 {
        return vec![2.0];
    }
    let engine = match turn {
        ..-0.05 => 3.0,
        0.05.. => 1.0,
        _ => 0.0,
    };
    vec![engine]
}

#[test]
fn gyms_own_controller_lands_the_lander() {
    let episodes = play("lander", 50, &gyms_heuristic);
    let landed = episodes.iter().filter(|(total, _)| *total > 200.0).count();
    assert!(landed >= 40, "{landed} of 50 landed: {episodes:?}");
    let falling = play("lander", 20, &|_| vec![0.0]);
    let crashed = falling.iter().filter(|(total, _)| *total < 0.0).count();
    assert!(
        crashed >= 16,
        "only {crashed} of 20 crashed without engines: {falling:?}"
    );
}

/// In the northern corridor, pushes are turned by a right angle to the left: to move north, push to
/// the right.
fn to_the_northern_tip(s: &[f32]) -> Vec<f32> {
    let aside = (-4.0 * s[0] - 2.0 * s[2]).clamp(-1.0, 1.0);
    if s[0] * s[0] + s[1] * s[1] < 1.69 {
        vec![aside, 1.0]
    } else {
        vec![1.0, -aside]
    }
}

#[test]
fn a_policy_that_knows_the_corridors_reaches_the_tip() {
    for (total, steps) in play("corridors", 50, &to_the_northern_tip) {
        assert!(
            total == 1.0 && steps < 150,
            "return {total} in {steps} steps"
        );
    }
    // A policy that keeps pushing as in the hub is pressed against a wall.
    let held = play("corridors", 20, &|_| vec![0.0, 1.0]);
    assert!(held.iter().all(|(total, _)| *total == 0.0), "{held:?}");
}

/// Pushes along a diagonal, given by its unit vector times √2, and back to its middle.
fn along_the_diagonal(s: &[f32], [x, y]: [f32; 2]) -> [f32; 2] {
    let aside = 2.0 * (y * s[0] - x * s[1]) + y * s[2] - x * s[3];
    [
        (x - y * aside).clamp(-1.0, 1.0),
        (y + x * aside).clamp(-1.0, 1.0),
    ]
}

fn to_the_south_eastern_tip(s: &[f32]) -> Vec<f32> {
    along_the_diagonal(s, [1.0, -1.0]).to_vec()
}

/// In the north-eastern corridor, pushes are reversed.
fn to_the_north_eastern_tip(s: &[f32]) -> Vec<f32> {
    let sign = if s[0] * s[0] + s[1] * s[1] < 1.69 {
        1.0
    } else {
        -1.0
    };
    along_the_diagonal(s, [1.0, 1.0])
        .map(|push| sign * push)
        .to_vec()
}

#[test]
fn rewards_in_other_corridors_are_reached_there_only() {
    assert_reached_in_one_only(
        "corridors_south_east",
        "corridors_north_east",
        &to_the_south_eastern_tip,
    );
    assert_reached_in_one_only(
        "corridors_north_east",
        "corridors_south_east",
        &to_the_north_eastern_tip,
    );
}

fn assert_reached_in_one_only(task: &str, other: &str, policy: &dyn Fn(&[f32]) -> Vec<f32>) {
    let episodes = play(task, 20, policy);
    assert!(
        episodes
            .iter()
            .all(|&(total, steps)| total == 1.0 && steps < 150),
        "{task}: {episodes:?}"
    );
    let elsewhere = play(other, 5, policy);
    assert!(
        elsewhere.iter().all(|(total, _)| *total == 0.0),
        "{other}: {elsewhere:?}"
    );
}

/// The first run seed with which a task draws this number as its first one, and the task of its run.
fn run_with(task: &TaskDescription, number: f32) -> TaskDescription {
    let runs = (0..1000).map(|run_seed| task.for_run(run_seed).into_owned());
    let has_number = |run: &TaskDescription| {
        let bodies = run.body_task().expect("the task has rigid bodies");
        bodies.run_constants[0].value == number
    };
    runs.into_iter()
        .find(has_number)
        .expect("one of 1000 runs draws it")
}

/// Plays episodes in a run that draws this number.
fn play_in_run(
    name: &str,
    number: f32,
    episodes: u32,
    policy: &dyn Fn(&[f32]) -> Vec<f32>,
) -> Vec<(f32, u32)> {
    let run = run_with(&task(name), number);
    let mut environment = build(&run, Physics::Rapier, 1).expect("it has rigid bodies");
    play_in(&mut *environment, episodes, policy)
}

/// Unit vector along a corridor.
fn direction(corridor: u8) -> [f32; 2] {
    let angle = f32::from(corridor) * std::f32::consts::FRAC_PI_4;
    [angle.cos(), angle.sin()]
}

/// The largest push along a corridor, and back to its middle.
fn along_the_corridor(s: &[f32], corridor: u8) -> [f32; 2] {
    let [x, y] = direction(corridor);
    let aside = 4.0 * (x * s[1] - y * s[0]) + 2.0 * (x * s[3] - y * s[2]);
    [x * 1.5 + y * aside, y * 1.5 - x * aside]
}

/// The push that has the effect of another one without the rules of a corridor in corridors.ron.
fn against_the_rule(s: &[f32], corridor: u8, [x, y]: [f32; 2]) -> [f32; 2] {
    match corridor {
        _ if s[0] * s[0] + s[1] * s[1] < 1.69 => [x, y],
        1 => [-x, -y],
        2 => [y, -x],
        _ => [x, y],
    }
}

/// Plays 20 episodes in the run whose goal is `goal`, towards the end of `corridor`.
fn play_corridor(name: &str, has_rules: bool, goal: u8, corridor: u8) -> Vec<(f32, u32)> {
    let policy = |s: &[f32]| {
        let mut push = along_the_corridor(s, corridor);
        if has_rules {
            push = against_the_rule(s, corridor, push);
        }
        push.map(|push| push.clamp(-1.0, 1.0)).to_vec()
    };
    play_in_run(name, goal.into(), 20, &policy)
}

/// For each of the goals, a policy that knows where the goal is reaches it. The same policy is
/// never rewarded in a run with another goal.
/// `play`: episodes in the run that draws the first goal, with the policy that knows the second one.
fn assert_each_goal_can_be_reached(
    name: &str,
    goals: u8,
    max_steps: u32,
    play: impl Fn(u8, u8) -> Vec<(f32, u32)>,
) {
    for goal in 0..goals {
        let episodes = play(goal, goal);
        assert!(
            episodes
                .iter()
                .all(|&(total, steps)| total == 1.0 && steps <= max_steps),
            "{name}, goal {goal}: {episodes:?}"
        );
        let elsewhere = play((goal + 1) % goals, goal);
        assert!(
            elsewhere.iter().all(|&(total, _)| total == 0.0),
            "{name}, not the goal {goal}: {elsewhere:?}"
        );
    }
}

#[test]
fn each_goal_that_a_run_draws_can_be_reached() {
    for (name, has_rules, max_steps) in [
        ("corridors_drawn_short", false, 60),
        ("corridors_drawn", false, 100),
        ("corridors_drawn_long", false, 150),
        ("corridors_noisy", false, 100),
        ("corridors_rules", true, 200),
    ] {
        assert_each_goal_can_be_reached(name, 8, max_steps, |drawn, known| {
            play_corridor(name, has_rules, drawn, known)
        });
    }
}

/// The push through a corridor with hooks, in the frame of its first lane: to the end of a lane, aside to the next one, and so on.
/// `s`: place and velocity in this frame
fn through_hooks([along, aside, v_along, v_aside]: [f32; 4], hooks: f32) -> [f32; 2] {
    let lane = (0.5 * aside + 0.5).floor().max(0.0);
    let is_in_lane = (aside - 2.0 * lane).abs() < 0.45;
    let end_of = |lane: f32| if lane % 2.0 == 0.0 { 5.5 } else { 2.5 };
    let end = end_of(lane);
    let target = if is_in_lane && lane == hooks {
        [if end > 5.0 { 5.9 } else { 2.1 }, 2.0 * lane]
    } else if is_in_lane && (along - end).abs() > 0.2 {
        [end, 2.0 * lane]
    } else {
        let below = (aside / 2.0).floor().max(0.0);
        [end_of(if is_in_lane { lane } else { below }), aside + 1.0]
    };
    [
        3.0 * (target[0] - along) - 2.0 * v_along,
        3.0 * (target[1] - aside) - 2.0 * v_aside,
    ]
}

/// The policy `push` in the frame of a corridor, of the puck's place and velocity in this frame and how far the block there was pushed.
fn in_corridor(goal: u8, push: impl Fn([f32; 4], f32) -> [f32; 2]) -> impl Fn(&[f32]) -> Vec<f32> {
    let angle = f32::from(goal) * std::f32::consts::FRAC_PI_2;
    let (sin, cos) = angle.sin_cos();
    move |s| {
        let in_frame = |x: f32, y: f32| [cos * x + sin * y, cos * y - sin * x];
        let ([along, aside], [v, w]) = (in_frame(s[0], s[1]), in_frame(s[2], s[3]));
        let block = s.get(4 + usize::from(goal)).copied().unwrap_or(f32::MAX);
        let [a, b] = push([along, aside, v, w], block);
        [cos * a - sin * b, sin * a + cos * b]
            .map(|push| push.clamp(-1.0, 1.0))
            .to_vec()
    }
}

/// A policy that knows the corridor walks through its hooks, and is never rewarded in a run with another one.
#[test]
fn corridors_with_hooks_can_be_walked_through() {
    for (name, hooks, max_steps) in [
        ("hooks_1", 1.0, 100),
        ("hooks_3", 3.0, 190),
        ("hooks_4", 4.0, 224),
    ] {
        assert_each_goal_can_be_reached(name, 4, max_steps, |drawn, known| {
            let policy = in_corridor(known, |s, _| through_hooks(s, hooks));
            play_in_run(name, drawn.into(), 5, &policy)
        });
    }
}

/// Likewise, after it has pushed the block out of the way. One that does not push for long enough sticks in front of it.
#[test]
fn plugs_can_be_pushed_away() {
    for (name, hooks, max_steps) in [("plugs_2", 2.0, 180), ("plugs_3", 3.0, 230)] {
        let push_until = |far: f32, goal: u8| {
            in_corridor(goal, move |s: [f32; 4], block| {
                let in_first_lane = s[1].abs() < 0.45;
                if in_first_lane && block < far {
                    [1.0, -s[1] - s[3]]
                } else {
                    through_hooks(s, hooks)
                }
            })
        };
        assert_each_goal_can_be_reached(name, 4, max_steps, |drawn, known| {
            play_in_run(name, drawn.into(), 5, &push_until(2.3, known))
        });
        for goal in 0..4 {
            let stuck = play_in_run(name, goal.into(), 2, &push_until(0.5, goal));
            assert!(
                stuck.iter().all(|&(total, _)| total == 0.0),
                "{name}: {stuck:?}"
            );
        }
    }
}

/// A rod that is turned along its push is moved through the hooks. A constant push to any side sticks at the first bend.
#[test]
fn rods_can_be_turned_through_bends() {
    let policy = |goal: u8| {
        let push = in_corridor(goal, |s, _| through_hooks(s, 3.0));
        move |s: &[f32]| {
            let [push_x, push_y] = [push(s)[0], push(s)[1]];
            let direction = 2.0 * push_y.atan2(push_x);
            // sin of twice the angle from the rod to the push: half a turn is no difference.
            let error = direction.sin() * s[4] - direction.cos() * s[5];
            let turn = (2.0 * error - 0.5 * s[6]).clamp(-1.0, 1.0);
            vec![push_x, push_y, turn]
        }
    };
    assert_each_goal_can_be_reached("rods_3", 4, 215, |drawn, known| {
        play_in_run("rods_3", drawn.into(), 5, &policy(known))
    });
    for side in 0..8_u8 {
        let (y, x) = (f32::from(side) * std::f32::consts::FRAC_PI_4).sin_cos();
        let pushed = play_in_run("rods_3", 0.0, 2, &|_| vec![x, y, 0.0]);
        assert!(pushed.iter().all(|&(total, _)| total == 0.0), "{pushed:?}");
    }
}

/// A drone that hovers rises through the holes of the floors, to the end of the hall that the run draws. Propellers that push alike
/// lift it to the first ceiling, and no further.
#[test]
fn storeys_are_reached_by_hovering() {
    for (name, storeys, max_steps) in [("storeys_1", 1, 140), ("storeys_2", 2, 200)] {
        assert_each_goal_can_be_reached(name, 2, max_steps, |drawn, known| {
            let side = 1.0 - 2.0 * f32::from(known);
            play_in_run(name, drawn.into(), 5, &|s| fly_up(s, side, storeys))
        });
        let below = play_in_run(name, 0.0, 2, &|_| vec![0.7, 0.7]);
        assert!(
            below.iter().all(|&(total, _)| total == 0.0),
            "{name}: {below:?}"
        );
    }
}

/// Thrusts of a drone that flies to the next hole, or in the uppermost storey to the end of the hall: an angle that accelerates it
/// towards the place, and a mean thrust that holds the height.
fn fly_up(s: &[f32], side: f32, storeys: u8) -> Vec<f32> {
    let (x, y, angle_rate) = (side * s[0], s[1], s[5]);
    let [x_dot, y_dot] = [side * s[3], s[4]];
    let storey = (y / 2.0).floor();
    let next_x = if storey % 2.0 == 0.0 { 4.4 } else { 0.8 };
    let rises = storey < f32::from(storeys) && (x - next_x).abs() < 0.35;
    let next_y = 2.0 * storey + if rises { 3.0 } else { 1.0 };
    let angle = -side * (0.15 * (next_x - x) - 0.25 * x_dot).clamp(-0.2, 0.2);
    let lift = 0.5 + 0.4 * (next_y - y) - 0.3 * y_dot;
    let turn = 1.5 * angle - 0.3 * angle_rate;
    [lift - turn, lift + turn]
        .map(|push| push.clamp(-1.0, 1.0))
        .to_vec()
}

/// A motor that pushes with the motion crosses hills, and one that pushes to one side never does. Where the car moves to the wrong
/// side of its valley with enough energy to leave it, it brakes.
#[test]
fn hills_are_crossed_by_swinging() {
    for (name, side) in [
        ("hills_1", 0_u8),
        ("hills_3", 0),
        ("hills_3", 1),
        ("hills_5", 1),
    ] {
        let to_goal = 1.0 - 2.0 * f32::from(side);
        let run = run_with(&task(name), f32::from(side));
        let swing = |s: &[f32]| {
            // 2/π (1 − cos(π x/2)) is the potential, 4/π its height.
            let energy = 0.5 * s[1] * s[1]
                + std::f32::consts::FRAC_2_PI * (1.0 - (std::f32::consts::FRAC_PI_2 * s[0]).cos());
            let is_wrong = s[1] * to_goal < 0.0 && energy > 1.1;
            vec![if is_wrong {
                -s[1].signum()
            } else {
                s[1].signum()
            }]
        };
        let mut environment = build(&run, Physics::Rapier, 1).unwrap();
        let swung = play_in(&mut *environment, 10, &swing);
        assert!(
            swung.iter().all(|&(total, _)| total == 1.0),
            "{name}, side {side}: {swung:?}"
        );
        let pushed = play_in(&mut *environment, 10, &|_: &[f32]| vec![to_goal]);
        assert!(
            pushed.iter().all(|&(total, _)| total == 0.0),
            "{name}: {pushed:?}"
        );
    }
}

/// A car that swings towards a valley, and brakes there, stops in this valley and in no other.
#[test]
fn a_weak_car_stops_in_the_valley_that_a_run_draws() {
    let policy = |valley: u8| {
        let place = [4.0, 8.0, -4.0, -8.0][usize::from(valley)];
        move |s: &[f32]| {
            let (away, forward) = (place - s[0], s[1].signum());
            let energy = 0.5 * s[1] * s[1]
                + std::f32::consts::FRAC_2_PI * (1.0 - (std::f32::consts::FRAC_PI_2 * s[0]).cos());
            let leaves_wrongly = s[1] * away < 0.0 && energy > 1.1;
            vec![if away.abs() < 2.0 || leaves_wrongly {
                -forward
            } else {
                forward
            }]
        }
    };
    assert_each_goal_can_be_reached("valleys_2", 4, 500, |drawn, known| {
        play_in_run("valleys_2", drawn.into(), 5, &policy(known))
    });
    let pushed = play_in_run("valleys_2", 0.0, 5, &|_| vec![1.0]);
    assert!(pushed.iter().all(|&(total, _)| total == 0.0), "{pushed:?}");
}

/// A torque with the motion of the elbow adds energy until the tip is high on either side; a constant one does not lift it.
#[test]
fn a_weak_motor_swings_two_links_up() {
    for side in [0.0, 1.0] {
        let run = run_with(&task("acrobot_side"), side);
        let mut environment = build(&run, Physics::Rapier, 1).unwrap();
        let swung = play_in(&mut *environment, 20, &|s: &[f32]| vec![s[5].signum()]);
        let successes = swung.iter().filter(|&&(total, _)| total == 1.0).count();
        assert!(successes >= 3, "side {side}: {swung:?}");
        let pushed = play_in(&mut *environment, 10, &|_: &[f32]| vec![1.0]);
        assert!(pushed.iter().all(|&(total, _)| total == 0.0), "{pushed:?}");
    }
}

/// A force that catches the pole, at a set speed, travels to either side; without feedback the pole falls.
#[test]
fn a_pole_travels_with_feedback_only() {
    for side in [0_u8, 1] {
        let direction = 1.0 - 2.0 * f32::from(side);
        let run = run_with(&task("travel_side"), f32::from(side));
        let mut environment = build(&run, Physics::Rapier, 1).unwrap();
        let catch = |s: &[f32]| {
            let force = 2.0 * (s[1] - 1.5 * direction) + 40.0 * s[2] + 8.0 * s[3];
            vec![force.clamp(-10.0, 10.0)]
        };
        let caught = play_in(&mut *environment, 10, &catch);
        assert!(
            caught.iter().all(|&(total, _)| total == 1.0),
            "side {side}: {caught:?}"
        );
        for force in [0.0, 1.0, 10.0] {
            let pushed = play_in(&mut *environment, 10, &|_: &[f32]| vec![force * direction]);
            assert!(pushed.iter().all(|&(total, _)| total == 0.0), "{pushed:?}");
        }
    }
}

/// With a controller that leans by its speed and levels off, the quadrotor reaches the end of the right corridor; with constant
/// thrusts, whatever their sum and difference, it does not.
#[test]
fn a_quadrotor_flies_with_feedback_only() {
    for side in [0_u8, 1] {
        let direction = 1.0 - 2.0 * f32::from(side);
        let run = run_with(&task("quadrotor_side"), f32::from(side));
        let mut environment = build(&run, Physics::Rapier, 1).unwrap();
        // Observations: x, y, angle, their rates.
        let fly = |s: &[f32]| {
            let angle = (0.1 * (s[3] - 1.5 * direction)).clamp(-0.15, 0.15);
            let lift = 2.0 * (3.0 - s[1]) - 1.0 * s[4];
            let turn = 2.0 * (angle - s[2]) - 0.4 * s[5];
            vec![lift - turn, lift + turn]
        };
        let flown = play_in(&mut *environment, 10, &fly);
        assert!(
            flown.iter().all(|&(total, _)| total == 1.0),
            "side {side}: {flown:?}"
        );
        for (lift, turn) in [(0.0, 0.0), (0.02, 0.0), (0.0, 0.001), (0.05, -0.01)] {
            let pushed = play_in(&mut *environment, 10, &|_: &[f32]| {
                vec![lift - turn, lift + turn]
            });
            assert!(pushed.iter().all(|&(total, _)| total == 0.0), "{pushed:?}");
        }
    }
}

/// Thrusts of ±0.1 (9.81/2 N) turn the frame by 2 · 0.1 (9.81/2 N)(0.25 m) / 0.02 kg m² = 12.26 rad/s², by 0.613 rad/s in a step of 0.05 s; gusts of
/// 0.1 add as much (one standard deviation). Mean and deviation over 400 episodes are within five standard errors. A thrust of 0.2 from
/// each lifts it by 1.962 m/s², as far as it does not lean.
#[test]
fn a_quadrotor_turns_by_the_difference_of_its_thrusts() {
    let run = run_with(&task("quadrotor_side"), 0.0);
    let mut environment = build(&run, Physics::Rapier, 1).unwrap();
    let mut rates_after = |action: [f32; 2], episode| {
        environment.reset(0, &mut stream(5, Purpose::Reset, 0, episode));
        environment.step(&action);
        let seen = environment.observations();
        [seen[4], seen[5]]
    };
    let spins: Vec<f32> = (0..400)
        .map(|episode| rates_after([-0.1, 0.1], episode)[1])
        .collect();
    let mean = spins.iter().sum::<f32>() / 400.0;
    let variance = spins.iter().map(|spin| (spin - mean).powi(2)).sum::<f32>() / 399.0;
    assert!((mean - 0.613).abs() < 5.0 * 0.613 / 20.0, "{mean}");
    assert!(
        (variance.sqrt() - 0.613).abs() < 5.0 * 0.613 / 800_f32.sqrt(),
        "{variance}"
    );
    let lift = rates_after([0.2, 0.2], 0)[0];
    assert!((lift - 1.962 * 0.05).abs() < 0.02 * 1.962 * 0.05, "{lift}");
}

/// Noise is uniform from −1 to 1 in the noisy corridor: its mean and its autocorrelation are within
/// five standard errors of 0, its variance is near 1/3, and it goes on when the puck is at rest.
/// Elsewhere it is 0.
#[test]
fn one_corridor_is_noisy() {
    let run = task("corridors_noisy").for_run(7).into_owned();
    let constants = &run.body_task().expect("it has bodies").run_constants;
    let [goal, turns] = [0, 1].map(|index| constants[index].value as u8);
    let mut environment = build(&run, Physics::Rapier, 1).expect("it has rigid bodies");
    let mut noise = Vec::new();
    for corridor in (0..8).filter(|&corridor| corridor != goal) {
        let seen = noise_in(&mut *environment, corridor);
        if corridor == (goal + turns) % 8 {
            noise = seen;
        } else {
            assert!(seen.iter().all(|&value| value == 0.0), "{corridor}");
        }
    }
    let count = noise.len() as f32;
    assert!(count > 1000.0, "{count}");
    let mean = |values: &mut dyn Iterator<Item = f32>| values.sum::<f32>() / count;
    let first = mean(&mut noise.iter().copied());
    let second = mean(&mut noise.iter().map(|value| value * value));
    let products = noise.windows(2).map(|pair| pair[0] * pair[1]);
    let neighbors = mean(&mut products.into_iter());
    let error = (1.0 / (3.0 * count)).sqrt();
    assert!(first.abs() < 5.0 * error, "mean {first}");
    assert!(
        (second - 1.0 / 3.0).abs() < 5.0 * error,
        "variance {second}"
    );
    assert!(neighbors.abs() < 5.0 * error, "autocorrelation {neighbors}");
    // In single precision there are at least 1024 values between −1 and 1.
    let repeated = noise.windows(2).filter(|pair| pair[0] == pair[1]).count();
    assert!(
        repeated * 100 < noise.len(),
        "it stops for {repeated} steps"
    );
}

/// The noise of the steps that a policy spends beyond the hub in a corridor, mostly at its end.
fn noise_in(environment: &mut dyn Environment, corridor: u8) -> Vec<f32> {
    let mut seen = Vec::new();
    for episode in 0..10 {
        environment.reset(0, &mut stream(5, Purpose::Reset, 0, episode));
        while environment.statuses()[0] == Status::Running {
            let s = environment.observations().to_vec();
            if s[0] * s[0] + s[1] * s[1] > 1.7 {
                seen.push(s[8]);
            }
            let push = along_the_corridor(&s, corridor);
            environment.step(&push.map(|push| push.clamp(-1.0, 1.0)));
        }
    }
    seen
}

/// Three legs: to the right below the wall, up beyond it, to the left above it.
fn around_the_corner(s: &[f32]) -> Vec<f32> {
    let aim = match (s[0], s[1]) {
        (x, y) if y > 0.7 && x > -2.0 => (-1.0, 1.0),
        (x, y) if x > 0.8 && y > -2.0 => (1.0, 1.2),
        _ => (1.1, -1.0),
    };
    let push =
        |target: f32, now: f32, rate: f32| ((target - now) * 2.0 - rate * 0.6).clamp(-1.0, 1.0);
    vec![push(aim.0, s[0], s[2]), push(aim.1, s[1], s[3])]
}

#[test]
fn a_policy_that_knows_the_maze_gets_through() {
    for (total, steps) in play("puck_maze", 50, &around_the_corner) {
        assert!(
            total == 1.0 && steps < 300,
            "return {total} in {steps} steps"
        );
    }
}

/// Runs 16 copies for 10,000 steps in total under random pushes, each held for `hold` steps, and
/// passes each observation to `check`. Returns the number of episodes that ended, and the number of
/// those that ended with a reward.
fn push_at_random(name: &str, hold: usize, check: &mut dyn FnMut(&[f32])) -> (u32, u32) {
    const COPIES: usize = 16;
    let mut environment = environment(name, COPIES);
    let width = environment.spec().action_width();
    let mut random: Stream = stream(9, Purpose::Action, 0, 0);
    (0..COPIES).for_each(|copy| environment.reset(copy, &mut random));
    let (mut ended, mut rewarded, mut actions) = (0, 0, vec![0.0; COPIES * width]);
    for step in 0..10_000 / COPIES {
        if step % hold == 0 {
            for action in &mut actions {
                *action = random.random_range(-1.0..=1.0);
            }
        }
        environment.step(&actions);
        environment
            .observations()
            .chunks(environment.spec().observation_width())
            .for_each(&mut *check);
        for copy in 0..COPIES {
            if environment.statuses()[copy] != Status::Running {
                (ended, rewarded) = (
                    ended + 1,
                    rewarded + u32::from(environment.rewards()[copy] > 0.0),
                );
                environment.reset(copy, &mut random);
            }
        }
    }
    (ended, rewarded)
}

/// Maximum distance by which the puck's rim may sink into a wall, m: a tenth of the puck's radius.
const MAX_DEPTH: f32 = 0.01;

#[test]
fn no_puck_leaves_the_maze() {
    for hold in [1, 20, 100] {
        let (mut max_x, reach) = (0.0_f32, 1.4 + MAX_DEPTH);
        push_at_random("puck_maze", hold, &mut |s| {
            assert!(
                s[0].abs() <= reach + 0.05 && s[1].abs() <= reach + 0.05,
                "outside at {s:?}"
            );
            let inside_wall = s[0] < 0.5 && s[1].abs() < 0.5;
            assert!(!inside_wall, "in the wall at {s:?}");
            max_x = max_x.max(s[0]);
        });
        assert!(
            hold == 1 || max_x > 1.3,
            "pushes held for {hold} steps never got to the right wall: {max_x}"
        );
    }
}

#[test]
fn no_puck_leaves_the_corridors_and_hardly_any_finds_the_tip() {
    for hold in [1, 20, 100] {
        let mut max_radius = 0.0_f32;
        let (_, rewarded) = push_at_random("corridors", hold, &mut |s| {
            let (radius, angle) = (s[0].hypot(s[1]), s[1].atan2(s[0]));
            let sector =
                (angle / std::f32::consts::FRAC_PI_4).round() * std::f32::consts::FRAC_PI_4;
            let (along, aside) = (
                radius * (angle - sector).cos(),
                radius * (angle - sector).sin(),
            );
            assert!(along < 5.9 + MAX_DEPTH, "through the end at {s:?}");
            assert!(
                along < 1.3 || aside.abs() < 0.4 + MAX_DEPTH,
                "through a wall at {s:?}"
            );
            max_radius = max_radius.max(radius);
        });
        assert!(
            hold == 1 || max_radius > 3.0,
            "pushes held for {hold} steps never went far: {max_radius} m"
        );
        assert!(
            hold > 1 || rewarded == 0,
            "{rewarded} random walks found the tip"
        );
    }
}

/// At most 6 of 600 episodes of a random walk reach the tip; see envs/corridors.ron for how far it
/// gets.
#[test]
fn a_random_walk_rarely_finds_the_tip() {
    let mut random = stream(2, Purpose::Action, 1, 0);
    let random = std::cell::RefCell::new(&mut random);
    let push = |_: &[f32]| {
        let mut random = random.borrow_mut();
        vec![
            random.random_range(-1.0..=1.0),
            random.random_range(-1.0..=1.0),
        ]
    };
    let found = play("corridors", 600, &push)
        .iter()
        .filter(|(total, _)| *total > 0.0)
        .count();
    assert!(found <= 6, "{found} of 600 found it");
}

/// Without control, a hopper falls over. In Gym it does so after about 20 steps of random torques.
#[test]
fn a_hopper_stands_for_a_moment_and_falls() {
    let episodes = play("hopper", 20, &|_| vec![0.0; 3]);
    for (total, steps) in episodes {
        assert!((30..1000).contains(&steps), "{steps} steps");
        assert!(
            total > 0.5 * steps as f32,
            "{total} in {steps} steps: expected 1 per step for being healthy, minus a little for \
             falling backwards"
        );
    }
}

/// A cheetah's springs hold it up: left alone, it comes to rest on its feet and is not rewarded.
#[test]
fn a_cheetah_left_alone_stands() {
    let mut environment = environment("cheetah", 1);
    environment.reset(0, &mut stream(5, Purpose::Reset, 0, 0));
    (0..400).for_each(|_| environment.step(&[0.0; 6]));
    let names: Vec<_> = environment
        .spec()
        .observations
        .iter()
        .map(|observation| observation.name.clone())
        .collect();
    let value = |name: &str| {
        environment.observations()[names
            .iter()
            .position(|known| known == name)
            .expect("it is observed")]
    };
    assert!(
        (0.4..0.75).contains(&value("z")) && value("angle").abs() < 0.3,
        "{:?}",
        environment.observations()
    );
    assert!(
        value("x_dot").abs() < 0.02 && value("z_dot").abs() < 0.02,
        "{:?}",
        environment.observations()
    );
    assert_eq!(environment.rewards()[0], 0.0);
}
