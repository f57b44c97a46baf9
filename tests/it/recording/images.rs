//! Pictures of visited states: lines, points, densities, their colours, axes and scales, and how
//! they are laid out.

use rerun::StoreKind;
use rerun::log::LogMsg;
use seedbed::record::rerun::RerunRecorder;
use seedbed::record::{AxisChoice, ColorBy, Difference, Recorder, RecordingSettings};
use seedbed_env::Status;
use seedbed_env::input::numbers::known_count;
use seedbed_figure::color::dark::sequential_color;

use super::contents::{Contents, messages};
use super::record;
use super::synthetic_run::{Round, Run};

#[test]
fn no_more_lines_are_visible_than_wanted() {
    let folder = tempfile::tempdir().unwrap();
    let run = Run::new(2, 70);
    for wanted in [1, 7, 120, 1000] {
        let settings = RecordingSettings {
            lines: known_count(wanted),
            ..RecordingSettings::default()
        };
        let contents = Contents::of(&record(&run, folder.path(), &settings));
        let lines = contents.lines_per_row("/visitation/agent_1/lines", "LineStrips2D:strips");
        let most = lines
            .windows(50.min(wanted.max(1) as usize))
            .map(|window| window.iter().sum::<usize>())
            .max();
        assert!(most.unwrap_or(0) <= wanted as usize, "{most:?} of {wanted}");
        assert!(
            most.unwrap_or(0) * 5 >= wanted as usize,
            "{most:?} of {wanted}"
        );
    }
}

#[test]
fn pictures_come_as_often_as_wanted_and_at_the_end() {
    let folder = tempfile::tempdir().unwrap();
    let settings = RecordingSettings {
        density_every: known_count(5),
        ..RecordingSettings::default()
    };
    let contents = Contents::of(&record(&Run::new(2, 12), folder.path(), &settings));
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

/// Pictures come every 10 rounds and at the end; the last of 73 rounds is pictured with the 49
/// before it, or with as many as are wanted.
#[test]
fn the_latest_rounds_are_pictured_as_if_there_had_been_no_others() {
    for window in [50, 7] {
        let settings = RecordingSettings {
            window: known_count(window),
            ..RecordingSettings::default()
        };
        pictures_are_of_the_latest_rounds(window, &settings);
    }
}

fn pictures_are_of_the_latest_rounds(window: u32, settings: &RecordingSettings) {
    let folder = tempfile::tempdir().unwrap();
    let (run, first) = (Run::new(3, 73), 73 - window);
    let whole = Contents::of(&record(&run, folder.path(), settings));
    for root in [
        "visitation/scale/latest",
        "visitation/team/scale/latest",
        "pairs/scale/bonus",
    ] {
        let note = whole
            .words(&format!("/{root}/ends"), "Points2D:labels")
            .pop()
            .unwrap();
        assert_eq!(note, format!("rounds {first} to 72"));
    }
    let path = folder.path().join("latest.rrd");
    let mut recorder = RerunRecorder::create(&path, &run.about(), settings).unwrap();
    run.rounds[first as usize..]
        .iter()
        .for_each(|round| round.record(&mut recorder));
    recorder.finish().unwrap();
    let latest = Contents::of(&path);
    for (root, of_latest, of_all) in [
        ("visitation", "latest", "density"),
        ("pairs", "bonus", "bonus"),
    ] {
        for who in ["agent_0", "agent_2", "team"] {
            let last = |contents: &Contents, name: &str| {
                contents
                    .pictures(&format!("/{root}/{who}/{name}"))
                    .pop()
                    .unwrap()
            };
            assert!(
                last(&whole, of_latest) == last(&latest, of_all),
                "/{root}/{who}"
            );
        }
    }
}

/// Every picture has its scale: the upper end is the number of lines on the brightest pixel, here
/// of one state, the first of each episode.
#[test]
fn scales_state_what_the_brightest_color_means() {
    let folder = tempfile::tempdir().unwrap();
    let contents = Contents::of(&record(
        &Run::new(2, 1),
        folder.path(),
        &RecordingSettings::default(),
    ));
    let pixels = |entity| contents.pictures(entity).pop().unwrap();
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
    let end = |entity| {
        contents.words(entity, "Points2D:labels")[0]
            .parse::<u32>()
            .unwrap()
    };
    let (of_agents, of_team) = (
        end("/visitation/scale/density/ends"),
        end("/visitation/team/scale/density/ends"),
    );
    assert!(
        of_agents > 1 && of_team >= of_agents && of_team <= 2 * of_agents,
        "{of_agents} and {of_team}"
    );
}

#[test]
fn points_are_states_of_their_episode() {
    let folder = tempfile::tempdir().unwrap();
    let run = Run::new(2, 12);
    let contents = Contents::of(&record(&run, folder.path(), &RecordingSettings::default()));
    let points = contents.points("/pairs/agent_1/states");
    let lengths = run
        .rounds
        .iter()
        .map(|round| round.episodes[1].length() + 1);
    assert_eq!(
        points.len(),
        lengths.clone().map(|states| states.min(20)).sum::<usize>() * 2
    );
    let mut rest = points.as_slice();
    for (round, states) in run.rounds.iter().zip(lengths) {
        let (own, others) = rest.split_at(states.min(20) * 2);
        let observed: Vec<&[f32]> = round.episodes[1].observations.chunks_exact(4).collect();
        let drawn = |state: &[f32]| {
            let place = |value: f32, end: f32| 40.0 * (0.5 + 0.5 * value / end).clamp(0.0, 1.0);
            [
                [place(state[0], 2.4), 40.0 - place(state[1], 3.0)],
                [60.0 + place(state[2], 0.209), 40.0 - place(state[3], 3.0)],
            ]
        };
        let near = |one: &[f32; 2], other: &[f32; 2]| {
            (one[0] - other[0]).abs() + (one[1] - other[1]).abs() < 1e-3
        };
        let is_state = |pair: &[[f32; 2]]| {
            observed.iter().any(|state| {
                drawn(state)
                    .iter()
                    .zip(pair)
                    .all(|(one, other)| near(one, other))
            })
        };
        assert!(own.chunks_exact(2).all(is_state));
        rest = others;
    }
    assert_eq!(
        contents
            .lines_per_row("/pairs/team/states", "Points2D:positions")
            .len(),
        24,
        "one row for each agent's episode"
    );
}

#[test]
fn colors_show_what_is_chosen() {
    let folder = tempfile::tempdir().unwrap();
    let run = Run::new(2, 12);
    let recorded = |color: ColorBy| {
        let settings = RecordingSettings {
            color: color.into(),
            ..RecordingSettings::default()
        };
        Contents::of(&record(&run, folder.path(), &settings))
    };
    let colors =
        |contents: &Contents| contents.integers("/visitation/agent_1/lines", "LineStrips2D:colors");
    let rgba = |[red, green, blue]: [u8; 3]| u32::from_be_bytes([red, green, blue, 255]);
    let lines = |round: &Round| (round.episodes[1].length() + 1).min(20);
    let per_episode = |color: &dyn Fn(&Round) -> [u8; 3]| -> Vec<u32> {
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
    let share = |round: &Round| (round.episodes[1].length() as f32 - lowest) / (195.0 - lowest);
    let by_return = recorded(ColorBy::Return);
    assert_eq!(
        colors(&by_return),
        per_episode(&|round| sequential_color(share(round).clamp(0.0, 1.0)))
    );
    let legend = [
        "return".to_owned(),
        "195 or more".to_owned(),
        format!("{lowest} or less"),
    ];
    assert_eq!(
        by_return.words("/visitation/scale/lines/labels", "Points2D:labels"),
        legend
    );
    let outcome = |round: &Round| {
        if round.episodes[1].outcome == Status::Truncated {
            [86, 180, 233]
        } else {
            [225, 95, 20]
        }
    };
    assert_eq!(colors(&recorded(ColorBy::Outcome)), per_episode(&outcome));
    let bonuses: Vec<u32> = colors(&recorded(ColorBy::IntrinsicReward));
    let known: Vec<u32> = (0..10)
        .map(|bonus| rgba(sequential_color(0.001 * bonus as f32 / 0.01)))
        .collect();
    assert!(
        bonuses.iter().all(|color| known.contains(color))
            && bonuses.iter().any(|color| *color != bonuses[0])
    );
}

#[test]
fn two_agents_are_compared_as_wanted() {
    let folder = tempfile::tempdir().unwrap();
    let recorded = |agents, difference| {
        let settings = RecordingSettings {
            difference,
            ..RecordingSettings::default()
        };
        let contents = Contents::of(&record(&Run::new(agents, 3), folder.path(), &settings));
        let words = contents.words("/visitation/difference/scale/ends", "Points2D:labels");
        (
            contents.pictures("/visitation/difference").len(),
            words.first().cloned(),
            words.get(3).cloned(),
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

/// Four observations, the force and the step: an episode's last state, from which nothing is done,
/// has no line.
#[test]
fn actions_and_steps_can_have_axes() {
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
    let run = Run::new(1, 2);
    let contents = Contents::of(&record(&run, folder.path(), &settings));
    let lengths: Vec<usize> = run
        .rounds
        .iter()
        .map(|round| round.episodes[0].length())
        .collect();
    assert_eq!(
        contents.lines_per_row("/visitation/agent_0/lines", "LineStrips2D:strips"),
        lengths
    );
    let names = contents.words("/visitation/axes/labels", "Points2D:labels");
    assert!(
        names.iter().any(|name| name.starts_with("force"))
            && names.iter().any(|name| name == "step"),
        "{names:?}"
    );
}

#[test]
fn a_layout_comes_with_the_recording() {
    let folder = tempfile::tempdir().unwrap();
    let messages = messages(&record(
        &Run::new(16, 2),
        folder.path(),
        &RecordingSettings::default(),
    ));
    let of_blueprint = |message: &&LogMsg| message.store_id().kind() == StoreKind::Blueprint;
    assert!(messages.iter().filter(of_blueprint).count() > 50);
    assert!(
        messages
            .iter()
            .any(|message| matches!(message, LogMsg::BlueprintActivationCommand(_)))
    );
}
