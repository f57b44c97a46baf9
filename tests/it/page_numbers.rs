//! Numbers and tables of pages are those of published results.
//!
//! Beside a page with numbers from studies, `PAGE.numbers.csv` lists them in the page's order: the text before the number on its line,
//! the number, and the study, the section of its tables (`claims` for `claims.md`), the row and the column, each by its beginning.
//! The column `effect` of claims is the beginning of `found`, without the values of both cells.
//!
//! A whole table stands in the page behind a comment `<!-- STUDY | SECTION -->`, and ends with `<!-- end -->`.
//!
//! With `UPDATE_EXPECT=1` pages and their lists are rewritten. To add a number, write `??` into the page and into the list.

use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::published::{published_folders, subfolders};
use super::util::REPOSITORY;

const END: &str = "<!-- end -->";

/// How much of the text before a number is listed with it, in characters.
const LENGTH_OF_CONTEXT: usize = 30;

#[test]
fn numbers_in_documents_are_those_of_published_tables() {
    let tables = PublishedTables(published_folders());
    for page in documents() {
        let list = page.with_extension("numbers.csv");
        let fail = |problem: String| -> String { panic!("{}: {problem}", page.display()) };
        let text = with_tables(&fs::read_to_string(&page).unwrap(), &tables).unwrap_or_else(fail);
        if !list.is_file() {
            expect_test::expect_file![page].assert_eq(&text);
            continue;
        }
        let listed = read_list(&fs::read_to_string(&list).unwrap());
        let (text, listed) = match with_numbers(&text, &listed, &tables) {
            Ok(filled) => filled,
            Err(problem) => panic!("{}: {problem}", list.display()),
        };
        expect_test::expect_file![page].assert_eq(&text);
        expect_test::expect_file![list].assert_eq(&write_list(&listed));
    }
}

/// Pages that may have numbers of tables.
fn documents() -> Vec<PathBuf> {
    let repository = Path::new(REPOSITORY);
    let mut documents = vec![repository.join("README.md")];
    let folders = [
        vec![repository.join("docs")],
        subfolders(&repository.join("scenarios")),
    ];
    for folder in folders.concat() {
        let entries = fs::read_dir(folder).unwrap();
        let paths = entries.map(|entry| entry.unwrap().path());
        documents.extend(paths.filter(|path| path.extension().is_some_and(|found| found == "md")));
    }
    documents.sort();
    documents
}

/// One number of a page.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct PageNumber {
    before: String,
    number: String,
    study: String,
    table: String,
    row: String,
    column: String,
}

fn read_list(text: &str) -> Vec<PageNumber> {
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    reader.deserialize().map(Result::unwrap).collect()
}

fn write_list(numbers: &[PageNumber]) -> String {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for number in numbers {
        writer.serialize(number).unwrap();
    }
    String::from_utf8(writer.into_inner().unwrap()).unwrap()
}

/// The page and its list with the present numbers of tables. Fails if a listed number is not where its list says, at the first one.
fn with_numbers(
    page: &str,
    listed: &[PageNumber],
    tables: &PublishedTables,
) -> Result<(String, Vec<PageNumber>), String> {
    let mut filled = String::new();
    let mut rest = page;
    let mut numbers = Vec::new();
    for entry in listed {
        let there = format!("{}{}", entry.before, entry.number);
        let (before, after) = rest.split_once(&there).ok_or_else(|| {
            format!("no `{there}` in the page behind the number before it; the list has the page's order")
        })?;
        if continues_a_number(after) {
            return Err(format!("`{there}` goes on with more digits in the page"));
        }
        let before = format!("{before}{}", entry.before);
        let number = tables.cell(entry)?;
        numbers.push(PageNumber {
            before: end_of_line(&before),
            number: number.clone(),
            ..entry.clone()
        });
        filled += &(before + &number);
        rest = after;
    }
    Ok((filled + rest, numbers))
}

fn continues_a_number(text: &str) -> bool {
    let text = text.trim_start_matches(['.', ',']);
    text.starts_with(|first: char| first.is_ascii_digit())
}

/// The end of the last line of the text between two numbers.
fn end_of_line(text: &str) -> String {
    let line = text.rsplit('\n').next().unwrap_or_default();
    let left_out = line.chars().count().saturating_sub(LENGTH_OF_CONTEXT);
    line.chars().skip(left_out).collect()
}

/// The page with the present contents of its whole tables.
fn with_tables(page: &str, tables: &PublishedTables) -> Result<String, String> {
    let mut filled = String::new();
    let mut rest = page;
    while let Some((before, reference, after)) = next_table(rest) {
        let (_, behind) = after
            .split_once(END)
            .ok_or_else(|| format!("no `{END}` behind `{reference}`"))?;
        let (study, section) = reference.split_once(" | ").unwrap_or((reference, ""));
        let table = tables.table(study, section)?.join("\n");
        filled += &format!("{before}<!-- {reference} -->\n\n{table}\n\n{END}");
        rest = behind;
    }
    Ok(filled + rest)
}

/// The text before the next comment that names a table, the comment, and the text behind.
fn next_table(text: &str) -> Option<(&str, &str, &str)> {
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
    fn cell(&self, number: &PageNumber) -> Result<String, String> {
        let table = self.table(&number.study, &number.table)?;
        cell(&table, &number.row, &number.column).ok_or_else(|| {
            let PageNumber {
                study,
                table,
                row,
                column,
                ..
            } = number;
            format!("no row `{row}` or no column `{column}` in the table `{table}` of `{study}`")
        })
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

/// A folder with one published study `small`.
fn small_study() -> (tempfile::TempDir, PublishedTables) {
    let folder = tempfile::tempdir().unwrap();
    let study = folder.path().join("small");
    fs::create_dir(&study).unwrap();
    let tables =
        "# T\n\n## Cost of all\n\n| cell | K |\n|---|---|\n| a, b | 5 |\n| a | 4 |\n\n## n\n";
    fs::write(study.join("tables.md"), tables).unwrap();
    let claims =
        "| claim | n | found |\n|---|---|---|\n| more | 7 | −2 (−3 to −1), 4 against 6 |\n";
    fs::write(study.join("claims.md"), claims).unwrap();
    (folder, PublishedTables(vec![study]))
}

#[test]
fn numbers_are_replaced_where_their_list_says() {
    let (_folder, tables) = small_study();
    let list = "before,number,study,table,row,column\n\
        K is ,5,small,Cost,a,K\n\", effect \",?,small,claims,more,effect\n";
    let (page, listed) =
        with_numbers("5 cells\nK is 5, effect ?.\n", &read_list(list), &tables).unwrap();
    assert_eq!(page, "5 cells\nK is 4, effect −2 (−3 to −1).\n");
    assert_eq!(
        write_list(&listed),
        "before,number,study,table,row,column\n\
        K is ,4,small,Cost,a,K\n\", effect \",−2 (−3 to −1),small,claims,more,effect\n"
    );
    // In the page's order only, each once, and only what tables have.
    let problem = |page: &str, list: &[PageNumber]| with_numbers(page, list, &tables).unwrap_err();
    assert!(
        problem("effect ?, K is 5", &read_list(list)).starts_with("no `, effect ?` in the page")
    );
    assert_eq!(
        problem("K is 4.5", &listed[..1]),
        "`K is 4` goes on with more digits in the page"
    );
    let unknown_row = PageNumber {
        row: "c".to_owned(),
        ..listed[0].clone()
    };
    assert_eq!(
        problem("K is 4", &[unknown_row]),
        "no row `c` or no column `K` in the table `Cost` of `small`"
    );
}

#[test]
fn tables_are_replaced() {
    let (_folder, tables) = small_study();
    let table = with_tables(
        "<!-- note --> <!-- small | claims -->old<!-- end -->",
        &tables,
    );
    let table = table.unwrap();
    assert!(table.starts_with("<!-- note --> <!-- small | claims -->\n\n| claim | n | found |\n"));
    assert!(table.ends_with("4 against 6 |\n\n<!-- end -->"));
    for (wrong, problem) in [
        (
            "<!-- other | claims --><!-- end -->",
            "no published results of `other`",
        ),
        (
            "<!-- small | Costs --><!-- end -->",
            "`small` has no table `Costs`",
        ),
        ("<!-- small | claims -->4", "no `<!-- end -->` behind"),
    ] {
        assert!(
            with_tables(wrong, &tables)
                .unwrap_err()
                .starts_with(problem),
            "{wrong}"
        );
    }
}
