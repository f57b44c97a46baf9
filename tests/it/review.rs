//! `seedbed inspect`, `seedbed plot`, and the sample recording of the repository.

use std::path::{Path, PathBuf};

use seedbed::record::RecordedEpisode;
use seedbed::record::recording::Recording;
use seedbed::review::LoadedRun;
use seedbed::review::selection::EpisodeSelection;
use seedbed::run::facts::EpisodeRow;

use super::state_files::{file_of_states, write_file};
use super::util::{REPOSITORY, command, run_refused, run_successful, seedbed, small_run, stderr};

const SAMPLE: &str = "recordings/sample/run.rrd";

/// Runs two agents for six episodes each, and returns the folder of the run.
fn finish_small_run(folder: &Path, extra_arguments: &[&str]) -> PathBuf {
    let path = folder.join("run");
    let output = small_run(&path, &[&["--quiet"], extra_arguments].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    path
}

/// `inspect` prints the same statistics of agents and states for a run folder and for a copy of its
/// recording without tables.
#[test]
fn inspect_prints_the_same_statistics_with_and_without_tables() {
    let folder = tempfile::tempdir().unwrap();
    let run = finish_small_run(folder.path(), &[]);
    let recording_path = folder.path().join("alone.rrd");
    std::fs::copy(run.join("run.rrd"), &recording_path).unwrap();
    let [printed_with_tables, printed_without_tables] =
        [&run, &recording_path].map(|path| run_successful(&["inspect", path.to_str().unwrap()]));
    for page in [&printed_with_tables, &printed_without_tables] {
        assert!(
            page.starts_with("cartpole, run seed 0: 2 agents in cartpole, 6 episodes each, "),
            "{page}"
        );
    }
    assert_eq!(
        statistics_section(&printed_with_tables),
        statistics_section(&printed_without_tables)
    );
    for expected in [
        "theta_dot [rad/s]",
        "overlap of visited states",
        "effective agents: ",
    ] {
        assert!(
            printed_without_tables.contains(expected),
            "{printed_without_tables}"
        );
    }
    let run_folder = LoadedRun::open(&run).unwrap();
    let mut recording_only = LoadedRun::open(&recording_path).unwrap();
    recording_only
        .compute_stats(&EpisodeSelection::all(), |_| ())
        .unwrap();
    assert_eq!(
        without_round_statistics(&recording_only.episodes),
        without_round_statistics(&run_folder.episodes)
    );
}

/// A folder with `episodes.csv` alone has its episodes; a table of others is an error.
#[test]
fn a_table_of_episodes_alone_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let run = finish_small_run(folder.path(), &[]);
    let alone = folder.path().join("alone");
    let table = alone.join("episodes.csv");
    std::fs::create_dir(&alone).unwrap();
    std::fs::copy(run.join("episodes.csv"), &table).unwrap();
    let path = alone.to_str().unwrap();
    let summary: serde_json::Value =
        serde_json::from_str(&run_successful(&["inspect", path, "--json"])).unwrap();
    assert_eq!(
        (&summary["agent_count"], &summary["episodes_per_agent"]),
        (&2.into(), &6.into())
    );
    let text = run_successful(&["inspect", path]);
    assert!(text.contains("2 agents, 6 episodes each"), "{text}");
    assert!(
        text.contains("not finished: in progress or interrupted"),
        "{text}"
    );
    let out = folder.path().join("episodes-copy.csv");
    run_successful(&[
        "export",
        path,
        "--to",
        out.to_str().unwrap(),
        "--content",
        "episodes",
    ]);
    assert_eq!(std::fs::read_to_string(out).unwrap().lines().count(), 13);
    let runs: serde_json::Value =
        serde_json::from_str(&run_successful(&["runs", path, "--json"])).unwrap();
    assert_eq!(
        (&runs[0]["agents"], &runs[0]["state"]),
        (&2.into(), &"unfinished".into())
    );

    std::fs::write(&table, "foo\n1\n").unwrap();
    let refused = run_refused(&["inspect", path]);
    assert!(refused.contains("episodes.csv"), "{refused}");
}

/// Agents 0 and 2 visit the same states, and agent 1 has no file: its overlap with others is not known.
#[test]
fn agents_without_visits_have_no_overlap() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    let axes = serde_json::json!([
        {"name": "x", "unit": "", "low": 0.0, "high": 9.0},
        {"name": "y", "unit": "", "low": 0.0, "high": 9.0},
    ]);
    for agent in [0, 2] {
        write_file(
            &run,
            agent,
            &file_of_states(agent, &axes, &[1.0, 2.0, 3.0, 4.0]),
        );
    }
    let path = run.to_str().unwrap();
    let summary: serde_json::Value =
        serde_json::from_str(&run_successful(&["inspect", path, "--json"])).unwrap();
    let unknown = serde_json::Value::Null;
    let overlaps = &summary["overlaps"];
    assert_eq!(
        (&overlaps[0][1], &overlaps[1][2], &overlaps[0][2]),
        (&unknown, &unknown, &1.0.into())
    );
    assert_eq!(summary["effective_agents"], 1.0);
    let text = run_successful(&["inspect", path]);
    assert!(
        text.contains("effective agents: 1 of 3, 2 with visits (overlap 100.0 %)"),
        "{text}"
    );
    assert!(text.contains("\n      1    –   ·   –"), "{text}");
}

/// The part of the output of `inspect` that is computed from episodes.
fn statistics_section(page: &str) -> &str {
    let (_, after_heading) = page.split_once("mean return of the team").unwrap();
    after_heading.split_once("files").unwrap().0
}

/// Rows without the columns that a recording alone does not provide: statistics of whole rounds.
fn without_round_statistics(rows: &[EpisodeRow]) -> Vec<EpisodeRow> {
    rows.iter()
        .map(|row| EpisodeRow {
            visitation_entropy: 0.0,
            team_overlap: 0.0,
            effective_agents: 0.0,
            ..row.clone()
        })
        .collect()
}

/// Two agents have six episodes each: the numbers of a selection are those of its episodes alone.
#[test]
fn inspect_selects_agents_and_episodes() {
    let folder = tempfile::tempdir().unwrap();
    let run = finish_small_run(folder.path(), &[]);
    let run = run.to_str().unwrap();
    let summary = |options: &[&str]| -> serde_json::Value {
        let arguments = [&["inspect", run, "--json"], options].concat();
        serde_json::from_str(&run_successful(&arguments)).unwrap()
    };
    let (all, late) = (summary(&[]), summary(&["--episodes", "4.."]));
    let returns = |summary: &serde_json::Value| summary["team_returns"].as_array().unwrap().clone();
    assert_eq!(returns(&late), returns(&all)[4..]);
    assert_eq!(late["agents"][1]["episodes"], 2);
    let rest = summary(&["--episodes", "..4"]);
    let steps = |summary: &serde_json::Value| summary["env_steps"].as_u64().unwrap();
    assert_eq!(steps(&late) + steps(&rest), steps(&all));
    let coverage = |summary: &serde_json::Value| {
        let agents = summary["agents"].as_array().unwrap().iter();
        agents
            .map(|agent| agent["first_coverage"].as_f64().unwrap())
            .sum::<f64>()
    };
    assert!(coverage(&late) < coverage(&all));

    let one = summary(&["--agents", "1"]);
    assert_eq!(
        (&one["agent_count"], &one["effective_agents"]),
        (&1.into(), &1.0.into())
    );
    assert_eq!(one["agents"][0]["coverage"], all["agents"][1]["coverage"]);
    let number = |name: &str| one["agents"][0][name].as_f64().unwrap();
    assert!((number("first_coverage") - number("coverage")).abs() < 1e-12);
    let page = run_successful(&["inspect", run, "--agents", "1", "--episodes", "2..4"]);
    assert!(
        page.contains("\nonly episodes 2 to 3 of agents 1\n"),
        "{page}"
    );
    let refused = run_refused(&["inspect", run, "--agents", "7"]);
    assert!(
        refused.ends_with("has no such episodes of agent 7\n"),
        "{refused}"
    );
    let refused = run_refused(&["inspect", run, "--episodes", "9.."]);
    assert!(refused.ends_with("has no such episodes\n"), "{refused}");
}

/// A single chosen agent is compared with the whole team. A figure without states is refused.
#[test]
fn plot_compares_chosen_agents_with_all_agents() {
    let folder = tempfile::tempdir().unwrap();
    let run = finish_small_run(folder.path(), &[]);
    let run = run.to_str().unwrap();
    let figure = format!("{run}/difference.svg");
    let options = [
        "plot",
        run,
        "--what",
        "difference",
        "--agents",
        "1",
        "--out",
        &figure,
    ];
    run_successful(&options);
    let svg = std::fs::read_to_string(&figure).unwrap();
    assert!(svg.contains("agent 1 − 2 agents together"), "{svg}");
    let error = run_refused(&["plot", run, "--where", "theta=5.."]);
    assert!(
        error.ends_with("has no states that meet --where\n"),
        "{error}"
    );
}

#[test]
fn inspect_and_plot_work_without_a_recording() {
    let folder = tempfile::tempdir().unwrap();
    let run = finish_small_run(folder.path(), &["--no-recording"]);
    let run = run.to_str().unwrap();
    let page = run_successful(&["inspect", run]);
    assert!(
        page.contains("effective agents: ") && !page.contains("observations in "),
        "{page}"
    );
    let figure = format!("{run}/curves.svg");
    assert!(
        run_successful(&["plot", run, "--what", "returns,curves", "--out", &figure])
            .starts_with(&format!("{figure}: "))
    );
    let output = seedbed(&["plot", run]);
    let note = "note: only returns and curves are drawn, because ";
    assert!(output.status.success() && stderr(&output).starts_with(note));
    let error = run_refused(&["plot", run, "--what", "visitation"]);
    let expected = "has no recording, which is needed to draw states; use --what returns,curves, which needs only the tables\n";
    assert!(error.ends_with(expected), "{error}");
}

/// A note names the tasks of runs whose returns are drawn beside each other, if they differ.
#[test]
fn plots_of_different_tasks_say_so() {
    let folder = tempfile::tempdir().unwrap();
    let run_of = |name: &str, task: &str| {
        let options = ["--no-recording", "--set", &format!("environment={task:?}")];
        finish_small_run(&folder.path().join(name), &options)
    };
    let runs = [
        ("one", "cartpole"),
        ("same", "cartpole"),
        ("other", "pendulum"),
    ];
    let [one, same, other] = runs.map(|(name, task)| run_of(name, task));
    let out = folder.path().join("returns.svg");
    let notes = |two: [&Path; 2]| {
        let [first, second, out] = [two[0], two[1], &out].map(|path| path.to_str().unwrap());
        let output = seedbed(&["plot", first, second, "--what", "returns", "--out", out]);
        assert!(output.status.success(), "{output:?}");
        stderr(&output)
    };
    assert_eq!(notes([&one, &same]), "");
    assert_eq!(
        notes([&one, &other]),
        "note: the runs are in different tasks (cartpole, pendulum), whose returns do not compare\n"
    );
}

#[test]
fn inspect_explains_why_a_path_is_not_a_run() {
    let folder = tempfile::tempdir().unwrap();
    let empty = folder.path().to_str().unwrap();
    let missing_path = folder.path().join("nowhere");
    let missing_path = missing_path.to_str().unwrap();
    assert_eq!(
        run_refused(&["inspect", missing_path]),
        format!("error: no such file or directory: {missing_path}\n")
    );
    assert_eq!(
        run_refused(&["inspect", empty]),
        format!(
            "error: {empty} contains no run: expected episodes.csv, run.rrd or states/*.states in it\n"
        )
    );
    let broken_table = folder.path().join("episodes.csv");
    std::fs::write(&broken_table, "agent,episode\n0,zero\n").unwrap();
    std::fs::write(folder.path().join("rounds.csv"), "").unwrap();
    let error = run_refused(&["inspect", empty]);
    assert!(
        error.starts_with(&format!(
            "error: cannot read {}: CSV ",
            broken_table.display()
        )),
        "{error}"
    );
}

#[test]
fn plot_explains_invalid_options() {
    let plot =
        |extra_arguments: &[&str]| run_refused(&[&["plot", SAMPLE], extra_arguments].concat());
    assert_eq!(
        plot(&["--out", "a.gif"]),
        "error: --out a.gif: expected FILE.svg, FILE.pdf or FILE.png\n"
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
        format!(
            "error: {SAMPLE} has no finished episodes, or none that match --agents and --episodes\n"
        )
    );
    assert_eq!(
        plot(&["--color", "intrinsic-reward", "--out", "a.svg"]),
        format!(
            "error: --color intrinsic-reward: {SAMPLE} has no intrinsic rewards (its scenario has no `bonus`)\n"
        )
    );
    assert!(plot(&["--episodes", "5..5"]).contains("the range is empty"));
    assert_eq!(
        plot(&["--where", "omega=1..2", "--out", "a.svg"]),
        "error: --where omega=1..2: no quantity `omega`; expected one of x, x_dot, theta, theta_dot, force, reward, intrinsic reward, advantage, \
         step, episode, return\n"
    );
    assert!(plot(&["--where", "x=2..1", "--out", "a.svg"]).contains("the range is empty"));
    assert!(plot(&["--where", "x>2", "--out", "a.svg"]).contains("expected NAME=LOW..HIGH"));
}

/// Runs `seedbed plot recordings/sample/run.rrd --what visitation --agents 3 EXTRA_ARGUMENTS` and
/// returns the figure as SVG.
fn plot_visitation_of_agent_3(extra_arguments: &[&str]) -> String {
    let folder = tempfile::tempdir().unwrap();
    let figure = folder.path().join("figure.svg");
    let out = ["--out", figure.to_str().unwrap()];
    let base = ["plot", SAMPLE, "--what", "visitation", "--agents", "3"];
    run_successful(&[&base, extra_arguments, &out].concat());
    std::fs::read_to_string(&figure).unwrap()
}

/// With `--agents 3 --episodes 0..5`, the figure has one line per recorded state of these episodes.
#[test]
fn plot_draws_each_selected_state_as_one_line() {
    let states: usize = sample_episodes()
        .iter()
        .filter(|episode| episode.agent == 3 && episode.episode < 5)
        .map(|episode| episode.length() + 1)
        .sum();
    let svg = plot_visitation_of_agent_3(&["--episodes", "0..5"]);
    assert_eq!(svg.matches("stroke-width=\"0.7\"").count(), states);
    assert!(
        svg.contains(&format!(">agent 3: {states} states</text>")),
        "{states}"
    );
}

/// `--where` draws exactly the recorded states in all ranges.
#[test]
fn plot_draws_the_states_that_meet_conditions() {
    let of_agent = sample_episodes()
        .into_iter()
        .filter(|episode| episode.agent == 3);
    let is_selected = |episode: &RecordedEpisode, step: usize, state: &[f32]| {
        state[2] >= 0.05 && step < episode.length() && episode.actions[step] == 10.0
    };
    let states: usize = of_agent
        .map(|episode| {
            let steps = episode.states().enumerate();
            steps
                .filter(|(step, state)| is_selected(&episode, *step, state))
                .count()
        })
        .sum();
    let conditions = ["--where", "theta=0.05..", "--where", "force=10..10"];
    let svg = plot_visitation_of_agent_3(&[&conditions[..], &["--lines", "100000"]].concat());
    assert!(states > 20, "{states}");
    assert_eq!(svg.matches("stroke-width=\"0.7\"").count(), states);
}

#[test]
fn plot_draws_at_most_the_chosen_number_of_lines() {
    let svg = plot_visitation_of_agent_3(&["--color", "episode", "--lines", "50"]);
    assert_eq!(svg.matches("stroke-width=\"0.7\"").count(), 50);
    assert!(svg.contains(">agent 3: 50 of "));
}

#[test]
fn plot_supports_every_color_option() {
    let folder = tempfile::tempdir().unwrap();
    let png = folder.path().join("figure.png");
    let out = png.to_str().unwrap();
    for color in ["agent", "episode", "return", "outcome"] {
        run_successful(&[
            "plot",
            SAMPLE,
            "--what",
            "visitation,scatter",
            "--color",
            color,
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
    let line = run_successful(&[
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

/// `docs/parallel_coordinates.svg` is the figure of all example distributions, to the byte. After a
/// change, draw it again with the command of `docs/parallel_coordinates.md`.
#[test]
fn the_figure_of_example_distributions_is_up_to_date() {
    let folder = tempfile::tempdir().unwrap();
    let figure = folder.path().join("figure.svg");
    let out = figure.to_str().unwrap();
    let line = run_successful(&["plot", "--distributions", "--out", out]);
    assert!(
        line.starts_with(&format!("{out}: 14 panels, 760 × ")),
        "{line}"
    );
    let committed = Path::new(REPOSITORY).join("docs/parallel_coordinates.svg");
    assert!(
        std::fs::read(&figure).unwrap() == std::fs::read(committed).unwrap(),
        "run `seedbed plot --distributions --out docs/parallel_coordinates.svg`"
    );
}

/// A panel of 80 lines and one of 80 dots for each named distribution.
#[test]
fn plot_draws_the_named_distributions() {
    let folder = tempfile::tempdir().unwrap();
    let figure = folder.path().join("figure.svg");
    let out = figure.to_str().unwrap();
    run_successful(&["plot", "--distributions", "ring,parabola", "--out", out]);
    let svg = std::fs::read_to_string(&figure).unwrap();
    let count = |text: &str| svg.matches(text).count();
    assert_eq!(
        (count("stroke-width=\"0.7\""), count("<circle")),
        (160, 160)
    );
    assert!(svg.contains(">ring</text>") && svg.contains(">parabola</text>"));
    assert!(!svg.contains(">two clusters</text>"));
}

#[test]
fn plot_explains_invalid_distributions() {
    let error = run_refused(&["plot", "--distributions", "rings", "--out", "a.svg"]);
    assert!(error.contains("invalid value 'rings'"), "{error}");
    assert!(error.contains("a similar value exists: 'ring'"), "{error}");
    let error = run_refused(&["plot", SAMPLE, "--distributions"]);
    assert!(error.contains("cannot be used with"), "{error}");
    let error = run_refused(&["plot"]);
    assert!(error.contains("<RUN>"), "{error}");
}

/// The episodes of the sample recording, sorted by (round, agent).
fn sample_episodes() -> Vec<RecordedEpisode> {
    let mut episodes = read_episodes(&Path::new(REPOSITORY).join(SAMPLE));
    episodes.sort_by_key(|episode| (episode.round, episode.agent));
    episodes
}

fn read_episodes(recording: &Path) -> Vec<RecordedEpisode> {
    let recording = Recording::open(recording).unwrap();
    recording
        .episodes()
        .unwrap()
        .collect::<Result<_, _>>()
        .unwrap()
}

/// The arguments of the first command `seedbed …` in `recordings/README.md`, which records the
/// sample.
fn sample_arguments() -> Vec<String> {
    let page = std::fs::read_to_string(Path::new(REPOSITORY).join("recordings/README.md")).unwrap();
    let command = page
        .lines()
        .find_map(|line| line.trim().strip_prefix("seedbed "))
        .unwrap()
        .replace('\'', "");
    let (before_comment, _) = command.split_once("  ").unwrap_or((&command, ""));
    before_comment
        .split_whitespace()
        .map(str::to_owned)
        .collect()
}

/// Runs the command of `recordings/README.md` and compares the first round with the sample. Later
/// rounds are not compared: learning amplifies differences between machines in the last bits.
#[test]
fn the_command_in_the_recordings_readme_reproduces_the_sample() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sample");
    let mut command = command(&sample_arguments());
    let status = command.args(["--quiet", "--out"]).arg(&path).status();
    assert!(status.unwrap().success());
    let repeated_episodes = read_episodes(&path.join("run.rrd"));
    let sample = sample_episodes();
    assert_eq!((sample.len(), repeated_episodes.len()), (4 * 30, 4 * 30));
    for episode in sample.iter().filter(|episode| episode.round == 0) {
        let repeated_episode = repeated_episodes
            .iter()
            .find(|candidate| {
                (candidate.agent, candidate.episode) == (episode.agent, episode.episode)
            })
            .unwrap();
        assert_eq!(episode.actions, repeated_episode.actions);
        let observations_are_close = episode
            .observations
            .iter()
            .zip(&repeated_episode.observations)
            .all(|(one, other)| (one - other).abs() < 1e-4);
        assert!(
            observations_are_close && episode.outcome == repeated_episode.outcome,
            "{episode:?}"
        );
    }
}
