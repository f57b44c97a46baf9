//! Files of visited states that other programs record: reading, damage, and the commands.
//!
//! The files are written by this module, as `docs/state_files.md` describes them.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use tempfile::TempDir;

use super::util::{run_refused, run_successful, seedbed, stderr, stdout};
use seedbed::record::state_files::StateFiles;
use seedbed::record::{ReadError, RecordedEpisode, RecordedStates};
use seedbed::review::LoadedRun;
use seedbed::review::recording_stats::RecordingStats;
use seedbed::review::selection::EpisodeSelection;
use seedbed::run::folder::RunFolder;
use seedbed::run::measures::visitation::Visitation;
use seedbed_env::Status;

/// CRC-32 of zlib, bit by bit.
fn checksum(bytes: &[u8]) -> u32 {
    let step = |crc: u32| (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg());
    !bytes.iter().fold(u32::MAX, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| step(crc))
    })
}

pub(crate) fn frame(kind: [u8; 4], payload: &[u8]) -> Vec<u8> {
    let mut start = kind.to_vec();
    start.extend((payload.len() as u32).to_le_bytes());
    start.extend(checksum(payload).to_le_bytes());
    let own_checksum = checksum(&start);
    start.extend(own_checksum.to_le_bytes());
    [&start, payload].concat()
}

/// Two observations, of which the second has no given range, and one action.
pub(crate) fn header(agent: u32) -> Value {
    json!({
        "agent": agent, "environment": "Walk-v0", "time_limit": null, "step_seconds": 0.05,
        "observations": [
            {"name": "x", "unit": "m", "low": -1.0, "high": 1.0},
            {"name": "Höhe", "unit": "", "low": null, "high": null},
        ],
        "actions": [{"name": "push", "unit": "N", "low": 0.0, "high": 2.0}],
    })
}

pub(crate) fn file_start(header: &Value) -> Vec<u8> {
    let mut start = b"SBSTATES".to_vec();
    start.extend(1_u32.to_le_bytes());
    start.extend(checksum(&start).to_le_bytes());
    [start, frame(*b"HEAD", header.to_string().as_bytes())].concat()
}

/// Steps of an episode: observations, actions and rewards.
#[derive(Clone)]
pub(crate) struct Steps {
    episode: u32,
    first_step: u32,
    outcome: u32,
    pub(crate) total: f64,
    observations: Vec<f32>,
    actions: Vec<f32>,
    rewards: Vec<f32>,
}

impl Steps {
    fn payload(&self) -> Vec<u8> {
        let numbers = [
            self.episode,
            self.first_step,
            self.rewards.len() as u32,
            self.outcome,
        ];
        let mut payload: Vec<u8> = numbers.into_iter().flat_map(u32::to_le_bytes).collect();
        payload.extend(self.total.to_le_bytes());
        for array in [&self.observations, &self.actions, &self.rewards] {
            payload.extend(array.iter().flat_map(|value| value.to_le_bytes()));
        }
        payload
    }

    pub(crate) fn frame(&self) -> Vec<u8> {
        frame(*b"EPIS", &self.payload())
    }
}

/// Episode `number` of two steps. Its total reward is not representable in single precision.
pub(crate) fn episode(number: u32, outcome: u32) -> Steps {
    let base = number as f32;
    Steps {
        episode: number,
        first_step: 0,
        outcome,
        total: 0.1 + f64::from(number),
        observations: vec![0.0, base, 0.5, base + 10.0, 2.0, base - 10.0],
        actions: vec![1.0, 2.0],
        rewards: vec![0.1, base],
    }
}

/// A file with one episode of these states of observations, with rewards of 1.
pub(crate) fn file_of_states(agent: u32, observations: &Value, states: &[f32]) -> Vec<u8> {
    let mut header = header(agent);
    header["observations"] = observations.clone();
    let steps = states.len() / observations.as_array().unwrap().len() - 1;
    let episode = Steps {
        observations: states.to_vec(),
        actions: vec![0.0; steps],
        rewards: vec![1.0; steps],
        total: steps as f64,
        ..episode(0, 1)
    };
    [file_start(&header), episode.frame()].concat()
}

/// A file of episodes of two observations.
pub(crate) fn file_of_episodes(agent: u32, episodes: &[Steps]) -> Vec<u8> {
    let frames: Vec<Vec<u8>> = episodes.iter().map(Steps::frame).collect();
    [file_start(&header(agent)), frames.concat()].concat()
}

/// An episode of one step with this reward.
pub(crate) fn short_episode(number: u32, reward: f32) -> Steps {
    Steps {
        observations: vec![0.0, 1.0, 0.5, 2.0],
        actions: vec![1.0],
        rewards: vec![reward],
        total: f64::from(reward),
        ..episode(number, 1)
    }
}

pub(crate) fn closed(episodes: u32) -> Vec<u8> {
    frame(*b"DONE", &episodes.to_le_bytes())
}

/// A file with three episodes, of which the second is written in two parts after an attempt that was
/// cut off.
pub(crate) fn small_file(agent: u32) -> Vec<u8> {
    [file_start(&header(agent)), small_frames().concat()].concat()
}

fn small_frames() -> Vec<Vec<u8>> {
    let second = episode(1, 2);
    let first_part = Steps {
        outcome: 0,
        observations: second.observations[..2].to_vec(),
        actions: second.actions[..1].to_vec(),
        rewards: second.rewards[..1].to_vec(),
        ..second.clone()
    };
    let last_part = Steps {
        first_step: 1,
        observations: second.observations[2..].to_vec(),
        actions: second.actions[1..].to_vec(),
        rewards: second.rewards[1..].to_vec(),
        ..second
    };
    let cut_off = Steps {
        observations: vec![77.0; 2],
        ..first_part.clone()
    };
    vec![
        episode(0, 1).frame(),
        cut_off.frame(),
        first_part.frame(),
        last_part.frame(),
        closed(2),
        episode(2, 1).frame(),
        closed(3),
    ]
}

fn expected_episode(agent: u32, number: u32) -> RecordedEpisode {
    let steps = episode(number, 0);
    RecordedEpisode {
        agent,
        episode: number,
        round: number,
        observations: steps.observations,
        actions: steps.actions,
        info: Vec::new(),
        rewards: steps.rewards,
        intrinsic_rewards: Vec::new(),
        advantages: Vec::new(),
        outcome: if number == 1 {
            Status::Truncated
        } else {
            Status::Terminated
        },
    }
}

/// A run folder with these files of agents 0, 1 and so on.
fn run_with(files: &[Vec<u8>]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (agent, bytes) in files.iter().enumerate() {
        write_file(folder.path(), agent as u32, bytes);
    }
    folder
}

pub(crate) fn write_file(folder: &Path, agent: u32, bytes: &[u8]) -> PathBuf {
    let path = folder.join(format!("states/agent_{agent}.states"));
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(&path, bytes).unwrap();
    path
}

fn read(path: &Path) -> Result<(StateFiles, Vec<RecordedEpisode>), ReadError> {
    let files = StateFiles::open_file(path)?;
    let episodes = files.episodes().collect::<Result<_, _>>()?;
    Ok((files, episodes))
}

fn error_of(bytes: &[u8]) -> String {
    let folder = run_with(&[bytes.to_vec()]);
    let error = StateFiles::open_folder(folder.path()).unwrap_err();
    error.to_string()
}

#[test]
fn episodes_axes_and_rows_are_those_in_the_files() {
    let folder = run_with(&[small_file(0), small_file(1)]);
    let run = LoadedRun::open(folder.path()).unwrap();
    let states = run.recording.as_ref().unwrap();
    let episodes: Vec<RecordedEpisode> = states.episodes().unwrap().map(Result::unwrap).collect();
    let expected: Vec<RecordedEpisode> = (0..2)
        .flat_map(|agent| (0..3).map(move |number| expected_episode(agent, number)))
        .collect();
    assert_eq!(episodes, expected);
    let names: Vec<&str> = states
        .observations()
        .iter()
        .map(|axis| axis.name.as_str())
        .collect();
    assert_eq!(names, ["x", "Höhe"]);
    assert_eq!(states.observations()[0].range, [-1.0, 1.0], "as given");
    assert_eq!(
        states.observations()[1].range,
        [-10.0, 12.0],
        "as visited by finished episodes"
    );
    assert_eq!(states.properties()["agents"], "2");
    let rows: Vec<_> = run
        .episodes
        .iter()
        .map(|row| {
            (
                row.round,
                row.agent,
                row.env_steps,
                row.r#return,
                row.length,
            )
        })
        .collect();
    assert_eq!(
        rows,
        [
            (0, 0, 2, 0.1, 2),
            (0, 1, 4, 0.1, 2),
            (1, 0, 6, 1.1, 2),
            (1, 1, 8, 1.1, 2),
            (2, 0, 10, 2.1, 2),
            (2, 1, 12, 2.1, 2)
        ]
    );
    assert!(run.warnings.is_empty() && !run.is_finished && run.agent_count() == 2);
}

/// Every bit of a file is protected: no number is read from a file in which one has changed.
#[test]
fn a_changed_bit_is_an_error() {
    let bytes = small_file(0);
    let folder = run_with(std::slice::from_ref(&bytes));
    let path = folder.path().join("states/agent_0.states");
    assert_eq!(read(&path).unwrap().1.len(), 3);
    for index in 0..bytes.len() {
        for bit in 0..8 {
            let mut changed = bytes.clone();
            changed[index] ^= 1 << bit;
            fs::write(&path, &changed).unwrap();
            let Err(error) = read(&path) else {
                panic!("bit {bit} of byte {index} was changed, but the file was read");
            };
            assert!(error.to_string().contains("agent_0.states"), "{error}");
        }
    }
}

/// A process that is killed leaves the beginning of a file.
#[test]
fn the_beginning_of_a_file_has_its_complete_episodes() {
    let (start, frames) = (file_start(&header(0)).len(), small_frames());
    let bytes = small_file(0);
    let folder = run_with(&[Vec::new()]);
    let path = folder.path().join("states/agent_0.states");
    let mut ends = vec![start];
    for frame in &frames {
        ends.push(ends[ends.len() - 1] + frame.len());
    }
    // Episodes are complete after frames 1, 4 and 6.
    let complete_after = [ends[1], ends[4], ends[6]];
    for length in 0..bytes.len() {
        fs::write(&path, &bytes[..length]).unwrap();
        let found = read(&path);
        if length < start {
            assert!(found.is_err(), "{length}");
            continue;
        }
        let (files, episodes) = found.unwrap();
        let expected = complete_after.iter().filter(|end| **end <= length).count();
        assert_eq!(episodes.len(), expected, "{length}");
        assert_eq!(
            files.warnings().is_empty(),
            ends.contains(&length),
            "{length}"
        );
    }
}

#[test]
fn zeros_at_the_end_are_an_incomplete_frame_and_other_bytes_are_damage() {
    let with_end = |end: &[u8]| [small_file(0), end.to_vec()].concat();
    let folder = run_with(&[with_end(&[0; 40])]);
    let files = StateFiles::open_folder(folder.path()).unwrap();
    assert!(
        files.warnings()[0].contains("ignored 40 bytes"),
        "{:?}",
        files.warnings()
    );
    let mut end = [0; 40];
    end[39] = 1;
    let offset = small_file(0).len();
    let error = error_of(&with_end(&end));
    assert!(
        error.contains(&format!("is damaged at offset {offset}")),
        "{error}"
    );
}

/// The checksums of these files are right, but their contents are impossible.
#[test]
fn impossible_contents_are_refused() {
    let good = episode(0, 1);
    let with = |frame: Vec<u8>| [file_start(&header(0)), frame].concat();
    let steps = |change: fn(&mut Steps)| {
        let mut steps = good.clone();
        change(&mut steps);
        with(steps.frame())
    };
    let offset = file_start(&header(0)).len();
    for (bytes, words) in [
        (
            steps(|steps| steps.episode = 1),
            "episode 1, expected episode 0",
        ),
        (
            steps(|steps| steps.first_step = 3),
            "steps from 3 on, expected 0",
        ),
        (
            steps(|steps| steps.outcome = 7),
            "outcome 7, expected 0 to 2",
        ),
        (
            steps(|steps| steps.outcome = 0),
            "bytes do not contain 2 steps",
        ),
        (
            steps(|steps| _ = steps.actions.pop()),
            "bytes do not contain 2 steps",
        ),
        (with(frame(*b"EPIS", &[0; 23])), "a frame of 23 bytes"),
        (with(frame(*b"WHAT", &[])), "unknown kind of frame"),
        (with(frame(*b"HEAD", &[])), "a second header"),
        (with(closed(1)), "another number of episodes"),
        (
            steps(|steps| {
                steps.observations.truncate(2);
                steps.actions.clear();
                steps.rewards.clear();
            }),
            "an episode without steps",
        ),
    ] {
        let error = error_of(&bytes);
        assert!(error.contains(words), "{error}");
        assert!(
            error.contains(&format!("is damaged at offset {offset}")),
            "{error}"
        );
    }
}

#[test]
fn impossible_headers_are_refused() {
    let with = |pointer: &str, value: Value| {
        let mut header = header(0);
        *header.pointer_mut(pointer).unwrap() = value;
        error_of(&file_start(&header))
    };
    for (error, words) in [
        (
            with("/observations/1/name", json!("x")),
            "observations have the name `x` twice",
        ),
        (
            with("/observations/0/low", json!(2.0)),
            "the axis `x` has the range",
        ),
        (
            with("/observations", json!([])),
            "0 observations, expected 1 to",
        ),
        (with("/agent", json!(-1)), "the header is not as expected"),
        (with("/agent", json!(1 << 20)), "is not below 65536"),
        (with("/step_seconds", json!(0.0)), "a step of 0 s"),
        (error_of(b"{}"), "is not a file of visited states"),
    ] {
        assert!(error.contains(words), "{error}");
    }
    let mut newer = file_start(&header(0));
    newer[8] = 2;
    let sum = checksum(&newer[..12]).to_le_bytes();
    newer[12..16].copy_from_slice(&sum);
    let error = error_of(&newer);
    assert!(error.contains("version 2 of the format"), "{error}");
}

#[test]
fn agents_with_other_axes_are_not_in_one_run() {
    let mut other = header(1);
    other["observations"][0]["high"] = json!(3.0);
    let folder = run_with(&[small_file(0), file_start(&other)]);
    let error = StateFiles::open_folder(folder.path())
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("observations of agent 1 differ from those of agent 0"),
        "{error}"
    );
    let folder = run_with(&[small_file(0), small_file(0)]);
    let error = StateFiles::open_folder(folder.path())
        .unwrap_err()
        .to_string();
    assert!(error.contains("another file has agent 0, too"), "{error}");
}

/// Agent 2 has no file, for example because its process never started.
#[test]
fn missing_agents_have_no_visits() {
    let folder = tempfile::tempdir().unwrap();
    for agent in [0, 1, 3] {
        write_file(folder.path(), agent, &small_file(agent));
    }
    let path = folder.path().to_str().unwrap();
    let summary: Value =
        serde_json::from_str(&run_successful(&["inspect", path, "--json"])).unwrap();
    assert_eq!(summary["agents"][2]["episodes"], 0);
    assert_eq!(summary["agents"][2]["coverage"], 0.0);
    assert_eq!(
        summary["effective_agents"], 1.0,
        "three agents with equal visits"
    );
    run_successful(&["export", path, "--to", &format!("{path}/run.rrd")]);
}

/// Two copies of one learner. Copy 0 is reset by a step that is not recorded before each episode but the
/// first, as in the mode `NEXT_STEP`; its episodes end after 1, 3 and 5 steps, that of copy 1 after 2.
#[test]
fn episodes_of_copies_are_in_the_order_of_steps_that_need_not_be_recorded() {
    let of_learner = |agent: u32| {
        let mut header = header(agent);
        header["learner"] = json!(0);
        file_start(&header)
    };
    let begin = |steps: u64| frame(*b"STEP", &steps.to_le_bytes());
    let copy_0 = [
        of_learner(0),
        short_episode(0, 1.0).frame(),
        begin(2),
        short_episode(1, 3.0).frame(),
        begin(4),
        short_episode(2, 5.0).frame(),
        closed(3),
    ];
    let copy_1 = [of_learner(1), episode(0, 1).frame(), closed(1)];
    let folder = run_with(&[copy_0.concat(), copy_1.concat()]);
    let files = StateFiles::open_folder(folder.path()).unwrap();
    let returns = files.learners().returns(files.episode_rows());
    assert_eq!(returns, [[1.0, 0.1, 3.0, 5.0]]);
    let error = error_of(&[file_start(&header(0)), frame(*b"STEP", &[0; 4])].concat());
    assert!(
        error.contains("a number of steps without 8 bytes"),
        "{error}"
    );
}

/// Each number of an agent takes memory, also without a file: 65,536² overlaps of pairs would take 34 GB.
#[test]
fn numbers_of_agents_with_large_gaps_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().to_str().unwrap();
    for agent in [0, 65535] {
        write_file(folder.path(), agent, &small_file(agent));
    }
    for command in ["inspect", "plot", "explore"] {
        let error = run_refused(&[command, path]);
        let words = "it has agent 65535 and 2 agents in all, expected numbers below 1024";
        assert!(error.contains(words), "{error}");
    }
    let single = write_file(folder.path(), 65535, &small_file(65535));
    fs::remove_file(&single).unwrap();
    write_file(folder.path(), 1023, &small_file(1023));
    assert_eq!(
        StateFiles::open_folder(folder.path())
            .unwrap()
            .agent_count(),
        1024
    );
}

/// The summary is written when all files are complete, so that the end of a file was lost later.
#[test]
fn a_finished_run_has_the_episodes_of_its_summary() {
    let folder = run_with(&[small_file(0), small_file(1)]);
    let path = folder.path().to_str().unwrap();
    let summary = folder.path().join("summary.json");
    fs::write(
        &summary,
        r#"{"agents": 2, "episodes_of_agents": {"0": 3, "1": 3}, "env_steps": 12}"#,
    )
    .unwrap();
    assert!(run_successful(&["inspect", path]).contains("finished"));
    let mut frames = small_frames();
    frames.truncate(1);
    write_file(
        folder.path(),
        1,
        &[file_start(&header(1)), frames.concat()].concat(),
    );
    let words = "the number of episodes of agent 1 is 1, expected 3 as in summary.json";
    let table = format!("{path}/states.csv");
    for arguments in [
        &["inspect", path][..],
        &["plot", path],
        &["explore", path],
        &["film", path],
        &["export", path, "--to", &table],
    ] {
        let error = run_refused(arguments);
        assert!(
            error.contains(words) && error.contains("delete summary.json"),
            "{error}"
        );
    }
    let listed: Value = serde_json::from_str(&run_successful(&["runs", path, "--json"])).unwrap();
    assert_eq!(listed[0]["state"], "unreadable");
    fs::write(&summary, "{").unwrap();
    let error = run_refused(&["inspect", path]);
    assert!(
        error.contains("summary.json") && error.contains("it is no summary"),
        "{error}"
    );
    fs::remove_file(&summary).unwrap();
    assert!(run_successful(&["inspect", path]).contains("not finished"));
}

/// The measures that commands show are those of the states in the files.
#[test]
fn commands_show_runs_that_others_recorded() {
    let folder = run_with(&[small_file(0), small_file(1)]);
    let path = folder.path().to_str().unwrap();
    let out = |name: &str| format!("{path}/{name}");
    let summary: Value =
        serde_json::from_str(&run_successful(&["inspect", path, "--json"])).unwrap();
    assert_eq!(summary["finished"], false);
    assert_eq!(summary["env_steps"], 12);
    assert_eq!(summary["team_returns"], json!([0.1, 1.1, 2.1]));
    assert_eq!(
        summary["observations"][1]["axis_range"],
        json!([-10.0, 12.0])
    );
    assert_eq!(summary["observations"][0]["outside"], 1.0 / 3.0);
    let text = run_successful(&["inspect", path]);
    assert!(
        text.contains("Walk-v0") && text.contains("agent_1.states"),
        "{text}"
    );
    for command in [
        &["plot", path][..],
        &["explore", path],
        &["film", path, "--seconds", "0.5"],
        &["export", path, "--to", &out("states.csv")],
        &[
            "export",
            path,
            "--to",
            &out("episodes.csv"),
            "--content",
            "episodes",
        ],
        &["export", path, "--tensorboard", &out("logs")],
    ] {
        run_successful(command);
    }
    for name in ["plot.svg", "explore.html", "film.gif", "logs/agent_1"] {
        assert!(folder.path().join(name).exists(), "{name}");
    }
    let states = fs::read_to_string(folder.path().join("states.csv")).unwrap();
    let lines: Vec<&str> = states.lines().collect();
    assert_eq!(lines.len(), 1 + 2 * 3 * 3);
    assert_eq!(
        lines[0],
        "agent,episode,round,step,x,Höhe,push,reward,outcome"
    );
    assert_eq!(lines[1], "0,0,0,0,0,0,1,0.1,terminated");
    let error = run_refused(&["plot", path, "--what", "curves"]);
    assert!(error.contains("has no rounds.csv"), "{error}");
    run_successful(&[
        "export",
        path,
        "--to",
        &out("rounds.csv"),
        "--content",
        "rounds",
    ]);
    run_successful(&["plot", path, "--what", "curves"]);
    let rounds = LoadedRun::open(folder.path()).unwrap().rounds;
    let summary = run_successful(&["inspect", path, "--json"]);
    let summary: Value = serde_json::from_str(&summary).unwrap();
    assert_eq!(rounds.len(), 6);
    assert_eq!(rounds[5].coverage, summary["agents"][1]["coverage"]);
    assert_eq!(
        rounds[5].value_loss, None,
        "what agents learned is not known"
    );
}

#[test]
fn runs_that_others_recorded_are_listed() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("walk");
    write_file(&run, 0, &small_file(0));
    let list = || -> Value {
        let path = folder.path().to_str().unwrap();
        serde_json::from_str(&run_successful(&["runs", path, "--json"])).unwrap()
    };
    let unfinished = list();
    assert_eq!(unfinished[0]["state"], "unfinished");
    assert_eq!(unfinished[0]["environment"], "Walk-v0");
    assert_eq!(unfinished[0]["episodes_per_agent"], 3);
    assert_eq!(unfinished[0]["final_return"], 1.1);
    fs::write(
        run.join("summary.json"),
        r#"{"environment":"Walk-v0","agents":1,"final_return":5}"#,
    )
    .unwrap();
    assert_eq!(list()[0]["state"], "finished");
    // Numbers are those of the files of states; the summary is for other tools.
    assert_eq!(list()[0]["final_return"], 1.1);
    fs::remove_file(run.join("summary.json")).unwrap();
    let mut damaged = small_file(0);
    damaged[300] ^= 1;
    write_file(&run, 0, &damaged);
    assert_eq!(list()[0]["state"], "unreadable");
}

#[test]
fn incomplete_files_are_a_warning_and_damaged_files_an_error() {
    let bytes = small_file(0);
    let folder = run_with(&[bytes[..bytes.len() - 30].to_vec()]);
    let path = folder.path().to_str().unwrap();
    let output = seedbed(&["inspect", path]);
    assert!(output.status.success() && stdout(&output).contains("Walk-v0"));
    let warning = stderr(&output);
    assert!(
        warning.contains("warning: ") && warning.contains("agent_0.states: ignored"),
        "{warning}"
    );
    let mut damaged = bytes;
    damaged[400] ^= 4;
    write_file(folder.path(), 0, &damaged);
    for command in ["inspect", "plot", "explore", "film"] {
        let error = run_refused(&[command, path]);
        assert!(error.contains("is damaged at offset"), "{error}");
    }
}

/// The recording for Rerun has the same states, returns and measures.
#[test]
fn a_recording_is_made_of_state_files() {
    let folder = run_with(&[small_file(0), small_file(1)]);
    let path = folder.path().to_str().unwrap();
    let rrd = format!("{path}/run.rrd");
    let printed = run_successful(&["export", path, "--to", &rrd]);
    assert!(
        printed.contains("18 states") && printed.contains("rerun "),
        "{printed}"
    );
    let files = RecordedStates::StateFiles(StateFiles::open_folder(folder.path()).unwrap());
    let recording = RecordedStates::open(Path::new(&rrd)).unwrap();
    assert_eq!(recording.observations(), files.observations());
    assert_eq!(recording.actions(), files.actions());
    assert_eq!(recording.properties()["environment"], "Walk-v0");
    let all = |states: &RecordedStates| -> Vec<RecordedEpisode> {
        let mut episodes: Vec<_> = states.episodes().unwrap().map(Result::unwrap).collect();
        episodes.sort_by_key(|episode| (episode.agent, episode.episode));
        episodes
    };
    assert_eq!(all(&recording), all(&files));
    let coverage = |states: &RecordedStates| -> Vec<f64> {
        let stats = RecordingStats::of(states, &EpisodeSelection::all(), |_| ()).unwrap();
        stats.visitation.iter().map(Visitation::coverage).collect()
    };
    assert_eq!(coverage(&recording), coverage(&files));
    // The directory is still read from its files of states.
    assert!(
        LoadedRun::open(folder.path())
            .unwrap()
            .state_files()
            .is_some()
    );
    let error = run_refused(&["export", &rrd, "--to", &format!("{path}/other.rrd")]);
    assert!(error.contains("has a recording already"), "{error}");
}

/// `--overwrite` replaces runs of seedbed only.
#[test]
fn no_run_takes_the_place_of_what_others_recorded() {
    let folder = run_with(&[small_file(0)]);
    let path = folder.path().to_str().unwrap();
    let run = [
        "run",
        "cartpole",
        "--set",
        "stop=Episodes(2)",
        "--out",
        path,
    ];
    for summary in [false, true] {
        if summary {
            fs::write(folder.path().join("summary.json"), "{}").unwrap();
        }
        let error = run_refused(&[&run[..], &["--overwrite"]].concat());
        assert!(error.contains("does not contain a seedbed run"), "{error}");
    }
    assert_eq!(RunFolder::new(folder.path()).state_files().len(), 1);
}
