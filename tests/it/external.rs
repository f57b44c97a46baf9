//! Studies of results that others made: files of other libraries, run directories, registrations, and
//! attempts to cheat. `tests/external/README.md` says how the files were made.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use seedbed::study::evaluate::claims;
use seedbed::study::evaluate::results::Results;
use seedbed::study::store::StudyFolder;
use seedbed_stats::effect_test::{EffectTest, lower_bound, upper_bound};
use seedbed_stats::means::TwoMeans;
use seedbed_stats::shares::{Share, TwoShares};
use seedbed_stats::{Direction, Interval, Verdict, verdict_on_effect};

use super::util::{
    REPOSITORY, seedbed, stderr, stdout, study_arguments, write_manifest_without_checksum,
};

/// A directory with a study and the files that it names.
struct Fixture {
    folder: tempfile::TempDir,
}

impl Fixture {
    fn new(study: &str) -> Self {
        let fixture = Self {
            folder: tempfile::tempdir().unwrap(),
        };
        fixture.write("mine.ron", study);
        fixture
    }

    /// A study with the files in `tests/external`.
    fn with_files_of_tools(study: &str) -> Self {
        let fixture = Self::new(study);
        let files = Path::new(REPOSITORY).join("tests/external");
        for folder in ["sb3", "sb3_team", "cleanrl", "csv"] {
            let copy = Command::new("cp")
                .arg("-r")
                .args([files.join(folder), fixture.path(folder)])
                .status();
            assert!(copy.unwrap().success());
        }
        fixture
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        let path = self.path(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }

    fn append(&self, name: &str, text: &str) {
        let earlier = fs::read_to_string(self.path(name)).unwrap();
        self.write(name, &(earlier + text));
    }

    fn study(&self, arguments: &[&str]) -> Output {
        let (study, out) = (self.path("mine.ron"), self.path("out"));
        let paths = [&study, &out].map(|path| path.to_str().unwrap());
        seedbed(&study_arguments(paths[0], paths[1], arguments))
    }

    /// The study must succeed. Returns standard output and standard error.
    fn succeed(&self, arguments: &[&str]) -> String {
        let output = self.study(arguments);
        assert!(output.status.success(), "{output:?}");
        stdout(&output) + &stderr(&output)
    }

    /// The study must end with this exit status. Returns standard output and standard error.
    fn fail(&self, status: i32, arguments: &[&str]) -> String {
        let output = self.study(arguments);
        assert_eq!(output.status.code(), Some(status), "{output:?}");
        stdout(&output) + &stderr(&output)
    }

    fn output(&self, name: &str) -> String {
        fs::read_to_string(self.path("out").join(name)).unwrap()
    }

    /// Rows of `results.csv`, each by the names of the columns.
    fn rows(&self) -> Vec<BTreeMap<String, String>> {
        let text = self.output("results.csv");
        let reader = csv::Reader::from_reader(text.as_bytes());
        reader.into_deserialize().map(Result::unwrap).collect()
    }
}

fn values<'a>(row: &'a BTreeMap<String, String>, columns: &[&str]) -> Vec<&'a str> {
    columns.iter().map(|column| row[*column].as_str()).collect()
}

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
        8
    );
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
        tables.contains("| CleanRL | 1 | 1/1 (0.207 to 1) | unknown | 40 | unknown | "),
        "{tables}"
    );
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

/// Final returns of two cells, and whether they reach 5.
const FIRST: [f64; 6] = [3.0, 9.5, 4.0, 8.0, 7.25, 11.0];
const SECOND: [f64; 5] = [1.0, 2.5, 0.5, 5.5, 2.0];

/// Effects, intervals and verdicts are those of the tests of `seedbed-stats` on the same numbers: one
/// family of two claims of an effect, at 2.5 % on each side. The smaller p of the two is tested at
/// 0.025 / 2.
#[test]
fn intervals_and_verdicts_are_those_of_the_statistics() {
    let fixture = Fixture::new(
        r#"Study(
            title: "Known numbers",
            solved: (return: 5, window: 1),
            cells: [(name: "first", results: Csv(files: "first/*.csv")), (name: "second", results: Csv(files: "second/*.csv"))],
            measures: [FinalReturn(window: 1)],
            claims: [
                (text: "more", compare: ("first", "second"), direction: More, smallest: 1, confirmatory: true),
                (text: "often", compare: ("first", "second"), measure: Solved, direction: More, smallest: 0.2),
            ],
        )"#,
    );
    for (cell, returns) in [("first", &FIRST[..]), ("second", &SECOND)] {
        for (number, value) in returns.iter().enumerate() {
            fixture.write(
                &format!("{cell}/{number}.csv"),
                &format!("return\n0\n{value}\n"),
            );
        }
    }
    fixture.succeed(&[]);
    let results = Results::read(&StudyFolder::new(fixture.path("out"))).unwrap();
    let found = claims::evaluate(&results);

    let test = TwoMeans::new(&FIRST, &SECOND);
    let interval = Interval::Known {
        low: lower_bound(&test, 0.025, 0.0),
        high: upper_bound(&test, 0.025, 1.0),
    };
    assert_eq!(found[0].interval, interval);
    assert_eq!(found[0].p, Some(test.p_above(0.0)));
    let verdict = verdict_on_effect(interval, Direction::Positive, 1.0);
    assert_eq!(
        (found[0].verdict, verdict),
        (Some(verdict), Verdict::Supported)
    );
    // 42.75 / 6 − 11.5 / 5 = 7.125 − 2.3.
    assert!((found[0].comparison.unwrap().effect.value - 4.825).abs() < 1e-6);

    // Four of six (9.5, 8, 7.25, 11) and one of five (5.5) reach 5.
    let share = |successes, runs| Share { successes, runs };
    let test = TwoShares::new(share(4, 6), share(1, 5));
    let Interval::Known { low, high } = found[1].interval else {
        panic!("{:?}", found[1].interval);
    };
    assert_eq!(found[1].comparison.unwrap().effect.value, test.estimate());
    assert!((test.p_above(low) - 0.025).abs() < 1e-3, "{low}");
    assert!((test.p_below(high) - 0.025).abs() < 1e-3, "{high}");
    assert_eq!(found[1].verdict, None);
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
    assert_eq!(listed.matches("finished").count(), 7);
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

/// A registered study of two cells with three runs each.
const REGISTERED: &str = r#"Study(
    title: "Registered",
    repeats: 3,
    cells: [(name: "a", results: Csv(files: "a/*.csv")), (name: "b", results: Csv(files: "b/*.csv"))],
    measures: [FinalReturn(window: 1)],
    claims: [(text: "more", compare: ("a", "b"), direction: More, smallest: 1, confirmatory: true)],
)"#;

impl Fixture {
    fn write_run(&self, name: &str, value: f64) {
        self.write(name, &format!("return\n0\n{value}\n"));
    }

    /// Registers a study before its files exist.
    fn registered() -> Self {
        let fixture = Self::new(REGISTERED);
        let printed = fixture.succeed(&["register"]);
        assert!(
            printed.contains(
                "of others  a: 3 runs; not fixed: run seeds, code, and when the runs were made"
            ),
            "{printed}"
        );
        fixture
    }

    fn write_all_runs(&self) {
        for number in 0..3 {
            self.write_run(&format!("a/{number}.csv"), 20.0 + f64::from(number));
            self.write_run(&format!("b/{number}.csv"), 10.0 + 0.5 * f64::from(number));
        }
    }

    /// Registers, makes all runs and confirms.
    fn confirmed() -> Self {
        let fixture = Self::registered();
        fixture.write_all_runs();
        let printed = fixture.succeed(&["confirm"]);
        assert!(printed.contains("6 finished\n"), "{printed}");
        fixture
    }
}

#[test]
fn a_study_is_registered_before_its_results_exist() {
    let fixture = Fixture::registered();
    let refused = fixture.fail(2, &[]);
    assert!(
        refused.contains("matches `a/*.csv`; expected a CSV file"),
        "{refused}"
    );
    let missing = fixture.succeed(&["confirm"]);
    assert!(
        missing.contains("3 of 3 runs of cell `a` are missing."),
        "{missing}"
    );
    assert!(
        missing.contains("1 confirmatory claim: 1 open"),
        "{missing}"
    );
    fixture.write_run("a/0.csv", 20.0);
    let missing = fixture.succeed(&["confirm"]);
    assert!(
        missing.contains("2 of 3 runs of cell `a` are missing."),
        "{missing}"
    );
    fixture.write_all_runs();
    let confirmed = fixture.succeed(&["confirm"]);
    assert!(
        confirmed.contains("6 finished\n") && !confirmed.contains("missing"),
        "{confirmed}"
    );
    let note = "The runs of cell `a` were made by others. The lock does not fix their run seeds, code, and when the runs were made.";
    assert!(confirmed.contains(note) && fixture.output("claims.md").contains(note));
    let lock: serde_json::Value =
        serde_json::from_slice(&fs::read(fixture.path("mine.ron.lock")).unwrap()).unwrap();
    let registered = &lock["registered"]["results_of_others"][1];
    assert_eq!(
        registered["source"],
        r#"Csv(files:"b/*.csv",columns:(return:"return",env_steps:None,length:None,episode:None,agent:None,run:None))"#
    );
    assert_eq!(
        (&registered["cell"], &registered["runs"]),
        (&"b".into(), &3.into())
    );
}

/// A file that existed, one that continues it, and one that was moved to the other cell.
#[test]
fn files_that_existed_at_the_registration_are_not_used() {
    let fixture = Fixture::new(REGISTERED);
    fixture.write_run("a/0.csv", 99.0);
    fixture.write_run("a/1.csv", 98.0);
    fixture.write_run("b/0.csv", 97.0);
    let printed = fixture.succeed(&["register"]);
    assert!(
        printed.contains("seen       3 files of results, which `confirm` does not use"),
        "{printed}"
    );
    fixture.append("a/1.csv", "50\n");
    fs::rename(fixture.path("b/0.csv"), fixture.path("a/2.csv")).unwrap();
    for number in 3..6 {
        fixture.write_run(&format!("a/{number}.csv"), 20.0 + f64::from(number));
        fixture.write_run(&format!("b/{number}.csv"), f64::from(number));
    }
    let confirmed = fixture.succeed(&["confirm"]);
    assert!(confirmed.contains("6 finished\n"), "{confirmed}");
    assert!(
        confirmed.contains(
            "Not used: 3 runs of cell `a`, whose files existed when the study was registered."
        ),
        "{confirmed}"
    );
    // The hash is that of `printf 'return\n0\n99\n' | sha256sum`.
    let seen = "Seen before: `a/0.csv` of cell `a`, SHA-256 ab83c352d5e40d31f140d79667eba7e4dfea9fa9a8140a01f6f261bed6293779.";
    assert!(confirmed.contains(seen), "{confirmed}");
    let rows = fixture.rows();
    let names: Vec<&str> = rows.iter().map(|row| row["run"].as_str()).collect();
    assert_eq!(
        names,
        [
            "a/3.csv", "a/4.csv", "a/5.csv", "b/3.csv", "b/4.csv", "b/5.csv"
        ]
    );
    // Files that an earlier registration saw are not forgotten.
    fs::rename(fixture.path("a/0.csv"), fixture.path("hidden")).unwrap();
    fixture.write(
        "mine.ron",
        &REGISTERED.replace("smallest: 1", "smallest: 2"),
    );
    fixture.succeed(&["register"]);
    fs::rename(fixture.path("hidden"), fixture.path("b/9.csv")).unwrap();
    fs::remove_dir_all(fixture.path("out")).unwrap();
    let confirmed = fixture.succeed(&["confirm"]);
    assert!(
        confirmed.contains("runs       0 finished, 6 missing"),
        "{confirmed}"
    );
    assert!(
        confirmed.contains("Not used: 4 runs of cell `b`"),
        "{confirmed}"
    );
}

#[test]
fn more_runs_than_registered_are_refused() {
    let fixture = Fixture::confirmed();
    fixture.write_run("a/3.csv", 100.0);
    let error = fixture.fail(2, &["confirm"]);
    assert!(
        error.contains(
            "found 4 runs, expected 3: which of them count must not depend on their results"
        ),
        "{error}"
    );
}

#[test]
fn a_changed_run_is_reported() {
    let fixture = Fixture::confirmed();
    fixture.write_run("a/1.csv", 100.0);
    let printed = fixture.fail(1, &["confirm"]);
    let expected =
        "not confirmed: The run `a/1.csv` of cell `a` was changed after it had been read.";
    assert!(printed.contains(expected), "{printed}");
    assert!(
        printed.contains("1 confirmatory claim: 1 open"),
        "{printed}"
    );
    // It stays reported when it is changed back.
    fixture.write_run("a/1.csv", 21.0);
    assert!(fixture.fail(1, &["confirm"]).contains(expected));
}

#[test]
fn a_run_that_was_moved_to_another_cell_is_reported() {
    let fixture = Fixture::confirmed();
    fs::rename(fixture.path("a/0.csv"), fixture.path("x")).unwrap();
    fs::rename(fixture.path("b/0.csv"), fixture.path("a/7.csv")).unwrap();
    fs::rename(fixture.path("x"), fixture.path("b/7.csv")).unwrap();
    let printed = fixture.fail(1, &["confirm"]);
    let expected =
        "not confirmed: The run `a/7.csv` of cell `a` had been read as `b/0.csv` of cell `b`.";
    assert!(printed.contains(expected), "{printed}");
    assert!(
        printed.contains("1 confirmatory claim: 1 open"),
        "{printed}"
    );
}

#[test]
fn a_deleted_run_leaves_claims_open() {
    let fixture = Fixture::confirmed();
    fs::remove_file(fixture.path("b/2.csv")).unwrap();
    let printed = fixture.succeed(&["confirm"]);
    assert!(
        printed.contains("1 of 3 runs of cell `b` are missing."),
        "{printed}"
    );
    assert!(
        printed.contains("1 confirmatory claim: 1 open"),
        "{printed}"
    );
    // Another run in its place does not count, under whatever name.
    fixture.write_run("b/9.csv", 5.0);
    let printed = fixture.fail(1, &["confirm"]);
    let expected =
        "The run `b/9.csv` of cell `b` was added when `b/2.csv`, which had been read, was gone.";
    assert!(printed.contains(expected), "{printed}");
    fs::remove_file(fixture.path("b/9.csv")).unwrap();
    fixture.write_run("b/2.csv", 6.0);
    let printed = fixture.fail(1, &["confirm"]);
    assert!(
        printed.contains("The run `b/2.csv` of cell `b` was changed"),
        "{printed}"
    );
}

#[test]
fn a_changed_mapping_or_threshold_is_refused() {
    let fixture = Fixture::registered();
    fixture.write(
        "mine.ron",
        &REGISTERED.replace("\"b/*.csv\"", "\"best/*.csv\""),
    );
    let error = fixture.fail(2, &["confirm"]);
    assert!(
        error.contains("settings of cell `b` were changed"),
        "{error}"
    );
    fixture.write(
        "mine.ron",
        &REGISTERED.replace("repeats: 3", "repeats: 3, solved: (return: 5)"),
    );
    let error = fixture.fail(2, &["confirm"]);
    assert!(
        error.contains("settings of cell `a` were changed"),
        "{error}"
    );
    fixture.write(
        "mine.ron",
        &REGISTERED.replace("(name: \"a\",", "(name: \"a\", repeats: 2,"),
    );
    let error = fixture.fail(2, &["confirm"]);
    assert!(error.contains("another value was changed"), "{error}");
}

/// Whoever edits what the results say of the files gets no verdict.
#[test]
fn edited_descriptions_of_files_are_reported() {
    let fixture = Fixture::new(REGISTERED);
    fixture.write_run("a/seen.csv", 99.0);
    fixture.succeed(&["register"]);
    fixture.write_all_runs();
    fixture.succeed(&["confirm"]);
    let manifest = fixture.path("out/study.json");
    let original = fs::read_to_string(&manifest).unwrap();
    let parsed: serde_json::Value = serde_json::from_str(&original).unwrap();
    let seen = &parsed["lock"]["registered"]["seen_files"][0]["file"]["sha256"];
    let run = &parsed["cells"][0]["external"]["runs"][0]["files"][0]["sha256"];
    let runs = "\"runs\": 3,";
    assert!(original.contains(runs));
    for (old, new) in [
        (run.as_str().unwrap(), seen.as_str().unwrap()),
        (runs, "\"runs\": 2,"),
        ("repeats: 3", "repeats: 2"),
        ("a/*.csv", "c/*.csv"),
    ] {
        write_manifest_without_checksum(&manifest, &original.replace(old, new));
        let out = fixture.path("out");
        let output = seedbed(&["report", out.to_str().unwrap()]);
        assert_eq!(output.status.code(), Some(1), "{old}: {output:?}");
        assert!(
            stdout(&output).contains("1 confirmatory claim: 1 open"),
            "{output:?}"
        );
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

/// The example of `docs/studies.md`, with the files that it names.
#[test]
fn the_example_of_the_documentation_works() {
    let page = fs::read_to_string(Path::new(REPOSITORY).join("docs/studies.md")).unwrap();
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
    assert!(printed.contains("1 exploratory comparison"), "{printed}");
}

/// A study of the cells `a` and `b` with confirmatory claims, and ten files of each with these returns.
fn study_of_cells(fields: &str, claims: &str, returns: [&dyn Fn(usize) -> Vec<f64>; 2]) -> Fixture {
    let cell = |name: &str| format!(r#"(name: "{name}", results: Csv(files: "{name}/*.csv"))"#);
    let fixture = Fixture::new(&format!(
        "Study(title: \"Cells\", {fields}, cells: [{}, {}], claims: [{claims}])",
        cell("a"),
        cell("b")
    ));
    for (cell, returns) in ["a", "b"].into_iter().zip(returns) {
        for run in 0..10 {
            // Files with equal returns must not be copies.
            let values = returns(run).into_iter();
            let rows = values.map(|value| format!("{value},{run}\n"));
            let text = format!("return,number\n{}", rows.collect::<String>());
            fixture.write(&format!("{cell}/{run}.csv"), &text);
        }
    }
    fixture
}

fn claim(text: &str, fields: &str) -> String {
    format!(r#"(text: "{text}", compare: ("a", "b"), {fields}, because: "x", confirmatory: true),"#)
}

/// 200 episodes, of which those from number `solved` on have the return 1.
fn solved_at(solved: usize) -> Vec<f64> {
    let mut returns = vec![0.0; 200];
    returns[solved - 1..].fill(1.0);
    returns
}

/// Both cells are solved after 60 to 87 episodes, but all files of `b` end after 30: nothing is known of
/// it up to episode 120, where it may be faster or slower. If only the last ten episodes before the horizon
/// are missing, they do not matter.
#[test]
fn runs_that_ended_early_say_nothing_of_what_came_later() {
    let times = "solved: (return: 1, window: 1), measures: [EpisodesToSolve]";
    let fields = "direction: Less, smallest: 5, horizon: 120";
    let claims = claim("a is faster", fields);
    let returns = |run: usize| solved_at(60 + 3 * run);
    let cut = |run: usize| returns(run)[..30].to_vec();
    let fixture = study_of_cells(times, &claims, [&returns, &cut]);
    let printed = fixture.succeed(&[]);
    let note = "Not known up to 120: 10 of 10 runs of b ended before without reaching their time, which may be any \
                after their end.";
    assert!(
        printed.contains("open             a is faster\n"),
        "{printed}"
    );
    assert!(printed.contains(note), "{printed}");
    for file in ["claims.md", "report.html"] {
        assert!(fixture.output(file).contains(note), "{file}");
    }
    // 73.5 on average, against times from 30 to 120.
    let table = fixture.output("claims.md");
    assert!(
        table.contains("−1.5 (") && table.contains(", 73.5 against 75 |"),
        "{table}"
    );

    let late = |_: usize| vec![0.0; 110];
    let fixture = study_of_cells(times, &claims, [&returns, &late]);
    let printed = fixture.succeed(&[]);
    assert!(
        printed.contains("supported        a is faster\n"),
        "{printed}"
    );
}

/// Without a horizon, times are compared up to the first end of a run that was not solved, here after seven
/// episodes, and the report says so.
#[test]
fn a_report_says_up_to_which_time_of_others_is_compared() {
    let times = "solved: (return: 1, window: 1), measures: [EpisodesToSolve]";
    let claims = r#"(text: "x", compare: ("a", "b"), direction: Less, smallest: 1)"#;
    let returns = |run: usize| solved_at(60 + 3 * run);
    let one_is_short = |run: usize| vec![0.0; if run == 4 { 7 } else { 200 }];
    let fixture = study_of_cells(times, claims, [&returns, &one_is_short]);
    let printed = fixture.succeed(&[]);
    let note =
        "Times are compared up to 7, where the first run ended that did not reach its time: ";
    assert!(printed.contains(note), "{printed}");
    for file in ["claims.md", "tables.md", "report.html"] {
        assert!(fixture.output(file).contains(note), "{file}");
    }
}

/// All returns are 0.1, but the means of 25 and of ten of them are rounded differently.
#[test]
fn rounding_is_no_effect() {
    let claims = ["More", "Less", "Same"].map(|direction| {
        claim(
            direction,
            &format!("direction: {direction}, smallest: 0.05"),
        )
    });
    let [many, few] = [25, 10].map(|episodes| move |_: usize| vec![0.1; episodes]);
    let fixture = study_of_cells(
        "measures: [FinalReturn()]",
        &claims.join(" "),
        [&many, &few],
    );
    let printed = fixture.succeed(&[]);
    assert!(
        printed.contains("3 confirmatory claims: 3 open"),
        "{printed}"
    );
    let table = fixture.output("claims.md");
    let found = "| 0 (no interval: all runs have the same value), 0.1 against 0.1 | 10 |";
    assert_eq!(table.matches(found).count(), 3, "{table}");
    assert_eq!(table.matches("| 1.0000 | open |").count(), 2, "{table}");
    assert!(!table.contains("Times are compared"), "{table}");
    assert!(
        fixture
            .output("tables.md")
            .contains("| 10 | 0 (no interval: all runs have the same value) | 0.5 (")
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

/// Without the files, nothing says whether published numbers of others are theirs.
#[test]
fn published_results_of_others_are_not_verified_without_their_files() {
    let fixture = Fixture::confirmed();
    let paths = ["out", "published"].map(|name| fixture.path(name));
    let paths = paths.each_ref().map(|path| path.to_str().unwrap());
    assert!(
        seedbed(&["report", paths[0], "--publish", paths[1]])
            .status
            .success()
    );
    for folder in [PathBuf::from(paths[0]), fixture.path("published/mine")] {
        let [study, folder] =
            [&fixture.path("mine.ron"), &folder].map(|path| path.display().to_string());
        let verify = || {
            let verify = ["verify", "--registered", "--runs=100%"];
            seedbed(&study_arguments(&study, &folder, &verify))
        };
        assert!(verify().status.success(), "{:?}", verify());
        fs::rename(fixture.path("a"), fixture.path("gone")).unwrap();
        let output = verify();
        assert_eq!(output.status.code(), Some(1), "{output:?}");
        assert!(
            stdout(&output).contains("3 of 3 repeated runs are bit-identical"),
            "{output:?}"
        );
        let error = stderr(&output);
        assert!(
            error.contains("missing    the files of 3 runs of cell `a`, with which"),
            "{error}"
        );
        assert!(error.ends_with("error: 3 runs not reproduced\n"), "{error}");
        fs::rename(fixture.path("gone"), fixture.path("a")).unwrap();
    }
}

/// One of three runs ended early without solving its task: it may have solved it afterwards. What did not solve its
/// task in all episodes is known.
#[test]
fn a_run_that_ended_early_may_have_solved_its_task() {
    let fixture = Fixture::new(
        r#"Study(
            title: "Early ends",
            solved: (return: 5, window: 1),
            max_episodes: 3,
            cells: [(name: "first", results: Csv(files: "first/*.csv")), (name: "second", results: Csv(files: "second/*.csv"))],
            measures: [Solved],
            claims: [(text: "often", compare: ("first", "second"), measure: Solved, direction: More, smallest: 0.2)],
        )"#,
    );
    for (name, returns) in [
        ("first/solved", "9"),
        ("first/early", "1\n2"),
        ("first/unsolved", "1\n2\n3"),
        ("second/solved", "1\n2\n8"),
        ("second/unsolved", "1\n2\n4\n9"),
    ] {
        fixture.write(&format!("{name}.csv"), &format!("return\n{returns}\n"));
    }
    fixture.succeed(&[]);
    let results = Results::read(&StudyFolder::new(fixture.path("out"))).unwrap();
    let comparison = claims::evaluate(&results)[0].comparison.unwrap();
    assert_eq!(
        (comparison.values, comparison.ended_early),
        ([0.5, 0.5], [1, 0])
    );
    let tables = fixture.output("tables.md");
    let note = "Not known of runs that ended before `max_episodes` without solving their task, which they may have solved \
                afterwards: 1 of 3 runs of first. Intervals hold for all that is possible, and shares are its middle.";
    assert!(tables.contains(note), "{tables}");
    assert!(
        tables.contains("| first | 3 | 0.5 (0.0615 to 0.939) |"),
        "{tables}"
    );
    assert!(fixture.output("claims.md").contains(note));
}
