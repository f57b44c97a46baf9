//! Report of a study: one self-contained HTML page, its figures as SVG and PNG, its tables as
//! Markdown, and a CSV table with one row per run.

mod claims_table;
mod figures;
mod format;
mod page;
pub mod publish;
mod states;
pub mod submission;
mod tables;

pub use claims_table::{effect_found, note_about_claim};
pub use format::summarize_claims;
use tables::Table;

use std::io;
use std::path::{Path, PathBuf};

use crate::storage::files;
use crate::study::evaluate::claims::ClaimResult;
use crate::study::evaluate::results::Results;
use crate::study::evaluate::rows;
use crate::study::store::FIGURES;
use seedbed_figure::{Figure, Format, PrintLayout};

/// Writes `tables.md` and `claims.md` for all finished runs into `folder`.
fn write_tables(
    results: &Results,
    claim_results: &[ClaimResult],
    folder: &Path,
) -> io::Result<Vec<Table>> {
    let tables = tables::all(results);
    let text = tables::markdown(results, &tables);
    files::replace(&folder.join("tables.md"), text.as_bytes())?;
    if claim_results.is_empty() {
        remove_earlier(&folder.join("claims.md"))?;
    } else {
        let text = claims_table::markdown(results, claim_results);
        files::replace(&folder.join("claims.md"), text.as_bytes())?;
    }
    Ok(tables)
}

/// Removes a file of an earlier report, if there is one.
fn remove_earlier(path: &Path) -> io::Result<()> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// Deletes figures of an earlier report, because the new report may not have them.
fn delete_outdated_files(folder: &Path) -> io::Result<()> {
    if let Ok(entries) = std::fs::read_dir(folder.join(FIGURES)) {
        for entry in entries.flatten() {
            if is_figure(&entry.path()) {
                std::fs::remove_file(entry.path())?;
            }
        }
    }
    Ok(())
}

/// Whether a file is a figure of a report, such as `3-curves.svg` and `claims.svg`.
fn is_figure(path: &Path) -> bool {
    let name = path.file_name().and_then(|name| name.to_str());
    let number = name.and_then(|name| name.split('-').next());
    let is_numbered = number.is_some_and(|number| {
        !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit())
    });
    let extension = path.extension().and_then(|extension| extension.to_str());
    let is_of_claims = path.file_stem().is_some_and(|stem| stem == "claims");
    (is_numbered || is_of_claims) && matches!(extension, Some("svg" | "pdf" | "png"))
}

/// Writes what published results have of a report, without curves and states: `tables.md`, `claims.md` and `claims.svg`.
///
/// # Errors
/// If a file cannot be written.
pub fn write_texts(
    results: &Results,
    claim_results: &[ClaimResult],
    folder: &Path,
) -> io::Result<()> {
    write_tables(results, claim_results, folder)?;
    let path = folder.join("claims.svg");
    match figures::claims(results, claim_results) {
        Some(figure) => files::replace(&path, figure.picture.svg().as_bytes()),
        None => remove_earlier(&path),
    }
}

/// A figure with its title and caption.
struct ReportFigure {
    /// Name of the figure's files, such as `3-curves`.
    name: String,
    title: String,
    /// Caption, which says what the figure shows and how it was computed.
    caption: String,
    picture: Figure,
}

/// Writes `report.html`, `results.csv`, `tables.md`, `claims.md` and `figures/` for all finished
/// runs into `folder`. Files in `figures/` have the layout. Returns the path of `report.html`.
///
/// # Errors
/// If a file cannot be written.
pub fn write(
    results: &Results,
    claim_results: &[ClaimResult],
    folder: &Path,
    layout: &PrintLayout,
) -> io::Result<PathBuf> {
    let figures = figures::draw(results);
    delete_outdated_files(folder)?;
    let claims_figure = figures::claims(results, claim_results);
    for figure in figures.iter().chain(&claims_figure) {
        write_figure(figure, &folder.join(FIGURES), layout)?;
    }
    files::replace(&folder.join("results.csv"), &rows::csv(results)?)?;
    let tables = write_tables(results, claim_results, folder)?;
    let page = folder.join("report.html");
    files::replace(
        &page,
        page::html(
            results,
            claim_results,
            &tables,
            &figures,
            claims_figure.as_ref(),
        )
        .as_bytes(),
    )?;
    Ok(page)
}

/// Writes a figure in each format.
fn write_figure(figure: &ReportFigure, folder: &Path, layout: &PrintLayout) -> io::Result<()> {
    let mut picture = figure.picture.clone();
    let drawn = picture.width;
    layout.apply(&mut picture, drawn);
    let formats = [
        ("svg", Format::Svg),
        ("pdf", Format::Pdf),
        ("png", Format::Png),
    ];
    for (extension, format) in formats {
        let bytes = layout
            .encode(&picture, format)
            .map_err(|error| io::Error::other(error.to_string()))?;
        let path = folder.join(&figure.name).with_added_extension(extension);
        files::replace(&path, &bytes)?;
    }
    Ok(())
}
