//! Lines, points and density images of visited states, their colors, axes, scales and layout.

use rerun::StoreKind;
use rerun::log::LogMsg;
use seedbed::record::rerun::RerunRecorder;
use seedbed::run::recorder::Recorder;
use seedbed::scenario::recording::{AxisChoice, ColorBy, Difference, RecordingSettings};
use seedbed_env::Status;
use seedbed_figure::color::dark::sequential_color;
use seedbed_input::numbers::ranged_count;
use seedbed_learn::experience::Episode;

use super::contents::{RecordingContents, messages};
use super::synthetic_run::{SyntheticRound, SyntheticRun};
use super::{record, record_rounds};

#[test]
fn the_number_of_visible_lines_follows_the_setting() {
    let folder = tempfile::tempdir().unwrap();
    let run = SyntheticRun::new(2, 70);
    for max_lines in [1, 7, 120, 1000] {
        let settings = RecordingSettings {
            lines: ranged_count(max_lines),
            ..RecordingSettings::default()
        };
        let contents = RecordingContents::read(&record(&run, folder.path(), &settings));
        let lines = contents.list_lengths("/visitation/agent_1/lines", "LineStrips2D:strips");
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

/// With images every second round, there is an image of the first round, of even rounds in which
/// the two agents have visited at least 2 × 400 states since the latest image, and of the last round.
#[test]
fn images_are_recorded_every_n_rounds_and_after_the_last_round() {
    let (folder, run) = (tempfile::tempdir().unwrap(), SyntheticRun::new(2, 60));
    let settings = RecordingSettings {
        density_every: ranged_count(2),
        ..RecordingSettings::default()
    };
    let contents = RecordingContents::read(&record(&run, folder.path(), &settings));
    // Rounds before twice the interval always have images.
    let early = [0, 1, 2, 3];
    let (mut expected, mut states) = (Vec::new(), 0);
    for round in &run.rounds {
        let lengths = round.episodes.iter().map(Episode::length);
        states += lengths.map(|length| length + 1).sum::<usize>();
        let has_enough_states = round.round % 2 == 0 && states >= 2 * 600;
        if early.contains(&round.round) || has_enough_states {
            expected.push(i64::from(round.round));
            states = 0;
        }
    }
    expected.push(59);
    assert!((5..25).contains(&expected.len()), "{expected:?}");
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
        assert_eq!(contents.times(entity, "round"), expected);
    }
}

/// The image of the latest `window` rounds of a run of 73 rounds equals the image of all rounds of
/// a run that has only these rounds.
#[test]
fn images_of_the_latest_rounds_do_not_depend_on_earlier_rounds() {
    for window in [50, 7] {
        let settings = RecordingSettings {
            window: ranged_count(window),
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
    record_rounds(&run.rounds[first as usize..], &mut recorder);
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

/// Number of states of an episode that are shown: 20 of 200 states or more, and proportionally fewer
/// of a shorter episode.
fn shown_states(episode: &Episode) -> usize {
    ((20 * (episode.length() + 1).min(200) + 100) / 200).max(1)
}

/// At most 20 states per episode are shown. Each state has one point in each of the two pairs of
/// observations.
#[test]
fn points_show_states_of_their_episode() {
    let folder = tempfile::tempdir().unwrap();
    let run = SyntheticRun::new(2, 12);
    let contents =
        RecordingContents::read(&record(&run, folder.path(), &RecordingSettings::default()));
    let points = contents.points("/pairs/agent_1/states");
    let mut remaining_points = points.as_slice();
    for round in &run.rounds {
        let episode = &round.episodes[1];
        let (points_of_episode, others) = remaining_points.split_at(shown_states(episode) * 2);
        let is_state_of_episode = |points: &[[f32; 2]]| {
            episode.observations.chunks_exact(4).any(|state| {
                expected_points(state)
                    .iter()
                    .zip(points)
                    .all(|(expected, point)| {
                        (expected[0] - point[0]).abs() + (expected[1] - point[1]).abs() < 1e-3
                    })
            })
        };
        assert!(points_of_episode.chunks_exact(2).all(is_state_of_episode));
        remaining_points = others;
    }
    assert!(remaining_points.is_empty());
    let points_of_team = contents.list_lengths("/pairs/team/states", "Points2D:positions");
    let episodes = run.rounds.iter().flat_map(|round| &round.episodes);
    let points_of_agents: usize = episodes.map(|episode| 2 * shown_states(episode)).sum();
    let difference = points_of_team
        .iter()
        .sum::<usize>()
        .abs_diff(points_of_agents / 2);
    assert!(
        difference <= 24,
        "the team has half as many points as its two agents"
    );
}

/// Positions of a state in the images of the pairs (x, x_dot) and (theta, theta_dot).
fn expected_points(state: &[f32]) -> [[f32; 2]; 2] {
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
}

/// Records a run with a color setting.
fn record_with_colors(run: &SyntheticRun, color: ColorBy) -> RecordingContents {
    let folder = tempfile::tempdir().unwrap();
    let settings = RecordingSettings {
        color: color.into(),
        ..RecordingSettings::default()
    };
    RecordingContents::read(&record(run, folder.path(), &settings))
}

/// The color of each line of agent 1.
fn line_colors(contents: &RecordingContents) -> Vec<u32> {
    contents.u32_values("/visitation/agent_1/lines", "LineStrips2D:colors")
}

/// The colors of the lines of agent 1 if each episode has one color.
fn colors_by_episode(run: &SyntheticRun, color: impl Fn(&SyntheticRound) -> [u8; 3]) -> Vec<u32> {
    run.rounds
        .iter()
        .flat_map(|round| vec![rgba(color(round)); shown_states(&round.episodes[1])])
        .collect()
}

fn rgba([red, green, blue]: [u8; 3]) -> u32 {
    u32::from_be_bytes([red, green, blue, 255])
}

#[test]
fn line_colors_can_show_the_episode() {
    let run = SyntheticRun::new(2, 12);
    assert_eq!(
        line_colors(&record_with_colors(&run, ColorBy::Episode)),
        colors_by_episode(&run, |round| sequential_color(round.round as f32 / 11.0))
    );
}

/// The color scale reaches from the lowest return of the first round to the reward threshold.
#[test]
fn line_colors_can_show_the_return() {
    let run = SyntheticRun::new(2, 12);
    let contents = record_with_colors(&run, ColorBy::Return);
    let lowest_return = run.rounds[0]
        .episodes
        .iter()
        .map(|episode| episode.length() as f32)
        .fold(f32::INFINITY, f32::min);
    let share_of_scale = |round: &SyntheticRound| {
        let share = (round.episodes[1].length() as f32 - lowest_return) / (195.0 - lowest_return);
        share.clamp(0.0, 1.0)
    };
    assert_eq!(
        line_colors(&contents),
        colors_by_episode(&run, |round| sequential_color(share_of_scale(round)))
    );
    assert_eq!(
        contents.texts("/visitation/scale/lines/labels", "Points2D:labels"),
        [
            "return".to_owned(),
            "195 or more".to_owned(),
            format!("{lowest_return} or less"),
        ]
    );
}

#[test]
fn line_colors_can_show_the_outcome() {
    let run = SyntheticRun::new(2, 12);
    let color = |round: &SyntheticRound| {
        if round.episodes[1].outcome == Status::Truncated {
            [0x8f, 0x55, 0xff]
        } else {
            [0x8b, 0x85, 0x1f]
        }
    };
    assert_eq!(
        line_colors(&record_with_colors(&run, ColorBy::Outcome)),
        colors_by_episode(&run, color)
    );
}

/// The intrinsic rewards of the synthetic run are 0, 0.001, …, 0.009.
#[test]
fn line_colors_can_show_the_intrinsic_reward() {
    let run = SyntheticRun::new(2, 12);
    let colors = line_colors(&record_with_colors(&run, ColorBy::IntrinsicReward));
    let possible_colors: Vec<u32> = (0..10)
        .map(|thousandths| rgba(sequential_color(0.001 * thousandths as f32 / 0.01)))
        .collect();
    assert!(
        colors.iter().all(|color| possible_colors.contains(color))
            && colors.iter().any(|color| *color != colors[0])
    );
}

#[test]
fn the_difference_image_compares_the_chosen_agents() {
    let folder = tempfile::tempdir().unwrap();
    let images_and_labels = |agents, difference| {
        let settings = RecordingSettings {
            difference,
            ..RecordingSettings::default()
        };
        let contents = RecordingContents::read(&record(
            &SyntheticRun::new(agents, 3),
            folder.path(),
            &settings,
        ));
        let texts = contents.texts("/visitation/team/scale/difference/ends", "Points2D:labels");
        (
            contents.image_bytes("/visitation/difference").len(),
            texts.first().cloned(),
            texts.get(3).cloned(),
        )
    };
    let label_of = |agent: u32| Some(format!("agent {agent}"));
    assert_eq!(
        images_and_labels(4, Difference::Between(2.into(), 1.into())),
        (3, label_of(2), label_of(1))
    );
    assert_eq!(
        images_and_labels(2, Difference::MostDifferent),
        (3, label_of(0), label_of(1))
    );
    assert_eq!(images_and_labels(4, Difference::Off), (0, None, None));
    assert_eq!(
        images_and_labels(1, Difference::MostDifferent),
        (0, None, None)
    );
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
        lines: ranged_count(10_000),
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
        contents.list_lengths("/visitation/agent_0/lines", "LineStrips2D:strips"),
        lengths
    );
    let axis_names = contents.texts("/visitation/axes/labels", "Points2D:labels");
    assert!(
        axis_names.iter().any(|name| name.starts_with("force"))
            && axis_names.iter().any(|name| name == "step"),
        "{axis_names:?}"
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
