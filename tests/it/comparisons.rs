//! Several runs in one figure or page: on common axes, or refused. Values that are no finite numbers.

use std::fs;
use std::path::{Path, PathBuf};

use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;
use serde_json::{Value, json};

use super::state_files::{file_of_states, write_file};
use super::util::{run_refused, run_successful, seedbed, stderr};
use seedbed::record::common_axes;
use seedbed::record::visitation::{AXIS_HEIGHT, BINS, share_difference};
use seedbed::review::LoadedRun;
use seedbed::review::selection::{EpisodeSelection, SelectedStates, StateSelection};

/// An axis whose range is what was visited.
fn visited(name: &str, unit: &str) -> Value {
    json!({"name": name, "unit": unit, "low": null, "high": null})
}

/// A run of one agent, with one episode of these states.
fn run_of(folder: &Path, name: &str, observations: &Value, states: &[f32]) -> PathBuf {
    let path = folder.join(name);
    write_file(&path, 0, &file_of_states(0, observations, states));
    path
}

/// Number of states of a run: 100 in each of 64 bins.
const STATES: usize = 100 * BINS;

/// States whose x is uniform in ±`end`, and whose y is the same.
fn uniform(end: f32) -> Vec<f32> {
    let x = |index: usize| end * (2.0 * (index as f32 + 0.5) / STATES as f32 - 1.0);
    (0..STATES).flat_map(|index| [x(index); 2]).collect()
}

/// Two runs that visited x in ±1 and in ±10, whose axes are what they visited.
fn narrow_and_wide(folder: &Path) -> [String; 2] {
    let observations = json!([visited("x", "m"), visited("y", "m")]);
    [("narrow", 1.0), ("wide", 10.0)].map(|(name, end)| {
        let path = run_of(folder, name, &observations, &uniform(end));
        path.to_str().unwrap().to_owned()
    })
}

/// Shares of states per bin of the first axis, from the lowest.
fn shares_of_first_axis(states: &SelectedStates) -> Vec<f64> {
    let pixels = states.density.pixels();
    let width = pixels.len() / AXIS_HEIGHT;
    let share = |row: usize| f64::from(pixels[row * width]) / states.count as f64;
    (0..AXIS_HEIGHT).rev().map(share).collect()
}

/// On an axis of ±10, a bin has a width of 20/64. Of x uniform in ±1 it has the share 10/64 if it is within
/// ±1, and a fifth of this if it is the last one of them, of which a fifth is within ±1. Of x uniform in
/// ±10, each bin has the share 1/64. So the largest difference is 9/64.
#[test]
fn densities_of_runs_are_on_common_axes() {
    let folder = tempfile::tempdir().unwrap();
    let runs = narrow_and_wide(folder.path()).map(|run| LoadedRun::open(Path::new(&run)).unwrap());
    let recordings = runs.each_ref().map(|run| run.recording.as_ref().unwrap());
    let named = recordings.map(|recording| ("run".to_owned(), recording));
    let axes = common_axes(&named).unwrap();
    let range = axes.all()[0].quantity.range;
    assert!(
        (range[0] + 10.0).abs() < 0.01 && (range[1] - 10.0).abs() < 0.01,
        "{range:?}"
    );
    let selection = StateSelection {
        episodes: EpisodeSelection::all(),
        conditions: Vec::new(),
        sample_size: 0,
        all_axes: axes,
        axes: vec![0, 1],
        pairs: Vec::new(),
    };
    let [narrow, wide] =
        recordings.map(|recording| selection.select(recording, |_| ()).unwrap().remove(0));
    let of_bin = |bin: usize| match bin {
        29..=34 => 10.0 / 64.0,
        28 | 35 => 2.0 / 64.0,
        _ => 0.0,
    };
    // The ends of the axis are the outermost states, which are 1/64,000 within ±10: a state per bin may move.
    let tolerance = 2.0 / STATES as f64;
    for (bin, share) in shares_of_first_axis(&narrow).into_iter().enumerate() {
        assert!(
            (share - of_bin(bin)).abs() <= tolerance,
            "bin {bin}: {share}"
        );
    }
    for (bin, share) in shares_of_first_axis(&wide).into_iter().enumerate() {
        assert!(
            (share - 1.0 / 64.0).abs() <= tolerance,
            "bin {bin}: {share}"
        );
    }
    let [of_narrow, of_wide] = [&narrow, &wide].map(|states| states.density.pixels());
    let (_, largest) = share_difference((&of_narrow, narrow.count), (&of_wide, wide.count));
    assert!(
        (f64::from(largest) - 9.0 / 64.0).abs() <= 2.0 * tolerance,
        "{largest}"
    );
}

#[test]
fn figures_and_pages_of_several_runs_have_one_set_of_axes() {
    let folder = tempfile::tempdir().unwrap();
    let [narrow, wide] = narrow_and_wide(folder.path());
    let svg = folder.path().join("plot.svg");
    let out = svg.to_str().unwrap();
    for what in ["visitation", "density", "difference", "scatter"] {
        run_successful(&["plot", &narrow, &wide, "--what", what, "--out", out]);
        let figure = fs::read_to_string(&svg).unwrap();
        // At the ends of the axes, or as a tick.
        assert!(
            !figure.contains(">−1<") && !figure.contains(">0.9998<"),
            "{what}: {figure}"
        );
        let upper_ends = figure.matches(">9.998<").count() + figure.matches(">5<").count();
        let panels = if what == "difference" { 1 } else { 2 };
        assert!(upper_ends >= panels, "{what}: {figure}");
    }
    run_successful(&["plot", &narrow, &wide, "--what", "difference", "--out", out]);
    let figure = fs::read_to_string(&svg).unwrap();
    assert!(
        figure.contains("14."),
        "the largest difference is 14.1 %: {figure}"
    );
    // Of two axes as a map of 40 cells a side: four cells of the diagonal have a quarter of the narrow states each, and
    // a fortieth of the wide ones.
    let map = [
        "plot",
        &narrow,
        &wide,
        "--what",
        "difference",
        "--axes",
        "x,y",
        "--out",
        out,
    ];
    run_successful(&map);
    let figure = fs::read_to_string(&svg).unwrap();
    assert!(
        figure.contains(">22 %<") && figure.contains(">y [m]<"),
        "the largest difference is 22.5 %: {figure}"
    );
    // Densities on two axes are maps, with both axes labeled, of shares between one and ten states in forty.
    let density = map.map(|word| {
        if word == "difference" {
            "density"
        } else {
            word
        }
    });
    run_successful(&density);
    let figure = fs::read_to_string(&svg).unwrap();
    assert!(
        figure.contains(">y [m]<")
            && figure.contains("share of states per cell")
            && figure.contains(">25 %<"),
        "{figure}"
    );
    let page = folder.path().join("page.html");
    run_successful(&["explore", &narrow, &wide, "--out", page.to_str().unwrap()]);
    let x = r#""name":"x","unit":"m","kind":"observation","low":-9.99"#;
    assert_eq!(fs::read_to_string(page).unwrap().matches(x).count(), 1);
}

#[test]
fn runs_with_other_observations_are_not_compared() {
    let folder = tempfile::tempdir().unwrap();
    let run = |name: &str, observations: &[Value]| {
        let states: Vec<f32> = (0..3 * observations.len())
            .map(|value| value as f32)
            .collect();
        let path = run_of(folder.path(), name, &json!(observations), &states);
        path.to_str().unwrap().to_owned()
    };
    let first = run("first", &[visited("x", "m"), visited("v", "m/s")]);
    for (name, observations, difference) in [
        (
            "order",
            vec![visited("v", "m/s"), visited("x", "m")],
            "its observations are in another order: v, x instead of x, v",
        ),
        (
            "names",
            vec![visited("x", "m"), visited("w", "m/s")],
            "its observations are x, w instead of x, v",
        ),
        (
            "units",
            vec![visited("x", "m"), visited("v", "cm/s")],
            "its `v` has the unit cm/s instead of the unit m/s",
        ),
        (
            "number",
            vec![visited("x", "m"), visited("v", "m/s"), visited("a", "")],
            "it has 3 observations (x, v, a) instead of 2 (x, v)",
        ),
    ] {
        let other = run(name, &observations);
        for command in ["plot", "explore"] {
            let error = run_refused(&[command, &first, &other]);
            let expected = format!(
                "{other} cannot be compared with {first}: {difference}; draw each of them alone"
            );
            assert!(error.contains(&expected), "{error}");
        }
        let svg = folder.path().join("plot.svg");
        let out = svg.to_str().unwrap();
        run_successful(&["plot", &first, &other, "--what", "returns", "--out", out]);
    }
}

/// Measures of visits count cells of the display ranges, so that they are not drawn together if these differ.
#[test]
fn curves_of_visits_on_other_axes_are_not_drawn_together() {
    let folder = tempfile::tempdir().unwrap();
    let runs = narrow_and_wide(folder.path());
    for run in &runs {
        let rounds = format!("{run}/rounds.csv");
        run_successful(&["export", run, "--to", &rounds, "--content", "rounds"]);
    }
    let svg = folder.path().join("curves.svg");
    let plot = |runs: &[&String]| {
        let runs: Vec<&str> = runs.iter().map(|run| run.as_str()).collect();
        let options = ["--what", "curves", "--out", svg.to_str().unwrap()];
        seedbed(&[&["plot"][..], &runs, &options].concat())
    };
    let output = plot(&[&runs[0]]);
    assert!(output.status.success() && stderr(&output).is_empty());
    let alone = fs::read_to_string(&svg).unwrap();
    assert!(alone.contains("coverage per agent"));
    fs::remove_file(&svg).unwrap();
    // Nothing else is known of these runs.
    let output = plot(&[&runs[0], &runs[1]]);
    let message = stderr(&output);
    assert_eq!(output.status.code(), Some(2), "{message}");
    for expected in [
        "measured on other axes: x is -9.99",
        "error: nothing is drawn: these runs have nothing for the chosen panels",
    ] {
        assert!(message.contains(expected), "{message}");
    }
    assert!(!svg.exists());
}

/// 1,000 states, of which every tenth has the value of `special` in x three times of ten.
fn with_special(special: f32) -> Vec<f32> {
    (0..1000)
        .flat_map(|index| {
            let x = (index % 10) as f32;
            [if x < 3.0 { special } else { x }, index as f32]
        })
        .collect()
}

/// 30 % of x are NaN; the others are 3 to 9, of which the median is 6 (as of `numpy.nanmedian`).
#[test]
fn nan_is_visible_everywhere() {
    let folder = tempfile::tempdir().unwrap();
    let observations = json!([visited("x", "m"), visited("y", "")]);
    let run = run_of(folder.path(), "run", &observations, &with_special(f32::NAN));
    let run = run.to_str().unwrap();
    let summary: Value =
        serde_json::from_str(&run_successful(&["inspect", run, "--json"])).unwrap();
    let x = &summary["observations"][0];
    assert_eq!([&x["nan"], &x["outside"]], [0.3, 0.0]);
    assert_eq!([&x["min"], &x["median"], &x["max"]], [3.0, 6.0, 9.0]);
    let text = run_successful(&["inspect", run]);
    assert!(
        text.contains("NaN (left out of min, median and max)") && text.contains("30.0 %"),
        "{text}"
    );
    let svg = folder.path().join("plot.svg");
    for what in ["visitation", "density", "scatter"] {
        run_successful(&["plot", run, "--what", what, "--out", svg.to_str().unwrap()]);
        let figure = fs::read_to_string(&svg).unwrap();
        assert!(figure.contains("NaN 30 %"), "{what}: {figure}");
    }
    let page = folder.path().join("page.html");
    run_successful(&["explore", run, "--out", page.to_str().unwrap()]);
    let page = fs::read_to_string(page).unwrap();
    assert!(page.contains(r#""outside":[0,0],"nan":300"#));
    run_successful(&["film", run, "--seconds", "0.2"]);
    run_successful(&["export", run, "--to", &format!("{run}/run.rrd")]);
    let rrd = format!("{run}/run.rrd");
    let summary: Value =
        serde_json::from_str(&run_successful(&["inspect", &rrd, "--json"])).unwrap();
    assert_eq!(summary["observations"][0]["nan"], 0.3);
}

/// Where 30 % of x are NaN, the lines between the axes are those of the other states, on the 70 % of them.
#[test]
fn infinite_values_are_at_the_ends_and_counted() {
    let folder = tempfile::tempdir().unwrap();
    let observations =
        json!([{"name": "x", "unit": "", "low": 0.0, "high": 10.0}, visited("y", "")]);
    let run = run_of(
        folder.path(),
        "run",
        &observations,
        &with_special(f32::INFINITY),
    );
    let run = run.to_str().unwrap();
    let summary: Value =
        serde_json::from_str(&run_successful(&["inspect", run, "--json"])).unwrap();
    let x = &summary["observations"][0];
    assert_eq!([&x["nan"], &x["infinite"], &x["outside"]], [0.0, 0.3, 0.3]);
    let text = run_successful(&["inspect", run]);
    assert!(text.contains('∞') && text.contains("30.0 %"), "{text}");
}

/// Of ten episodes, one has a reward that is NaN.
fn run_with_nan_return(folder: &Path) -> String {
    let mut episodes = Vec::new();
    for number in 0..10 {
        let reward = if number == 4 { f32::NAN } else { number as f32 };
        episodes.push(super::state_files::short_episode(number, reward));
    }
    let path = folder.join("returns");
    write_file(
        &path,
        0,
        &super::state_files::file_of_episodes(0, &episodes),
    );
    path.to_str().unwrap().to_owned()
}

#[test]
fn nan_returns_are_visible() {
    let folder = tempfile::tempdir().unwrap();
    let run = run_with_nan_return(folder.path());
    let text = run_successful(&["inspect", &run]);
    assert!(
        text.contains("return NaN 10.0 %: in 1 of 10 episodes"),
        "{text}"
    );
    assert!(text.contains("▁▁▁") || text.contains('·'), "{text}");
    assert!(
        text.contains("\n  reward "),
        "rewards that are NaN have a row: {text}"
    );
    let summary: Value =
        serde_json::from_str(&run_successful(&["inspect", &run, "--json"])).unwrap();
    assert_eq!(summary["nan_returns"], 1);
    assert_eq!(summary["agents"][0]["best_return"], 9.0);
    let svg = folder.path().join("plot.svg");
    let out = svg.to_str().unwrap();
    run_successful(&["plot", &run, "--what", "returns", "--out", out]);
    assert!(
        fs::read_to_string(&svg)
            .unwrap()
            .contains("returns (NaN 10 %)")
    );
    run_successful(&[
        "plot",
        &run,
        "--what",
        "visitation",
        "--color",
        "return",
        "--out",
        out,
    ]);
    assert!(fs::read_to_string(&svg).unwrap().contains("gray: NaN"));
    run_successful(&["explore", &run, "--out", &format!("{run}/page.html")]);
    run_successful(&["film", &run, "--seconds", "0.2"]);
    run_successful(&["export", &run, "--tensorboard", &format!("{run}/logs")]);
}

/// Values of a column of a Parquet file; `None` is null.
fn parquet_column(path: &Path, name: &str) -> Vec<Option<f32>> {
    let reader = SerializedFileReader::new(fs::File::open(path).unwrap()).unwrap();
    let number = |field: &Field| match field {
        Field::Float(value) => Some(*value),
        Field::Null => None,
        other => panic!("{other:?}"),
    };
    let rows = reader.get_row_iter(None).unwrap().map(Result::unwrap);
    rows.map(|row| {
        let mut columns = row.get_column_iter();
        number(columns.find(|(column, _)| *column == name).unwrap().1)
    })
    .collect()
}

/// A missing value is not NaN: the last state has no action and no reward. Rows are sorted.
#[test]
fn exports_tell_nan_from_missing_values() {
    let folder = tempfile::tempdir().unwrap();
    let observations = json!([visited("x", "m"), visited("y", "")]);
    let states = [f32::NAN, 1.0, f32::INFINITY, 2.0, f32::NEG_INFINITY, 3.0];
    let run = folder.path().join("run");
    for agent in [10, 9, 2] {
        write_file(&run, agent, &file_of_states(agent, &observations, &states));
    }
    let export = |name: &str| {
        let path = folder.path().join(name);
        run_successful(&[
            "export",
            run.to_str().unwrap(),
            "--to",
            path.to_str().unwrap(),
        ]);
        path
    };
    let csv = fs::read_to_string(export("states.csv")).unwrap();
    let of_agent = |agent: u32| {
        [
            format!("{agent},0,0,0,NaN,1,0,1,terminated"),
            format!("{agent},0,0,1,inf,2,0,1,terminated"),
            format!("{agent},0,0,2,-inf,3,,,terminated"),
        ]
    };
    let expected: Vec<String> = [2, 9, 10].into_iter().flat_map(of_agent).collect();
    assert_eq!(csv.lines().skip(1).collect::<Vec<_>>(), expected);
    let parquet = export("states.parquet");
    let x = parquet_column(&parquet, "x");
    assert!(x[0].unwrap().is_nan());
    assert_eq!(x[1..3], [Some(f32::INFINITY), Some(f32::NEG_INFINITY)]);
    assert_eq!(
        parquet_column(&parquet, "reward")[..3],
        [Some(1.0), Some(1.0), None]
    );
    let reader = SerializedFileReader::new(fs::File::open(&parquet).unwrap()).unwrap();
    let metadata = reader
        .metadata()
        .file_metadata()
        .key_value_metadata()
        .unwrap()
        .clone();
    let units = metadata
        .into_iter()
        .find(|entry| entry.key == "units")
        .unwrap();
    assert_eq!(units.value.as_deref(), Some(r#"{"push":"N","x":"m"}"#));
}

fn tree(folder: &Path) -> Vec<String> {
    let mut names = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let entry = entry.unwrap().path();
        if entry.is_dir() {
            let name = entry.file_name().unwrap().to_string_lossy().into_owned();
            names.extend(
                tree(&entry)
                    .into_iter()
                    .map(|inner| format!("{name}/{inner}")),
            );
        } else {
            names.push(entry.file_name().unwrap().to_string_lossy().into_owned());
        }
    }
    names.sort();
    names
}

/// Curves of three agents, then of one: those of the others would be shown as part of the second run.
#[test]
fn curves_of_an_earlier_export_are_removed() {
    let folder = tempfile::tempdir().unwrap();
    let observations = json!([visited("x", ""), visited("y", "")]);
    let team = folder.path().join("team");
    for agent in 0..3 {
        write_file(
            &team,
            agent,
            &file_of_states(agent, &observations, &[0.0; 6]),
        );
    }
    let single = run_of(folder.path(), "single", &observations, &[0.0; 6]);
    let logs = folder.path().join("logs");
    fs::create_dir_all(logs.join("agent_2")).unwrap();
    fs::write(logs.join("agent_2/notes.txt"), "mine").unwrap();
    let export = |run: &Path| {
        run_successful(&[
            "export",
            run.to_str().unwrap(),
            "--tensorboard",
            logs.to_str().unwrap(),
        ]);
        tree(&logs)
    };
    let event_file = |name: &str| format!("{name}/events.out.tfevents.0.seedbed");
    let notes = "agent_2/notes.txt".to_owned();
    let all = ["agent_0", "agent_1", "agent_2", "team"].map(event_file);
    assert_eq!(
        export(&team),
        [&all[..3], std::slice::from_ref(&notes), &all[3..]].concat()
    );
    assert_eq!(
        export(&single),
        [event_file("agent_0"), notes, event_file("team")]
    );
    assert!(!logs.join("agent_1").exists());
    let foreign = logs.join("team/events.out.tfevents.1700000000.host");
    fs::write(&foreign, "").unwrap();
    let before = tree(&logs);
    let output = seedbed(&[
        "export",
        team.to_str().unwrap(),
        "--tensorboard",
        logs.to_str().unwrap(),
    ]);
    assert!(!output.status.success());
    assert!(
        stderr(&output).contains("is of another program"),
        "{}",
        stderr(&output)
    );
    assert_eq!(tree(&logs), before);
}
