//! Whether results confirm what was registered.

use super::results::{Audit, CellResults, Results};
use crate::provenance;
use crate::storage::hashes::shown_digits;
use crate::study::design::lock::list;
use crate::study::design::lock::{Lock, Registered, SeenFile};
use crate::study::external::SeenFiles;
use crate::study::store::StudyFolder;
use crate::text::pluralize;
use seedbed_stats::family::FAMILY_LEVEL;

impl Audit {
    /// Checks registered results; `None` if they are not registered.
    #[must_use]
    pub fn of(results: &Results, folder: &StudyFolder) -> Option<Self> {
        let lock = results.manifest.lock.as_ref()?;
        Some(Self {
            broken: broken(lock, results),
            notes: [
                notes_on_runs(lock, results, folder),
                notes_on_results_of_others(lock, results),
                notes_on_history(lock),
            ]
            .concat(),
        })
    }
}

fn broken(lock: &Lock, results: &Results) -> Vec<String> {
    let mut broken = Vec::new();
    if !lock.is_unchanged() {
        broken.push(
            "The lock was changed after it was made: its contents do not have its id.".to_owned(),
        );
    }
    let manifest = &results.manifest;
    if lock.registered.level != FAMILY_LEVEL {
        broken.push(format!(
            "The lock has an error probability of {}, where {FAMILY_LEVEL} is used.",
            lock.registered.level
        ));
    }
    if manifest.quick || Some(&manifest.repeats) != lock.registered.looks.last() {
        broken.push("The results say another number of runs per cell than the lock.".to_owned());
    }
    let study = (&results.study, manifest.study.as_str());
    let reported = Registered::of(&manifest.name, study, &manifest.cells);
    for difference in lock.registered.differences(&reported) {
        broken.push(format!(
            "The reported study differs from its lock: {difference}."
        ));
    }
    broken.extend(broken_results_of_others(lock, results));
    broken
}

/// Results of others that were changed, seen before the registration, or too many.
fn broken_results_of_others(lock: &Lock, results: &Results) -> Vec<String> {
    let mut broken = results.manifest.changed_results.clone();
    let seen = SeenFiles::new(lock.registered.seen_files.iter().map(|seen| &seen.file));
    for cell in &results.manifest.cells {
        let Some(external) = &cell.external else {
            continue;
        };
        let expected = results.expected_runs_of_others(&cell.name);
        if expected.is_some_and(|expected| external.runs.len() as u64 > expected) {
            broken.push(format!(
                "Cell `{}` has more runs than were registered.",
                cell.name
            ));
        }
        for run in &external.runs {
            if run.files.iter().any(|file| seen.include(file)) {
                broken.push(format!(
                    "The run `{}` of cell `{}` existed when the study was registered.",
                    run.name, cell.name
                ));
            }
        }
    }
    broken
}

/// What a reader should know of the results of others.
fn notes_on_results_of_others(lock: &Lock, results: &Results) -> Vec<String> {
    let mut notes = Vec::new();
    for registered in &lock.registered.results_of_others {
        notes.push(format!(
            "The runs of cell `{}` were made by others. The lock does not fix their {}.",
            registered.cell, registered.not_fixed
        ));
        let cell = results.cell(&registered.cell);
        let external = cell.and_then(|cell| cell.description.external.as_ref());
        let missing = cell.map_or(0, |cell| cell.missing);
        if missing > 0 {
            notes.push(format!(
                "{missing} of {} of cell `{}` are missing.",
                pluralize(registered.runs as usize, "run"),
                registered.cell
            ));
        }
        let not_used = external.map_or(0, |external| external.seen_before.len());
        if not_used > 0 {
            notes.push(format!(
                "Not used: {} of cell `{}`, whose files existed when the study was registered.",
                pluralize(not_used, "run"),
                registered.cell
            ));
        }
    }
    for SeenFile { cell, file } in &lock.registered.seen_files {
        notes.push(format!(
            "Seen before: `{}` of cell `{cell}`, SHA-256 {}.",
            file.path, file.sha256
        ));
    }
    notes
}

fn notes_on_runs(lock: &Lock, results: &Results, folder: &StudyFolder) -> Vec<String> {
    let mut notes = Vec::new();
    let [_, failed, missing] = results.run_counts();
    for (count, state) in [(missing, "missing"), (failed, "failed")] {
        if count > 0 {
            notes.push(format!(
                "{} of the registered runs: {state}. Claims are evaluated at looks whose runs are all finished.",
                pluralize(count, "run")
            ));
        }
    }
    let other = count_other_files(results, folder);
    if other > 0 {
        notes.push(format!(
            "Not registered and not used: {} in the directory.",
            pluralize(other, "result file")
        ));
    }
    let builds = results
        .builds
        .iter()
        .map(|build| provenance::format_build_id(*build));
    let other_builds: Vec<String> = builds
        .filter(|build| *build != lock.registered.build)
        .collect();
    if !other_builds.is_empty() {
        notes.push(format!(
            "Runs were made by another build ({}) than the one that registered the study ({}).",
            other_builds.join(", "),
            lock.registered.build
        ));
    }
    notes
}

/// Number of result files that belong to no registered run.
fn count_other_files(results: &Results, folder: &StudyFolder) -> usize {
    let run_seeds_of = |cell: &CellResults| results.manifest.run_seeds_of(&cell.description);
    let run_seeds: Vec<Vec<u64>> = results.cells.iter().map(run_seeds_of).collect();
    let is_registered = |name: &String| {
        results
            .cells
            .iter()
            .zip(&run_seeds)
            .any(|(cell, run_seeds)| {
                let run_seed = name
                    .strip_prefix(&format!("{}-", shown_digits(&cell.description.digest)))
                    .and_then(|rest| rest.strip_suffix(".run"))
                    .and_then(|run_seed| run_seed.parse().ok());
                run_seed.is_some_and(|run_seed| run_seeds.contains(&run_seed))
            })
    };
    folder
        .result_file_names()
        .iter()
        .filter(|name| !is_registered(name))
        .count()
}

fn notes_on_history(lock: &Lock) -> Vec<String> {
    let mut notes = Vec::new();
    for ancestor in &lock.registered.ancestors {
        notes.push(format!(
            "An earlier lock: {}, with {} at {} runs per cell.",
            ancestor.id,
            pluralize(ancestor.claims.len(), "claim"),
            list(&ancestor.looks)
        ));
    }
    for claim in lock.withdrawn_claims() {
        notes.push(format!(
            "A claim of an earlier lock was withdrawn: `{claim}`."
        ));
    }
    for related in &lock.registered.related {
        notes.push(format!(
            "Another study with some of these cells is registered: {}, {}.",
            related.study, related.id
        ));
    }
    if let Some(log) = &lock.registered.run_log {
        notes.push(format!(
            "When the study was registered, the project's log had {}, of which {} with other settings in tasks of this study.",
            pluralize(log.runs, "run"),
            log.others_in_tasks
        ));
    }
    for (cell, runs) in &lock.registered.seen_before {
        notes.push(format!(
            "When the study was registered, {} of cell `{cell}` with other run seeds had been made.",
            pluralize(*runs, "run")
        ));
    }
    notes
}
