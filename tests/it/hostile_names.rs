//! Names that try to become markup, formulas or control sequences: they stay text in all that is written.

use std::fs;
use std::path::Path;

use serde_json::{Value, json};

use super::state_files::{file_of_states, write_file};
use super::util::{run_successful, seedbed, stderr, stdout};

/// Ends or begins elements and comments, is a formula of spreadsheets, a link of Markdown, a table cell, and
/// a sequence that colors a terminal; changes the direction of text.
const NAME: &str =
    "=1+1|[a](http://b)![i](http://j)\u{1b}[31m<!--<script></script><b>\u{202e}\u{9b}\\|";
const UNIT: &str = "<!--<script></svg></title><img src=x onerror=alert(1)>\u{7}";

/// Characters that control a terminal or the direction of text.
fn assert_no_controls(text: &str, place: &str) {
    let is_control = |character: char| {
        (character.is_control() && !"\n\t\r".contains(character)) || character == '\u{202e}'
    };
    let found = text.find(is_control);
    assert!(
        found.is_none(),
        "{place}: {:?}",
        found.map(|at| &text[at..])
    );
}

/// A page has no other elements than those that every page has.
fn assert_no_markup(page: &str, scripts: usize, place: &str) {
    assert_eq!(page.matches("<script").count(), scripts, "{place}");
    for markup in ["<!--", "<img", "<b>", "]]>"] {
        assert!(!page.contains(markup), "{place}: {markup}");
    }
}

fn run_with_hostile_names(folder: &Path) -> String {
    let observations = json!([
        {"name": NAME, "unit": UNIT, "low": null, "high": null},
        {"name": "x", "unit": UNIT, "low": null, "high": null},
    ]);
    let states: Vec<f32> = (0..40).map(|value| value as f32).collect();
    let path = folder.join("run");
    write_file(&path, 0, &file_of_states(0, &observations, &states));
    path.to_str().unwrap().to_owned()
}

#[test]
fn names_of_observations_stay_text() {
    let folder = tempfile::tempdir().unwrap();
    let run = run_with_hostile_names(folder.path());
    let text = run_successful(&["inspect", &run]);
    assert_no_controls(&text, "inspect");
    assert!(text.contains(r"\u001b[31m"), "{text}");
    let printed = run_successful(&["inspect", &run, "--json"]);
    assert_no_controls(&printed, "inspect --json");
    let summary: Value = serde_json::from_str(&printed).unwrap();
    assert_eq!(summary["observations"][0]["name"], NAME);
    for what in ["visitation", "density", "scatter"] {
        let out = format!("{run}/plot.svg");
        run_successful(&["plot", &run, "--what", what, "--out", &out]);
        let svg = fs::read_to_string(&out).unwrap();
        assert_no_controls(&svg, what);
        assert_no_markup(&svg, 0, what);
    }
    let out = format!("{run}/page.html");
    run_successful(&["explore", &run, "--out", &out]);
    let page = fs::read_to_string(&out).unwrap();
    assert_no_controls(&page, "explore");
    let (before, data) = page.split_once(r#"id="data">"#).unwrap();
    let (data, after) = data.split_once("</script>").unwrap();
    assert!(
        !data.contains('<'),
        "the data of the page are in one script"
    );
    assert_no_markup(before, 1, "before the data");
    assert_eq!(
        after.matches("</script>").count(),
        1,
        "the page's own script"
    );
    let data: Value = serde_json::from_str(data).unwrap();
    assert_eq!(
        [&data["axes"][0]["name"], &data["axes"][0]["unit"]],
        [NAME, UNIT]
    );
}

/// A name that a spreadsheet would take for a formula begins with an apostrophe, in the header, too.
#[test]
fn exported_names_are_no_formulas() {
    let folder = tempfile::tempdir().unwrap();
    let run = run_with_hostile_names(folder.path());
    let out = format!("{run}/states.csv");
    run_successful(&["export", &run, "--to", &out]);
    let bytes = fs::read(&out).unwrap();
    assert_no_controls(std::str::from_utf8(&bytes).unwrap(), "states.csv");
    let mut reader = csv::Reader::from_reader(&bytes[..]);
    let header = reader.headers().unwrap().clone();
    assert!(header[4].starts_with("'=1+1|"), "{header:?}");
    for format in ["parquet", "npz"] {
        run_successful(&["export", &run, "--to", &format!("{run}/states.{format}")]);
    }
}

/// The title of a study, and names and sentences in it.
#[test]
fn names_in_a_study_stay_text() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    for name in ["a", "b"] {
        fs::write(path(&format!("{name}.csv")), "return\n1\n2\n3\n").unwrap();
    }
    let name = NAME.replace('\\', "\\\\").replace('\u{1b}', "\\u{1b}");
    let cell = |label: &str, file: &str| {
        format!("(name: \"{name} {label}\", results: Csv(files: \"{file}\")),")
    };
    let study = format!(
        "Study(title: \"{name}\", solved: (return: 2, window: 1), cells: [{}{}], measures: [FinalReturn(window: 2)], \
         claims: [(text: \"{name}\", compare: (\"{name} 1\", \"{name} 2\"), direction: More, smallest: 1)], \
         figures: [Curves(), Intervals()])",
        cell("1", "a.csv"),
        cell("2", "b.csv")
    );
    fs::write(path("mine.ron"), study).unwrap();
    let output = seedbed(&["study", &path("mine.ron"), "--out", &path("out")]);
    assert!(output.status.success(), "{output:?}");
    assert_no_controls(&stdout(&output), "study");
    assert_no_controls(&stderr(&output), "study");
    for file in ["report.html", "tables.md", "claims.md", "results.csv"] {
        let text = fs::read_to_string(path(&format!("out/{file}"))).unwrap();
        assert_no_controls(&text, file);
        if file == "report.html" {
            assert_no_markup(&text, 0, file);
        }
    }
    let tables = fs::read_to_string(path("out/tables.md")).unwrap();
    for line in tables.lines().filter(|line| line.starts_with("| =1+1")) {
        assert!(line.contains(r"\[a\](http://b)!\[i\](http://j)"), "{line}");
        assert!(
            line.contains("&lt;script>") && line.contains(r"\\\|"),
            "{line}"
        );
    }
    let rows = fs::read(path("out/results.csv")).unwrap();
    let mut reader = csv::Reader::from_reader(&rows[..]);
    let row = reader.records().next().unwrap().unwrap();
    assert!(row[0].starts_with("'=1+1|"), "{row:?}");
}

/// A run whose directory has a line break in its name, or a name that is no text, is one row, and does not
/// hide others.
#[cfg(unix)]
#[test]
fn names_of_runs_are_one_row() {
    use std::os::unix::ffi::OsStrExt;
    let folder = tempfile::tempdir().unwrap();
    let observations = json!([{"name": "x", "unit": "", "low": null, "high": null}]);
    let states = file_of_states(0, &observations, &[1.0, 2.0]);
    for name in [&b"a\nb  forged  1"[..], b"\xff\xfe", b"plain"] {
        let path = folder.path().join(std::ffi::OsStr::from_bytes(name));
        write_file(&path, 0, &states);
    }
    let path = folder.path().to_str().unwrap();
    let table = run_successful(&["runs", path]);
    assert_eq!(table.lines().count(), 4, "{table}");
    assert!(table.contains(r"a\u000ab  forged"), "{table}");
    let runs: Value = serde_json::from_str(&run_successful(&["runs", path, "--json"])).unwrap();
    let paths = runs
        .as_array()
        .unwrap()
        .iter()
        .map(|run| run["path"].as_str().unwrap());
    let mut names: Vec<&str> = paths.map(|path| path.rsplit('/').next().unwrap()).collect();
    names.sort_unstable();
    assert_eq!(names, ["a\nb  forged  1", "plain", "\u{fffd}\u{fffd}"]);
    let text = run_successful(&["inspect", &format!("{path}/a\nb  forged  1")]);
    assert!(text.starts_with(r"a\u000ab  forged  1: 1 agent"), "{text}");
}
