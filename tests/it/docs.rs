//! Guides: their commands work, and the page of algorithms is that of the program.

use std::fs;
use std::path::Path;
use std::process::Command;

use super::util::{REPOSITORY, run_successful, stderr, stdout};

/// Commands that are not run here: they wait for a viewer, take hours, or read a run that Python
/// recorded.
const NOT_RUN: [&str; 6] = [
    "recordings/lander",
    "--live",
    "--serve",
    "/thesis/",
    "/benchmark/",
    "scenarios/*.ron --seeds",
];

/// The commands of a page: the lines of its indented blocks that begin with `seedbed`.
fn commands(page: &str) -> Vec<String> {
    let text = fs::read_to_string(Path::new(REPOSITORY).join(page)).unwrap();
    let commands = text.lines().filter_map(|line| line.strip_prefix("    "));
    commands
        .filter(|line| line.starts_with("seedbed "))
        .filter(|line| !NOT_RUN.iter().any(|part| line.contains(part)))
        .map(without_whole_studies)
        .collect()
}

/// A whole study takes minutes.
fn without_whole_studies(line: &str) -> String {
    let runs_all =
        line.starts_with("seedbed study scenarios") || line.starts_with("seedbed study run");
    if runs_all && !line.contains(" --") {
        line.replacen(".ron", ".ron --quick", 1)
    } else {
        line.to_owned()
    }
}

/// Runs of a few episodes: that agents learn in the scenarios of this repository is what other tests show.
fn with_short_runs(line: &str) -> String {
    let short = "--set 'stop=Episodes(30)'";
    if line.contains("/tabular/") {
        line.to_owned()
    } else if line.contains("stop=Episodes(200)") {
        line.replace("Episodes(200)", "Episodes(30)")
    } else if line.starts_with("seedbed run ") && !line.contains("stop=") {
        line.replacen("seedbed run", &format!("seedbed run {short}"), 1)
    } else {
        line.replacen("--seeds 10 ", &format!("--seeds 2 {short} "), 1)
    }
}

/// Copies files and directories of the repository into `folder`.
fn copy_to(paths: &[&str], folder: &Path) {
    let mut copy = Command::new("cp");
    copy.arg("-r")
        .args(paths)
        .arg(folder)
        .current_dir(REPOSITORY);
    assert!(copy.status().unwrap().success());
}

/// Runs all commands of a page, with [short runs](with_short_runs).
fn run_commands(page: &str, at_least: usize) -> tempfile::TempDir {
    let commands: Vec<String> = commands(page)
        .iter()
        .map(|line| with_short_runs(line))
        .collect();
    assert!(commands.len() >= at_least, "{page}: {commands:?}");
    run_in_repository_files(page, &commands)
}

/// Runs commands of a page in one shell, in a directory with the files of the repository that they name. Returns that directory.
fn run_in_repository_files(page: &str, commands: &[String]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    copy_to(&["envs", "scenarios"], folder.path());
    // Without the runs and studies that this checkout may have made.
    copy_to(&["docs/gallery/teams.ron"], folder.path());
    let recordings = folder.path().join("recordings");
    std::fs::create_dir(&recordings).unwrap();
    copy_to(&["recordings/README.md", "recordings/sample"], &recordings);
    let binary = Path::new(env!("CARGO_BIN_EXE_seedbed")).parent().unwrap();
    let path = format!("{}:{}", binary.display(), std::env::var("PATH").unwrap());
    let output = Command::new("sh")
        .args(["-e", "-x", "-c", &commands.join("\n")])
        .env("PATH", path)
        .current_dir(folder.path())
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{page}: {}\n{}",
        stdout(&output),
        stderr(&output)
    );
    folder
}

fn is_svg(name: &str) -> bool {
    Path::new(name)
        .extension()
        .is_some_and(|found| found == "svg")
}

/// The commands of the gallery draw its pictures, and the page shows all of them.
#[test]
fn pictures_of_the_gallery_are_those_of_its_commands() {
    let page = "docs/gallery.md";
    let drawn = run_commands(page, 12);
    let text = fs::read_to_string(Path::new(REPOSITORY).join(page)).unwrap();
    let shown = text.split("](gallery/").skip(1);
    let shown = shown.filter_map(|rest| rest.split_once(')').map(|(name, _)| name));
    let pictures: Vec<&str> = shown.filter(|name| is_svg(name)).collect();
    assert!(pictures.len() > 10, "{pictures:?}");
    for picture in pictures {
        let of_study = drawn.path().join("recordings/teams/figures").join(picture);
        let path = [drawn.path().join(picture), of_study]
            .into_iter()
            .find(|path| path.is_file());
        let text = fs::read_to_string(path.expect(picture)).unwrap();
        let stored = Path::new(REPOSITORY).join("docs/gallery").join(picture);
        expect_test::expect_file![stored].assert_eq(&text);
    }
}

#[test]
fn commands_of_the_readme_work() {
    let commands = commands("README.md");
    assert!(commands.len() >= 6, "{commands:?}");
    run_in_repository_files("README.md", &commands);
}

#[test]
fn commands_of_the_quickstart_work() {
    run_commands("docs/quickstart.md", 14);
}

#[test]
fn commands_of_the_page_on_recordings_work() {
    run_commands("docs/recording.md", 10);
}

#[test]
fn commands_of_the_page_on_scenarios_work() {
    run_commands("docs/scenarios.md", 6);
}

#[test]
fn commands_of_the_page_on_the_explorer_work() {
    run_commands("docs/explorer.md", 6);
}

#[test]
fn commands_of_the_page_on_learning_work() {
    run_commands("docs/learning_problems.md", 9);
}

#[test]
fn commands_of_the_page_on_clusters_work() {
    run_commands("docs/cluster.md", 7);
}

#[test]
fn commands_of_the_page_on_tuning_work() {
    run_commands("docs/tuning.md", 5);
}

#[test]
fn commands_of_the_page_on_coordination_work() {
    run_commands("docs/coordination.md", 3);
}

#[test]
fn commands_of_the_pages_on_algorithms_work() {
    run_commands("docs/tabular.md", 3);
    run_commands("docs/bonuses.md", 2);
    run_commands("docs/how_agents_differ.md", 2);
    run_commands("docs/soft_actor_critic.md", 1);
}

/// With `UPDATE_EXPECT=1` the page is rewritten.
#[test]
fn the_page_of_algorithms_is_current() {
    let page = run_successful(&["list", "algorithms", "--markdown"]);
    let path = Path::new(REPOSITORY).join("docs/algorithms.md");
    if std::env::var_os("UPDATE_EXPECT").is_some() {
        fs::write(&path, &page).unwrap();
    }
    let stored = fs::read_to_string(path).unwrap_or_default();
    assert!(stored == page, "run this test with UPDATE_EXPECT=1");
}
