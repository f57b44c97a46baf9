//! Runs as they are looked at afterwards: `inspect`, `plot`, and the sample recording that comes with the sources.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use seedbed::record::EpisodeRow;
use seedbed::record::rerun::read::{RecordedEpisode, Recording};
use seedbed::run::review::Review;

const SAMPLE: &str = "recordings/sample/run.rrd";

fn seedbed(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_seedbed"));
    command
        .args(arguments)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .expect("the binary runs")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// What a command says when it succeeds.
fn said(arguments: &[&str]) -> String {
    let output = seedbed(arguments);
    assert!(
        output.status.success(),
        "{arguments:?}: {}",
        text(&output.stderr)
    );
    text(&output.stdout)
}

/// What a command says when the input is wrong.
fn refusal(arguments: &[&str]) -> String {
    let output = seedbed(arguments);
    assert_eq!(
        output.status.code(),
        Some(2),
        "{arguments:?}: {}",
        text(&output.stderr)
    );
    text(&output.stderr)
}

/// Two agents, six episodes.
fn small_run(folder: &Path, more: &[&str]) -> PathBuf {
    let path = folder.join("run");
    let out = path.to_str().unwrap();
    let base = [
        "run",
        "scenarios/cartpole.ron",
        "--quiet",
        "--set",
        "agents.count=2",
        "--set",
        "stop=Episodes(6)",
        "--out",
        out,
    ];
    said(&[&base, more].concat());
    path
}

/// The recording knows as much as the tables: with and without them the same is said of agents and states.
#[test]
fn a_recording_alone_tells_the_same_as_its_folder() {
    let folder = tempfile::tempdir().unwrap();
    let run = small_run(folder.path(), &[]);
    let alone = folder.path().join("alone.rrd");
    std::fs::copy(run.join("run.rrd"), &alone).unwrap();
    let [with_tables, without] =
        [&run, &alone].map(|path| said(&["inspect", path.to_str().unwrap()]));
    assert!(
        with_tables.starts_with("run, seed 0: 2 agents in cartpole, 6 episodes each, ")
            || with_tables.starts_with("cartpole")
    );
    let from_returns = |page: &str| {
        let (_, rest) = page.split_once("mean return of the team").unwrap();
        rest.split_once("files").unwrap().0.to_owned()
    };
    assert_eq!(from_returns(&with_tables), from_returns(&without));
    for wanted in [
        "theta_dot [rad/s]",
        "overlap of where two agents were",
        "agents that share none",
    ] {
        assert!(without.contains(wanted), "{without}");
    }
    let tables = Review::open(&run).unwrap();
    let mut lone = Review::open(&alone).unwrap();
    lone.survey(|_| ()).unwrap();
    let of_episodes = |rows: &[EpisodeRow]| -> Vec<EpisodeRow> {
        let of_episode = |row: &EpisodeRow| EpisodeRow {
            visitation_entropy: 0.0,
            team_overlap: 0.0,
            effective_agents: 0.0,
            ..row.clone()
        };
        rows.iter().map(of_episode).collect()
    };
    assert_eq!(of_episodes(&lone.episodes), of_episodes(&tables.episodes));
}

#[test]
fn tables_alone_are_inspected_and_their_curves_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let run = small_run(folder.path(), &["--no-recording"]);
    let run = run.to_str().unwrap();
    let page = said(&["inspect", run]);
    assert!(
        page.contains("the team visits as many different places as")
            && !page.contains("what agents saw"),
        "{page}"
    );
    let figure = format!("{run}/curves.svg");
    assert!(
        said(&["plot", run, "--what", "returns,curves", "--out", &figure])
            .starts_with(&format!("{figure}: "))
    );
    let wrong = refusal(&["plot", run]);
    let wanted = "has no recording, so that its states are not known; draw --what returns,curves, which takes the tables alone\n";
    assert!(wrong.ends_with(wanted), "{wrong}");
}

#[test]
fn runs_that_are_none_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let empty = folder.path().to_str().unwrap();
    let nowhere = folder.path().join("nowhere");
    let nowhere = nowhere.to_str().unwrap();
    assert_eq!(
        refusal(&["inspect", nowhere]),
        format!("error: there is no file or folder {nowhere}\n")
    );
    assert_eq!(
        refusal(&["inspect", empty]),
        format!("error: {empty} holds no run: neither episodes.csv nor run.rrd is there\n")
    );
    let broken = folder.path().join("episodes.csv");
    std::fs::write(&broken, "agent,episode\n0,zero\n").unwrap();
    std::fs::write(folder.path().join("rounds.csv"), "").unwrap();
    let wrong = refusal(&["inspect", empty]);
    assert!(
        wrong.starts_with(&format!("error: cannot read {}: CSV ", broken.display())),
        "{wrong}"
    );
}

#[test]
fn what_cannot_be_drawn_is_explained() {
    let plot = |more: &[&str]| refusal(&[&["plot", SAMPLE], more].concat());
    assert_eq!(
        plot(&["--out", "a.pdf"]),
        "error: --out a.pdf: a figure is FILE.svg or FILE.png\n"
    );
    assert_eq!(
        plot(&["--agents", "0,9", "--out", "a.svg"]),
        format!("error: --agents: there is no agent 9 in {SAMPLE}; they are 0 to 3\n")
    );
    assert_eq!(
        plot(&["--axes", "x,omega", "--out", "a.svg"]),
        "error: --axes: there is no axis `omega`; there are x, x_dot, theta, theta_dot\n"
    );
    assert_eq!(
        plot(&["--episodes", "900..", "--out", "a.svg"]),
        format!("error: {SAMPLE} has no episode among those that were asked for\n")
    );
    assert_eq!(
        plot(&["--colour", "intrinsic-reward", "--out", "a.svg"]),
        format!("error: --colour intrinsic-reward: the agents of {SAMPLE} earn none\n")
    );
    assert!(plot(&["--episodes", "5..5"]).contains("no episode is in this range"));
}

/// Each state in the window is one line of the figure; the numbers of states are those that the recording has.
#[test]
fn the_states_of_one_agent_in_a_window_are_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let figure = folder.path().join("figure.svg");
    let out = figure.to_str().unwrap();
    let states: usize = sample_episodes()
        .iter()
        .filter(|e| e.agent == 3 && e.episode < 5)
        .map(|e| e.length() + 1)
        .sum();
    said(&[
        "plot",
        SAMPLE,
        "--what",
        "visitation",
        "--agents",
        "3",
        "--episodes",
        "0..5",
        "--out",
        out,
    ]);
    let svg = std::fs::read_to_string(&figure).unwrap();
    assert_eq!(svg.matches("stroke-width=\"0.7\"").count(), states);
    assert!(
        svg.contains(&format!(">agent 3: {states} states</text>")),
        "{states}"
    );
    said(&[
        "plot",
        SAMPLE,
        "--what",
        "visitation",
        "--agents",
        "3",
        "--colour",
        "episode",
        "--lines",
        "50",
        "--out",
        out,
    ]);
    let svg = std::fs::read_to_string(&figure).unwrap();
    assert_eq!(svg.matches("stroke-width=\"0.7\"").count(), 50);
    assert!(svg.contains(">agent 3: 50 of "));
}

#[test]
fn every_picture_can_be_drawn_in_every_colour() {
    let folder = tempfile::tempdir().unwrap();
    let png = folder.path().join("figure.png");
    let out = png.to_str().unwrap();
    for colour in ["agent", "episode", "return", "outcome"] {
        said(&[
            "plot",
            SAMPLE,
            "--what",
            "visitation,scatter",
            "--colour",
            colour,
            "--lines",
            "20",
            "--size",
            "600x800",
            "--out",
            out,
        ]);
        assert_eq!(
            std::fs::read(&png).unwrap()[16..24],
            [0, 0, 4, 176, 0, 0, 6, 64],
            "1200 × 1600 pixels"
        );
    }
    let line = said(&[
        "plot",
        SAMPLE,
        SAMPLE,
        "--lines",
        "0",
        "--what",
        "visitation,density,scatter,returns",
        "--out",
        out,
    ]);
    assert!(line.contains("panels"), "{line}");
}

fn sample_episodes() -> Vec<RecordedEpisode> {
    let recording = Recording::open(&Path::new(env!("CARGO_MANIFEST_DIR")).join(SAMPLE)).unwrap();
    let mut episodes: Vec<RecordedEpisode> = recording
        .episodes()
        .unwrap()
        .collect::<Result<_, _>>()
        .unwrap();
    episodes.sort_by_key(|episode| (episode.round, episode.agent));
    episodes
}

/// The command of `recordings/README.md`. What agents learn may differ in the last bits between machines, and soon in all; the first
/// round, before they learn, does not.
#[test]
fn the_sample_is_reproduced_by_its_command() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sample");
    let page =
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("recordings/README.md"))
            .unwrap();
    let command = page
        .lines()
        .find_map(|line| line.trim().strip_prefix("seedbed "))
        .unwrap()
        .replace('\'', "");
    let words: Vec<&str> = command
        .split("  ")
        .next()
        .unwrap()
        .split_whitespace()
        .collect();
    said(&[&words[..], &["--quiet", "--out", path.to_str().unwrap()]].concat());
    let again = Recording::open(&path.join("run.rrd")).unwrap();
    let again: Vec<RecordedEpisode> = again.episodes().unwrap().collect::<Result<_, _>>().unwrap();
    let sample = sample_episodes();
    assert_eq!((sample.len(), again.len()), (4 * 30, 4 * 30));
    for episode in sample.iter().filter(|episode| episode.round == 0) {
        let same = again
            .iter()
            .find(|other| (other.agent, other.episode) == (episode.agent, episode.episode))
            .unwrap();
        assert_eq!(episode.actions, same.actions);
        let near = episode
            .observations
            .iter()
            .zip(&same.observations)
            .all(|(one, other)| (one - other).abs() < 1e-4);
        assert!(near && episode.outcome == same.outcome, "{episode:?}");
    }
}
