//! The report of a study: one page of HTML that needs nothing else, its figures as SVG and PNG, and every run as a row of a table.

mod claims_table;
mod figures;
mod page;
mod rows;
mod tables;
mod words;

pub use words::{counted, tally};

use std::io;
use std::path::{Path, PathBuf};

use super::claims::Judgement;
use super::results::Results;
use crate::figure::Figure;
use crate::run::files;

/// Pixels of a PNG for each CSS pixel.
const PNG_SCALE: f64 = 2.0;

/// Removes what an earlier report left: figures and a table that this one may not have.
fn clear(folder: &Path) -> io::Result<()> {
    let entries = std::fs::read_dir(folder.join("figures"))
        .into_iter()
        .flatten()
        .flatten();
    for path in entries
        .map(|entry| entry.path())
        .filter(|path| is_a_figure(path))
    {
        std::fs::remove_file(path)?;
    }
    match std::fs::remove_file(folder.join("claims.md")) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// Such as `3-curves.svg`.
fn is_a_figure(path: &Path) -> bool {
    let number = path
        .file_name()
        .and_then(|name| name.to_str())
        .and_then(|name| name.split('-').next())
        .unwrap_or_default();
    let is_numbered = !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit());
    is_numbered
        && matches!(
            path.extension().and_then(|extension| extension.to_str()),
            Some("svg" | "png")
        )
}

/// A figure with the words around it.
struct Drawn {
    /// Its number and kind, for the names of its files.
    name: String,
    title: String,
    /// What can be seen and how it came about.
    caption: String,
    picture: Figure,
}

/// Writes `report.html`, `results.csv`, `tables.md`, `claims.md`, and `figures/` into `folder`, whatever runs are there. Tells where the page is.
///
/// # Errors
/// A file cannot be written.
pub fn write(results: &Results, judgements: &[Judgement], folder: &Path) -> io::Result<PathBuf> {
    let drawn = figures::draw(results);
    clear(folder)?;
    for figure in &drawn {
        let path = folder.join("figures").join(&figure.name);
        let png = figure
            .picture
            .png(PNG_SCALE)
            .map_err(|error| io::Error::other(error.to_string()))?;
        files::replace(
            &path.with_added_extension("svg"),
            figure.picture.svg().as_bytes(),
        )?;
        files::replace(&path.with_added_extension("png"), &png)?;
    }
    files::replace(&folder.join("results.csv"), &rows::csv(results)?)?;
    let tables = tables::all(results);
    files::replace(
        &folder.join("tables.md"),
        tables::markdown(results, &tables).as_bytes(),
    )?;
    if !judgements.is_empty() {
        files::replace(
            &folder.join("claims.md"),
            claims_table::markdown(results, judgements).as_bytes(),
        )?;
    }
    let page = folder.join("report.html");
    files::replace(
        &page,
        page::html(results, judgements, &tables, &drawn).as_bytes(),
    )?;
    Ok(page)
}
