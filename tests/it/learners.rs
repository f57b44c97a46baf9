//! Runs of other programs whose agents have different numbers of episodes, or are copies of an
//! environment in which one learner acts: all commands and studies count them alike.

use std::fs;
use std::path::Path;

use serde_json::{Value, json};

use super::state_files::{closed, episode, file_start, header};
use super::util::{run_successful, seedbed};

/// Writes a run, with the returns and the learner of each agent. Each episode has two steps.
fn write_run(folder: &Path, agents: &[(Vec<f64>, u32)]) {
    fs::create_dir_all(folder.join("states")).unwrap();
    let mut rows = Vec::new();
    for (agent, (returns, learner)) in agents.iter().enumerate() {
        let mut header = header(agent as u32);
        if *learner != agent as u32 {
            header["learner"] = json!(learner);
        }
        let mut bytes = file_start(&header);
        for (number, &total) in returns.iter().enumerate() {
            let mut steps = episode(number as u32, 1);
            steps.total = total;
            bytes.extend(steps.frame());
            rows.push((number, agent, total));
        }
        bytes.extend(closed(returns.len() as u32));
        fs::write(folder.join(format!("states/agent_{agent}.states")), bytes).unwrap();
    }
    // As `RecordVisitation` of the Python package writes them.
    rows.sort_by_key(|(number, agent, _)| (*number, *agent));
    let mut table = "agent,episode,round,env_steps,return,length,outcome,coverage,visitation_entropy,team_overlap,\
                     effective_agents\n"
        .to_owned();
    for (index, (number, agent, total)) in rows.iter().enumerate() {
        let steps = 2 * (index + 1);
        table +=
            &format!("{agent},{number},{number},{steps},{total},2,terminated,NaN,NaN,NaN,NaN\n");
    }
    fs::write(folder.join("episodes.csv"), table).unwrap();
    let learners: Vec<u32> = agents.iter().map(|(_, learner)| *learner).collect();
    let summary = json!({"environment": "Walk-v0", "agents": agents.len(), "learners": learners, "final_return": 5});
    fs::write(folder.join("summary.json"), summary.to_string()).unwrap();
}

/// What `runs` and `inspect` print, and the row of a study.
fn results(folder: &Path) -> [Value; 3] {
    let path = folder.to_str().unwrap();
    let json =
        |arguments: &[&str]| -> Value { serde_json::from_str(&run_successful(arguments)).unwrap() };
    let runs = json(&["runs", path, "--json"]);
    let inspect = json(&["inspect", path, "--json"]);
    let work = tempfile::tempdir().unwrap();
    let [study, out] = ["study.ron", "out"].map(|name| work.path().join(name));
    let text = format!(
        r#"Study(title: "x", cells: [(name: "walk", results: Runs("{path}"))], measures: [FinalReturn(), Mean(of: Return)])"#
    );
    fs::write(&study, text).unwrap();
    run_successful(&[
        "study",
        study.to_str().unwrap(),
        "--out",
        out.to_str().unwrap(),
    ]);
    let table = fs::read(out.join("results.csv")).unwrap();
    let mut rows = csv::Reader::from_reader(&table[..]).into_deserialize();
    let row: std::collections::BTreeMap<String, String> = rows.next().unwrap().unwrap();
    [runs[0].clone(), inspect, json!(row)]
}

fn number(row: &Value, column: &str) -> f64 {
    row[column].as_str().unwrap().parse().unwrap()
}

/// Agents with a budget of steps, whose last 25 episodes have the means 173, 183 and 143; the best one
/// has the fewest episodes. (173 + 183 + 143) / 3 = 166⅓. Cut to 30 episodes, agents 0 and 2 would
/// count with episodes in which they had learned nothing.
#[test]
fn agents_count_with_their_own_last_episodes() {
    let agent = |zeros: usize, value: f64| [vec![0.0; zeros], vec![value; 25]].concat();
    let folder = tempfile::tempdir().unwrap();
    let agents = [
        (agent(20, 173.0), 0),
        (agent(5, 183.0), 1),
        (agent(60, 143.0), 2),
    ];
    write_run(folder.path(), &agents);
    let [runs, inspect, row] = results(folder.path());
    let expected = 499.0 / 3.0;
    for value in [
        runs["final_return"].as_f64().unwrap(),
        inspect["final_return"].as_f64().unwrap(),
        number(&row, "FinalReturn(window:25)"),
        number(&row, "final_return"),
    ] {
        assert!((value - expected).abs() < 1e-12, "{value}");
    }
    // Means over all episodes of each agent: 173 · 25 / 45 and so on.
    let mean = (173.0 / 45.0 + 183.0 / 30.0 + 143.0 / 85.0) * 25.0 / 3.0;
    assert!((number(&row, "mean_return") - mean).abs() < 1e-12);
    assert_eq!(
        (&runs["agents"], &runs["copies"]),
        (&json!(3), &Value::Null)
    );
    assert_eq!(runs["episodes_per_agent"], 30);
    assert_eq!(row["agents"], "3");
    let text = run_successful(&["inspect", folder.path().to_str().unwrap()]);
    assert!(
        text.contains("3 agents in Walk-v0, 30 to 85 episodes each"),
        "{text}"
    );
    assert!(
        text.contains("mean of each agent's last 25 episodes: 166.3"),
        "{text}"
    );
}

/// The episodes of two copies end alternately: 0, 1, 2, …, 39. The mean of the last 25 is 27.
#[test]
fn copies_of_one_learner_are_one_agent() {
    let folder = tempfile::tempdir().unwrap();
    let copy = |first: u32| {
        (0..20)
            .map(|number| f64::from(2 * number + first))
            .collect()
    };
    write_run(folder.path(), &[(copy(0), 0), (copy(1), 0)]);
    let [runs, inspect, row] = results(folder.path());
    assert_eq!((&runs["agents"], &runs["copies"]), (&json!(1), &json!(2)));
    assert_eq!(runs["episodes_per_agent"], 40);
    assert_eq!(
        (&runs["final_return"], &inspect["final_return"]),
        (&json!(27.0), &json!(27.0))
    );
    assert_eq!(inspect["learner_count"], 1);
    let team_returns: Vec<f64> = (0..40).map(f64::from).collect();
    assert_eq!(inspect["team_returns"], json!(team_returns));
    assert_eq!(
        [&row["agents"], &row["episodes"], &row["env_steps"]],
        ["1", "40", "80"]
    );
    assert_eq!(number(&row, "FinalReturn(window:25)"), 27.0);
    let text = run_successful(&["inspect", folder.path().to_str().unwrap()]);
    assert!(
        text.contains("1 learner in 2 copies of Walk-v0, 40 episodes,"),
        "{text}"
    );
    let picture = folder.path().join("returns.svg");
    let arguments = ["--what", "returns", "--out", picture.to_str().unwrap()];
    run_successful(&[&["plot", folder.path().to_str().unwrap()], &arguments[..]].concat());
    assert!(fs::read_to_string(picture).unwrap().contains("learner 0"));
    let page = folder.path().join("page.html");
    let arguments = ["explore", folder.path().to_str().unwrap(), "--out"];
    run_successful(&[&arguments[..], &[page.to_str().unwrap()]].concat());
    let page = fs::read_to_string(page).unwrap();
    assert!(page.contains("(2 copies of the environment, 1 learner)"));
    let study = folder.path().join("study.ron");
    let text =
        r#"Study(title: "x", cells: [(name: "walk", results: Runs("."))], measures: [Coverage])"#;
    fs::write(&study, text).unwrap();
    let refused = seedbed(&["check", study.to_str().unwrap()]);
    let message = String::from_utf8(refused.stderr).unwrap();
    let expected = "its learners act in several copies of the environment, whose visits are not counted together; expected a \
                    measure of returns";
    assert!(message.contains(expected), "{message}");
    // Without a summary, learners are read from the files of states.
    fs::remove_file(folder.path().join("summary.json")).unwrap();
    assert_eq!(results(folder.path())[2]["agents"], "1");
}
