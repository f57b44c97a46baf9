//! Recordings are read back and compared with what was recorded, number by number.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![allow(clippy::iter_over_hash_type, reason = "chunks of the viewer's format hold hash maps; the columns are sorted here")]
#![allow(clippy::struct_field_names, reason = "a round's rows are named as in the record")]

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use rerun::external::arrow::array::{Array, StringArray};
use rerun::external::re_log_encoding::rrd::DecoderApp;
use rerun::log::{Chunk, LogMsg};
use rerun::{ComponentIdentifier, StoreKind, TimelineName};
use seedbed::env::{Action, Choice, Force, ForceSource, Pose, Quantity, Scene, SceneBody, Shape, Spec, Status};
use seedbed::experience::Episode;
use seedbed::input::numbers::{Finite, known, known_count};
use seedbed::record::palette::sequential;
use seedbed::record::rerun::read::{RecordedEpisode, Recording};
use seedbed::record::rerun::{Focus, RecordingAbout, RerunRecorder};
use seedbed::record::visitation::Axes;
use seedbed::record::{
    AxisChoice, Colour, Difference, EpisodeRow, Footage, Recorder, RecordingSettings, RoundRecord, RoundRow, SceneSettings,
};
use seedbed::run::Plan;
use seedbed::run::trainer::Trainer;

#[test]
fn every_state_and_action_is_read_back_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let run = Run::new(4, 12);
    let path = record(&run, folder.path(), &RecordingSettings::default());
    assert!(!folder.path().join("run.rrd.part").exists());
    compare_raw(&run, &Contents::of(&path));
}

#[test]
fn episodes_are_read_back_as_they_were() {
    let folder = tempfile::tempdir().unwrap();
    let run = Run::new(3, 40);
    let path = record(&run, folder.path(), &RecordingSettings::default());
    let recording = Recording::open(&path).unwrap();
    assert_eq!((recording.observations(), recording.largest_bonus()), (&run.spec.observations[..], Some(0.01)));
    assert_eq!(recording.actions(), [run.spec.actions[0].quantity.clone()]);
    assert_eq!(recording.axes(), Axes::of(&run.spec, &RecordingSettings::default().axes, Some(0.01)));
    let property = |name: &str| recording.properties().get(name).map(String::as_str);
    assert_eq!([property("agents"), property("RecordingInfo:name")], [Some("3"), Some("cartpole-made-up")]);
    assert_eq!(read_back(&path), played(&run, 40));
}

/// Without its end, and in the middle of a message, what is complete is read: rows reach the file in pieces of 2,048 an agent.
#[test]
fn a_killed_recording_is_read_as_far_as_it_goes() {
    let folder = tempfile::tempdir().unwrap();
    let run = Run::new(2, 60);
    let mut recorder =
        RerunRecorder::create(&folder.path().join("run.rrd"), &run.about(), &RecordingSettings::default()).unwrap();
    run.rounds[..20].iter().for_each(|round| round.record(&mut recorder));
    recorder.checkpoint().unwrap();
    let part = folder.path().join("run.rrd.part");
    let length = std::fs::metadata(&part).unwrap().len();
    run.rounds[20..].iter().for_each(|round| round.record(&mut recorder));
    drop(recorder);
    assert_eq!(read_back(&part), played(&run, 60));
    File::options().write(true).open(&part).unwrap().set_len(length + 50).unwrap();
    assert_eq!(read_back(&part), played(&run, 20));
}

#[test]
fn other_files_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("other.rrd");
    let refusal = |path: &Path| Recording::open(path).unwrap_err().to_string().replace(path.to_str().unwrap(), "FILE");
    assert_eq!(refusal(&path), "cannot read FILE: No such file or directory (os error 2)");
    std::fs::write(&path, "agent,episode,round\n0,0,0\n").unwrap();
    assert!(refusal(&path).starts_with("cannot read FILE: "), "{}", refusal(&path));
    let stream = rerun::RecordingStreamBuilder::new("other").save(&path).unwrap();
    stream.log("words", &rerun::TextLog::new("hello")).unwrap();
    drop(stream);
    let none = "FILE holds no run that this version of seedbed can read: there is no `/scenario/quantities` in it";
    assert_eq!(refusal(&path), none);
    let mut bytes = std::fs::read(&path).unwrap();
    bytes[4..8].copy_from_slice(&[0, 9, 0, 0]);
    std::fs::write(&path, bytes).unwrap();
    let old = "cannot read FILE: Data from Rerun version 0.9.0, which is incompatible with the local Rerun version 0.36.3";
    assert_eq!(refusal(&path), old);
}

/// By (agent, episode).
fn read_back(path: &Path) -> Vec<RecordedEpisode> {
    let episodes = Recording::open(path).unwrap().episodes().unwrap();
    let mut episodes: Vec<RecordedEpisode> = episodes.collect::<Result<_, _>>().unwrap();
    assert!(episodes.iter().all(|episode| episode.observations.len() == 4 * (episode.length() + 1)));
    episodes.sort_by_key(|episode| (episode.agent, episode.episode));
    episodes
}

fn played(run: &Run, rounds: usize) -> Vec<RecordedEpisode> {
    let all = run.rounds[..rounds].iter().flat_map(|round| round.episodes.clone());
    let mut played: Vec<RecordedEpisode> = all
        .map(|episode| RecordedEpisode {
            agent: episode.agent,
            episode: episode.episode,
            round: episode.round,
            observations: episode.observations,
            actions: episode.actions.iter().map(|&action| if action == 0.0 { -10.0 } else { 10.0 }).collect(),
            rewards: episode.rewards,
            intrinsic_rewards: episode.intrinsic_rewards,
            outcome: episode.outcome,
        })
        .collect();
    played.sort_by_key(|episode| (episode.agent, episode.episode));
    played
}

#[test]
fn curves_hold_the_rows_of_the_tables() {
    let folder = tempfile::tempdir().unwrap();
    let run = Run::new(3, 30);
    let contents = Contents::of(&record(&run, folder.path(), &RecordingSettings::default()));
    let returns: Vec<f64> = run.rounds.iter().map(|round| round.episode_rows[1].r#return).collect();
    assert_eq!(contents.numbers64("/curves/return/agent_1", "Scalars:scalars"), returns);
    let coverage: Vec<f64> = run.rounds.iter().flat_map(|round| &round.round_rows).map(|row| row.coverage).collect();
    assert_eq!(contents.numbers64("/curves/coverage", "Scalars:scalars"), coverage);
    let effective: Vec<f64> = run.rounds.iter().map(|round| round.round_rows[0].effective_agents).collect();
    assert_eq!(contents.numbers64("/curves/effective_agents", "Scalars:scalars"), effective);
    let mean = |rows: &[EpisodeRow]| rows.iter().map(|row| row.r#return).sum::<f64>() / 3.0;
    let means: Vec<f64> = run.rounds.iter().map(|round| mean(&round.episode_rows)).collect();
    assert_eq!(contents.numbers64("/curves/return/team_mean", "Scalars:scalars"), means);
    let last_25 = means[5..].iter().sum::<f64>() / 25.0;
    approx::assert_relative_eq!(contents.numbers64("/curves/return/team_mean_25", "Scalars:scalars")[29], last_25);
}

#[test]
fn no_more_lines_are_visible_than_wanted() {
    let folder = tempfile::tempdir().unwrap();
    let run = Run::new(2, 70);
    for wanted in [1, 7, 120, 1000] {
        let settings = RecordingSettings { lines: known_count(wanted), ..RecordingSettings::default() };
        let contents = Contents::of(&record(&run, folder.path(), &settings));
        let lines = contents.lines_per_row("/visitation/agent_1/lines", "LineStrips2D:strips");
        let most = lines.windows(50.min(wanted.max(1) as usize)).map(|window| window.iter().sum::<usize>()).max();
        assert!(most.unwrap_or(0) <= wanted as usize, "{most:?} of {wanted}");
        assert!(most.unwrap_or(0) * 5 >= wanted as usize, "{most:?} of {wanted}");
    }
}

#[test]
fn pictures_come_as_often_as_wanted_and_at_the_end() {
    let folder = tempfile::tempdir().unwrap();
    let settings = RecordingSettings { density_every: known_count(5), ..RecordingSettings::default() };
    let contents = Contents::of(&record(&Run::new(2, 12), folder.path(), &settings));
    let densities =
        ["/visitation/agent_0/density", "/visitation/agent_1/latest", "/visitation/team/density", "/visitation/team/latest"];
    for entity in densities.into_iter().chain(["/visitation/difference", "/pairs/agent_1/bonus", "/pairs/team/bonus"]) {
        assert_eq!(contents.times(entity, "round"), [0, 5, 10, 11]);
    }
}

/// Pictures come every 10 rounds and at the end, so that the last of 70 rounds is pictured with the 59 after round 10.
#[test]
fn the_latest_rounds_are_pictured_as_if_there_had_been_no_others() {
    let folder = tempfile::tempdir().unwrap();
    let (run, settings) = (Run::new(3, 70), RecordingSettings::default());
    let whole = Contents::of(&record(&run, folder.path(), &settings));
    assert_eq!(whole.words("/visitation/scale/latest/ends", "Points2D:labels").last().unwrap(), "rounds 11 to 69");
    let path = folder.path().join("latest.rrd");
    let mut recorder = RerunRecorder::create(&path, &run.about(), &settings).unwrap();
    run.rounds[11..].iter().for_each(|round| round.record(&mut recorder));
    recorder.finish().unwrap();
    let latest = Contents::of(&path);
    for (root, of_latest, of_all) in [("visitation", "latest", "density"), ("pairs", "bonus", "bonus")] {
        for who in ["agent_0", "agent_2", "team"] {
            let last = |contents: &Contents, name: &str| contents.pictures(&format!("/{root}/{who}/{name}")).pop().unwrap();
            assert!(last(&whole, of_latest) == last(&latest, of_all), "/{root}/{who}");
        }
    }
}

/// Every picture has its scale: the upper end is the number of lines on the brightest pixel, here of one state, the first of each episode.
#[test]
fn scales_say_what_the_brightest_colour_means() {
    let folder = tempfile::tempdir().unwrap();
    let contents = Contents::of(&record(&Run::new(2, 1), folder.path(), &RecordingSettings::default()));
    let pixels = |entity| contents.pictures(entity).pop().unwrap();
    assert_eq!(*pixels("/visitation/agent_0/density").iter().chain(&pixels("/visitation/agent_1/density")).max().unwrap(), 255);
    assert_eq!(*pixels("/visitation/team/density").iter().max().unwrap(), 255);
    let end = |entity| contents.words(entity, "Points2D:labels")[0].parse::<u32>().unwrap();
    let (of_agents, of_team) = (end("/visitation/scale/density/ends"), end("/visitation/team/scale/density/ends"));
    assert!(of_agents > 1 && of_team >= of_agents && of_team <= 2 * of_agents, "{of_agents} and {of_team}");
}

#[test]
fn points_are_states_of_their_episode() {
    let folder = tempfile::tempdir().unwrap();
    let run = Run::new(2, 12);
    let contents = Contents::of(&record(&run, folder.path(), &RecordingSettings::default()));
    let points = contents.points("/pairs/agent_1/states");
    let lengths = run.rounds.iter().map(|round| round.episodes[1].length() + 1);
    assert_eq!(points.len(), lengths.clone().map(|states| states.min(20)).sum::<usize>() * 2);
    let mut rest = points.as_slice();
    for (round, states) in run.rounds.iter().zip(lengths) {
        let (own, others) = rest.split_at(states.min(20) * 2);
        let observed: Vec<&[f32]> = round.episodes[1].observations.chunks_exact(4).collect();
        let drawn = |state: &[f32]| {
            let place = |value: f32, end: f32| 40.0 * (0.5 + 0.5 * value / end).clamp(0.0, 1.0);
            [[place(state[0], 2.4), 40.0 - place(state[1], 3.0)], [60.0 + place(state[2], 0.209), 40.0 - place(state[3], 3.0)]]
        };
        let near = |one: &[f32; 2], other: &[f32; 2]| (one[0] - other[0]).abs() + (one[1] - other[1]).abs() < 1e-3;
        let is_state =
            |pair: &[[f32; 2]]| observed.iter().any(|state| drawn(state).iter().zip(pair).all(|(one, other)| near(one, other)));
        assert!(own.chunks_exact(2).all(is_state));
        rest = others;
    }
    assert_eq!(contents.lines_per_row("/pairs/team/states", "Points2D:positions").len(), 24, "one row for each agent's episode");
}

#[test]
fn colours_tell_what_is_wanted() {
    let folder = tempfile::tempdir().unwrap();
    let run = Run::new(2, 12);
    let recorded = |colour: Colour| {
        let settings = RecordingSettings { colour: colour.into(), ..RecordingSettings::default() };
        Contents::of(&record(&run, folder.path(), &settings))
    };
    let colors = |contents: &Contents| contents.integers("/visitation/agent_1/lines", "LineStrips2D:colors");
    let rgba = |[red, green, blue]: [u8; 3]| u32::from_be_bytes([red, green, blue, 255]);
    let lines = |round: &Round| (round.episodes[1].length() + 1).min(20);
    let per_episode = |color: &dyn Fn(&Round) -> [u8; 3]| -> Vec<u32> {
        run.rounds.iter().flat_map(|round| vec![rgba(color(round)); lines(round)]).collect()
    };

    assert_eq!(colors(&recorded(Colour::Episode)), per_episode(&|round| sequential(round.round as f32 / 11.0)));
    let lowest = run.rounds[0].episodes.iter().map(|episode| episode.length() as f32).fold(f32::INFINITY, f32::min);
    let share = |round: &Round| (round.episodes[1].length() as f32 - lowest) / (195.0 - lowest);
    let by_return = recorded(Colour::Return);
    assert_eq!(colors(&by_return), per_episode(&|round| sequential(share(round).clamp(0.0, 1.0))));
    let legend = ["return".to_owned(), "195 or more".to_owned(), format!("{lowest} or less")];
    assert_eq!(by_return.words("/visitation/scale/lines/labels", "Points2D:labels"), legend);
    let outcome = |round: &Round| if round.episodes[1].outcome == Status::Truncated { [86, 180, 233] } else { [225, 95, 20] };
    assert_eq!(colors(&recorded(Colour::Outcome)), per_episode(&outcome));
    let bonuses: Vec<u32> = colors(&recorded(Colour::IntrinsicReward));
    let known: Vec<u32> = (0..10).map(|bonus| rgba(sequential(0.001 * bonus as f32 / 0.01))).collect();
    assert!(bonuses.iter().all(|color| known.contains(color)) && bonuses.iter().any(|color| *color != bonuses[0]));
}

#[test]
fn two_agents_are_compared_as_wanted() {
    let folder = tempfile::tempdir().unwrap();
    let recorded = |agents, difference| {
        let settings = RecordingSettings { difference, ..RecordingSettings::default() };
        let contents = Contents::of(&record(&Run::new(agents, 3), folder.path(), &settings));
        let words = contents.words("/visitation/difference/scale/ends", "Points2D:labels");
        (contents.pictures("/visitation/difference").len(), words.first().cloned(), words.get(3).cloned())
    };
    let agent = |agent: u32| Some(format!("agent {agent}"));
    assert_eq!(recorded(4, Difference::Between(2.into(), 1.into())), (2, agent(2), agent(1)));
    assert_eq!(recorded(2, Difference::MostDifferent), (2, agent(0), agent(1)));
    assert_eq!(recorded(4, Difference::Off), (0, None, None));
    assert_eq!(recorded(1, Difference::MostDifferent), (0, None, None));
}

/// Four observations, the force and the step: an episode's last state, from which nothing is done, has no line.
#[test]
fn actions_and_steps_can_have_axes() {
    let folder = tempfile::tempdir().unwrap();
    let axes = vec![AxisChoice::Observations, AxisChoice::Action, AxisChoice::Step];
    let settings = RecordingSettings { axes: axes.into(), lines: known_count(10_000), ..RecordingSettings::default() };
    let run = Run::new(1, 2);
    let contents = Contents::of(&record(&run, folder.path(), &settings));
    let lengths: Vec<usize> = run.rounds.iter().map(|round| round.episodes[0].length()).collect();
    assert_eq!(contents.lines_per_row("/visitation/agent_0/lines", "LineStrips2D:strips"), lengths);
    let names = contents.words("/visitation/axes/labels", "Points2D:labels");
    assert!(names.iter().any(|name| name.starts_with("force")) && names.iter().any(|name| name == "step"), "{names:?}");
}

/// The column is there with the axis, and only then.
#[test]
fn advantages_are_on_record_where_an_axis_tells_them() {
    let (folder, run) = (tempfile::tempdir().unwrap(), Run::new(2, 3));
    let recorded = |axes: Vec<AxisChoice>| {
        let settings = RecordingSettings { axes: axes.into(), ..RecordingSettings::default() };
        let contents = Contents::of(&record(&run, folder.path(), &settings));
        compare_raw(&run, &contents);
        contents
    };
    let advantage = AxisChoice::Advantage { from: known(-30.0), to: known::<Finite>(170.0).into() };
    let with = recorded(vec![AxisChoice::Observations, advantage]);
    let given: Vec<f32> = run.rounds.iter().flat_map(|round| &round.episodes[1].advantages).copied().collect();
    assert_eq!(with.numbers("/raw/agent_1", "State:advantage"), given);
    assert_eq!(with.rows_with("/raw/agent_1", "State:advantage"), with.rows_with("/raw/agent_1", "State:force"));
    let names = with.words("/visitation/axes/labels", "Points2D:labels");
    assert!(names.iter().any(|name| name.starts_with("advantage")), "{names:?}");
    let without = recorded(vec![AxisChoice::Observations]);
    assert!(without.rows_with("/raw/agent_1", "State:advantage").is_empty());
}

/// Without a baseline, ratios, seeds and discount, an action's advantage is what its episode still earned: from T down to 1, as each of
/// the T steps of the cartpole earns 1.
#[test]
fn the_column_holds_what_agents_estimated() {
    let overrides = [
        "algorithm=SeedPg(value_data: Own, policy_data: Own, discount: 1, value_target: MonteCarlo(importance: Off), \
         advantage: MonteCarlo(baseline: Off), standardise: PerTrajectory)",
        "agents=(count: 2, seeds: Normal(sigma: 0))",
        "recording.axes=[Advantage(from: 0, to: 200)]",
    ];
    let scenario = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios/cartpole.ron");
    let plan = Plan::load(&scenario, &overrides.map(ToOwned::to_owned)).unwrap();
    let mut trainer = Trainer::new(&plan.scenario, &plan.description, 1).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.rrd");
    let made_up = Run::new(2, 2);
    let mut recorder = RerunRecorder::create(&path, &made_up.about(), &plan.scenario.recording).unwrap();
    let mut expected = Vec::new();
    for number in 0..2 {
        let round = trainer.advance().unwrap();
        let episodes = trainer.newest_episodes();
        expected.extend((1..=episodes[1].length()).rev().map(|left| left as f32));
        let (episode_rows, round_rows) = (&round.rows.episodes[..], &round.rows.updates[..]);
        recorder
            .record_round(&RoundRecord { round: number, episodes: &episodes, episode_rows, round_rows, footage: &[] })
            .unwrap();
    }
    recorder.finish().unwrap();
    assert_eq!(Contents::of(&path).numbers("/raw/agent_1", "State:advantage"), expected);
}

#[test]
fn the_filmed_episodes_move_and_leave_a_trace() {
    let folder = tempfile::tempdir().unwrap();
    let run = Run::new(2, 12);
    let contents = Contents::of(&record(&run, folder.path(), &RecordingSettings::default()));
    let filmed: usize = [0, 10].iter().map(|&round: &usize| run.rounds[round].episodes[0].length() + 1).sum();
    assert_eq!(contents.times("/scene/agent_0/bodies/pole", "env_step").len(), filmed);
    assert_eq!(contents.times("/scene/agent_0/trace", "episode"), [0, 10]);
    assert!(contents.times("/scene/agent_0/trace", "env_step").is_empty());
}

#[test]
fn scenes_of_several_agents_have_their_own_episodes_and_forces() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = Run::new(3, 12);
    for round in &mut run.rounds {
        round.footage = [0, 2].map(|agent| pushed(&round.episodes[agent])).to_vec();
    }
    let scene = SceneSettings { agents: vec![0.into(), 2.into()].into(), every: known_count(1) };
    let settings = RecordingSettings { scene: Some(scene), ..RecordingSettings::default() };
    let contents = Contents::of(&record(&run, folder.path(), &settings));
    assert!(contents.chunks("/scene/agent_1/bodies/pole").is_empty());
    for agent in [0, 2] {
        let rows: usize = run.rounds.iter().map(|round| round.episodes[agent].length() + 1).sum();
        let poses = contents.times(&format!("/scene/agent_{agent}/bodies/pole"), "env_step");
        assert_eq!(poses, (0..rows as i64).collect::<Vec<_>>());
        let action = format!("/scene/agent_{agent}/forces/action");
        assert_eq!(contents.times(&action, "env_step"), poses);
        let pushes = rows - run.rounds.len();
        assert_eq!(contents.numbers(&action, "Force:newtons"), vec![5.0; pushes], "no force led to a first row");
        let contacts = format!("/scene/agent_{agent}/forces/contacts");
        assert_eq!(contents.times(&contacts, "env_step").len(), run.rounds.len(), "an empty row an episode");
    }
}

/// Bodies that move 1 cm in every step, pushed by 5 N.
fn pushed(episode: &Episode) -> Footage {
    let force = Force { source: ForceSource::Action, at: [0.5, 0.1], newtons: [3.0, -4.0] };
    let at = |step: usize| Pose { x: 0.01 * step as f32, ..Pose::default() };
    Footage {
        agent: episode.agent,
        episode: episode.episode,
        poses: (0..=episode.length()).flat_map(|step| [Pose::default(), at(step), at(step)]).collect(),
        forces: vec![force; episode.length()],
        forces_per_row: std::iter::once(0).chain(vec![1; episode.length()]).collect(),
    }
}

/// Every third episode is on record, on the agent's own steps of all episodes; the file says so.
#[test]
fn a_part_of_the_episodes_can_be_on_record() {
    let folder = tempfile::tempdir().unwrap();
    let run = Run::new(2, 8);
    let settings = RecordingSettings { raw_every: known_count(3), ..RecordingSettings::default() };
    let contents = Contents::of(&record(&run, folder.path(), &settings));
    let (mut steps, mut rewards, mut next) = (Vec::new(), Vec::<f32>::new(), 0);
    for round in &run.rounds {
        let rows = round.episodes[1].length() as i64 + 1;
        if round.round % 3 == 0 {
            steps.extend(next..next + rows);
            rewards.extend(&round.episodes[1].rewards);
        }
        next += rows;
    }
    assert_eq!(contents.times("/raw/agent_1", "env_step"), steps);
    assert_eq!(contents.numbers("/raw/agent_1", "State:reward"), rewards);
    assert_eq!(contents.words("/__properties/run", "raw_every"), ["3"]);
    assert_eq!(contents.numbers64("/curves/return/agent_1", "Scalars:scalars").len(), 8, "returns are of all episodes");
}

/// What an agent saw and did costs at most 45 bytes a state with four observations, an action, a reward, its probability, a bonus and an
/// outcome; a further observation at most 6.
#[test]
fn a_state_takes_few_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let run = Run::new(2, 400);
    let states: usize = run.rounds.iter().flat_map(|round| &round.episodes).map(|episode| episode.length() + 1).sum();
    let narrow = raw_bytes(&record(&run, folder.path(), &RecordingSettings::default())) as f64 / states as f64;
    let wide = raw_bytes(&record(&widened(run), folder.path(), &RecordingSettings::default())) as f64 / states as f64;
    println!("{narrow:.2} bytes a state, {:.2} for a further column", wide - narrow);
    assert!(narrow <= 45.0, "{narrow} bytes a state");
    assert!(wide - narrow <= 6.0, "{} bytes for a further column", wide - narrow);
}

/// The same run with a fifth observation, as hard to compress as the others.
fn widened(mut run: Run) -> Run {
    let fifth = Quantity { name: "fifth".to_owned(), ..run.spec.observations[1].clone() };
    run.spec.observations.push(fifth);
    for episode in run.rounds.iter_mut().flat_map(|round| &mut round.episodes) {
        let wide = episode.observations.chunks_exact(4).flat_map(|row| [row, &[row[1].sin() + row[3]]].concat());
        episode.observations = wide.collect();
    }
    run
}

/// Bytes that `/raw` takes in the file.
fn raw_bytes(path: &Path) -> u64 {
    let is_raw = |message: &&LogMsg| match message {
        LogMsg::ArrowMsg(_, arrow) => Chunk::from_arrow_msg(arrow).unwrap().entity_path().to_string().starts_with("/raw/"),
        _ => false,
    };
    let messages = messages(path);
    let encoded = |messages: Vec<&LogMsg>| {
        rerun::external::re_log_encoding::rrd::Encoder::encode(messages.into_iter().map(Ok)).unwrap().len() as u64
    };
    encoded(messages.iter().filter(is_raw).collect())
}

#[test]
fn a_tracked_body_is_followed() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = Run::new(2, 12);
    run.scene.tracked = Some(1);
    let contents = Contents::of(&record(&run, folder.path(), &RecordingSettings::default()));
    let followed = contents.times("/scene/agent_0/camera", "env_step");
    assert!(!followed.is_empty());
    assert_eq!(followed, contents.times("/scene/agent_0/bodies/cart", "env_step"));
}

#[test]
fn a_layout_comes_with_the_recording() {
    let folder = tempfile::tempdir().unwrap();
    let messages = messages(&record(&Run::new(16, 2), folder.path(), &RecordingSettings::default()));
    let of_blueprint = |message: &&LogMsg| message.store_id().kind() == StoreKind::Blueprint;
    assert!(messages.iter().filter(of_blueprint).count() > 50);
    assert!(messages.iter().any(|message| matches!(message, LogMsg::BlueprintActivationCommand(_))));
}

#[test]
fn a_killed_and_resumed_run_equals_an_uninterrupted_one() {
    let folder = tempfile::tempdir().unwrap();
    let run = Run::new(4, 30);
    let whole = Contents::of(&record(&run, folder.path(), &RecordingSettings::default()));

    let path = folder.path().join("killed.rrd");
    let settings = RecordingSettings::default();
    let mut recorder = RerunRecorder::create(&path, &run.about(), &settings).unwrap();
    run.rounds[..13].iter().for_each(|round| round.record(&mut recorder));
    let checkpoint = recorder.checkpoint().unwrap();
    run.rounds[13..21].iter().for_each(|round| round.record(&mut recorder));
    drop(recorder);
    assert!(!path.exists());

    let mut recorder = RerunRecorder::resume(&path, &run.about(), &settings, &checkpoint).unwrap();
    run.rounds[13..].iter().for_each(|round| round.record(&mut recorder));
    recorder.finish().unwrap();
    let resumed = Contents::of(&path);
    compare_raw(&run, &resumed);
    assert_eq!(whole.columns(), resumed.columns());
}

#[test]
fn a_torn_file_is_resumed_from_its_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    let (run, settings) = (Run::new(2, 8), RecordingSettings::default());
    let path = folder.path().join("run.rrd");
    let mut recorder = RerunRecorder::create(&path, &run.about(), &settings).unwrap();
    run.rounds[..4].iter().for_each(|round| round.record(&mut recorder));
    let checkpoint = recorder.checkpoint().unwrap();
    let part = folder.path().join("run.rrd.part");
    let length = std::fs::metadata(&part).unwrap().len();
    run.rounds[4..].iter().for_each(|round| round.record(&mut recorder));
    drop(recorder);
    File::options().write(true).open(&part).unwrap().set_len(length + 100).unwrap();

    for _ in 0..2 {
        let mut recorder = RerunRecorder::resume(&path, &run.about(), &settings, &checkpoint).unwrap();
        run.rounds[4..].iter().for_each(|round| round.record(&mut recorder));
        recorder.finish().unwrap();
        compare_raw(&run, &Contents::of(&path));
    }

    File::options().write(true).open(&path).unwrap().set_len(length / 2).unwrap();
    let error = RerunRecorder::resume(&path, &run.about(), &settings, &checkpoint).map(drop).unwrap_err().to_string();
    assert!(error.starts_with("cannot go on with ") && error.contains("ends before the checkpoint"), "{error}");
    let error = RerunRecorder::resume(&path, &run.about(), &settings, b"nonsense").map(drop).unwrap_err().to_string();
    assert!(error.contains("the checkpoint is damaged"), "{error}");
    let error = RerunRecorder::resume(&path, &Run::new(3, 1).about(), &settings, &checkpoint).map(drop).unwrap_err().to_string();
    assert!(error.contains("the checkpoint belongs to another scenario"), "{error}");
}

#[test]
fn a_recording_that_is_dropped_early_stays_readable() {
    let folder = tempfile::tempdir().unwrap();
    let run = Run::new(2, 5);
    let path = folder.path().join("run.rrd");
    let mut recorder = RerunRecorder::create(&path, &run.about(), &RecordingSettings::default()).unwrap();
    run.rounds.iter().for_each(|round| round.record(&mut recorder));
    drop(recorder);
    compare_raw(&run, &Contents::of(&folder.path().join("run.rrd.part")));
}

#[test]
fn a_missing_folder_is_an_error_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("nowhere/run.rrd");
    let error = RerunRecorder::create(&path, &Run::new(1, 1).about(), &RecordingSettings::default()).map(drop).unwrap_err();
    let error = error.to_string();
    assert!(error.starts_with("cannot write ") && error.contains("nowhere/run.rrd.part: No such file"), "{error}");
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_is_an_error_at_once() {
    let folder = tempfile::tempdir().unwrap();
    std::os::unix::fs::symlink("/dev/full", folder.path().join("run.rrd.part")).unwrap();
    let path = folder.path().join("run.rrd");
    let error = RerunRecorder::create(&path, &Run::new(1, 1).about(), &RecordingSettings::default()).map(drop).unwrap_err();
    assert!(error.to_string().contains("No space left on device"), "{error}");
}

/// For looking at, and for measuring: `RECORDING=out.rrd AGENTS=4 ROUNDS=200 cargo test --release -- --ignored --nocapture`.
#[test]
#[ignore = "measures"]
fn a_long_recording_is_small_and_quick() {
    let number = |name: &str, default: u32| std::env::var(name).map_or(default, |text| text.parse().unwrap());
    let run = Run::new(number("AGENTS", 4), number("ROUNDS", 200));
    let path: PathBuf = std::env::var("RECORDING").map_or(std::env::temp_dir().join("long.rrd"), Into::into);
    let start = std::time::Instant::now();
    let mut recorder = RerunRecorder::create(&path, &run.about(), &RecordingSettings::default()).unwrap();
    let created = start.elapsed();
    run.rounds.iter().for_each(|round| round.record(&mut recorder));
    recorder.finish().unwrap();
    let seconds = start.elapsed().as_secs_f64();
    let states = run.rounds.iter().flat_map(|round| &round.episodes).map(|episode| episode.length() + 1).sum::<usize>() as f64;
    let bytes = std::fs::metadata(&path).unwrap().len() as f64;
    println!(
        "{states} states, {bytes} bytes: {:.1} B and {:.3} µs a state, {created:?} to begin",
        bytes / states,
        1e6 * seconds / states
    );
    let mut sizes: BTreeMap<String, (usize, u64)> = BTreeMap::new();
    for message in messages(&path) {
        let LogMsg::ArrowMsg(store, arrow) = &message else { continue };
        let chunk = Chunk::from_arrow_msg(arrow).unwrap();
        let kind =
            if store.kind() == StoreKind::Blueprint { "blueprint".to_owned() } else { kind(&chunk.entity_path().to_string()) };
        let encoded = rerun::external::re_log_encoding::rrd::Encoder::encode([Ok(&message)]).unwrap().len() as u64;
        let entry = sizes.entry(kind).or_default();
        *entry = (entry.0 + 1, entry.1 + encoded);
    }
    for (kind, (count, bytes)) in sizes {
        println!("{kind:40} {count:6} messages, {:6.2} B a state (with a file's head and index each)", bytes as f64 / states);
    }
}

fn kind(entity: &str) -> String {
    entity.replace(|character: char| character.is_ascii_digit(), "")
}

fn record(run: &Run, folder: &Path, settings: &RecordingSettings) -> PathBuf {
    let path = folder.join("run.rrd");
    let mut recorder = RerunRecorder::create(&path, &run.about(), settings).unwrap();
    run.rounds.iter().for_each(|round| round.record(&mut recorder));
    recorder.finish().unwrap();
    path
}

/// Each row of `/raw/agent_K` exactly once, in order, with every number unchanged.
fn compare_raw(run: &Run, contents: &Contents) {
    for agent in 0..run.agents as usize {
        let entity = format!("/raw/agent_{agent}");
        let episodes: Vec<&Episode> = run.rounds.iter().map(|round| &round.episodes[agent]).collect();
        let rows: usize = episodes.iter().map(|episode| episode.length() + 1).sum();
        assert_eq!(contents.times(&entity, "env_step"), (0..rows as i64).collect::<Vec<_>>());
        let repeated = |value: fn(&Episode) -> u32| -> Vec<i64> {
            episodes.iter().flat_map(|episode| vec![i64::from(value(episode)); episode.length() + 1]).collect()
        };
        assert_eq!(contents.times(&entity, "episode"), repeated(|episode| episode.episode));
        assert_eq!(contents.times(&entity, "round"), repeated(|episode| episode.round));
        for (index, name) in ["x", "x_dot", "theta", "theta_dot"].iter().enumerate() {
            let given: Vec<f32> = episodes.iter().flat_map(|e| e.observations.iter().skip(index).step_by(4)).copied().collect();
            assert_eq!(contents.numbers(&entity, &format!("State:{name}")), given);
        }
        let forces = episodes.iter().flat_map(|e| &e.actions).map(|&action| if action == 0.0 { -10.0 } else { 10.0 });
        assert_eq!(contents.numbers(&entity, "State:force"), forces.collect::<Vec<f32>>());
        let rewards = episodes.iter().flat_map(|e| &e.rewards).copied().collect::<Vec<f32>>();
        assert_eq!(contents.numbers(&entity, "State:reward"), rewards);
        let log_probs = episodes.iter().flat_map(|e| &e.log_probs).copied().collect::<Vec<f32>>();
        assert_eq!(contents.numbers(&entity, "State:log_prob"), log_probs);
        let bonuses = episodes.iter().flat_map(|e| &e.intrinsic_rewards).copied().collect::<Vec<f32>>();
        assert_eq!(contents.numbers(&entity, "State:intrinsic_reward"), bonuses);
        let word = |status| if status == Status::Terminated { "terminated" } else { "truncated" };
        let outcomes: Vec<String> = episodes.iter().map(|episode| word(episode.outcome).to_owned()).collect();
        assert_eq!(contents.words(&entity, "State:outcome"), outcomes);
        let last_rows: Vec<usize> = episodes
            .iter()
            .scan(0, |row, e| {
                *row += e.length() + 1;
                Some(*row - 1)
            })
            .collect();
        assert_eq!(contents.rows_with(&entity, "State:outcome"), last_rows);
        let others: Vec<usize> = (0..rows).filter(|row| last_rows.binary_search(row).is_err()).collect();
        assert_eq!(contents.rows_with(&entity, "State:force"), others);
    }
}

fn messages(path: &Path) -> Vec<LogMsg> {
    let decoder = DecoderApp::decode_lazy(BufReader::new(File::open(path).unwrap()));
    decoder.collect::<Result<_, _>>().unwrap()
}

/// A recording's chunks, by entity, in the order of the file.
struct Contents(BTreeMap<String, Vec<Chunk>>);

impl Contents {
    fn of(path: &Path) -> Self {
        let mut entities: BTreeMap<String, Vec<Chunk>> = BTreeMap::new();
        for message in messages(path) {
            if let LogMsg::ArrowMsg(store, arrow) = message
                && store.kind() == StoreKind::Recording
            {
                let chunk = Chunk::from_arrow_msg(&arrow).unwrap();
                entities.entry(chunk.entity_path().to_string()).or_default().push(chunk);
            }
        }
        Self(entities)
    }

    fn chunks(&self, entity: &str) -> &[Chunk] {
        self.0.get(entity).map_or(&[], Vec::as_slice)
    }

    fn times(&self, entity: &str, timeline: &'static str) -> Vec<i64> {
        let timeline = TimelineName::from(timeline);
        let columns = self.chunks(entity).iter().filter_map(|chunk| chunk.timelines().get(&timeline));
        columns.flat_map(|column| column.times_raw().to_vec()).collect()
    }

    fn numbers(&self, entity: &str, component: &str) -> Vec<f32> {
        let component = ComponentIdentifier::try_new(component).unwrap();
        self.chunks(entity).iter().flat_map(|chunk| chunk.iter_slices::<f32>(component).flatten().copied()).collect()
    }

    fn numbers64(&self, entity: &str, component: &str) -> Vec<f64> {
        let component = ComponentIdentifier::try_new(component).unwrap();
        self.chunks(entity).iter().flat_map(|chunk| chunk.iter_slices::<f64>(component).flatten().copied()).collect()
    }

    fn words(&self, entity: &str, component: &str) -> Vec<String> {
        let component = ComponentIdentifier::try_new(component).unwrap();
        let mut words = Vec::new();
        for list in self.chunks(entity).iter().filter_map(|chunk| chunk.components().get_array(component)) {
            let values = list.values().as_any().downcast_ref::<StringArray>().unwrap();
            words.extend(values.iter().flatten().map(ToOwned::to_owned));
        }
        words
    }

    fn integers(&self, entity: &str, component: &str) -> Vec<u32> {
        let component = ComponentIdentifier::try_new(component).unwrap();
        self.chunks(entity).iter().flat_map(|chunk| chunk.iter_slices::<u32>(component).flatten().copied()).collect()
    }

    fn points(&self, entity: &str) -> Vec<[f32; 2]> {
        let component = ComponentIdentifier::try_new("Points2D:positions").unwrap();
        self.chunks(entity).iter().flat_map(|chunk| chunk.iter_slices::<[f32; 2]>(component).flatten().copied()).collect()
    }

    /// The bytes of each picture, of densities or in colour.
    fn pictures(&self, entity: &str) -> Vec<Vec<u8>> {
        let names = ["DepthImage:buffer", "Image:buffer"].map(|name| ComponentIdentifier::try_new(name).unwrap());
        let bytes = |chunk: &Chunk| -> Vec<Vec<u8>> {
            let buffers = names
                .iter()
                .flat_map(|name| chunk.iter_slices::<&[u8]>(*name).flatten().map(|bytes| bytes.to_vec()).collect::<Vec<_>>());
            buffers.collect()
        };
        self.chunks(entity).iter().flat_map(bytes).collect()
    }

    /// The rows, counted over all chunks, that have the component.
    fn rows_with(&self, entity: &str, component: &str) -> Vec<usize> {
        self.lists(entity, component).iter().enumerate().filter_map(|(row, length)| length.map(|_| row)).collect()
    }

    fn lines_per_row(&self, entity: &str, component: &str) -> Vec<usize> {
        self.lists(entity, component).into_iter().flatten().collect()
    }

    fn lists(&self, entity: &str, component: &str) -> Vec<Option<usize>> {
        let component = ComponentIdentifier::try_new(component).unwrap();
        let lists = self.chunks(entity).iter().filter_map(|chunk| chunk.components().get_array(component));
        lists.flat_map(|list| (0..list.len()).map(|row| list.is_valid(row).then(|| list.value_length(row) as usize))).collect()
    }

    /// Every column of every entity, row by row, in words; however the rows are cut into chunks.
    fn columns(&self) -> BTreeMap<String, Vec<String>> {
        let mut columns: BTreeMap<String, Vec<String>> = BTreeMap::new();
        for (entity, chunk) in self.0.iter().flat_map(|(entity, chunks)| chunks.iter().map(move |chunk| (entity, chunk))) {
            for (name, column) in chunk.timelines() {
                columns.entry(format!("{entity} {name}")).or_default().extend(column.times_raw().iter().map(ToString::to_string));
            }
            for column in chunk.components().values() {
                let rows = (0..column.list_array.len()).map(|row| format!("{:?}", column.list_array.value(row)));
                columns.entry(format!("{entity} {}", column.descriptor.component)).or_default().extend(rows);
            }
        }
        columns
    }
}

/// A made-up team whose poles stay up longer and longer.
struct Run {
    agents: u32,
    spec: Spec,
    scene: Scene,
    rounds: Vec<Round>,
}

struct Round {
    round: u32,
    episodes: Vec<Episode>,
    episode_rows: Vec<EpisodeRow>,
    round_rows: Vec<RoundRow>,
    footage: Vec<Footage>,
}

impl Round {
    fn record(&self, recorder: &mut impl Recorder) {
        let round = RoundRecord {
            round: self.round,
            episodes: &self.episodes.iter().collect::<Vec<_>>(),
            episode_rows: &self.episode_rows,
            round_rows: &self.round_rows,
            footage: &self.footage,
        };
        recorder.record_round(&round).unwrap();
    }
}

impl Run {
    fn new(agents: u32, rounds: u32) -> Self {
        let mut env_steps = 0;
        let rounds = (0..rounds).map(|round| made_up_round(agents, round, rounds, &mut env_steps)).collect();
        Self { agents, spec: cart_pole(), scene: cart_and_pole(), rounds }
    }

    fn about(&self) -> RecordingAbout<'_> {
        RecordingAbout {
            name: "cartpole-made-up",
            focus: Focus::Learning,
            spec: &self.spec,
            scene: Some(&self.scene),
            agents: self.agents,
            largest_bonus: Some(0.01),
            episodes: self.rounds.len() as u32,
            run_seed: 7,
            scenario: "Scenario(\n    environment: \"cartpole\",\n    agents: (count: 4),\n)",
            properties: &[],
        }
    }
}

fn cart_pole() -> Spec {
    let quantity = |name: &str, unit: &str, end: f32| Quantity { name: name.into(), unit: unit.into(), range: [-end, end] };
    Spec {
        name: "cartpole".to_owned(),
        description: "Keep a pole upright on a cart.".to_owned(),
        observations: vec![
            quantity("x", "m", 2.4),
            quantity("x_dot", "m/s", 3.0),
            quantity("theta", "rad", 0.209),
            quantity("theta_dot", "rad/s", 3.0),
        ],
        actions: vec![Action { quantity: quantity("force", "N", 10.0), choice: Choice::Discrete(vec![-10.0, 10.0]) }],
        control_step: 0.02,
        time_limit: 200,
        reward_threshold: Some(195.0),
    }
}

fn cart_and_pole() -> Scene {
    let body = |name: &str, shapes| SceneBody { name: name.to_owned(), fixed: name == "rail", shapes, hinge: None };
    Scene {
        bodies: vec![
            body("rail", vec![Shape::Polyline(vec![[-2.4, 0.0], [2.4, 0.0]])]),
            body("cart", vec![Shape::Box { center: [0.0, 0.0], half_size: [0.25, 0.125], angle: 0.0 }]),
            body("pole", vec![Shape::Capsule { from: [0.0, 0.0], to: [0.0, 1.0], radius: 0.04 }]),
        ],
        tracked: None,
    }
}

fn made_up_round(agents: u32, round: u32, rounds: u32, env_steps: &mut u64) -> Round {
    let skill = (f64::from(round) / f64::from(rounds)).min(0.9);
    let played: Vec<(Episode, Footage)> = (0..agents).map(|agent| made_up_episode(agent, round, skill)).collect();
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
    Round {
        round,
        episode_rows: episodes.iter().map(row).collect(),
        round_rows: (0..agents).map(|agent| made_up_update(agent, round, skill)).collect(),
        footage: round.is_multiple_of(10).then(|| played[0].1.clone()).into_iter().collect(),
        episodes,
    }
}

fn made_up_update(agent: u32, round: u32, skill: f64) -> RoundRow {
    let wave = ((round + 9 * agent) as f32 * 0.7).sin() * 0.05;
    let left = 1.0 - skill as f32;
    RoundRow {
        agent,
        round,
        value_loss: left * left + wave.abs(),
        policy_loss: -0.02 * left + 0.1 * wave,
        ratio_deviation: 1.1 + wave,
        largest_ratio: 2.0 + wave,
        intrinsic_reward: 0.01 + wave,
        prediction_error: 0.5 + wave,
        bonus_agreement: 0.3 + wave,
        clipped_fraction: 0.2 + wave,
        entropy: 0.69 * left + wave.abs(),
        coverage: 0.4 * skill.sqrt() + 0.01 * f64::from(agent),
        visitation_entropy: 3.0 * skill + 0.01 * f64::from(agent),
        visitation_evenness: 0.5 * skill,
        team_coverage: 0.5 * skill.sqrt(),
        team_overlap: 0.8,
        effective_agents: 1.0 + f64::from(round),
    }
}

/// A pole held up by a controller that heeds its state more often with growing skill.
fn made_up_episode(agent: u32, round: u32, skill: f64) -> (Episode, Footage) {
    let mut noise = Noise((u64::from(agent) << 32) | (u64::from(round) << 8) | 1);
    let mut state = [0.0_f64; 4].map(|_| noise.symmetric() * 0.05);
    let mut episode = Episode {
        agent,
        episode: round,
        round,
        observations: state.map(|x| x as f32).to_vec(),
        actions: Vec::new(),
        rewards: Vec::new(),
        log_probs: Vec::new(),
        intrinsic_rewards: Vec::new(),
        advantages: Vec::new(),
        outcome: Status::Truncated,
    };
    let mut footage = Footage { agent, episode: round, poses: poses(state).to_vec(), ..Footage::default() };
    while episode.length() < 200 {
        let lean = 0.05 * (state[0] + 0.3 * f64::from(agent) - 0.5) + 0.1 * state[1] + state[2] + 0.3 * state[3];
        let heed = noise.symmetric().abs() < skill + 0.1;
        let push = if heed { lean > 0.0 } else { noise.symmetric() > 0.0 };
        state = moved(state, if push { 10.0 } else { -10.0 });
        episode.actions.push(f32::from(u8::from(push)));
        episode.intrinsic_rewards.push(0.001 * (episode.length() % 10) as f32);
        episode.advantages.push(episode.length() as f32 - 30.0);
        episode.rewards.push(1.0);
        episode.log_probs.push(-(1.0 + noise.symmetric().abs() as f32).ln());
        episode.observations.extend(state.map(|x| x as f32));
        footage.poses.extend(poses(state));
        if state[0].abs() > 2.4 || state[2].abs() > 0.209 {
            episode.outcome = Status::Terminated;
            break;
        }
    }
    (episode, footage)
}

fn poses([x, _, theta, _]: [f64; 4]) -> [Pose; 3] {
    let cart = Pose { x: x as f32, y: 0.1, angle: 0.0 };
    [Pose::default(), cart, Pose { angle: -theta as f32, ..cart }]
}

fn moved([x, v, theta, omega]: [f64; 4], force: f64) -> [f64; 4] {
    let push = (force + 0.05 * omega * omega * theta.sin()) / 1.1;
    let alpha = (9.8 * theta.sin() - theta.cos() * push) / (0.5 * (4.0 / 3.0 - 0.1 * theta.cos().powi(2) / 1.1));
    let a = push - 0.05 * alpha * theta.cos() / 1.1;
    [x + 0.02 * v, v + 0.02 * a, theta + 0.02 * omega, omega + 0.02 * alpha]
}

struct Noise(u64);

impl Noise {
    /// Evenly between −1 and 1.
    fn symmetric(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}
