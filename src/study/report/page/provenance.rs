//! Sections of a report that say where its results come from, and how to repeat runs.

use std::collections::HashSet;

use maud::{Markup, html};

use crate::provenance;
use crate::study::evaluate::results::{CellResults, Results};
use crate::study::external::{ExternalCell, FileHash};
use crate::text::{pluralize, shell_word};

/// The files of results that others made, with their hashes.
pub(super) fn results_of_others_section(results: &Results) -> Markup {
    let cells: Vec<(&CellResults, &ExternalCell)> = results
        .cells
        .iter()
        .filter_map(|cell| Some((cell, cell.description.external.as_ref()?)))
        .collect();
    html! {
        @if !cells.is_empty() {
            h2 { "Results of others" }
            p {
                "These results were made by others: run seeds and code cannot be checked. A run is identified by the SHA-256 of \
                 its files. A team whose agents have files of their own has done K · n steps when one of its agents has done n."
            }
            @for (cell, external) in cells {
                h3 { (cell.description.name) }
                p {
                    code { (cell.description.scenario) } ": " (pluralize(external.runs.len(), "run")) ", "
                    (pluralize(files_of(external).len(), "file")) "."
                }
                @for warning in &external.warnings { p.evidence { (warning) "." } }
                @for name in &external.seen_before {
                    p.evidence { "Not used, because its files existed at the registration: " code { (name) } "." }
                }
                details {
                    summary { "Files" }
                    div.scroll tabindex="0" {
                        table {
                            thead { tr { th.name { "file" } th { "bytes" } th.name { "SHA-256" } } }
                            tbody {
                                @for file in files_of(external) {
                                    tr {
                                        td.name { (file.path) } td { (file.bytes) } td.name { code { (file.sha256) } }
                                    }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// The files of all runs, each once: a file may have several runs.
fn files_of(cell: &ExternalCell) -> Vec<&FileHash> {
    let mut files: Vec<&FileHash> = Vec::new();
    let mut paths = HashSet::new();
    for file in cell.runs.iter().flat_map(|run| &run.files) {
        if paths.insert(&file.path) {
            files.push(file);
        }
    }
    files
}

pub(super) fn reproduction_section(results: &Results) -> Markup {
    let manifest = &results.manifest;
    let (action, option) = match &manifest.lock {
        Some(_) => ("confirm ", ""),
        None if manifest.quick => ("", " --quick"),
        None => ("", ""),
    };
    let first_seed = manifest.run_seeds().first().copied().unwrap_or_default();
    html! {
        h2 { "How to reproduce the results" }
        pre { "seedbed study " (action) (shell_word(&manifest.study_path)) (option) }
        p { (provenance_text(results)) }
        p { "One run of each cell, with its recording:" }
        div.scroll tabindex="0" {
            table {
                thead {
                    tr { th.name { "cell" } th { "K" } th { "max episodes" } th.name { "command" } }
                }
                tbody {
                    @for cell in &results.cells {
                        tr {
                            td.name { (cell.description.name) }
                            td { (cell.description.agents) }
                            td { (max_episodes(cell)) }
                            td.name {
                                @if cell.description.external.is_some() {
                                    "results of others"
                                } @else {
                                    code { (command(cell, first_seed)) }
                                }
                            }
                        }
                    }
                }
            }
        }
        details { summary { "Study file" } pre { (manifest.study) } }
    }
}

fn max_episodes(cell: &CellResults) -> String {
    if cell.unknown().episodes {
        return "unknown".to_owned();
    }
    cell.description.max_episodes.to_string()
}

/// Versions, commits and builds of seedbed that made the runs, and that made this page.
fn provenance_text(results: &Results) -> String {
    let mut runs = format!("seedbed {}", versions(results));
    if !results.commits.is_empty() {
        let commits: Vec<&str> = results.commits.iter().map(String::as_str).collect();
        runs += &format!(", commit {}", commits.join(", "));
    }
    runs += &format!(", build {}", builds(results));
    let mut page = format!("seedbed {}", env!("CARGO_PKG_VERSION"));
    if let Some(commit) = provenance::commit() {
        page += &format!(", commit {commit}");
    }
    let dependencies = provenance::dependency_versions();
    if !dependencies.is_empty() {
        page += &format!(", with {}", dependencies.join(", "));
    }
    let is_external = |cell: &CellResults| cell.description.external.is_some();
    let made = if results.cells.iter().all(is_external) {
        "The results of others were read by"
    } else if results.cells.iter().any(is_external) {
        "Runs were made, and results of others read, by"
    } else {
        "The runs were made by"
    };
    format!("{made} {runs}. This page was made by {page}.")
}

pub(super) fn versions(results: &Results) -> String {
    let versions: Vec<&str> = results.versions.iter().map(String::as_str).collect();
    versions.join(", ")
}

/// Build ids of all builds that made the runs.
pub(super) fn builds(results: &Results) -> String {
    let builds = results.builds.iter().copied();
    let ids: Vec<String> = builds.map(provenance::format_build_id).collect();
    ids.join(", ")
}

fn command(cell: &CellResults, seed: u64) -> String {
    let scenario = shell_word(&cell.description.scenario);
    let mut command = format!("seedbed run {scenario} --seed {seed}");
    for text in &cell.description.overrides {
        command += &format!(" --set {}", shell_word(text));
    }
    command
}

#[cfg(test)]
mod tests {
    use super::super::tests::cell;
    use super::*;

    #[test]
    fn printed_commands_are_quoted_for_the_shell() {
        let command = command(&cell("A", 40, 3.0), 1000);
        let arguments = shlex::split(&command).unwrap();
        assert_eq!(arguments[2], "it's a scenario.ron");
        assert_eq!(
            arguments[3..],
            ["--seed", "1000", "--set", "agents.count=2"]
        );
    }
}
