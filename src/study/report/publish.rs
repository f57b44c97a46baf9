//! Publishes results: what verdicts and tables need of the runs of a study, and the texts of its report.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use flate2::Compression;
use flate2::write::GzEncoder;

use crate::storage::files;
use crate::storage::hashes::sha256;
use crate::study::evaluate::claims::ClaimResult;
use crate::study::evaluate::published::{BUILDS, Builds, MANIFEST, TABLE};
use crate::study::evaluate::results::Results;
use crate::study::evaluate::rows;
use crate::study::file_error::to_json;
use crate::study::report;

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
    encoder.write_all(&rows::csv(results)?)?;
    let (manifest, table) = (results.manifest.to_json().into_bytes(), encoder.finish()?);
    let hashes = [(MANIFEST, &manifest), (TABLE, &table)];
    let hash = |(name, bytes): (&str, &Vec<u8>)| (name.to_owned(), sha256(bytes));
    let mut builds = Builds::of(results);
    builds.sha256 = hashes.map(hash).into();
    Ok([
        (MANIFEST, manifest),
        (BUILDS, to_json(&builds).into_bytes()),
        (TABLE, table),
    ])
}
