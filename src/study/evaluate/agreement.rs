//! Whether results are those of a study: their description, `study.json`, is compared with the study file
//! and its lock before any run is repeated. Whoever forges results can forge their description, too, but
//! not the study that others have.

use std::collections::HashSet;

use super::results::Results;
use crate::study::design::FormerDigests;
use crate::study::design::cell::CellDescription;
use crate::study::design::file::Study;
use crate::study::design::plan::StudyPlan;
use crate::study::external::ExternalCell;
use crate::study::store::Manifest;
use crate::text::pluralize;

/// How the description of `results` differs from the study and its lock, as sentences without a full
/// stop; empty if it does not.
#[must_use]
pub fn differences(plan: &StudyPlan, results: &Results) -> Vec<String> {
    let former = match FormerDigests::beside(&plan.path) {
        Ok(former) => former,
        Err(error) => return vec![error.to_string()],
    };
    let (expected, described) = (Manifest::of(plan), &results.manifest);
    let mut differences = differences_of_cells(&expected.cells, &described.cells, &former);
    differences.extend(differences_of_run_seeds(&expected, described));
    differences.extend(differences_of_claims(plan.study(), &results.study));
    if differences.is_empty() && plan.study() != &results.study {
        differences.push("a text, a figure, a measure or another value was changed".to_owned());
    }
    if differences.is_empty() {
        differences.extend(differences_of_locks(plan, results));
    }
    differences
}

/// Cells with runs in `results` that the study does not have now, such as runs of others whose files are
/// gone, and the numbers of these runs. Nothing can be compared with them.
#[must_use]
pub fn runs_without_source(plan: &StudyPlan, results: &Results) -> Vec<(String, usize)> {
    let planned = plan.runs().into_iter();
    let planned: HashSet<(&str, u64)> = planned
        .map(|run| (run.cell.name.as_str(), run.run_seed))
        .collect();
    let mut found = Vec::new();
    for cell in &results.cells {
        let name = &cell.description.name;
        let is_unknown = |run_seed: &u64| !planned.contains(&(name.as_str(), *run_seed));
        let runs = cell.run_seeds().filter(is_unknown).count();
        if runs > 0 {
            found.push((name.clone(), runs));
        }
    }
    found
}

fn differences_of_cells(
    expected: &[CellDescription],
    described: &[CellDescription],
    former: &FormerDigests,
) -> Vec<String> {
    let has = |cells: &[CellDescription], name: &str| cells.iter().any(|cell| cell.name == name);
    let mut differences = Vec::new();
    for cell in expected {
        let mut of_name = described.iter().filter(|other| other.name == cell.name);
        match of_name.next() {
            Some(_) if of_name.next().is_some() => {
                differences.push(format!("there are two cells `{}`", cell.name));
            }
            Some(other) => differences.extend(difference_of_cell(cell, other, former)),
            None => differences.push(format!("the cell `{}` is missing", cell.name)),
        }
    }
    let unknown = described.iter().filter(|cell| !has(expected, &cell.name));
    differences.extend(unknown.map(|cell| format!("the study has no cell `{}`", cell.name)));
    differences
}

fn difference_of_cell(
    expected: &CellDescription,
    described: &CellDescription,
    former: &FormerDigests,
) -> Option<String> {
    if !former.are_same(&expected.digest, &described.digest) {
        let name = &expected.name;
        return Some(format!(
            "the scenario, the task or the settings of cell `{name}` are others"
        ));
    }
    let is_same = comparable(expected) == comparable(described);
    (!is_same).then(|| format!("the description of cell `{}` was changed", expected.name))
}

/// What a description says of a cell besides its hashes, without paths, which depend on the working
/// directory, and without what follows from files of others, which may be gone.
fn comparable(cell: &CellDescription) -> CellDescription {
    let is_of_others = cell.external.is_some();
    CellDescription {
        digest: String::new(),
        agents: if is_of_others { 0 } else { cell.agents },
        max_episodes: if is_of_others { 0 } else { cell.max_episodes },
        external: cell.external.as_ref().map(|_| ExternalCell::default()),
        ..cell.without_path_and_derived()
    }
}

fn differences_of_run_seeds(expected: &Manifest, described: &Manifest) -> Vec<String> {
    let mut differences = Vec::new();
    if expected.repeats != described.repeats {
        differences.push(format!(
            "there are {} of each cell where the study has {}",
            pluralize(described.repeats as usize, "run"),
            expected.repeats
        ));
    }
    if expected.first_seed != described.first_seed {
        differences.push(format!(
            "the first run seed is {} where the study has {}",
            described.first_seed, expected.first_seed
        ));
    }
    differences
}

fn differences_of_claims(expected: &Study, described: &Study) -> Vec<String> {
    let (expected, described) = (claims(expected), claims(described));
    let missing = expected.iter().filter(|claim| !described.contains(claim));
    let unknown = described.iter().filter(|claim| !expected.contains(claim));
    let missing = missing.map(|claim| format!("the claim `{claim}` is missing"));
    let unknown = unknown.map(|claim| format!("the study has no claim `{claim}`"));
    missing.chain(unknown).collect()
}

fn claims(study: &Study) -> Vec<String> {
    let claims = study.claims.iter();
    claims
        .map(|claim| format!("{} | {}", claim.canonical_text(study), claim.text))
        .collect()
}

/// That the lock in the description is another one, or why the results do not confirm it.
fn differences_of_locks(plan: &StudyPlan, results: &Results) -> Vec<String> {
    if plan.lock != results.manifest.lock {
        return vec!["the lock was changed".to_owned()];
    }
    let broken = results.audit.iter().flat_map(|audit| &audit.broken);
    broken
        .map(|sentence| sentence.trim_end_matches('.').to_owned())
        .collect()
}
