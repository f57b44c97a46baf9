//! `seedbed list`.

use std::path::Path;

use crate::util::{command, seedbed, stderr, stdout};

/// Details of environments and algorithms are printed only if asked for.
#[test]
fn list_prints_one_line_per_environment_scenario_and_algorithm() {
    let output = seedbed(&["list"]);
    assert!(output.status.success());
    let printed = stdout(&output);
    for line in [
        "\n  cartpole ",
        "\n  scenarios/cartpole.ron ",
        "\n  SeedPg ",
        "\n  Ucrl ",
    ] {
        assert_eq!(printed.matches(line).count(), 1, "{line} in {printed}");
    }
    let details = [
        ("environments", "theta_dot"),
        ("algorithms", "ratio_product_cap"),
    ];
    for (kind, word) in details {
        assert!(!printed.contains(word), "{word} in {printed}");
        let detailed = stdout(&seedbed(&["list", kind]));
        assert!(detailed.contains(word), "{word} in {detailed}");
    }
}

/// Prints `seedbed list WHAT` in a folder.
fn list_in(folder: &Path, what: &str) -> String {
    let output = command(&["list", what])
        .current_dir(folder)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    stdout(&output)
}

/// In a folder without tasks and scenarios, names are those of the built-in files.
#[test]
fn list_prints_built_in_files_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let environments = list_in(folder.path(), "environments");
    assert!(
        environments
            .starts_with("Environments (built in; use them by name in any directory)\n  acrobot\n"),
        "{environments}"
    );
    assert!(
        environments.contains("\n  mistakes/parking_naive\n"),
        "{environments}"
    );
    let scenarios = list_in(folder.path(), "scenarios");
    assert!(!environments.contains("invalid") && !scenarios.contains("invalid"));
    assert!(scenarios.contains("\n  cartpole_team "), "{scenarios}");
    assert!(scenarios.contains("\n  tabular/deep_sea "), "{scenarios}");
}

/// `list --show` prints the file itself, which can be edited and run.
#[test]
fn list_shows_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let output = command(&["list", "--show", "cartpole"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    let text = std::fs::read_to_string("envs/cartpole.ron").unwrap();
    assert_eq!(
        stdout(&output),
        format!("// builtin:envs/cartpole.ron\n{text}")
    );
    assert_eq!(
        stderr(&output),
        "note: for the scenario, use `seedbed list scenarios --show cartpole`\n"
    );
    let scenario = seedbed(&["list", "scenarios", "--show", "cartpole"]);
    assert!(stdout(&scenario).starts_with("// scenarios/cartpole.ron\n"));
    let unknown = seedbed(&["list", "--show", "cartpol"]);
    assert_eq!(unknown.status.code(), Some(2));
    assert_eq!(
        stderr(&unknown),
        "error: cartpol: there is no such file, environment or scenario\n  = help: did you mean `cartpole`?\n"
    );
    let action = seedbed(&["study", "powr", "team_size"]);
    assert!(stderr(&action).ends_with("  = help: `seedbed study power`, if that was meant\n"));
}

/// `list` searches the same directories as the lookup of environments and scenarios by name: the
/// working directory and its parents.
#[test]
fn list_searches_parent_directories() {
    let folder = tempfile::tempdir().unwrap();
    let project = folder.path().canonicalize().unwrap();
    let subfolder = project.join("notes/today");
    for name in ["envs", "scenarios", "notes/today"] {
        std::fs::create_dir_all(project.join(name)).unwrap();
    }
    std::fs::copy("envs/cartpole.ron", project.join("envs/broom.ron")).unwrap();
    let one_agent = r#"Scenario(environment: "broom", agents: (count: 1), stop: Episodes(1))"#;
    for name in ["alone", "lonely"] {
        let path = project.join("scenarios").join(name).with_extension("ron");
        std::fs::write(path, one_agent).unwrap();
    }
    let environments = list_in(&subfolder, "environments");
    assert!(
        environments.starts_with(&format!(
            "Environments ({})\n  broom\n",
            project.join("envs/").display()
        )),
        "{environments}"
    );
    let scenarios = project.join("scenarios/").display().to_string();
    let description = "1 agent in broom, at most 1 episode each";
    let expected = format!(
        "Scenarios ({scenarios})\n  {scenarios}alone.ron  {description}\n  {scenarios}lonely.ron {description}\n\n"
    );
    let listed = list_in(&subfolder, "scenarios");
    assert!(
        listed.starts_with(&expected),
        "descriptions begin after the longest path: {listed}"
    );
}

/// A folder `envs` among the scenarios has tasks; one around all of them is any folder.
#[test]
fn tasks_among_scenarios_are_no_scenarios() {
    let folder = tempfile::tempdir().unwrap();
    let project = folder.path().join("envs/project");
    let [inner, below] = ["scenarios/envs", "sub"].map(|name| project.join(name));
    std::fs::create_dir_all(&inner).unwrap();
    std::fs::create_dir_all(&below).unwrap();
    std::fs::write(inner.join("task.ron"), "Gymnasium(id: \"CartPole-v1\")").unwrap();
    let scenario = "Scenario(environment: \"cartpole\")";
    std::fs::write(project.join("scenarios/mine.ron"), scenario).unwrap();
    for working_directory in [&project, &below] {
        let printed = list_in(working_directory, "scenarios");
        assert!(
            printed.contains("scenarios/mine.ron 4 agents in cartpole"),
            "{printed}"
        );
        assert!(!printed.contains("task.ron"), "{printed}");
    }
}

/// A text after the kind selects by name: files on the disk and built-in ones, algorithms, fields.
#[test]
fn a_part_of_a_name_selects() {
    for (arguments, expected) in [
        (
            ["environments", "hooks"],
            vec!["hooks_1", "hooks_3", "hooks_4", "hooks_easy"],
        ),
        (["algorithms", "Leader"], vec!["LeaderFollowers"]),
        (["algorithms", "Ucrl"], vec!["Ucrl(width:"]),
    ] {
        let printed = stdout(&seedbed(&["list", arguments[0], arguments[1]]));
        let names = printed.lines().filter_map(|line| line.strip_prefix("  "));
        let names = names.filter(|line| !line.starts_with(' '));
        let names: Vec<&str> = names.map(|line| line.split(' ').next().unwrap()).collect();
        assert_eq!(names, expected, "{printed}");
    }
    let unknown = seedbed(&["list", "scenarios", "no_such"]);
    assert_eq!(unknown.status.code(), Some(2));
    assert_eq!(
        stderr(&unknown),
        "error: no name contains `no_such`; without it, all are listed\n"
    );
}
