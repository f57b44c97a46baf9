//! Published results: what verdicts and tables need of the runs of a study, small enough to be kept
//! in a repository.
//!
//! A directory with published results has `study.json`, the manifest with the study file and its
//! lock; `results.csv.gz`, the report's `results.csv`, with one row per run; and `builds.json`, which
//! says what made the runs. From these files the verdicts and tables are computed again, with the
//! same digits. Curves and visited states are not published: `seedbed study confirm` makes the runs
//! again, with the same bits.

mod hashes;
mod row;

pub(in crate::study) use hashes::SUBMISSION;
pub(crate) use hashes::listed_hashes;

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::io::{self};
use std::path::{Path, PathBuf};

use super::rows;
use flate2::read::MultiGzDecoder;
use seedbed_input::limits::{
    MAX_SMALL_FILE_BYTES, MAX_TABLE_BYTES, open_regular, read_bytes, text_of,
};
use serde::{Deserialize, Serialize};

use super::column;
use super::completeness;
use super::results::{CellResults, Results, ResultsError};
use crate::experiment::Outcome;
use crate::experiment::measure::Measure;
use crate::provenance::{format_build_id, parse_build_id};
use crate::study::design::cell::PlannedRun;
use crate::study::design::plan::StudyPlan;
use crate::study::execute::runner::ExpectedResults;
use crate::study::store::StudyFolder;
use crate::text::from_spreadsheet_cell;
use row::Row;

/// Name of the file with one row per run.
pub(in crate::study) const TABLE: &str = "results.csv.gz";

/// Name of the file with the manifest.
pub(in crate::study) const MANIFEST: &str = "study.json";

/// What made the runs of a study: `builds.json`.
#[derive(Serialize, Deserialize)]
pub(in crate::study) struct Builds {
    versions: BTreeSet<String>,
    commits: BTreeSet<String>,
    /// Hashes of the executables, in hexadecimal digits.
    executables: BTreeSet<String>,
    /// SHA-256 of the other files, by their names. Earlier versions did not write them.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub(in crate::study) sha256: BTreeMap<String, String>,
}

/// Name of the file with the builds.
pub(in crate::study) const BUILDS: &str = "builds.json";

/// Where the published results of a study are: `results/<study>` beside its file.
#[must_use]
pub fn folder_beside(study: &Path) -> PathBuf {
    let name = study.file_stem().unwrap_or_default();
    study.with_file_name("results").join(name)
}

/// The folder of a study's runs, `stored`, or, if there is none, that of the results that are
/// published beside the study.
#[must_use]
pub fn stored_or_beside(study: &Path, stored: StudyFolder) -> StudyFolder {
    let beside_study = StudyFolder::new(folder_beside(study));
    if !stored.path().exists() && is_published(&beside_study) {
        beside_study
    } else {
        stored
    }
}

impl Builds {
    /// The builds that made the runs of a study.
    pub(in crate::study) fn of(results: &Results) -> Self {
        let executables = results.builds.iter();
        Self {
            versions: results.versions.clone(),
            commits: results.commits.clone(),
            executables: executables.map(|build| format_build_id(*build)).collect(),
            sha256: BTreeMap::new(),
        }
    }
}

/// Whether a folder has published results instead of runs.
#[must_use]
pub fn is_published(folder: &StudyFolder) -> bool {
    folder.path().join(TABLE).is_file()
}

/// The rows of published runs, to compare repeated runs with.
pub struct PublishedRuns {
    folder: PathBuf,
    /// The study, with its cells but without runs.
    study: Results,
    /// Digests of the cells by their names, as the study file says.
    digests: HashMap<String, String>,
    columns: HashMap<String, usize>,
    /// Rows by the name of the cell and the run seed.
    rows: HashMap<(String, u64), csv::StringRecord>,
}

impl PublishedRuns {
    /// Reads the table in a folder of published results of `plan`, of which `study` was read.
    ///
    /// # Errors
    /// If the table is damaged.
    pub fn read(
        folder: &StudyFolder,
        mut study: Results,
        plan: &StudyPlan,
    ) -> Result<Self, ResultsError> {
        for cell in &mut study.cells {
            *cell = CellResults::without_runs(cell.description.clone());
        }
        let path = folder.path().join(TABLE);
        let damaged = |message: String| ResultsError::Table {
            path: path.clone(),
            line: None,
            message,
        };
        let text = decompress(&path).map_err(|problem| damaged(problem.to_string()))?;
        let (columns, records) =
            read_records(text.as_bytes()).map_err(|problem| damaged(problem.to_string()))?;
        let mut rows = HashMap::new();
        for record in records {
            let row = Row {
                record,
                columns: &columns,
            };
            let key = row.key().map_err(&damaged)?;
            rows.insert(key, row.record);
        }
        let cells = plan.cells.iter();
        Ok(Self {
            folder: folder.path().to_owned(),
            study,
            digests: cells
                .map(|cell| (cell.name.clone(), cell.digest().to_owned()))
                .collect(),
            columns,
            rows,
        })
    }

    /// Whether the row of a run has the values of this outcome.
    fn is_same(&self, cell: &CellResults, run_seed: u64, outcome: &Outcome) -> bool {
        let key = (cell.description.name.clone(), run_seed);
        let (Some(published), Ok((columns, repeated))) =
            (self.rows.get(&key), self.row_of(cell, run_seed, outcome))
        else {
            return false;
        };
        let measures = self.study.measures().into_iter();
        let of_an_episode: HashSet<String> = measures
            .filter(|measure| measure.needed_moment().is_some())
            .map(column)
            .collect();
        self.columns.iter().all(|(name, place)| {
            let new = columns.get(name).and_then(|column| repeated.get(*column));
            // The run ended before the episode: earlier versions wrote its last value, which nobody reads.
            let is_unknown = of_an_episode.contains(name) && new == Some("");
            is_unknown
                || new.map(without_sign_of_zero) == published.get(*place).map(without_sign_of_zero)
        })
    }

    fn has_row(&self, cell: &str, run_seed: u64) -> bool {
        self.rows.contains_key(&(cell.to_owned(), run_seed))
    }

    /// The row that the report writes for a run.
    fn row_of(
        &self,
        cell: &CellResults,
        run_seed: u64,
        outcome: &Outcome,
    ) -> io::Result<(HashMap<String, usize>, csv::StringRecord)> {
        let mut cell = cell.clone();
        match outcome {
            Ok(result) => cell.runs.push((run_seed, result.clone())),
            Err(reason) => cell.failures.push((run_seed, reason.clone())),
        }
        let results = Results {
            cells: vec![cell],
            ..self.study.clone()
        };
        let (columns, mut records) = read_records(&rows::csv(&results)?)?;
        let record = records.pop().ok_or(io::ErrorKind::NotFound)?;
        Ok((columns, record))
    }
}

impl ExpectedResults for PublishedRuns {
    fn contains(&self, run: &PlannedRun<'_>) -> bool {
        self.has_row(&run.cell.name, run.run_seed)
    }

    /// Visited states are not published.
    fn windows(&self, _: &PlannedRun<'_>) -> Vec<u32> {
        Vec::new()
    }

    /// Whether a repeated run has the values of its rows, in all columns of the table. Cells with equal
    /// settings share the run, and each has a row.
    fn is_reproduced_by(&self, run: &PlannedRun<'_>, outcome: &Outcome) -> bool {
        let mut cells = self.study.cells.iter().filter(|cell| {
            let name = &cell.description.name;
            let shares_run = self.digests.get(name).map(String::as_str) == Some(run.cell.digest());
            shares_run && self.has_row(name, run.run_seed)
        });
        self.contains(run) && cells.all(|cell| self.is_same(cell, run.run_seed, outcome))
    }

    fn location(&self, _: &PlannedRun<'_>) -> PathBuf {
        self.folder.clone()
    }
}

/// The text of a number, with −0 as 0: earlier versions wrote the number of no gradient steps as −0.
fn without_sign_of_zero(text: &str) -> &str {
    if text == "-0.0" { "0.0" } else { text }
}

/// The places of the columns by their names, and the rows.
fn read_records(bytes: &[u8]) -> csv::Result<(HashMap<String, usize>, Vec<csv::StringRecord>)> {
    let mut reader = csv::Reader::from_reader(bytes);
    let names = reader.headers()?.iter().map(str::to_owned);
    let columns = names.zip(0..).collect();
    Ok((columns, reader.records().collect::<csv::Result<_>>()?))
}

/// Fills in the cells of `results` from the table in the folder.
pub(super) fn read_table(results: &mut Results, folder: &StudyFolder) -> Result<(), ResultsError> {
    let path = folder.path().join(TABLE);
    let error = |line: Option<u64>, message: String| ResultsError::Table {
        path: path.clone(),
        line,
        message,
    };
    hashes::check_submission(folder.path())?;
    let builds = read_builds(results, folder).map_err(|problem| ResultsError::Table {
        path: folder.path().join(BUILDS),
        line: None,
        message: problem.to_string(),
    })?;
    let listed = folder.path().join(BUILDS);
    hashes::check_files(folder.path(), &builds.sha256, &listed)?;
    let text = decompress(&path).map_err(|problem| error(None, problem.to_string()))?;
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let header = reader
        .headers()
        .map_err(|problem| error(None, problem.to_string()))?;
    let columns: HashMap<String, usize> = header.iter().map(str::to_owned).zip(0..).collect();
    let mut rows = Rows::of(results);
    rows.check_header(header)
        .map_err(|problem| error(Some(1), problem))?;
    for (record, line) in reader.records().zip(2..) {
        let record = record.map_err(|problem| error(Some(line), problem.to_string()))?;
        let row = Row {
            record,
            columns: &columns,
        };
        rows.add(results, &row)
            .map_err(|problem| error(Some(line), problem))?;
    }
    count_missing_runs(results);
    Ok(())
}

/// Checks that the table has a row for each run of each cell, up to the look at which the study could
/// end. Runs of others may be missing.
///
/// # Errors
/// Rows are missing.
pub(super) fn check_complete(results: &Results, folder: &StudyFolder) -> Result<(), ResultsError> {
    let cells = results.cells.iter();
    let mut own_cells = cells.filter(|cell| cell.description.external.is_none());
    if own_cells.all(|cell| cell.missing == 0) {
        return Ok(());
    }
    let sentence = completeness::missing_sentence(results);
    Err(ResultsError::Table {
        path: folder.path().join(TABLE),
        line: None,
        message: format!("{sentence}; expected one row for each run of each cell"),
    })
}

fn read_builds(results: &mut Results, folder: &StudyFolder) -> io::Result<Builds> {
    let bytes = read_bytes(&folder.path().join(BUILDS), MAX_SMALL_FILE_BYTES)?;
    let builds: Builds = serde_json::from_slice(&bytes).map_err(|error| {
        let message = format!("expected the builds of published results: {error}");
        io::Error::new(io::ErrorKind::InvalidData, message)
    })?;
    results.versions.clone_from(&builds.versions);
    results.commits.clone_from(&builds.commits);
    results.builds = builds
        .executables
        .iter()
        .map(|text| parse_build_id(text))
        .collect();
    Ok(builds)
}

/// The text of a file of gzip, of which all members are read (RFC 1952).
fn decompress(path: &Path) -> io::Result<String> {
    let text = text_of(MultiGzDecoder::new(open_regular(path)?), MAX_TABLE_BYTES);
    text.map_err(|error| io::Error::new(error.kind(), format!("is no whole file of gzip: {error}")))
}

/// What is known of the rows of a table that were read.
struct Rows {
    /// Measures with the names of their columns.
    measures: Vec<(Measure, String)>,
    /// Run seeds of each cell, by its name.
    run_seeds: HashMap<String, HashSet<u64>>,
    /// Whether runs of a cell have a value in a column, by both names.
    has_value: HashMap<(String, String), bool>,
}

impl Rows {
    fn of(results: &Results) -> Self {
        let manifest = &results.manifest;
        let run_seeds_of = |cell| manifest.run_seeds_of(cell).into_iter().collect();
        let cells = manifest.cells.iter();
        let measures = results.measures().into_iter();
        Self {
            measures: measures.map(|measure| (measure, column(measure))).collect(),
            run_seeds: cells
                .map(|cell| (cell.name.clone(), run_seeds_of(cell)))
                .collect(),
            has_value: HashMap::new(),
        }
    }

    /// Checks that the table has exactly the columns that the report writes.
    fn check_header(&self, header: &csv::StringRecord) -> Result<(), String> {
        let names = self.measures.iter().map(|(_, name)| name.as_str());
        let expected: Vec<&str> = rows::COLUMNS.into_iter().chain(names).collect();
        for name in &expected {
            let count = header.iter().filter(|found| found == name).count();
            // Earlier versions had no names of runs.
            if count != 1 && (count > 1 || *name != "run") {
                return Err(format!("expected one column `{name}`, found {count}"));
            }
        }
        let unknown = header.iter().find(|name| !expected.contains(name));
        unknown.map_or(Ok(()), |name| {
            Err(format!("the study has no column `{name}`"))
        })
    }

    /// Adds a run to its cell, if its run seed is one of the cell's and its values are possible.
    fn add(&mut self, results: &mut Results, row: &Row<'_>) -> Result<(), String> {
        let (name, run_seed) = row.key()?;
        let cell = results
            .cells
            .iter_mut()
            .find(|cell| cell.description.name == name);
        let cell = cell.ok_or_else(|| format!("the study has no cell `{name}`"))?;
        let run_seeds = self.run_seeds.get(&name);
        let is_of_cell = run_seeds.is_some_and(|run_seeds| run_seeds.contains(&run_seed));
        if !is_of_cell || cell.has_run(run_seed) {
            return Err(format!(
                "the study has no (second) run of `{name}` with run seed {run_seed}"
            ));
        }
        row.check(cell, &self.measures)?;
        match row.text("state")? {
            "finished" => {
                self.check_has_values(&name, row)?;
                let measures = self.measures.iter();
                let (measures, scores): (Vec<Measure>, Vec<_>) = measures
                    .map(|(measure, name)| (*measure, row.score(*measure, name, run_seed)))
                    .unzip();
                let scores = scores.into_iter().collect::<Result<Vec<_>, _>>()?;
                cell.add_scored_run(run_seed, row.cost()?, &measures, scores);
            }
            "failed" => cell.failures.push((
                run_seed,
                from_spreadsheet_cell(row.text("reason")?).into_owned(),
            )),
            other => return Err(format!("`{other}` in the column `state`")),
        }
        Ok(())
    }

    /// Checks that all finished runs of a cell have the same measures.
    fn check_has_values(&mut self, cell: &str, row: &Row<'_>) -> Result<(), String> {
        let measures = self.measures.iter();
        let mut names = vec!["solved".to_owned()];
        for (measure, name) in measures {
            if !row.may_lack(*measure)? {
                names.push(name.clone());
            }
        }
        for name in names {
            let has_value = !row.text(&name)?.is_empty();
            let message = format!(
                "`{}` in the column `{name}`; expected {} as of other runs of the cell",
                row.text(&name)?,
                if has_value { "nothing" } else { "a value" }
            );
            let of_cell = self.has_value.entry((cell.to_owned(), name));
            if *of_cell.or_insert(has_value) != has_value {
                return Err(message);
            }
        }
        Ok(())
    }
}

/// Counts the runs of each cell that the table lacks, up to the first look that has all its runs.
fn count_missing_runs(results: &mut Results) {
    let run_seeds = results.begun_run_seeds(|cell, run_seed| results.cells[cell].has_run(run_seed));
    let mut cells = std::mem::take(&mut results.cells);
    for cell in &mut cells {
        let of_others = cell.description.external.is_some();
        let ids = of_others.then(|| results.manifest.run_seeds_of(&cell.description));
        let run_seeds = ids.as_ref().unwrap_or(&run_seeds);
        let missing = run_seeds
            .iter()
            .filter(|run_seed| !cell.has_run(**run_seed));
        cell.missing = missing.count() + results.missing_runs_of_others(&cell.description);
    }
    results.cells = cells;
}
