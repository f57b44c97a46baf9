//! Reads the results of a study from the files of its runs, or from published rows.

use std::collections::BTreeSet;

use super::results::{Audit, CellResults, Results, ResultsError};
use super::{completeness, published};
use crate::study::design::file::Study;
use crate::study::store::StudyFolder;
use crate::text::shell_word;

impl Results {
    /// Reads all results in the folder of a study.
    ///
    /// # Errors
    /// If the folder has no readable study.
    pub fn read(folder: &StudyFolder) -> Result<Self, ResultsError> {
        let manifest = folder.manifest().map_err(ResultsError::Folder)?;
        let name = format!("{}: study file", folder.path().join("study.json").display());
        let study: Study = seedbed_input::parse(&name, manifest.study.clone())?.value;
        let mut results = Self {
            study,
            cells: Vec::new(),
            versions: BTreeSet::new(),
            commits: BTreeSet::new(),
            builds: BTreeSet::new(),
            audit: None,
            manifest,
        };
        let descriptions = results.manifest.cells.iter().cloned();
        results.cells = descriptions.map(CellResults::without_runs).collect();
        if published::is_published(folder) {
            published::read_table(&mut results, folder)?;
        } else {
            results.read_runs(folder)?;
        }
        results.audit = Audit::of(&results, folder);
        if completeness::count_next_look(&mut results) {
            results.audit = Audit::of(&results, folder);
        }
        if published::is_published(folder) {
            published::check_complete(&results, folder)?;
        }
        Ok(results)
    }

    /// Reads the result files of a folder.
    fn read_runs(&mut self, folder: &StudyFolder) -> Result<(), ResultsError> {
        let descriptions = &self.manifest.cells;
        let run_seeds = self.begun_run_seeds(|cell, run_seed| {
            folder.has_result_file(&descriptions[cell].digest, run_seed)
        });
        let mut cells = std::mem::take(&mut self.cells);
        for cell in &mut cells {
            if cell.description.external.is_some() {
                let ids = self.manifest.run_seeds_of(&cell.description);
                self.read_cell(folder, cell, &ids)?;
                cell.missing += self.missing_runs_of_others(&cell.description);
            } else {
                self.read_cell(folder, cell, &run_seeds)?;
            }
        }
        self.cells = cells;
        self.score_runs();
        Ok(())
    }

    /// Reads the runs of a cell with these run seeds.
    fn read_cell(
        &mut self,
        folder: &StudyFolder,
        cell: &mut CellResults,
        run_seeds: &[u64],
    ) -> Result<(), ResultsError> {
        for &run_seed in run_seeds {
            let digest = &cell.description.digest;
            let Some(stored) = folder.find_run(digest, run_seed, &[]) else {
                if let Some(path) = folder.damaged_file(digest, run_seed) {
                    let study = self.study_command();
                    return Err(ResultsError::Run { path, study });
                }
                cell.missing += 1;
                continue;
            };
            self.versions.insert(stored.version);
            self.commits.extend(stored.commit);
            self.builds.insert(stored.build);
            match stored.outcome {
                Ok(run) => cell.runs.push((run_seed, run)),
                Err(reason) => cell.failures.push((run_seed, reason)),
            }
        }
        Ok(())
    }

    /// The study and the options with which its runs were made.
    fn study_command(&self) -> String {
        let mut words = shell_word(&self.manifest.study_path).into_owned();
        if self.manifest.lock.is_some() {
            words.insert_str(0, "confirm ");
        }
        if self.manifest.quick {
            words += " --quick";
        }
        words
    }
}
