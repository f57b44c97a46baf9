//! Published results: what verdicts and tables need of the runs of a study, small enough to be kept
//! in a repository.
//!
//! A directory with published results has `study.json`, the manifest with the study file and its
//! lock; `results.csv.gz`, the report's `results.csv`, with one row per run; and `builds.json`, which
//! says what made the runs. From these files the verdicts and tables are computed again, with the
//! same digits. Curves and visited states are not published: `seedbed study --confirm` makes the runs
//! again, with the same bits.

use std::collections::{BTreeSet, HashMap, HashSet};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::str::FromStr;

use flate2::Compression;
use flate2::read::GzDecoder;
use flate2::write::GzEncoder;
use seedbed_env::input::limits::MAX_TABLE_BYTES;
use serde::{Deserialize, Serialize};

use super::claims::ClaimResult;
use super::comparison::RunScore;
use super::cost::RunCost;
use super::measure::Measure;
use super::plan::PlannedRun;
use super::provenance::{format_build_id, parse_build_id};
use super::report::{self, column};
use super::results::{CellResults, Results, ResultsError};
use super::runner::Outcome;
use super::store::{self, StudyFolder};
use crate::run::files;
use crate::text::from_spreadsheet_cell;

/// Name of the file with one row per run.
const TABLE: &str = "results.csv.gz";

/// Name of the file with the manifest.
const MANIFEST: &str = "study.json";

/// What made the runs of a study: `builds.json`.
#[derive(Serialize, Deserialize)]
pub(super) struct Builds {
    versions: BTreeSet<String>,
    commits: BTreeSet<String>,
    /// Hashes of the executables, in hexadecimal digits.
    executables: BTreeSet<String>,
}

/// Name of the file with the builds.
const BUILDS: &str = "builds.json";

/// Writes `study.json`, `builds.json`, `results.csv.gz`, `claims.md` and `tables.md` to the folder of
/// the study in `parent`. Returns that folder.
///
/// # Errors
/// If a file cannot be written.
pub fn write(
    results: &Results,
    claim_results: &[ClaimResult],
    parent: &Path,
) -> io::Result<PathBuf> {
    let name = Path::new(&results.manifest.name).file_name();
    let folder = parent.join(name.ok_or(io::ErrorKind::InvalidFilename)?);
    std::fs::create_dir_all(&folder)?;
    for (name, bytes) in files(results)? {
        files::replace(&folder.join(name), &bytes)?;
    }
    report::write_texts(results, claim_results, &folder)?;
    Ok(folder)
}

/// Contents of `study.json`, `builds.json` and `results.csv.gz`, each with its name.
///
/// # Errors
/// If the table cannot be made.
pub fn files(results: &Results) -> io::Result<[(&'static str, Vec<u8>); 3]> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(&report::csv(results)?)?;
    Ok([
        (MANIFEST, results.manifest.to_json().into_bytes()),
        (BUILDS, store::to_json(&Builds::of(results)).into_bytes()),
        (TABLE, encoder.finish()?),
    ])
}

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
    pub(super) fn of(results: &Results) -> Self {
        let executables = results.builds.iter();
        Self {
            versions: results.versions.clone(),
            commits: results.commits.clone(),
            executables: executables.map(|build| format_build_id(*build)).collect(),
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
    /// The study, with its cells but without runs.
    study: Results,
    columns: HashMap<String, usize>,
    /// Rows by the name of the cell and the run seed.
    rows: HashMap<(String, u64), csv::StringRecord>,
}

impl PublishedRuns {
    /// Reads the table in a folder of published results, which is checked.
    ///
    /// # Errors
    /// If a file in the folder is damaged, or does not belong to the study.
    pub fn read(folder: &StudyFolder) -> Result<Self, ResultsError> {
        let mut study = Results::read(folder)?;
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
        Ok(Self {
            study,
            columns,
            rows,
        })
    }

    /// Whether the table has this run.
    #[must_use]
    pub fn contains(&self, run: &PlannedRun<'_>) -> bool {
        self.rows.contains_key(&key_of(run))
    }

    /// Whether a repeated run has the values of its row, in all columns of the table.
    #[must_use]
    pub fn is_reproduced_by(&self, run: &PlannedRun<'_>, outcome: &Outcome) -> bool {
        let Some(published) = self.rows.get(&key_of(run)) else {
            return false;
        };
        let Ok((columns, repeated)) = self.row_of(run, outcome) else {
            return false;
        };
        self.columns.iter().all(|(name, place)| {
            let new = columns.get(name).and_then(|column| repeated.get(*column));
            new == published.get(*place)
        })
    }

    /// The row that the report writes for a run.
    fn row_of(
        &self,
        run: &PlannedRun<'_>,
        outcome: &Outcome,
    ) -> io::Result<(HashMap<String, usize>, csv::StringRecord)> {
        let mut cells = self.study.cells.iter();
        let of_run = |cell: &&CellResults| cell.description.name == run.cell.name;
        let mut cell = cells.find(of_run).ok_or(io::ErrorKind::NotFound)?.clone();
        match outcome {
            Ok(result) => cell.runs.push((run.run_seed, result.clone())),
            Err(reason) => cell.failures.push((run.run_seed, reason.clone())),
        }
        let results = Results {
            cells: vec![cell],
            ..self.study.clone()
        };
        let (columns, mut records) = read_records(&report::csv(&results)?)?;
        let record = records.pop().ok_or(io::ErrorKind::NotFound)?;
        Ok((columns, record))
    }
}

fn key_of(run: &PlannedRun<'_>) -> (String, u64) {
    (run.cell.name.clone(), run.run_seed)
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
    read_builds(results, folder).map_err(|problem| ResultsError::Table {
        path: folder.path().join(BUILDS),
        line: None,
        message: problem.to_string(),
    })?;
    let text = decompress(&path).map_err(|problem| error(None, problem.to_string()))?;
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let header = reader
        .headers()
        .map_err(|problem| error(None, problem.to_string()))?;
    let columns: HashMap<String, usize> = header.iter().map(str::to_owned).zip(0..).collect();
    let measures = results.measures();
    let cells = results.manifest.cells.iter();
    let run_seeds_of = |cell| results.manifest.run_seeds_of(cell).into_iter().collect();
    let run_seeds: RunSeeds = cells
        .map(|cell| (cell.name.clone(), run_seeds_of(cell)))
        .collect();
    for (record, line) in reader.records().zip(2..) {
        let record = record.map_err(|problem| error(Some(line), problem.to_string()))?;
        let row = Row {
            record,
            columns: &columns,
        };
        add_row(results, &run_seeds, &measures, &row)
            .map_err(|problem| error(Some(line), problem))?;
    }
    count_missing_runs(results);
    Ok(())
}

fn read_builds(results: &mut Results, folder: &StudyFolder) -> io::Result<()> {
    let bytes = std::fs::read(folder.path().join(BUILDS))?;
    let builds: Builds = serde_json::from_slice(&bytes)?;
    results.versions = builds.versions;
    results.commits = builds.commits;
    results.builds = builds
        .executables
        .iter()
        .map(|text| parse_build_id(text))
        .collect();
    Ok(())
}

fn decompress(path: &Path) -> io::Result<String> {
    let mut text = String::new();
    let mut decoder = GzDecoder::new(std::fs::File::open(path)?).take(MAX_TABLE_BYTES);
    decoder.read_to_string(&mut text)?;
    if text.len() as u64 == MAX_TABLE_BYTES {
        return Err(io::Error::other("the table has more than 1 GiB"));
    }
    Ok(text)
}

/// A row of the table.
struct Row<'a> {
    record: csv::StringRecord,
    columns: &'a HashMap<String, usize>,
}

impl Row<'_> {
    /// The text in a column.
    fn text(&self, name: &str) -> Result<&str, String> {
        let column = self.columns.get(name);
        let column = column.ok_or_else(|| format!("expected a column `{name}`"))?;
        Ok(&self.record[*column])
    }

    /// The value in a column; `None` if it is empty.
    fn value<T: FromStr>(&self, name: &str) -> Result<Option<T>, String> {
        let text = self.text(name)?;
        if text.is_empty() {
            return Ok(None);
        }
        let value = text.parse();
        value
            .map(Some)
            .map_err(|_| format!("`{text}` in the column `{name}`"))
    }

    /// The value in a column that must not be empty.
    fn required<T: FromStr>(&self, name: &str) -> Result<T, String> {
        let value = self.value(name)?;
        value.ok_or_else(|| format!("expected a value in the column `{name}`"))
    }

    /// Name of the cell and run seed.
    fn key(&self) -> Result<(String, u64), String> {
        let name = from_spreadsheet_cell(self.text("cell")?);
        Ok((name.into_owned(), self.required("seed")?))
    }

    fn cost(&self) -> Result<RunCost, String> {
        let (episodes, env_steps) = (self.value("episodes")?, self.value("env_steps")?);
        Ok(RunCost {
            solved: self.value("solved")?,
            episodes: self.value("episodes_to_solve")?.or(episodes),
            env_steps: self.value("env_steps_to_solve")?.or(env_steps),
            gradient_steps: self.value("gradient_steps")?,
            had_policy_gradient: self.value("had_policy_gradient")?,
        })
    }

    fn score(&self, measure: Measure, run_seed: u64) -> Result<Option<RunScore>, String> {
        let Some(value) = self.value::<f64>(&column(measure))? else {
            return Ok(None);
        };
        let is_censored = measure.is_time() && !value.is_finite();
        let end = if measure == Measure::EnvStepsToSolve {
            "env_steps"
        } else {
            "episodes"
        };
        let observed_until = if is_censored {
            self.required(end)?
        } else {
            f64::INFINITY
        };
        Ok(Some(RunScore {
            run_seed,
            value,
            observed_until,
        }))
    }
}

/// Run seeds of each cell, by its name.
type RunSeeds = HashMap<String, HashSet<u64>>;

/// Adds a run to its cell, if its run seed is one of the cell's.
fn add_row(
    results: &mut Results,
    run_seeds: &RunSeeds,
    measures: &[Measure],
    row: &Row<'_>,
) -> Result<(), String> {
    let (name, run_seed) = row.key()?;
    let cell = results
        .cells
        .iter_mut()
        .find(|cell| cell.description.name == name);
    let cell = cell.ok_or_else(|| format!("the study has no cell `{name}`"))?;
    let is_of_cell = run_seeds
        .get(&name)
        .is_some_and(|run_seeds| run_seeds.contains(&run_seed));
    if !is_of_cell || cell.has_run(run_seed) {
        return Err(format!(
            "the study has no (second) run of `{name}` with run seed {run_seed}"
        ));
    }
    match row.text("state")? {
        "finished" => {
            let scores = measures.iter().map(|&measure| row.score(measure, run_seed));
            let scores = scores.collect::<Result<Vec<_>, _>>()?;
            cell.add_scored_run(run_seed, row.cost()?, measures, scores);
        }
        "failed" => cell.failures.push((
            run_seed,
            from_spreadsheet_cell(row.text("reason")?).into_owned(),
        )),
        other => return Err(format!("`{other}` in the column `state`")),
    }
    Ok(())
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
