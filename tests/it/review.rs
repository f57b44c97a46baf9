//! Runs as they are looked at afterwards: `inspect`, `plot`, and the sample recording that comes
//! with the sources.

use std::path::{Path, PathBuf};

use seedbed::record::EpisodeRow;
use seedbed::record::RecordedEpisode;
use seedbed::record::recording::Recording;
use seedbed::run::review::LoadedRun;

use super::util::{REPOSITORY, refuse, small_run, stderr, succeed};

const SAMPLE: &str = "recordings/sample/run.rrd";

/// A finished run of two agents and six episodes; its folder.
fn small_run_in(folder: &Path, more: &[&str]) -> PathBuf {
    let path = folder.join("run");
    let output = small_run(&path, &[&["--quiet"], more].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    path
}

/// The recording knows as much as the tables: with and without them the same is said of agents and
/// states.
#[test]
fn a_recording_alone_tells_the_same_as_its_folder() {
    let folder = tempfile::tempdir().unwrap();
    let run = small_run_in(folder.path(), &[]);
    let alone = folder.path().join("alone.rrd");
    std::fs::copy(run.join("run.rrd"), &alone).unwrap();
    let [with_tables, without] =
        [&run, &alone].map(|path| succeed(&["inspect", path.to_str().unwrap()]));
    for page in [&with_tables, &without] {
        assert!(
            page.starts_with("cartpole, run seed 0: 2 agents in cartpole, 6 episodes each, "),
            "{page}"
        );
    }
    let from_returns = |page: &str| {
        let (_, rest) = page.split_once("mean return of the team").unwrap();
        rest.split_once("files").unwrap().0.to_owned()
    };
    assert_eq!(from_returns(&with_tables), from_returns(&without));
    for wanted in [
        "theta_dot [rad/s]",
        "overlap of visited states",
        "effective agents: ",
    ] {
        assert!(without.contains(wanted), "{without}");
    }
    let tables = LoadedRun::open(&run).unwrap();
    let mut lone = LoadedRun::open(&alone).unwrap();
    lone.compute_stats(|_| ()).unwrap();
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
    let run = small_run_in(folder.path(), &["--no-recording"]);
    let run = run.to_str().unwrap();
    let page = succeed(&["inspect", run]);
    assert!(
        page.contains("effective agents: ") && !page.contains("observations in "),
        "{page}"
    );
    let figure = format!("{run}/curves.svg");
    assert!(
        succeed(&["plot", run, "--what", "returns,curves", "--out", &figure])
            .starts_with(&format!("{figure}: "))
    );
    let wrong = refuse(&["plot", run]);
    let wanted = "has no recording, which is needed to draw states; use --what returns,curves, which needs only the tables\n";
    assert!(wrong.ends_with(wanted), "{wrong}");
}

#[test]
fn runs_that_are_none_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let empty = folder.path().to_str().unwrap();
    let nowhere = folder.path().join("nowhere");
    let nowhere = nowhere.to_str().unwrap();
    assert_eq!(
        refuse(&["inspect", nowhere]),
        format!("error: no such file or directory: {nowhere}\n")
    );
    assert_eq!(
        refuse(&["inspect", empty]),
        format!("error: {empty} contains no run: expected episodes.csv or run.rrd in it\n")
    );
    let broken = folder.path().join("episodes.csv");
    std::fs::write(&broken, "agent,episode\n0,zero\n").unwrap();
    std::fs::write(folder.path().join("rounds.csv"), "").unwrap();
    let wrong = refuse(&["inspect", empty]);
    assert!(
        wrong.starts_with(&format!("error: cannot read {}: CSV ", broken.display())),
        "{wrong}"
    );
}

#[test]
fn what_cannot_be_drawn_is_explained() {
    let plot = |more: &[&str]| refuse(&[&["plot", SAMPLE], more].concat());
    assert_eq!(
        plot(&["--out", "a.pdf"]),
        "error: --out a.pdf: expected FILE.svg or FILE.png\n"
    );
    assert_eq!(
        plot(&["--agents", "0,9", "--out", "a.svg"]),
        format!("error: --agents: no agent 9 in {SAMPLE}; expected 0 to 3\n")
    );
    assert_eq!(
        plot(&["--axes", "x,omega", "--out", "a.svg"]),
        "error: --axes: no axis `omega`; expected x, x_dot, theta, theta_dot\n"
    );
    assert_eq!(
        plot(&["--episodes", "900..", "--out", "a.svg"]),
        format!("error: {SAMPLE} has no episodes that match --agents and --episodes\n")
    );
    assert_eq!(
        plot(&["--colour", "intrinsic-reward", "--out", "a.svg"]),
        format!(
            "error: --colour intrinsic-reward: {SAMPLE} has no intrinsic rewards (its scenario has no `bonus`)\n"
        )
    );
    assert!(plot(&["--episodes", "5..5"]).contains("the range is empty"));
}

/// Each state in the window is one line of the figure; the numbers of states are those that the
/// recording has.
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
    succeed(&[
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
    succeed(&[
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
        succeed(&[
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
    let line = succeed(&[
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
    let recording = Recording::open(&Path::new(REPOSITORY).join(SAMPLE)).unwrap();
    let mut episodes: Vec<RecordedEpisode> = recording
        .episodes()
        .unwrap()
        .collect::<Result<_, _>>()
        .unwrap();
    episodes.sort_by_key(|episode| (episode.round, episode.agent));
    episodes
}

/// The command of `recordings/README.md`. What agents learn may differ in the last bits between
/// machines, and soon in all; the first round, before they learn, does not.
#[test]
fn the_sample_is_reproduced_by_its_command() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sample");
    let page = std::fs::read_to_string(Path::new(REPOSITORY).join("recordings/README.md")).unwrap();
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
    succeed(&[&words[..], &["--quiet", "--out", path.to_str().unwrap()]].concat());
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
