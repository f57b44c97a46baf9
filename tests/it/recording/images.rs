//! Lines, points and density images of visited states, their colors, axes, scales and layout.

use rerun::StoreKind;
use rerun::log::LogMsg;
use seedbed::record::rerun::RerunRecorder;
use seedbed::record::{AxisChoice, ColorBy, Difference, Recorder, RecordingSettings};
use seedbed_env::Status;
use seedbed_env::input::numbers::known_count;
use seedbed_figure::color::dark::sequential_color;

use super::contents::{RecordingContents, messages};
use super::record;
use super::synthetic_run::{SyntheticRound, SyntheticRun};

#[test]
fn visible_lines_do_not_exceed_the_setting() {
    let folder = tempfile::tempdir().unwrap();
    let run = SyntheticRun::new(2, 70);
    for max_lines in [1, 7, 120, 1000] {
        let settings = RecordingSettings {
            lines: known_count(max_lines),
            ..RecordingSettings::default()
        };
        let contents = RecordingContents::read(&record(&run, folder.path(), &settings));
        let lines = contents.lines_per_row("/visitation/agent_1/lines", "LineStrips2D:strips");
        let max_visible = lines
            .windows(50.min(max_lines.max(1) as usize))
            .map(|window| window.iter().sum::<usize>())
            .max();
        assert!(
            max_visible.unwrap_or(0) <= max_lines as usize,
            "{max_visible:?} of {max_lines}"
        );
        assert!(
            max_visible.unwrap_or(0) * 5 >= max_lines as usize,
            "{max_visible:?} of {max_lines}"
        );
    }
}

#[test]
fn images_are_recorded_every_n_rounds_and_after_the_last_round() {
    let folder = tempfile::tempdir().unwrap();
    let settings = RecordingSettings {
        density_every: known_count(5),
        ..RecordingSettings::default()
    };
    let contents =
        RecordingContents::read(&record(&SyntheticRun::new(2, 12), folder.path(), &settings));
    let densities = [
        "/visitation/agent_0/density",
        "/visitation/agent_1/latest",
        "/visitation/team/density",
        "/visitation/team/latest",
    ];
    for entity in densities.into_iter().chain([
        "/visitation/difference",
        "/pairs/agent_1/bonus",
        "/pairs/team/bonus",
    ]) {
        assert_eq!(contents.times(entity, "round"), [0, 5, 10, 11]);
    }
}

/// The image of the latest `window` rounds of a run of 73 rounds equals the image of all rounds of
/// a run that has only these rounds.
#[test]
fn images_of_the_latest_rounds_do_not_depend_on_earlier_rounds() {
    for window in [50, 7] {
        let settings = RecordingSettings {
            window: known_count(window),
            ..RecordingSettings::default()
        };
        assert_latest_images_equal_those_of_a_shorter_run(window, &settings);
    }
}

fn assert_latest_images_equal_those_of_a_shorter_run(window: u32, settings: &RecordingSettings) {
    let folder = tempfile::tempdir().unwrap();
    let (run, first) = (SyntheticRun::new(3, 73), 73 - window);
    let complete = RecordingContents::read(&record(&run, folder.path(), settings));
    for root in [
        "visitation/scale/latest",
        "visitation/team/scale/latest",
        "pairs/scale/bonus",
    ] {
        let note = complete
            .texts(&format!("/{root}/ends"), "Points2D:labels")
            .pop()
            .unwrap();
        assert_eq!(note, format!("rounds {first} to 72"));
    }
    let path = folder.path().join("latest.rrd");
    let mut recorder = RerunRecorder::create(&path, &run.run_info(), settings).unwrap();
    run.rounds[first as usize..]
        .iter()
        .for_each(|round| round.record(&mut recorder));
    recorder.finish().unwrap();
    let latest = RecordingContents::read(&path);
    for (root, latest_image, image_of_all) in [
        ("visitation", "latest", "density"),
        ("pairs", "bonus", "bonus"),
    ] {
        for subject in ["agent_0", "agent_2", "team"] {
            let last = |contents: &RecordingContents, name: &str| {
                contents
                    .image_bytes(&format!("/{root}/{subject}/{name}"))
                    .pop()
                    .unwrap()
            };
            assert!(
                last(&complete, latest_image) == last(&latest, image_of_all),
                "/{root}/{subject}"
            );
        }
    }
}

/// The label at the upper end of a scale is the number of lines on the brightest pixel of the
/// images that share the scale.
#[test]
fn scale_labels_give_the_count_of_the_brightest_color() {
    let folder = tempfile::tempdir().unwrap();
    let contents = RecordingContents::read(&record(
        &SyntheticRun::new(2, 1),
        folder.path(),
        &RecordingSettings::default(),
    ));
    let pixels = |entity| contents.image_bytes(entity).pop().unwrap();
    assert_eq!(
        *pixels("/visitation/agent_0/density")
            .iter()
            .chain(&pixels("/visitation/agent_1/density"))
            .max()
            .unwrap(),
        255
    );
    assert_eq!(
        *pixels("/visitation/team/density").iter().max().unwrap(),
        255
    );
    let scale_end = |entity| {
        contents.texts(entity, "Points2D:labels")[0]
            .parse::<u32>()
            .unwrap()
    };
    let (max_of_agents, max_of_team) = (
        scale_end("/visitation/scale/density/ends"),
        scale_end("/visitation/team/scale/density/ends"),
    );
    assert!(
        max_of_agents > 1 && max_of_team >= max_of_agents && max_of_team <= 2 * max_of_agents,
        "{max_of_agents} and {max_of_team}"
    );
}

#[test]
fn points_show_states_of_their_episode() {
    let folder = tempfile::tempdir().unwrap();
    let run = SyntheticRun::new(2, 12);
    let contents =
        RecordingContents::read(&record(&run, folder.path(), &RecordingSettings::default()));
    let points = contents.points("/pairs/agent_1/states");
    let lengths = run
        .rounds
        .iter()
        .map(|round| round.episodes[1].length() + 1);
    assert_eq!(
        points.len(),
        lengths.clone().map(|states| states.min(20)).sum::<usize>() * 2
    );
    let mut remaining_points = points.as_slice();
    for (round, states) in run.rounds.iter().zip(lengths) {
        let (states_of_round, others) = remaining_points.split_at(states.min(20) * 2);
        let observed: Vec<&[f32]> = round.episodes[1].observations.chunks_exact(4).collect();
        let drawn = |state: &[f32]| {
            let pixel_position =
                |value: f32, scale_end: f32| 40.0 * (0.5 + 0.5 * value / scale_end).clamp(0.0, 1.0);
            [
                [
                    pixel_position(state[0], 2.4),
                    40.0 - pixel_position(state[1], 3.0),
                ],
                [
                    60.0 + pixel_position(state[2], 0.209),
                    40.0 - pixel_position(state[3], 3.0),
                ],
            ]
        };
        let is_close = |one: &[f32; 2], other: &[f32; 2]| {
            (one[0] - other[0]).abs() + (one[1] - other[1]).abs() < 1e-3
        };
        let is_state = |pair: &[[f32; 2]]| {
            observed.iter().any(|state| {
                drawn(state)
                    .iter()
                    .zip(pair)
                    .all(|(one, other)| is_close(one, other))
            })
        };
        assert!(states_of_round.chunks_exact(2).all(is_state));
        remaining_points = others;
    }
    assert_eq!(
        contents
            .lines_per_row("/pairs/team/states", "Points2D:positions")
            .len(),
        24,
        "one row per episode of each agent"
    );
}

#[test]
fn line_colors_follow_the_color_setting() {
    let folder = tempfile::tempdir().unwrap();
    let run = SyntheticRun::new(2, 12);
    let recorded = |color: ColorBy| {
        let settings = RecordingSettings {
            color: color.into(),
            ..RecordingSettings::default()
        };
        RecordingContents::read(&record(&run, folder.path(), &settings))
    };
    let colors = |contents: &RecordingContents| {
        contents.u32_values("/visitation/agent_1/lines", "LineStrips2D:colors")
    };
    let rgba = |[red, green, blue]: [u8; 3]| u32::from_be_bytes([red, green, blue, 255]);
    let lines = |round: &SyntheticRound| (round.episodes[1].length() + 1).min(20);
    let per_episode = |color: &dyn Fn(&SyntheticRound) -> [u8; 3]| -> Vec<u32> {
        run.rounds
            .iter()
            .flat_map(|round| vec![rgba(color(round)); lines(round)])
            .collect()
    };

    assert_eq!(
        colors(&recorded(ColorBy::Episode)),
        per_episode(&|round| sequential_color(round.round as f32 / 11.0))
    );
    let lowest = run.rounds[0]
        .episodes
        .iter()
        .map(|episode| episode.length() as f32)
        .fold(f32::INFINITY, f32::min);
    let share =
        |round: &SyntheticRound| (round.episodes[1].length() as f32 - lowest) / (195.0 - lowest);
    let by_return = recorded(ColorBy::Return);
    assert_eq!(
        colors(&by_return),
        per_episode(&|round| sequential_color(share(round).clamp(0.0, 1.0)))
    );
    let scale_labels = [
        "return".to_owned(),
        "195 or more".to_owned(),
        format!("{lowest} or less"),
    ];
    assert_eq!(
        by_return.texts("/visitation/scale/lines/labels", "Points2D:labels"),
        scale_labels
    );
    let outcome = |round: &SyntheticRound| {
        if round.episodes[1].outcome == Status::Truncated {
            [86, 180, 233]
        } else {
            [225, 95, 20]
        }
    };
    assert_eq!(colors(&recorded(ColorBy::Outcome)), per_episode(&outcome));
    let bonuses: Vec<u32> = colors(&recorded(ColorBy::IntrinsicReward));
    let possible_colors: Vec<u32> = (0..10)
        .map(|bonus| rgba(sequential_color(0.001 * bonus as f32 / 0.01)))
        .collect();
    assert!(
        bonuses.iter().all(|color| possible_colors.contains(color))
            && bonuses.iter().any(|color| *color != bonuses[0])
    );
}

#[test]
fn the_difference_image_compares_the_chosen_agents() {
    let folder = tempfile::tempdir().unwrap();
    let recorded = |agents, difference| {
        let settings = RecordingSettings {
            difference,
            ..RecordingSettings::default()
        };
        let contents = RecordingContents::read(&record(
            &SyntheticRun::new(agents, 3),
            folder.path(),
            &settings,
        ));
        let texts = contents.texts("/visitation/difference/scale/ends", "Points2D:labels");
        (
            contents.image_bytes("/visitation/difference").len(),
            texts.first().cloned(),
            texts.get(3).cloned(),
        )
    };
    let agent = |agent: u32| Some(format!("agent {agent}"));
    assert_eq!(
        recorded(4, Difference::Between(2.into(), 1.into())),
        (2, agent(2), agent(1))
    );
    assert_eq!(
        recorded(2, Difference::MostDifferent),
        (2, agent(0), agent(1))
    );
    assert_eq!(recorded(4, Difference::Off), (0, None, None));
    assert_eq!(recorded(1, Difference::MostDifferent), (0, None, None));
}

/// With axes for observations, the action and the step, the last state of an episode has no line,
/// because no action is taken in it.
#[test]
fn axes_can_show_actions_and_steps() {
    let folder = tempfile::tempdir().unwrap();
    let axes = vec![
        AxisChoice::Observations,
        AxisChoice::Action,
        AxisChoice::Step,
    ];
    let settings = RecordingSettings {
        axes: axes.into(),
        lines: known_count(10_000),
        ..RecordingSettings::default()
    };
    let run = SyntheticRun::new(1, 2);
    let contents = RecordingContents::read(&record(&run, folder.path(), &settings));
    let lengths: Vec<usize> = run
        .rounds
        .iter()
        .map(|round| round.episodes[0].length())
        .collect();
    assert_eq!(
        contents.lines_per_row("/visitation/agent_0/lines", "LineStrips2D:strips"),
        lengths
    );
    let names = contents.texts("/visitation/axes/labels", "Points2D:labels");
    assert!(
        names.iter().any(|name| name.starts_with("force"))
            && names.iter().any(|name| name == "step"),
        "{names:?}"
    );
}

#[test]
fn a_recording_includes_a_blueprint() {
    let folder = tempfile::tempdir().unwrap();
    let messages = messages(&record(
        &SyntheticRun::new(16, 2),
        folder.path(),
        &RecordingSettings::default(),
    ));
    let is_blueprint_message =
        |message: &&LogMsg| message.store_id().kind() == StoreKind::Blueprint;
    assert!(messages.iter().filter(is_blueprint_message).count() > 50);
    assert!(
        messages
            .iter()
            .any(|message| matches!(message, LogMsg::BlueprintActivationCommand(_)))
    );
}
