//! Published results: their tables follow from one row per run, and the numbers in documents are
//! those of the tables.
//!
//! A document takes a number from a table by a comment before it and one behind it, which name the
//! study, the section of its tables (`claims` for `claims.md`), the row and the column, each by its
//! beginning:
//!
//! ```text
//! <!-- fig_6_1 | episodes until solved | σ 0.01 | median -->282.5<!-- end -->
//! ```
//!
//! The column `effect` of claims is the beginning of `found`, without the values of both cells.
//! `<!-- fig_6_1 | claims -->` on a line of its own is followed by the whole table. With
//! `UPDATE_EXPECT=1` documents are rewritten.

use std::fs;
use std::path::{Path, PathBuf};

use super::util::{REPOSITORY, seedbed};

const END: &str = "<!-- end -->";

/// Folders with published results. Those of groups precede those of groups within groups, so that a reference with the
/// name of a study alone means the former: `thesis/results/x` and `gymnasium/thesis/results/x`.
fn published_folders() -> Vec<PathBuf> {
    let groups = subfolders(&Path::new(REPOSITORY).join("scenarios"));
    let inner = groups.iter().flat_map(|group| subfolders(group));
    let all = groups.iter().cloned().chain(inner);
    all.flat_map(|group| subfolders(&group.join("results")))
        .collect()
}

fn subfolders(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else {
        return Vec::new();
    };
    let paths = entries.map(|entry| entry.unwrap().path());
    let mut folders: Vec<PathBuf> = paths.filter(|path| path.is_dir()).collect();
    folders.sort();
    folders
}

/// Documents that may take numbers from tables.
fn documents() -> Vec<PathBuf> {
    let repository = Path::new(REPOSITORY);
    let mut documents = vec![repository.join("README.md")];
    let folders = [
        vec![repository.join("docs")],
        subfolders(&repository.join("scenarios")),
    ];
    for folder in folders.concat() {
        let entries = fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().path());
        documents
            .extend(entries.filter(|path| path.extension().is_some_and(|found| found == "md")));
    }
    documents.sort();
    documents
}

/// Each JSON file beside published results: not JSON, of wrong types, nested deeply, huge, a pipe, a folder.
#[cfg(unix)]
#[test]
fn hostile_files_beside_published_results_are_refused_by_name() {
    let published = Path::new(REPOSITORY).join("scenarios/thesis/results/fig_6_1");
    let deep = "[".repeat(100_000);
    let wrong_types = r#"{"versions": 3, "sha256": [1]}"#;
    for (file, what) in [
        ("builds.json", "expected the builds of published results: "),
        (
            "submission.json",
            "expected the description of a submission: ",
        ),
        ("study.json", ""),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path().canonicalize().unwrap();
        for file in ["study.json", "builds.json", "results.csv.gz"] {
            fs::copy(published.join(file), folder.join(file)).unwrap();
        }
        let path = folder.join(file);
        let refusal = || {
            let output = seedbed(&["report", folder.to_str().unwrap()]);
            assert_eq!(output.status.code(), Some(2), "{file}: {output:?}");
            String::from_utf8(output.stderr).unwrap()
        };
        let begins = if file == "study.json" {
            format!("error: not the results of a study: {}: ", path.display())
        } else {
            format!("error: {}: ", path.display())
        };
        for text in ["hello", "", "7", deep.as_str(), wrong_types] {
            fs::write(&path, text).unwrap();
            let error = refusal();
            assert!(error.starts_with(&format!("{begins}{what}")), "{error}");
        }
        fs::File::create(&path).unwrap().set_len(1 << 32).unwrap();
        assert_eq!(
            refusal(),
            format!("{begins}expected at most 64 MiB, found more\n")
        );
        fs::remove_file(&path).unwrap();
        let made = std::process::Command::new("mkfifo").arg(&path).status();
        assert!(made.unwrap().success());
        let message = "expected a regular file, found a pipe, a socket or a device";
        assert_eq!(refusal(), format!("{begins}{message}\n"));
        fs::remove_file(&path).unwrap();
        fs::create_dir(&path).unwrap();
        assert_eq!(
            refusal(),
            format!("{begins}expected a file, found a folder\n")
        );
    }
}

/// Size of a table of results, in bytes, from which it takes the tests too long to compute its tables: `tests/interop/published` does, with
/// the program as users have it.
const LARGE: u64 = 5_000_000;

#[test]
fn tables_of_published_results_follow_from_their_rows() {
    let size = |folder: &Path| fs::metadata(folder.join("results.csv.gz")).unwrap().len();
    let (large, others): (Vec<PathBuf>, Vec<PathBuf>) = published_folders()
        .into_iter()
        .partition(|folder| size(folder) > LARGE);
    assert!(large.len() <= 2 && others.len() > 20, "{large:?}");
    for folder in others {
        let copy = tempfile::tempdir().unwrap();
        for file in ["study.json", "builds.json", "results.csv.gz"] {
            fs::copy(folder.join(file), copy.path().join(file)).unwrap();
        }
        let output = seedbed(&["report", copy.path().to_str().unwrap()]);
        assert!(output.status.success(), "{}: {output:?}", folder.display());
        assert!(copy.path().join("tables.md").is_file());
        for file in ["claims.md", "tables.md"] {
            let (computed, published) = (copy.path().join(file), folder.join(file));
            // A study without claims has no table of them.
            assert_eq!(computed.is_file(), published.is_file(), "{file}");
            if computed.is_file() {
                let computed = fs::read_to_string(computed).unwrap();
                expect_test::expect_file![published].assert_eq(&computed);
            }
        }
    }
}

#[test]
fn numbers_in_documents_are_those_of_published_tables() {
    let tables = PublishedTables(published_folders());
    for document in documents() {
        let text = fs::read_to_string(&document).unwrap();
        let filled = fill_in(&text, &tables)
            .unwrap_or_else(|problem| panic!("{}: {problem}", document.display()));
        expect_test::expect_file![document].assert_eq(&filled);
    }
}

/// The text with the present contents of tables between all pairs of comments.
fn fill_in(text: &str, tables: &PublishedTables) -> Result<String, String> {
    let mut filled = String::new();
    let mut rest = text;
    while let Some((before, reference, after)) = next_reference(rest) {
        let (_, behind) = after
            .split_once(END)
            .ok_or_else(|| format!("no `{END}` behind `{reference}`"))?;
        filled += &format!(
            "{before}<!-- {reference} -->{}{END}",
            tables.contents(reference)?
        );
        rest = behind;
    }
    Ok(filled + rest)
}

/// The text before the next comment with a reference to a table, the reference, and the text behind.
fn next_reference(text: &str) -> Option<(&str, &str, &str)> {
    let mut start = 0;
    loop {
        let comment = start + text[start..].find("<!-- ")?;
        let length = text[comment..].find(" -->")?;
        let reference = &text[comment + 5..comment + length];
        if reference.contains(" | ") {
            return Some((&text[..comment], reference, &text[comment + length + 4..]));
        }
        start = comment + length;
    }
}

struct PublishedTables(Vec<PathBuf>);

impl PublishedTables {
    /// What a reference stands for: a cell of a table, or a table with empty lines around it.
    fn contents(&self, reference: &str) -> Result<String, String> {
        let parts: Vec<&str> = reference.split(" | ").collect();
        let table = self.table(parts[0], parts[1])?;
        match parts[2..] {
            [] => Ok(format!("\n\n{}\n\n", table.join("\n"))),
            [row, column] => cell(&table, row, column).ok_or_else(|| format!("no `{reference}`")),
            _ => Err(format!(
                "`{reference}`: expected a study, a table, a row and a column"
            )),
        }
    }

    /// The lines of a table of a study.
    fn table(&self, study: &str, section: &str) -> Result<Vec<String>, String> {
        let folder = self.0.iter().find(|folder| folder.ends_with(study));
        let folder = folder.ok_or_else(|| format!("no published results of `{study}`"))?;
        let file = if section == "claims" {
            "claims.md"
        } else {
            "tables.md"
        };
        let text = fs::read_to_string(folder.join(file)).unwrap();
        let heading = format!("## {section}");
        let mut lines = text
            .lines()
            .skip_while(|line| section != "claims" && !line.starts_with(&heading));
        let table = lines.by_ref().skip_while(|line| !line.starts_with('|'));
        let table = table.take_while(|line| line.starts_with('|'));
        let table: Vec<String> = table.map(str::to_owned).collect();
        if table.is_empty() {
            return Err(format!("`{study}` has no table `{section}`"));
        }
        Ok(table)
    }
}

/// The effect with its interval of the column `found`, which also has both values:
/// `2 (1 to 3), 6 against 4`.
fn effect_of(found: &str) -> &str {
    found.rsplit_once(", ").map_or(found, |(effect, _)| effect)
}

/// The cell of a table in the row and in the column that begin with these texts. A row that is equal
/// to its text precedes rows that begin with it.
fn cell(table: &[String], row: &str, column: &str) -> Option<String> {
    if column == "effect" {
        return cell(table, row, "found").map(|found| effect_of(&found).to_owned());
    }
    let position = cells(&table[0])
        .iter()
        .position(|head| head.starts_with(column))?;
    let rows: Vec<Vec<&str>> = table[2..].iter().map(|line| cells(line)).collect();
    let equal = rows.iter().find(|cells| cells[0] == row);
    let found = equal.or_else(|| rows.iter().find(|cells| cells[0].starts_with(row)))?;
    Some(found[position].to_owned())
}

fn cells(line: &str) -> Vec<&str> {
    line.trim_matches('|').split(" | ").map(str::trim).collect()
}

#[test]
fn references_are_replaced_by_cells_and_tables() {
    let folder = tempfile::tempdir().unwrap();
    let study = folder.path().join("small");
    fs::create_dir(&study).unwrap();
    let tables =
        "# T\n\n## Cost of all\n\n| cell | K |\n|---|---|\n| a, b | 5 |\n| a | 4 |\n\n## n\n";
    fs::write(study.join("tables.md"), tables).unwrap();
    fs::write(
        study.join("claims.md"),
        "| claim | n |\n|---|---|\n| more | 7 |\n",
    )
    .unwrap();
    let tables = PublishedTables(vec![study]);
    let text = "K is <!-- small | Cost | a | K -->5<!-- end -->, n <!-- small | claims | more | n --><!-- end -->";
    let filled = "K is <!-- small | Cost | a | K -->4<!-- end -->, n <!-- small | claims | more | n -->7<!-- end -->";
    assert_eq!(fill_in(text, &tables).unwrap(), filled);
    assert_eq!(effect_of("−2 (−3 to −1), 4 against 6"), "−2 (−3 to −1)");
    let table = fill_in(
        "<!-- note --> <!-- small | claims -->old<!-- end -->",
        &tables,
    )
    .unwrap();
    assert!(table.ends_with("-->\n\n| claim | n |\n|---|---|\n| more | 7 |\n\n<!-- end -->"));
    for (wrong, problem) in [
        (
            "<!-- other | claims --><!-- end -->",
            "no published results of `other`",
        ),
        (
            "<!-- small | Costs --><!-- end -->",
            "`small` has no table `Costs`",
        ),
        (
            "<!-- small | Cost | b | K --><!-- end -->",
            "no `small | Cost | b | K`",
        ),
        ("<!-- small | Cost | a | K -->4", "no `<!-- end -->` behind"),
    ] {
        assert!(
            fill_in(wrong, &tables).unwrap_err().starts_with(problem),
            "{wrong}"
        );
    }
}
