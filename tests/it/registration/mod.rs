//! Registered studies on the command line: locks and confirmations.

mod edited;
mod published;
mod tried_before;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use crate::util::{
    REPOSITORY, seedbed, stderr, stdout, study_arguments, write_manifest_without_checksum,
};

/// A study in a directory of its own, with its own copy of the scenario.
struct Fixture {
    folder: tempfile::TempDir,
}

impl Fixture {
    /// A study with these claims and further fields, of six finite runs of each of two cells.
    fn new(fields: &str) -> Self {
        let fixture = Self {
            folder: tempfile::tempdir().unwrap(),
        };
        let scenario = Path::new(REPOSITORY).join("scenarios/tabular/deep_sea.ron");
        fs::copy(scenario, fixture.path("deep_sea.ron")).unwrap();
        fixture.write_study(fields);
        fixture
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write_study(&self, fields: &str) {
        let text = format!(
            r#"Study(
                title: "Small",
                scenario: "deep_sea.ron",
                set: ["agents.count=10", "episodes=40"],
                cells: [
                    (name: "seeds", set: ["algorithm=SeedSampling()"]),
                    (name: "random", set: ["algorithm=Random"]),
                ],
                measures: [Regret],
                {fields}
            )"#
        );
        fs::write(self.path("small.ron"), text).unwrap();
    }

    fn study(&self, arguments: &[&str]) -> Output {
        let paths = [self.path("small.ron"), self.path("out")];
        let [study, out] = paths.each_ref().map(|path| path.to_str().unwrap());
        seedbed(&study_arguments(study, out, arguments))
    }

    /// The arguments must succeed. Returns the standard output.
    fn succeed(&self, arguments: &[&str]) -> String {
        let output = self.study(arguments);
        assert!(output.status.success(), "{output:?}");
        stdout(&output)
    }

    /// Registers and confirms the study. Returns the output of `confirm`.
    fn confirm(&self) -> String {
        self.succeed(&["register"]);
        self.succeed(&["confirm"])
    }

    /// `confirm` must be refused as invalid input. Returns the error.
    fn refusal(&self) -> String {
        let output = self.study(&["confirm"]);
        assert_eq!(output.status.code(), Some(2), "{output:?}");
        stderr(&output)
    }

    /// Writes the report again, and returns the standard output.
    fn report(&self) -> String {
        let output = seedbed(&["report", self.path("out").to_str().unwrap()]);
        assert!(output.status.success(), "{output:?}");
        stdout(&output)
    }

    /// Writes the report again, which must fail because the results do not confirm what was
    /// registered, without any verdict. Returns the standard output.
    fn refuted_report(&self) -> String {
        let output = seedbed(&["report", self.path("out").to_str().unwrap()]);
        assert_eq!(output.status.code(), Some(1), "{output:?}");
        let printed = stdout(&output);
        assert!(
            printed.contains("claims     1 confirmatory claim: 1 open"),
            "{printed}"
        );
        assert!(printed.contains("not confirmed: "), "{printed}");
        printed
    }

    /// Publishes the results. Returns the folder with the published results.
    fn publish(&self) -> PathBuf {
        let [out, parent] = ["out", "published"].map(|name| self.path(name));
        let paths = [&out, &parent].map(|path| path.to_str().unwrap());
        let output = seedbed(&["report", paths[0], "--publish", paths[1]]);
        assert!(output.status.success(), "{output:?}");
        parent.join("small")
    }

    /// Replaces a text in the stored description of the results.
    fn edit_manifest(&self, old: &str, new: &str) {
        let path = self.path("out/study.json");
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.contains(old), "{old} in {text}");
        write_manifest_without_checksum(&path, &text.replace(old, new));
    }

    /// Paths of the result files, in the order of their names.
    fn result_files(&self) -> Vec<PathBuf> {
        let entries = fs::read_dir(self.path("out/runs")).unwrap();
        let mut files: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
        files.sort();
        files
    }

    fn claims_table(&self) -> String {
        fs::read_to_string(self.path("out/claims.md")).unwrap()
    }
}

const CLAIM: &str = r#"claims: [(text: "less regret", compare: ("seeds", "random"), direction: Less, smallest: 5, confirmatory: true)],"#;

fn with_repeats(repeats: u32) -> String {
    format!("repeats: {repeats}, {CLAIM}")
}

/// A registration says that one lock was before it, whose claim it does not have.
fn assert_follows_one_lock(registered: &str) {
    assert!(
        registered.contains("history    1 lock before this one"),
        "{registered}"
    );
    assert!(
        registered.contains("withdrawn  seeds | random | Regret | Less | 5"),
        "{registered}"
    );
}

#[test]
fn a_registered_study_is_confirmed_with_run_seeds_from_its_lock() {
    let fixture = Fixture::new(&with_repeats(6));
    assert!(
        fixture
            .refusal()
            .contains("register the study with `seedbed study register` first")
    );
    let registered = fixture.succeed(&["register"]);
    assert!(
        registered.contains("registered small: 1 confirmatory claim, 2 cells, 6 runs each"),
        "{registered}"
    );
    let confirmed = fixture.succeed(&["confirm"]);
    assert!(
        confirmed.contains("1 confirmatory claim: 1 supported"),
        "{confirmed}"
    );
    let lock: serde_json::Value =
        serde_json::from_slice(&fs::read(fixture.path("small.ron.lock")).unwrap()).unwrap();
    let id = lock["id"].as_str().unwrap();
    assert!(fixture.claims_table().contains(&format!("lock `{id}`")));
    let listed = fixture.succeed(&["list", "--registered"]);
    assert!(
        listed.lines().all(|line| !line.contains("run seed 1000 ")),
        "{listed}"
    );
    assert_eq!(listed.matches("finished").count(), 12);
    let said = stderr(&fixture.study(&["list"]));
    assert!(
        said.starts_with("note       these runs are not those that ")
            && said.contains("small.ron.lock"),
        "{said}"
    );
    // The same file is the same lock, and has no history.
    let again = fixture.succeed(&["register"]);
    assert!(
        again.contains(&id[..12]) && !again.contains("history"),
        "{again}"
    );
}

#[test]
fn a_changed_claim_is_refused_and_a_new_lock_names_the_old_one() {
    let fixture = Fixture::new(&with_repeats(6));
    fixture.confirm();
    let seeds_before = fixture.succeed(&["list", "--registered"]);
    fixture.write_study(&with_repeats(6).replace("smallest: 5", "smallest: 1"));
    let error = fixture.refusal();
    assert!(
        error.contains("the study differs from its lock: the claim `seeds | random | Regret"),
        "{error}"
    );
    let registered = fixture.succeed(&["register"]);
    assert_follows_one_lock(&registered);
    // All runs of the new lock are other runs.
    let other_lock = fixture.refusal();
    assert!(
        other_lock.contains("contains this study with other run seeds"),
        "{other_lock}"
    );
    fs::remove_dir_all(fixture.path("out")).unwrap();
    fixture.succeed(&["confirm"]);
    assert_ne!(fixture.succeed(&["list", "--registered"]), seeds_before);
    let table = fixture.claims_table();
    assert!(
        table.contains("An earlier lock: ") && table.contains("was withdrawn: `seeds"),
        "{table}"
    );
}

#[test]
fn another_scenario_is_refused() {
    let fixture = Fixture::new(&with_repeats(6));
    fixture.confirm();
    let scenario = fixture.path("deep_sea.ron");
    let text = fs::read_to_string(&scenario).unwrap();
    fs::write(
        &scenario,
        text.replacen("Scenario", "Scenario ", 1)
            .replace("width: 10", "width: 9"),
    )
    .unwrap();
    fixture.write_study(&with_repeats(6).replace("repeats", "first_seed: 1000, repeats"));
    fixture.succeed(&["confirm"]);
    fixture.write_study(&with_repeats(6));
    let study = fixture.path("small.ron");
    let text = fs::read_to_string(&study).unwrap();
    fs::write(&study, text.replace("episodes=40", "episodes=41")).unwrap();
    let error = fixture.refusal();
    assert!(
        error.contains("the scenario, the task or the settings of cell `seeds` were changed"),
        "{error}"
    );
}

/// The effect is so large that it is decided at the first of two looks.
#[test]
fn a_decided_study_stops_at_an_early_look() {
    let looks = with_repeats(20).replace("claims:", "looks: [10, 20], claims:");
    let fixture = Fixture::new(&looks);
    let confirmed = fixture.confirm();
    assert!(
        confirmed.contains("look       1 of 2: 10 runs per cell"),
        "{confirmed}"
    );
    assert!(
        confirmed.contains("decided    all confirmatory claims, at look 1 of 2"),
        "{confirmed}"
    );
    assert!(
        confirmed.contains("runs       20 finished\n"),
        "{confirmed}"
    );
    assert_eq!(fixture.result_files().len(), 20);
}

#[test]
fn a_study_without_confirmatory_claims_is_not_registered() {
    let fixture = Fixture::new("repeats: 6,");
    let output = fixture.study(&["register"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        stderr(&output).contains("the study has no confirmatory claim"),
        "{output:?}"
    );
}

#[test]
fn runs_from_before_the_registration_are_reported() {
    let fixture = Fixture::new(&with_repeats(6));
    fixture.succeed(&[]);
    fixture.succeed(&["register"]);
    fs::remove_dir_all(fixture.path("out")).unwrap();
    let confirmed = fixture.succeed(&["confirm"]);
    assert!(
        confirmed.contains("note       When the study was registered, 6 runs of cell `seeds` with other run seeds had been made."),
        "{confirmed}"
    );
}

#[test]
fn power_says_how_many_runs_each_claim_needs() {
    let fixture = Fixture::new(
        &with_repeats(6).replace("confirmatory", "expected: Deviation(10), confirmatory"),
    );
    let printed = fixture.succeed(&["power"]);
    // An effect of half a standard deviation at the level 0.025: 64 runs per cell, 86 for
    // a power of 0.9.
    assert!(
        printed.contains("0.0250     0.12       64       86  less regret"),
        "{printed}"
    );
}

/// In the deep sea, random agents hardly ever reach the treasure, and teams that sample seeds do.
#[test]
fn a_study_says_whether_its_task_is_one_of_exploration() {
    let gate = r#"exploration: (undirected: ["random"], measure: Reach),"#;
    let fixture = Fixture::new(&format!("repeats: 12, {gate}"));
    let printed = fixture.succeed(&[]);
    let expected = "gate       `DeepSea` with K = 10 is a task of exploration: the share of agents that \
                    reached the goal is ";
    assert!(printed.contains(expected), "{printed}");
    let swapped = Fixture::new(&format!("repeats: 3, {}", gate.replace("random", "seeds")));
    let printed = swapped.succeed(&[]);
    assert!(
        printed.contains("`DeepSea` with K = 10 is no task of exploration"),
        "{printed}"
    );
}

/// Changes what a folder of results says of itself.
fn edit_json(path: &Path, edit: impl Fn(&mut serde_json::Value)) {
    let mut json = serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap();
    edit(&mut json);
    json.as_object_mut().unwrap().remove("sha256");
    fs::write(path, json.to_string()).unwrap();
}

/// The folder of figures, too, has files of processes that were killed.
#[test]
fn incomplete_figures_are_removed() {
    let fixture = Fixture::new(&with_repeats(6));
    fixture.succeed(&[]);
    let part = fixture.path("out/figures/1-curves.svg.abc123.part");
    fs::create_dir_all(part.parent().unwrap()).unwrap();
    fs::write(&part, "").unwrap();
    fixture.succeed(&[]);
    assert!(!part.exists());
}
