//! `seedbed explore`. What the page does in a browser is checked by `tests/interop/run`.

use std::path::Path;

use crate::util::{ball_above_ground, run_refused, run_successful, small_run};

fn explore(arguments: &[&str]) -> String {
    run_successful(&[&["explore"], arguments].concat())
}

/// The JSON in a page.
fn data_of(page: &Path) -> serde_json::Value {
    let text = std::fs::read_to_string(page).unwrap();
    let (_, data) = text
        .split_once(r#"<script type="application/json" id="data">"#)
        .unwrap();
    let (data, _) = data.split_once("</script>").unwrap();
    serde_json::from_str(data).unwrap()
}

/// A page has all states, as many as `episodes.csv` says, or an evenly spaced sample, which it says.
#[test]
fn a_page_has_the_states_of_a_run() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    assert!(small_run(&run, &[]).status.success());
    let run_text = run.to_str().unwrap();
    let printed = explore(&[run_text]);
    let page = run.join("explore.html");
    assert!(
        printed.starts_with(&format!("wrote {}: ", page.display())),
        "{printed}"
    );
    let episodes = std::fs::read_to_string(run.join("episodes.csv")).unwrap();
    let lengths = episodes
        .lines()
        .skip(1)
        .map(|line| line.split(',').nth(5).unwrap());
    let states: u64 = lengths
        .map(|length| length.parse::<u64>().unwrap() + 1)
        .sum();
    let data = data_of(&page);
    let axes = data["axes"].as_array().unwrap();
    let names: Vec<&str> = axes
        .iter()
        .map(|axis| axis["name"].as_str().unwrap())
        .collect();
    assert_eq!(
        names,
        [
            "x",
            "x_dot",
            "theta",
            "theta_dot",
            "force",
            "reward",
            "step",
            "episode",
            "return"
        ]
    );
    let data = &data["runs"][0];
    assert_eq!(
        (&data["states"], &data["kept"]),
        (&states.into(), &states.into())
    );
    assert!(
        data["film"].is_object(),
        "the bodies of agent 0 are recorded"
    );
    let bytes = std::fs::read(&page).unwrap();
    let printed = explore(&[run_text, "--states", "20"]);
    assert!(
        printed.contains(&format!("a sample of 20 of {states} states")),
        "{printed}"
    );
    let data = &data_of(&page)["runs"][0];
    assert_eq!(
        (&data["states"], &data["kept"]),
        (&states.into(), &20.into())
    );
    explore(&[run_text, "--all"]);
    assert!(
        std::fs::read(&page).unwrap() == bytes,
        "the same run gives the same bytes"
    );
}

/// A page has the ground of each filmed episode: 11 points whose heights are drawn.
#[test]
fn a_page_has_the_ground_of_each_episode() {
    let folder = tempfile::tempdir().unwrap();
    let [envs, scenario, run] = ["envs", "short.ron", "run"].map(|name| folder.path().join(name));
    std::fs::create_dir(&envs).unwrap();
    std::fs::write(envs.join("ball.ron"), ball_above_ground("bump")).unwrap();
    let text = r#"Scenario(environment: "ball", agents: (count: 1), algorithm: Random, stop: Episodes(3), recording: (scene: (every: 1)))"#;
    std::fs::write(&scenario, text).unwrap();
    let [scenario, run_text] = [&scenario, &run].map(|path| path.to_str().unwrap());
    run_successful(&["run", scenario, "--out", run_text]);
    explore(&[run_text]);
    let data = data_of(&run.join("explore.html"));
    let terrain = data["runs"][0]["film"]["terrain"].as_array().unwrap();
    let lines: Vec<&serde_json::Value> = terrain.iter().map(|lines| &lines[0]).collect();
    assert_eq!(lines.len(), 3);
    for line in &lines {
        let points = line.as_array().unwrap();
        let heights = points.iter().map(|point| point[1].as_f64().unwrap());
        assert_eq!(points.len(), 11);
        assert!(heights.clone().all(|height| (0.0..0.1).contains(&height)));
    }
    assert!(lines[0] != lines[1] && lines[1] != lines[2]);
}

/// The world has a line of the ground, and so is the first body; cup and ball follow.
#[test]
fn a_page_has_the_ropes_between_bodies() {
    let folder = tempfile::tempdir().unwrap();
    let [scenario, run] = ["short.ron", "run"].map(|name| folder.path().join(name));
    let text = r#"Scenario(environment: "dm_ball_in_cup_catch", agents: (count: 1), algorithm: Random, stop: Episodes(1), recording: (scene: (every: 1)))"#;
    std::fs::write(&scenario, text).unwrap();
    let [scenario, run_text] = [&scenario, &run].map(|path| path.to_str().unwrap());
    run_successful(&["run", scenario, "--out", run_text]);
    explore(&[run_text]);
    let film = &data_of(&run.join("explore.html"))["runs"][0]["film"];
    let ends = serde_json::json!([{"body": 2, "at": [0.0, 0.0]}, {"body": 1, "at": [0.0, -0.108]}]);
    assert_eq!(film["ropes"], serde_json::json!([ends]));
}

/// Runs that are not finished, and recordings alone, are shown as far as they are written. A name cannot
/// end the script.
#[test]
fn unfinished_runs_and_recordings_have_pages() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    assert!(small_run(&run, &[]).status.success());
    let alone = folder.path().join("alone.rrd");
    std::fs::copy(run.join("run.rrd"), &alone).unwrap();
    explore(&[alone.to_str().unwrap()]);
    let data = data_of(&folder.path().join("alone.html"));
    assert!(data["runs"][0]["film"].is_null() && data["runs"][0]["kept"].as_u64() > Some(0));

    // As of a run that is not finished.
    std::fs::remove_file(run.join("summary.json")).unwrap();
    std::fs::remove_file(run.join("SHA256SUMS")).unwrap();
    std::fs::rename(run.join("run.rrd"), run.join("run.rrd.part")).unwrap();
    let odd = folder.path().join("<").join("script> & co");
    std::fs::create_dir_all(odd.parent().unwrap()).unwrap();
    std::fs::rename(&run, &odd).unwrap();
    let page = folder.path().join("two.html");
    let two = [odd.to_str().unwrap(), alone.to_str().unwrap()];
    explore(&[&two[..], &["--out", page.to_str().unwrap()]].concat());
    let paths = data_of(&page)["runs"][0]["path"].clone();
    assert_eq!(paths, odd.to_str().unwrap());
}

#[test]
fn runs_that_cannot_be_shown_are_explained() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    assert!(small_run(&run, &[]).status.success());
    std::fs::remove_file(run.join("run.rrd")).unwrap();
    let run_text = run.to_str().unwrap();
    let message = run_refused(&["explore", run_text]);
    assert_eq!(
        message,
        format!("error: {run_text} has no recording, whose states are shown\n")
    );
    assert!(!run.join("explore.html").exists());
    run_refused(&["explore", run_text, "--states", "0"]);
}
