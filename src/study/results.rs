//! What a study has come to so far, read from its folder.

use std::collections::BTreeSet;

use super::build::BuildMark;
use super::comparison::Score;
use super::figure::{Figure, Upto};
use super::file::{FIRST_REPORTING_SEED, Study};
use super::measure::Measure;
use super::measured::Measured;
use super::store::{Manifest, ManifestCell, StoreError, StudyFolder};
use crate::input::{self, InputError};

/// A study with all runs that are there.
#[derive(Clone, Debug)]
pub struct Results {
    /// What was run.
    pub manifest: Manifest,
    /// What the study's file says.
    pub study: Study,
    /// One a cell of the study, in the same order.
    pub cells: Vec<CellResults>,
    /// The versions of the workbench that ran it.
    pub versions: BTreeSet<String>,
    /// Its builds; none stands for those that are not known.
    pub builds: BTreeSet<Option<BuildMark>>,
}

/// All runs of a cell that are there.
#[derive(Clone, Debug)]
pub struct CellResults {
    /// What the cell is.
    pub about: ManifestCell,
    /// Finished runs by their seeds.
    pub runs: Vec<(u64, Measured)>,
    /// Failed runs by their seeds, with their reasons.
    pub failures: Vec<(u64, String)>,
    /// Runs that are not there.
    pub missing: usize,
}

/// Why a folder holds no results that can be read.
#[derive(Debug, thiserror::Error)]
pub enum ResultsError {
    /// It is no study's folder.
    #[error("no study was run here: {0}")]
    Folder(StoreError),
    /// Its study cannot be read by this version.
    #[error(transparent)]
    Study(#[from] InputError),
}

impl Results {
    /// Reads what is there.
    ///
    /// # Errors
    /// The folder holds no study.
    pub fn read(folder: &StudyFolder) -> Result<Self, ResultsError> {
        let manifest = folder.manifest().map_err(ResultsError::Folder)?;
        let study: Study = input::parse(&manifest.study_path, manifest.study.clone())?.value;
        let mut results = Self {
            study,
            cells: Vec::new(),
            versions: BTreeSet::new(),
            builds: BTreeSet::new(),
            manifest,
        };
        for about in results.manifest.cells.clone() {
            results.read_cell(folder, about);
        }
        Ok(results)
    }

    fn read_cell(&mut self, folder: &StudyFolder, about: ManifestCell) {
        let mut cell = CellResults {
            about,
            runs: Vec::new(),
            failures: Vec::new(),
            missing: 0,
        };
        for seed in self.manifest.first_seed..self.manifest.first_seed + self.manifest.repeats {
            let Some(stored) = folder.stored(&cell.about.digest, seed, &[]) else {
                cell.missing += 1;
                continue;
            };
            self.versions.insert(stored.version);
            self.builds.insert(stored.build);
            match stored.outcome {
                Ok(run) => cell.runs.push((seed, run)),
                Err(reason) => cell.failures.push((seed, reason)),
            }
        }
        self.cells.push(cell);
    }

    /// The cell of this name.
    #[must_use]
    pub fn cell(&self, name: &str) -> Option<&CellResults> {
        self.cells.iter().find(|cell| cell.about.name == name)
    }

    /// The cells that a figure shows: all, or those that it names, in its order.
    #[must_use]
    pub fn shown_by(&self, figure: &Figure) -> Vec<&CellResults> {
        if figure.cells().is_empty() {
            return self.cells.iter().collect();
        }
        figure
            .cells()
            .iter()
            .filter_map(|name| self.cell(name))
            .collect()
    }

    /// Whether its seeds are those for tuning, whose results are not to be published.
    #[must_use]
    pub fn is_tuning(&self) -> bool {
        self.manifest.first_seed < FIRST_REPORTING_SEED
    }

    /// Runs that are finished, failed, and missing.
    #[must_use]
    pub fn counts(&self) -> [usize; 3] {
        let sum = |count: fn(&CellResults) -> usize| self.cells.iter().map(count).sum();
        [
            sum(|cell| cell.runs.len()),
            sum(|cell| cell.failures.len()),
            sum(|cell| cell.missing),
        ]
    }
}

impl CellResults {
    /// A measure of all runs that can tell it.
    #[must_use]
    pub fn scores(&self, measure: Measure) -> Vec<Score> {
        self.runs
            .iter()
            .filter_map(|(seed, run)| Score::of(measure, *seed, run))
            .collect()
    }

    /// The states of the first run's first episodes, if they were kept: how many were visited, and a sample of them.
    #[must_use]
    pub fn states(&self, upto: Upto) -> Option<(u64, &[f32])> {
        let kept = self
            .runs
            .iter()
            .flat_map(|(_, run)| &run.states)
            .find(|states| states.episodes == upto.episodes());
        kept.map(|kept| (kept.visited, kept.states.as_slice()))
    }
}
