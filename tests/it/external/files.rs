//! What is read from the files.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use super::{Fixture, values};
use crate::util::{REPOSITORY, seedbed};

const STUDY_OF_TOOLS: &str = r#"Study(
    title: "Files of other libraries",
    solved: (return: 3, window: 2),
    cells: [
        (name: "SB3", results: Monitor("sb3/ppo-*/")),
        (name: "SB3 team", results: Monitor("sb3_team/*/")),
        (name: "CleanRL", results: TensorBoard(runs: "cleanrl/*/", tag: "charts/episodic_return")),
        (name: "CSV", results: Csv(files: "csv/runs.csv",
            columns: (return: "reward", env_steps: "frames", episode: "ep", agent: "worker", run: "seed"))),
        (name: "lengths", results: Csv(files: "csv/lengths.csv", columns: (length: "length"))),
        (name: "unknown steps", results: Csv(files: "csv/lengths.csv")),
    ],
    measures: [EpisodesToSolve, Solved, FinalReturn(window: 2)],
    figures: [Curves(window: 2), Agents(), Unsolved(), Intervals()],
)"#;

/// Returns and steps of the files, and windows of two team returns, of which the first of at least 3
/// solves the task:
///
/// - `ppo-0`: 1, 3, 2.5, 8 up to steps 2, 5, 10, 12; windows 2, 2.75, 5.25: after 4 episodes;
/// - `ppo-1`: 1, 2, 3; windows 1.5, 2.5: not solved in 3 steps;
/// - the team: agents with 1, 4, 3 up to their steps 1, 3, 6 and 2, 6 up to 4, 5. Means 1.5, 5;
///   window 3.25: after two episodes, when the second agent has done 5 steps and the team 10. All in
///   all the first agent has done 6 and the team 12. The last two of each are 3.5 and 4 on average;
/// - CleanRL: 1.5, −2, 0, 200 at 10, 25, 25, 40; windows −0.25, −1, 100: after 4 episodes;
/// - `runs.csv`, run 7: agents with 1, 5 and 3, 7.5; means 2, 6.25; window 4.125: after two episodes,
///   at step 12. Run 8: −2, 4 and 2, 0; means 0, 2; window 1: not solved in 20 steps;
/// - `lengths.csv`: 1, 2, 6 up to steps 2, 5, 10; windows 1.5, 4: after 3 episodes.
#[test]
fn measures_follow_from_the_files() {
    let fixture = Fixture::with_files_of_tools(STUDY_OF_TOOLS);
    let printed = fixture.succeed(&[]);
    assert!(
        printed.contains("of others  SB3: 2 runs in sb3/ppo-*/"),
        "{printed}"
    );
    let columns = [
        "cell",
        "run",
        "agents",
        "episodes",
        "env_steps",
        "episodes_to_solve",
        "env_steps_to_solve",
        "FinalReturn(window:2)",
        "mean_return",
    ];
    let expected = [
        "SB3|sb3/ppo-0|1|4|12|4.0|12.0|5.25|3.625",
        "SB3|sb3/ppo-1|1|3|3|||2.5|2.0",
        "SB3 team|sb3_team/run|2|2|12|2.0|10.0|3.75|3.333333333333333",
        "CleanRL|cleanrl/run-0|1|4|40|4.0|40.0|100.0|49.875",
        "CSV|csv/runs.csv, seed 7|2|2|12|2.0|12.0|4.125|4.125",
        "CSV|csv/runs.csv, seed 8|2|2|20|||1.0|1.0",
        "lengths|csv/lengths.csv|1|3|10|3.0|10.0|4.0|3.0",
        "unknown steps|csv/lengths.csv|1|3||3.0||4.0|3.0",
    ];
    let rows = fixture.rows();
    let found: Vec<String> = rows
        .iter()
        .map(|row| values(row, &columns).join("|"))
        .collect();
    assert_eq!(found, expected);
    for row in &rows {
        assert_eq!(
            values(row, &["gradient_steps", "team_coverage", "seeds"]),
            ["", "", "external"]
        );
    }
    let tables = fixture.output("tables.md");
    for expected in [
        "| SB3 | 1 | 1/2 (0.0945 to 0.905) | 3.5 | 7.5 | unknown | ",
        "| unknown steps | 1 | 1/1 (0.207 to 1) | 3 | unknown | unknown | ",
    ] {
        assert!(tables.contains(expected), "{tables}");
    }
    let page = fixture.output("report.html");
    let hash = "f08dddb13364d8e16c537f46b4a8f3c1ab33e01e79ace2ddc8b40982f8fd68fd";
    assert!(page.contains("run seeds and code cannot be checked") && page.contains(hash));
    assert_eq!(
        fs::read_dir(fixture.path("out/figures")).unwrap().count(),
        12
    );
}

/// The files of the team are those of the copies of one learner: its episodes are 1, 4, 2, 6, 3 up to steps 2, 6, 8, 10, 12 of
/// both copies. Windows of two: 2.5, 3, so that it has solved the task after 3 episodes.
#[test]
fn files_of_the_copies_of_one_learner_are_merged() {
    let study = |agents: &str| {
        format!(
            r#"Study(
                title: "Copies",
                solved: (return: 3, window: 2),
                cells: [(name: "SB3", results: Monitor("sb3_team/*/"){agents})],
                measures: [EpisodesToSolve, FinalReturn(window: 2)],
            )"#
        )
    };
    let fixture = Fixture::with_files_of_tools(&study(", agents: 1"));
    let printed = fixture.succeed(&[]);
    assert!(!printed.contains("copies of one learner"), "{printed}");
    let columns = [
        "agents",
        "episodes",
        "episodes_to_solve",
        "env_steps_to_solve",
        "FinalReturn(window:2)",
        "mean_return",
    ];
    let expected = ["1", "5", "3.0", "8.0", "4.5", "3.2"];
    assert_eq!(values(&fixture.rows()[0], &columns), expected);
    fixture.write("mine.ron", &study(""));
    let printed = fixture.succeed(&[]);
    let warning = "sb3_team/run: its 2 files count as as many agents; if they are of the copies of one learner, as of \
                   `make_vec_env`, write `agents: 1` in the cell";
    assert!(printed.contains(warning), "{printed}");
}

/// The mean over several episodes first reaches 3 at step 40, in a window of one value.
#[test]
fn values_may_be_means_over_episodes() {
    let fixture = Fixture::with_files_of_tools(
        r#"Study(
            title: "Means",
            solved: (return: 3, window: 1),
            cells: [(name: "CleanRL", results: TensorBoard(runs: "cleanrl/*/", tag: "charts/episodic_return", values: Means))],
            measures: [EnvStepsToSolve, Solved, Last(of: Return)],
        )"#,
    );
    fixture.succeed(&[]);
    let row = &fixture.rows()[0];
    let columns = [
        "episodes",
        "episodes_to_solve",
        "env_steps",
        "env_steps_to_solve",
        "first_goal",
    ];
    assert_eq!(values(row, &columns), ["", "", "40", "40.0", ""]);
    let tables = fixture.output("tables.md");
    assert!(
        tables.contains("| CleanRL | 1 | 1/1 (0.207 to 1) | unknown | 40 | unknown |\n"),
        "{tables}"
    );
}

/// The rows of Stable-Baselines3's `progress.csv` before the first episode has ended have no mean.
#[test]
fn a_table_of_means_may_begin_without_values() {
    let fixture = Fixture::new(
        r#"Study(
            title: "Progress",
            solved: (return: 30, window: 1),
            cells: [(name: "SB3", results: Csv(files: "sb3/*/progress.csv",
                columns: (return: "rollout/ep_rew_mean", env_steps: "time/total_timesteps"), values: Means))],
            measures: [EnvStepsToSolve, Last(of: Return), At(of: Return, steps: 5000)],
            figures: [Curves(x: EnvSteps)],
        )"#,
    );
    fixture.write(
        "sb3/a/progress.csv",
        "rollout/ep_rew_mean,time/total_timesteps\n,2048\n21.5,4096\n33.0,6144\n",
    );
    fixture.succeed(&[]);
    let row = &fixture.rows()[0];
    let columns = [
        "episodes",
        "env_steps",
        "env_steps_to_solve",
        "Last(of:Return)",
        "At(of:Return,steps:5000)",
    ];
    assert_eq!(
        values(row, &columns),
        ["", "6144", "6144.0", "33.0", "21.5"]
    );
    assert!(fixture.path("out/figures/1-curves.svg").is_file());
}

/// A chart of Weights & Biases, in which rows have values of one run each.
const CHART: &str = r#""Step","ppo-1 - charts/episodic_return","ppo-1 - charts/episodic_return__MIN","ppo-1 - charts/episodic_return__MAX","ppo-2 - charts/episodic_return","ppo-2 - charts/episodic_return__MIN","ppo-2 - charts/episodic_return__MAX"
"10","1","1","1","","",""
"12","","","","5","5","5"
"30","3","3","3","","",""
"35","","","","8","8","8"
"40","","","","9","9","9"
"#;

#[test]
fn each_column_of_a_chart_is_a_run() {
    let fixture = Fixture::new(
        r#"Study(
            title: "Chart",
            cells: [(name: "PPO", results: Csv(files: "wandb.csv",
                columns: (return: "* - charts/episodic_return", env_steps: "Step")))],
            measures: [FinalReturn(window: 1), FinalReturn(window: 1, steps: 36)],
        )"#,
    );
    fixture.write("wandb.csv", CHART);
    fixture.succeed(&[]);
    let columns = [
        "run",
        "episodes",
        "env_steps",
        "FinalReturn(window:1)",
        "FinalReturn(window:1,steps:36)",
    ];
    let rows: Vec<String> = fixture
        .rows()
        .iter()
        .map(|row| values(row, &columns).join("|"))
        .collect();
    let expected = [
        "wandb.csv, run ppo-1|2|30|3.0|3.0",
        "wandb.csv, run ppo-2|3|40|9.0|8.0",
    ];
    assert_eq!(rows, expected);
}

const EPISODES_OF_COPIES: &str = "agent,episode,round,env_steps,return,length,outcome,end_step
0,0,0,1,1.0,1,terminated,1
1,0,0,3,7.0,2,terminated,2
0,1,1,4,3.0,1,terminated,3
1,1,1,6,9.0,2,terminated,4
0,2,2,7,5.0,1,terminated,5
";

/// Two copies of one learner, of which the first is reset by steps that are not recorded: the return 9 is
/// that of the fourth episode, which ended after four steps of both.
#[test]
fn episodes_of_copies_are_in_the_order_of_their_ends() {
    let fixture = Fixture::new(
        r#"Study(
            title: "Copies",
            solved: (return: 9, window: 1),
            cells: [(name: "copies", results: Runs("run"))],
            measures: [EpisodesToSolve],
        )"#,
    );
    let write_summary = |episodes: u32| {
        let text = format!(
            r#"{{"learners": [0, 0], "env_steps": 7, "episodes_of_agents": {{"0": 3, "1": {episodes}}}}}"#
        );
        fixture.write("run/summary.json", &text);
    };
    fixture.write("run/episodes.csv", EPISODES_OF_COPIES);
    write_summary(2);
    fixture.succeed(&[]);
    let columns = ["episodes", "episodes_to_solve", "env_steps_to_solve"];
    assert_eq!(values(&fixture.rows()[0], &columns), ["5", "4.0", "8.0"]);
    write_summary(3);
    let error = fixture.fail(2, &[]);
    let words = "the number of episodes of agent 1 is 2, expected 3 as in summary.json";
    assert!(error.contains(words), "{error}");
}

/// Two agents that solve the task of the scenario in some of their runs.
const SETTINGS: [&str; 2] = [
    "agents.count=2",
    "stop=Solved(return: 23, window: 4, at_most: 12)",
];

/// A study of a scenario with these settings, and of run directories in `runs`.
fn study_of_equal_runs(scenario: &Path) -> String {
    format!(
        r#"Study(
            title: "The same runs",
            repeats: 4,
            max_episodes: 12,
            cells: [
                (name: "run here", scenario: "{}", set: ["{}", "{}"]),
                (name: "read", results: Runs("runs/seed-*")),
            ],
            measures: [
                EpisodesToSolve, EnvStepsToSolve, Solved, Reach, FirstGoal, FinalReturn(window: 3), Coverage,
                ReturnAt(episode: 5, window: 2, held: true), SpreadOfAgents(window: 2), PercentileOfAgents(percent: 75, window: 2),
                Mean(of: ValueLoss), Last(of: Entropy), At(of: TeamOverlap, episode: 3), Mean(of: GradientSteps),
                Last(of: NewCoverageRate),
            ],
            figures: [Curves(of: Entropy)],
        )"#,
        scenario.display(),
        SETTINGS[0],
        SETTINGS[1]
    )
}

/// A study of run directories gives the values of a study that runs the same scenario with the same
/// run seeds.
#[test]
fn run_directories_give_the_measures_of_the_same_runs() {
    let scenario = Path::new(REPOSITORY).join("scenarios/cartpole.ron");
    let fixture = Fixture::new(&study_of_equal_runs(&scenario));
    for run_seed in ["1000", "1001", "1002", "1003"] {
        let out = fixture.path(&format!("runs/seed-{run_seed}"));
        let paths = [&scenario, &out].map(|path| path.to_str().unwrap());
        let settings = ["--set", SETTINGS[0], "--set", SETTINGS[1], "--no-recording"];
        let run = ["run", paths[0], "--seed", run_seed, "--out", paths[1]];
        let output = seedbed(&[&run[..], &settings].concat());
        assert!(output.status.success(), "{output:?}");
    }
    fixture.succeed(&[]);
    let mut rows = fixture.rows();
    for row in &mut rows {
        for column in ["cell", "seed", "run", "seeds"] {
            row.remove(column).unwrap();
        }
    }
    let read = rows.split_off(4);
    assert_eq!(rows, read);
    assert_equal_runs_differ(&rows);
    let tables = fixture.output("tables.md");
    let cost = |cell: &str| {
        let start = format!("| {cell} |");
        let mut lines = tables.lines();
        lines
            .find_map(|line| line.strip_prefix(start.as_str()))
            .unwrap()
    };
    assert_eq!(cost("run here"), cost("read"));
}

/// The comparison of equal runs means something: some runs solved the task and some did not, they
/// differ, and every measure has values.
fn assert_equal_runs_differ(rows: &[BTreeMap<String, String>]) {
    let solved = rows.iter().filter(|row| row["solved"] == "true").count();
    assert!(
        (1..4).contains(&solved),
        "{solved} of 4 runs solved the task"
    );
    assert_ne!(rows[0], rows[1]);
    for (column, value) in &rows[0] {
        let may_be_empty =
            column.ends_with("_to_solve") || ["reason", "regret"].contains(&column.as_str());
        assert!(!value.is_empty() || may_be_empty, "{column}");
    }
}

/// A file that is still written to ends within a line, an event file within a record.
#[test]
fn incomplete_ends_of_files_are_ignored_with_a_warning() {
    let fixture = Fixture::with_files_of_tools(STUDY_OF_TOOLS);
    fixture.append("sb3/ppo-0/monitor.csv", "99.0,99,0.0");
    let events = fixture.path("cleanrl/run-0/events.out.tfevents.1700000000.host.1.0");
    let bytes = fs::read(&events).unwrap();
    fs::write(&events, &bytes[..bytes.len() - 3]).unwrap();
    let printed = fixture.succeed(&[]);
    for warning in [
        "warning: cell `SB3`: sb3/ppo-0/monitor.csv: the last line has no line break and is ignored",
        "warning: cell `CleanRL`: cleanrl/run-0/events.out.tfevents.1700000000.host.1.0: the last record is incomplete",
    ] {
        assert!(printed.contains(warning), "{printed}");
    }
    let rows = fixture.rows();
    assert_eq!(values(&rows[0], &["episodes", "env_steps"]), ["4", "12"]);
    assert!(
        fixture
            .output("report.html")
            .contains("the last line has no line break")
    );
}

/// Copies of one run with another first line are not equal files, but have the same returns.
#[test]
fn equal_returns_of_two_runs_are_reported() {
    let fixture = Fixture::with_files_of_tools(STUDY_OF_TOOLS);
    let copy = fs::read_to_string(fixture.path("sb3/ppo-0/monitor.csv")).unwrap();
    fixture.write(
        "sb3/ppo-2/monitor.csv",
        &copy.replace("1700000000.25", "1700000009.5"),
    );
    let printed = fixture.succeed(&[]);
    let expected =
        "`sb3/ppo-0` and `sb3/ppo-2` have the same returns in all episodes: they may be one run";
    assert!(printed.contains(expected), "{printed}");
}

/// Only runs whose files have changed are read again; `verify` compares the stored results with the
/// files, and `report` needs no files.
#[test]
fn results_are_stored_and_verified() {
    let fixture = Fixture::with_files_of_tools(STUDY_OF_TOOLS);
    fixture.succeed(&[]);
    let listed = fixture.succeed(&["list"]);
    assert!(
        listed.contains("     1  finished     run sb3/ppo-1    SB3"),
        "{listed}"
    );
    fixture.append("sb3/ppo-1/monitor.csv", "50.0,1,0.5\n");
    let listed = fixture.succeed(&["list"]);
    assert!(
        listed.contains("     1  to run       run sb3/ppo-1    SB3"),
        "{listed}"
    );
    assert_eq!(listed.matches("  finished  ").count(), 7);
    fixture.succeed(&[]);
    assert_eq!(fixture.rows()[1]["episodes"], "4");
    let verified = fixture.succeed(&["verify"]);
    assert!(
        verified.contains("8 of 8 repeated runs are bit-identical"),
        "{verified}"
    );
    let rows = fixture.rows();
    fs::remove_dir_all(fixture.path("sb3")).unwrap();
    let out = fixture.path("out");
    assert!(seedbed(&["report", out.to_str().unwrap()]).status.success());
    assert_eq!(fixture.rows(), rows);
}

/// The example of `docs/study_other_libraries.md`, with the files that it names.
#[test]
fn the_example_of_the_documentation_works() {
    let page =
        fs::read_to_string(Path::new(REPOSITORY).join("docs/study_other_libraries.md")).unwrap();
    let section = page
        .split("## Compare results of other libraries")
        .nth(1)
        .unwrap();
    let example = section
        .split("```ron\n")
        .nth(1)
        .unwrap()
        .split("```")
        .next()
        .unwrap();
    let fixture = Fixture::with_files_of_tools(example);
    fs::create_dir(fixture.path("other")).unwrap();
    fs::rename(fixture.path("csv/runs.csv"), fixture.path("other/runs.csv")).unwrap();
    let run = fixture.path("recordings/cartpole/seed-0");
    let arguments = [
        "run",
        "cartpole",
        "--set",
        "stop=Episodes(3)",
        "--no-recording",
        "--out",
    ];
    let output = seedbed(&[&arguments[..], &[run.to_str().unwrap()]].concat());
    assert!(output.status.success(), "{output:?}");
    let printed = fixture.succeed(&["--quick"]);
    assert!(printed.contains("runs       8 finished\n"), "{printed}");
    assert!(
        printed.contains("1 confirmatory claim: 1 open"),
        "{printed}"
    );
}

/// A name of a run or agent that is missing, a quotation mark that is not closed, and lines after empty
/// ones.
#[test]
fn errors_in_files_have_their_places() {
    for (text, expected) in [
        (
            "return,run\n1,a\n7,\n",
            "a/0.csv:3:3: in `run`: expected a name, found none",
        ),
        (
            "return,run\n1,\"a\n2,a\n3,b\n",
            "a/0.csv:2:3: expected a second quotation mark, found the end of the file",
        ),
        (
            "return,run\n\n\n1,a,\n",
            "a/0.csv:4:5: expected 2 values, as in the header, found 3",
        ),
    ] {
        let fixture = Fixture::new(
            r#"Study(title: "t", cells: [(name: "a", results: Csv(files: "a/*.csv", columns: (run: "run")))], measures: [FinalReturn()])"#,
        );
        fixture.write("a/0.csv", text);
        let refused = fixture.fail(2, &[]);
        assert!(refused.contains(expected), "{refused}");
    }
}

/// Published results have one row per run of others, and give the same tables.
#[test]
fn published_results_of_others_give_the_tables_of_the_report() {
    let fixture = Fixture::with_files_of_tools(STUDY_OF_TOOLS);
    fixture.succeed(&[]);
    let [out, parent] = ["out", "published"].map(|name| fixture.path(name));
    let paths = [&out, &parent].map(|path| path.to_str().unwrap());
    assert!(
        seedbed(&["report", paths[0], "--publish", paths[1]])
            .status
            .success()
    );
    let published = parent.join("mine");
    fs::remove_file(published.join("tables.md")).unwrap();
    let output = seedbed(&["report", published.to_str().unwrap()]);
    assert!(output.status.success(), "{output:?}");
    let tables = fs::read_to_string(published.join("tables.md")).unwrap();
    assert_eq!(tables, fixture.output("tables.md"));
}
