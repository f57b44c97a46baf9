//! Studies on the command line, and what their tests share.

#[cfg(unix)]
mod checkpoints;
mod claims;
mod reports;
mod runs;
mod tabular;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use crate::util::{REPOSITORY, files_below, seedbed, study_arguments};

/// A study of two agents and few episodes. It has three cells: the results of `σ 0` and `σ 9`
/// differ, those of `σ 0 again` equal those of `σ 0`.
pub(crate) fn study_text(repeats: u32, extra_fields: &str) -> String {
    let scenario = Path::new(REPOSITORY).join("scenarios/cartpole.ron");
    format!(
        r#"Study(
            title: "Small & <small>",
            scenario: "{}",
            set: ["agents.count=2", "stop=Episodes(8)"],
            grid: [(name: "σ", set: ["agents.seeds={{}}"], values: ["Normal(sigma: 0)", "Normal(sigma: 9)", "TwoPoint(sigma: 0)"],
                labels: ["0", "9", "0 again"])],
            repeats: {repeats},
            measures: [FinalReturn(window: 5), Coverage],
            figures: [Curves(window: 3), Visitation(cells: ["σ 9"], episodes: [First(2), All])],
            {extra_fields}
        )"#,
        scenario.display()
    )
}

/// Writes a study file in a temporary directory. Returns the directory, the path of the study file,
/// and a path for results.
pub(crate) fn write_study(text: &str) -> (tempfile::TempDir, String, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let study = folder.path().join("small.ron");
    fs::write(&study, text).unwrap();
    let (study, out) = (
        study.to_str().unwrap().to_owned(),
        folder.path().join("out"),
    );
    (folder, study, out)
}

pub(crate) fn run_study(study: &str, out: &Path, extra_arguments: &[&str]) -> Output {
    let out = out.to_str().unwrap();
    seedbed(&study_arguments(study, out, extra_arguments))
}

/// Number of bytes of the checksum at the end of a result file.
const CHECKSUM_BYTES: usize = 8;

/// Replaces the contents of a result file, with a valid checksum.
pub(crate) fn write_result_file(path: &Path, mut contents: Vec<u8>) {
    let checksum = xxhash_rust::xxh64::xxh64(&contents, 0);
    contents.extend(checksum.to_le_bytes());
    fs::write(path, contents).unwrap();
}

/// The contents of a result file without the checksum.
pub(crate) fn contents(file: &[u8]) -> &[u8] {
    &file[..file.len() - CHECKSUM_BYTES]
}

/// Contents of the result files of runs, by file name.
pub(crate) fn stored_results(out: &Path) -> BTreeMap<String, Vec<u8>> {
    let name_and_bytes = |path: PathBuf| {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        (name, fs::read(path).unwrap())
    };
    result_files(out).into_iter().map(name_and_bytes).collect()
}

fn result_files(out: &Path) -> Vec<PathBuf> {
    files_below(&out.join("runs"), "run")
}

/// Changes one number in the stored results of all runs with a run seed.
pub(crate) fn change_stored_runs(out: &Path, run_seed: u64) {
    let file_end = format!("-{run_seed}.run");
    for (name, bytes) in stored_results(out) {
        if name.ends_with(&file_end) {
            let mut contents = contents(&bytes).to_vec();
            // The last byte is of the number of steps at which the last episode ended.
            *contents.last_mut().unwrap() ^= 2;
            write_result_file(&out.join("runs").join(name), contents);
        }
    }
}

/// Rows of `results.csv`, each as values by column.
pub(crate) fn result_rows(out: &Path) -> Vec<BTreeMap<String, String>> {
    let mut reader = csv::Reader::from_path(out.join("results.csv")).unwrap();
    reader.deserialize().map(|row| row.unwrap()).collect()
}

/// The `summary.json` of a run.
fn read_summary(run: &Path) -> serde_json::Value {
    serde_json::from_slice(&fs::read(run.join("summary.json")).unwrap()).unwrap()
}
