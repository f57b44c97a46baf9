//! `envs/README.md` and the pages of its reference are up to date: their task files run, and they name every construct of task
//! files.

use seedbed_env::{Physics, build, parse};
use seedbed_random::{Purpose, stream};

const PAGE: &str = concat!(
    include_str!("../../../../envs/README.md"),
    include_str!("../../../../docs/task_bodies.md"),
    include_str!("../../../../docs/task_joints.md"),
    include_str!("../../../../docs/task_observations.md"),
    include_str!("../../../../docs/task_draws.md"),
    include_str!("../../../../docs/task_contacts.md"),
    include_str!("../../../../docs/task_fields.md"),
    include_str!("../../../../docs/tabular.md"),
);

/// The page's blocks of RON, which are whole files.
fn files() -> Vec<&'static str> {
    PAGE.split("```ron\n")
        .skip(1)
        .map(|rest| rest.split("```").next().expect("a block has an end"))
        .collect()
}

#[test]
fn every_file_of_the_page_runs() {
    let files = files();
    assert!(files.len() >= 5);
    for (index, text) in files.into_iter().enumerate() {
        let task = parse("mine", &format!("block {index}"), text.to_owned())
            .unwrap_or_else(|error| panic!("{error}"));
        let analytic = task.has_analytic_model().then_some(Physics::Analytic);
        for physics in [Physics::Rapier].into_iter().chain(analytic) {
            let mut environment = build(&task, physics, 1).unwrap();
            environment.reset(0, &mut stream(0, Purpose::Reset, 0, 0));
            let before = environment.observations().to_vec();
            let actions = vec![1.0; environment.spec().actions.len()];
            (0..5).for_each(|_| environment.step(&actions));
            assert_ne!(
                before,
                environment.observations(),
                "block {index}: nothing moves"
            );
            assert!(
                environment
                    .observations()
                    .iter()
                    .all(|value| value.is_finite())
            );
        }
    }
}

/// A place in the pages' fourth file, and what replaces it: text with a word that is unknown there.
const UNKNOWN_WORDS: &[(&str, &str)] = &[
    ("Environment(", "Environment(zzz: 1,"),
    ("time_limit: 500,", "time_limit: 500, solver: (zzz: 1),"),
    ("(name: \"bead\",", "(zzz: 1, name: \"bead\","),
    ("Ball(radius: 0.05)", "Zzz()"),
    ("Ball(radius: 0.05)", "Ball(zzz: 1)"),
    ("Ball(radius: 0.05)", "Box(zzz: 1)"),
    ("Ball(radius: 0.05)", "Capsule(zzz: 1)"),
    ("drawn: (", "colliders: [(zzz: 1)], drawn: ("),
    ("drawn: (", "forces: [(zzz: 1)], drawn: ("),
    ("reward:", "ropes: [(zzz: 1)], reward:"),
    ("reward:", "ropes: [(from: (zzz: 1))], reward:"),
    ("reward:", "fluid: (zzz: 1), reward:"),
    ("reward:", "contact_softness: (zzz: 1), reward:"),
    ("reward:", "markers: [(zzz: 1)], reward:"),
    ("Ball(radius: 0.05)", "Terrain(zzz: 1)"),
    ("Ball(radius: 0.05)", "Terrain(drawn: [(zzz: 1)])"),
    ("Ball(radius: 0.05)", "Terrain(values: [(zzz: 1)])"),
    ("reward:", "drawn_per_episode: [(zzz: 1)], reward:"),
    ("reward:", "drawn_per_step: [(zzz: 1)], reward:"),
    (
        "name: \"wire\",",
        "name: \"wire\", range_softness: (zzz: 1),",
    ),
    ("JointPosition(\"wire\")", "SubtreeVelocity(zzz: 1)"),
    ("drawn: (", "forces: [(frame: Zzz)], drawn: ("),
    ("Ball(radius: 0.05)", "HalfSpace(zzz: 1)"),
    ("drawn: (", "drawn: (zzz: 1, "),
    ("name: \"wire\",", "name: \"wire\", zzz: 1,"),
    ("Slide(axis: (1.0, 0.0))", "Zzz()"),
    ("Slide(axis: (1.0, 0.0))", "Slide(zzz: 1)"),
    ("Slide(axis: (1.0, 0.0))", "Hinge(zzz: 1)"),
    ("Slide(axis: (1.0, 0.0))", "Hinge(positive: Zzz)"),
    ("(name: \"pull\",", "(zzz: 1, name: \"pull\","),
    ("JointForce(\"wire\")", "Zzz(\"wire\")"),
    ("JointForce(\"wire\")", "VelocityServo(zzz: 1)"),
    ("JointForce(\"wire\")", "PositionServo(zzz: 1)"),
    ("JointForce(\"wire\")", "SpeedMotor(zzz: 1)"),
    ("JointForce(\"wire\")", "BodyForce(zzz: 1)"),
    ("Continuous(-1.0, 1.0)", "Zzz(1)"),
    ("JointPosition(\"wire\")", "BodyPosition(zzz: 1)"),
    ("JointPosition(\"wire\")", "BodyPosition(axis: Zzz)"),
    ("JointPosition(\"wire\")", "BodyVelocity(zzz: 1)"),
    ("JointPosition(\"wire\")", "Ray(zzz: 1)"),
    ("JointPosition(\"wire\")", "Zzz(\"wire\")"),
    ("(name: \"x\", unit", "(zzz: 1, name: \"x\", unit"),
    ("(joint: \"wire\",", "(zzz: 1, joint: \"wire\","),
    ("Uniform(-0.1, 0.1)", "Zzz(1)"),
    ("if abs(x) > 0.9 { 1 } else { 0 }", "zzz(x)"),
    ("reward:", "analytic: Zzz(), reward:"),
    ("reward:", "analytic: CartPole(zzz: 1), reward:"),
    (
        "reward:",
        "analytic: CartPole(slider: \"wire\", hinge: \"wire\", integrator: Zzz), reward:",
    ),
    ("reward:", "analytic: Acrobot(zzz: 1), reward:"),
];

/// The error about an unknown word lists all words that are known in its place. The page must name
/// each of them.
#[test]
fn the_page_names_every_construct() {
    let file = files()[3];
    for &(place, replacement) in UNKNOWN_WORDS {
        assert!(file.contains(place), "{place}");
        let error = parse("mine", "mine", file.replacen(place, replacement, 1)).unwrap_err();
        let known = error
            .message
            .split_once(", expected one of ")
            .or(error.message.split_once(", expected "));
        let (_, names) = known.unwrap_or_else(|| panic!("{replacement}: {error}"));
        for name in names.split('`').skip(1).step_by(2) {
            let named = PAGE.contains(&format!("`{name}`")) || PAGE.contains(&format!("`{name}("));
            assert!(
                named,
                "the page does not name `{name}`, which `{}` can contain",
                error.field
            );
        }
    }
}
