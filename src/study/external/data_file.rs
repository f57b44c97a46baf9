//! Files with results of others: their contents, their hashes, and the rows of tables.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::storage::hashes::sha256;

use seedbed_input::limits::{MAX_TABLE_BYTES, read_bytes};
use seedbed_input::{InputError, Position, shown};

/// Mark at the beginning of a text in UTF-8, as spreadsheets write it.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// A file as it was when it was read.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FileHash {
    /// Path relative to the folder of the study.
    pub path: String,
    /// Number of bytes.
    pub bytes: u64,
    /// SHA-256 of the bytes, in hexadecimal digits.
    pub sha256: String,
}

/// A file with its contents.
pub(super) struct DataFile {
    pub(super) path: PathBuf,
    pub(super) bytes: Vec<u8>,
    pub(super) hash: FileHash,
}

impl DataFile {
    /// Reads a file. Its hash has the path relative to `folder`.
    pub(super) fn read(folder: &Path, path: &Path) -> Result<Self, InputError> {
        let bytes = read_bytes(path, MAX_TABLE_BYTES)
            .map_err(|error| file_error(path, error.to_string()))?;
        Ok(Self {
            path: path.to_owned(),
            hash: FileHash {
                path: name_of(folder, path),
                bytes: bytes.len() as u64,
                sha256: sha256(&bytes),
            },
            bytes,
        })
    }

    /// An error about the whole file.
    pub(super) fn error(&self, message: impl Into<String>) -> InputError {
        file_error(&self.path, message)
    }

    /// The complete lines of a text file, and whether there is an incomplete one behind them, as in a
    /// file that is still written to.
    pub(super) fn complete_lines(&self) -> (&[u8], bool) {
        let bytes = self.bytes.strip_prefix(BYTE_ORDER_MARK);
        let bytes = bytes.unwrap_or(&self.bytes);
        let end = bytes.iter().rposition(|&byte| byte == b'\n');
        let (lines, rest) = bytes.split_at(end.map_or(0, |end| end + 1));
        (lines, !rest.trim_ascii().is_empty())
    }
}

/// An error about a whole file or folder.
pub(super) fn file_error(path: &Path, message: impl Into<String>) -> InputError {
    InputError::about(path.display().to_string(), message)
}

/// Path relative to the folder of the study, with `/` between names.
pub(super) fn name_of(folder: &Path, path: &Path) -> String {
    let relative = path.strip_prefix(folder).unwrap_or(path);
    relative.to_string_lossy().replace('\\', "/")
}

/// A warning that the last line of a file was ignored.
pub(super) fn incomplete_line_warning(file: &DataFile) -> String {
    format!(
        "{}: the last line has no line break and is ignored, because it may be incomplete",
        file.hash.path
    )
}

/// A table with a header in a CSV file.
pub(super) struct Rows<'a> {
    file: &'a DataFile,
    /// Number of lines before the header.
    lines_before: u64,
    header: Vec<String>,
    text: &'a [u8],
    reader: csv::Reader<&'a [u8]>,
    record: csv::ByteRecord,
}

/// Index of a column of [`Rows`].
#[derive(Clone, Copy)]
pub(super) struct Column(usize);

impl<'a> Rows<'a> {
    /// The rows of `text`, which are the lines of a file after the first `lines_before`.
    pub(super) fn new(
        file: &'a DataFile,
        text: &'a [u8],
        lines_before: u64,
    ) -> Result<Self, InputError> {
        check_quotes(file, text, lines_before)?;
        let mut reader = csv::ReaderBuilder::new()
            .flexible(true)
            .trim(csv::Trim::All)
            .from_reader(text);
        let header = reader
            .byte_headers()
            .map_err(|error| file.error(error.to_string()))?;
        let header: Vec<String> = header
            .iter()
            .map(|name| String::from_utf8_lossy(name).into_owned())
            .collect();
        if header.is_empty() {
            return Err(file
                .error("expected a header with the names of the columns, found no complete line"));
        }
        Ok(Self {
            file,
            lines_before,
            header,
            text,
            reader,
            record: csv::ByteRecord::new(),
        })
    }

    /// Names of the columns.
    pub(super) fn header(&self) -> impl Iterator<Item = &str> + Clone {
        self.header.iter().map(String::as_str)
    }

    /// The only column with this name; `None` if there is none.
    pub(super) fn find(&self, name: &str) -> Result<Option<Column>, InputError> {
        let mut columns = (0..self.header.len()).filter(|&column| self.header[column] == name);
        let column = columns.next();
        if columns.next().is_some() {
            return Err(self
                .file
                .error(format!("two columns are named `{name}`; expected one")));
        }
        Ok(column.map(Column))
    }

    /// The column with this name.
    pub(super) fn column(&self, name: &str) -> Result<Column, InputError> {
        self.find(name)?.ok_or_else(|| {
            let names: Vec<&str> = self.header().collect();
            self.file.error(format!(
                "expected a column `{name}`, found only {}",
                seedbed_input::quoted_list(names)
            ))
        })
    }

    /// Goes to the next row; `false` at the end.
    pub(super) fn advance(&mut self) -> Result<bool, InputError> {
        let is_row = self.reader.read_byte_record(&mut self.record);
        let is_row = is_row.map_err(|error| self.file.error(error.to_string()))?;
        let (found, expected) = (self.record.len(), self.header.len());
        if is_row && found != expected {
            let last = Column(found.saturating_sub(1));
            return Err(self.error(
                last,
                format!("expected {expected} values, as in the header, found {found}"),
            ));
        }
        Ok(is_row)
    }

    /// The bytes in a column of this row.
    pub(super) fn bytes(&self, column: Column) -> &[u8] {
        &self.record[column.0]
    }

    /// The text in a column of this row.
    pub(super) fn text(&self, column: Column) -> String {
        String::from_utf8_lossy(&self.record[column.0]).into_owned()
    }

    /// The finite number in a column of this row.
    pub(super) fn number(&self, column: Column) -> Result<f64, InputError> {
        let text = std::str::from_utf8(&self.record[column.0]);
        let number = text.ok().and_then(|text| text.parse::<f64>().ok());
        number.filter(|number| number.is_finite()).ok_or_else(|| {
            self.error(
                column,
                format!(
                    "expected a finite number, found `{}`",
                    shown(&self.text(column))
                ),
            )
        })
    }

    /// The whole number in a column of this row. It may have decimals that are zeros.
    pub(super) fn count(&self, column: Column) -> Result<u64, InputError> {
        /// Whole numbers up to this one are exact in double precision.
        const MAX: f64 = (1_u64 << 53) as f64;
        let text = std::str::from_utf8(&self.record[column.0]).unwrap_or_default();
        let whole = || {
            let number = text.parse::<f64>().ok()?;
            (number.fract() == 0.0 && (0.0..=MAX).contains(&number)).then_some(number as u64)
        };
        text.parse().ok().or_else(whole).ok_or_else(|| {
            self.error(
                column,
                format!(
                    "expected a whole number of at least 0, found `{}`",
                    shown(&self.text(column))
                ),
            )
        })
    }

    /// `earlier` plus the whole number in a column of this row.
    pub(super) fn sum(&self, earlier: u64, column: Column) -> Result<u64, InputError> {
        let sum = earlier.checked_add(self.count(column)?);
        sum.ok_or_else(|| {
            let message = format!(
                "expected a sum of at most {} with the earlier {earlier}, found `{}`",
                u64::MAX,
                shown(&self.text(column))
            );
            self.error(column, message)
        })
    }

    /// The text in a column of this row, which names something.
    pub(super) fn name(&self, column: Column) -> Result<&[u8], InputError> {
        let name = self.bytes(column);
        if name.is_empty() {
            return Err(self.error(column, "expected a name, found none".to_owned()));
        }
        Ok(name)
    }

    /// An error about a value of this row.
    pub(super) fn error(&self, column: Column, message: String) -> InputError {
        let record = self.record.position().map_or(0, csv::Position::byte) as usize;
        // The place of a row is that of the empty lines before it.
        let text = self.text.get(record..).unwrap_or_default();
        let is_text = |byte: &u8| !b"\r\n".contains(byte);
        let row = record + text.iter().position(is_text).unwrap_or(0);
        let place = row + start_of_field(&self.text[row..], column.0);
        InputError {
            field: self.header.get(column.0).cloned().unwrap_or_default(),
            ..error_at(self.file, self.text, place, self.lines_before, message)
        }
    }
}

/// Whether a text in CSV is in a field, and in quotation marks.
#[derive(Clone, Copy, Default, PartialEq)]
enum Quotes {
    #[default]
    BeforeField,
    Plain,
    Open,
    Closed,
}

impl Quotes {
    fn after(self, byte: u8) -> Self {
        match (self, byte) {
            (Self::Open, b'"') => Self::Closed,
            (Self::Open, _) | (Self::BeforeField | Self::Closed, b'"') => Self::Open,
            (_, b',' | b'\r' | b'\n') => Self::BeforeField,
            _ => Self::Plain,
        }
    }
}

/// Checks that every quotation mark is closed: otherwise all rows behind it would be one value.
fn check_quotes(file: &DataFile, text: &[u8], lines_before: u64) -> Result<(), InputError> {
    let (mut quotes, mut opened) = (Quotes::default(), 0);
    for (place, &byte) in text.iter().enumerate() {
        let next = quotes.after(byte);
        if (quotes, next) == (Quotes::BeforeField, Quotes::Open) {
            opened = place;
        }
        quotes = next;
    }
    if quotes == Quotes::Open {
        let message = "expected a second quotation mark, found the end of the file";
        return Err(error_at(
            file,
            text,
            opened,
            lines_before,
            message.to_owned(),
        ));
    }
    Ok(())
}

/// Number of bytes in a row before the field with this index, and before what is not blank in it.
fn start_of_field(row: &[u8], field: usize) -> usize {
    let (mut quotes, mut fields) = (Quotes::default(), 0);
    for (place, &byte) in row.iter().enumerate() {
        if fields == field && !b" \t".contains(&byte) {
            return place;
        }
        quotes = quotes.after(byte);
        fields += usize::from(byte == b',' && quotes == Quotes::BeforeField);
    }
    row.len()
}

/// An error about a place in the lines of a file after the first `lines_before`, given by the number of
/// bytes before it.
fn error_at(
    file: &DataFile,
    text: &[u8],
    place: usize,
    lines_before: u64,
    message: String,
) -> InputError {
    let before = &text[..place];
    let start = before.iter().rposition(|&byte| byte == b'\n');
    let start = start.map_or(0, |line_break| line_break + 1);
    let line = text[start..].split(|&byte| byte == b'\n').next();
    let lines = before.split(|&byte| byte == b'\n').count();
    InputError {
        position: Some(Position {
            line: lines_before as usize + lines,
            column: String::from_utf8_lossy(&before[start..]).chars().count() + 1,
            text: String::from_utf8_lossy(line.unwrap_or_default())
                .trim_end()
                .to_owned(),
        }),
        ..file.error(message)
    }
}

/// Files that existed at a registration.
pub(crate) struct SeenFiles {
    /// Their hashes, by their numbers of bytes.
    by_length: BTreeMap<u64, Vec<String>>,
}

impl SeenFiles {
    pub(crate) fn new<'a>(files: impl IntoIterator<Item = &'a FileHash>) -> Self {
        let mut by_length: BTreeMap<u64, Vec<String>> = BTreeMap::new();
        // An empty file is the beginning of every file, and shows nothing.
        for file in files.into_iter().filter(|file| file.bytes > 0) {
            by_length
                .entry(file.bytes)
                .or_default()
                .push(file.sha256.clone());
        }
        Self { by_length }
    }

    /// Whether a file is one of these or begins with all bytes of one of them.
    pub(crate) fn include(&self, file: &FileHash) -> bool {
        let same_length = self.by_length.get(&file.bytes);
        same_length.is_some_and(|hashes| hashes.contains(&file.sha256))
    }

    /// Whether the contents of a file begin with all bytes of one of these files.
    pub(crate) fn include_beginning_of(&self, bytes: &[u8]) -> bool {
        let mut hash = Sha256::new();
        let mut hashed = 0;
        for (&length, hashes) in &self.by_length {
            let Some(next) = bytes.get(hashed..length as usize) else {
                return false;
            };
            hash.update(next);
            hashed = length as usize;
            if hashes.contains(&format!("{:x}", hash.clone().finalize())) {
                return true;
            }
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(text: &str) -> DataFile {
        DataFile {
            path: "a.csv".into(),
            bytes: text.as_bytes().to_vec(),
            hash: FileHash {
                path: "a.csv".to_owned(),
                bytes: text.len() as u64,
                sha256: sha256(text),
            },
        }
    }

    #[test]
    fn only_complete_lines_are_read() {
        assert_eq!(file("a\nb\n").complete_lines(), (&b"a\nb\n"[..], false));
        assert_eq!(file("a\nb").complete_lines(), (&b"a\n"[..], true));
        assert_eq!(file("a").complete_lines(), (&b""[..], true));
        assert_eq!(file("").complete_lines(), (&b""[..], false));
    }

    fn rows_error(text: &str, read: impl Fn(&Rows<'_>) -> Option<InputError>) -> String {
        let file = file(text);
        let error = (|| {
            let mut rows = Rows::new(&file, file.complete_lines().0, 0)?;
            while rows.advance()? {
                if let Some(error) = read(&rows) {
                    return Err(error);
                }
            }
            Ok(())
        })();
        let error = error.unwrap_err();
        let position = error.position.unwrap();
        format!(
            "{}:{} {}: {}",
            position.line, position.column, position.text, error.message
        )
    }

    /// Lines and columns as in the file, whatever the reader skips.
    #[test]
    fn errors_have_the_places_of_the_file() {
        let number = |rows: &Rows<'_>| rows.number(Column(1)).err();
        let found = "expected a finite number, found";
        for (text, expected) in [
            ("a,b\n1,x\n", format!("2:3 1,x: {found} `x`")),
            ("a,b\n1,2\n\n\n1,x\n", format!("5:3 1,x: {found} `x`")),
            ("a,b\r\n1,2\r\n\r\n1,x\r\n", format!("4:3 1,x: {found} `x`")),
            ("a,b\n ä ,  x\n", format!("2:7  ä ,  x: {found} `x`")),
            ("a,b\n\"1,\n2\",x\n", format!("3:4 2\",x: {found} `x`")),
            ("a,b\n1,\n", format!("2:3 1,: {found} ``")),
        ] {
            assert_eq!(rows_error(text, number), expected, "{text:?}");
        }
        // What a process that was killed, or a second one, has left.
        let zeros = format!("a,b\n1,{}\n", "\0".repeat(10_000));
        let error = rows_error(&zeros, number);
        let shown = "\0".repeat(30);
        assert!(error.ends_with(&format!("{found} `{shown}…`")), "{error:?}");
        assert_eq!(
            rows_error("return\n1\n\n\n,\n", |_| None),
            "5:2 ,: expected 1 values, as in the header, found 2"
        );
    }

    #[test]
    fn quotation_marks_are_closed() {
        let message = "expected a second quotation mark, found the end of the file";
        for (text, place) in [
            ("return,run\n1,\"a\n2,a\n3,b\n", "2:3 1,\"a"),
            ("return,\"run\n1,a\n", "1:8 return,\"run"),
            ("r,n\n1,\"a\"\"\n", "2:3 1,\"a\"\""),
        ] {
            assert_eq!(rows_error(text, |_| None), format!("{place}: {message}"));
        }
        for text in [
            "r,n\n1,\"a\n b\"\n",
            "r,n\n1,a\"\n",
            "r,n\n1,\"a\"\"b\"\n",
            "r,n\n1,\"\"\n",
        ] {
            let file = file(text);
            assert!(Rows::new(&file, text.as_bytes(), 0).is_ok(), "{text}");
        }
    }

    /// Files that existed, their copies, and files that continue them; the hash is that of the bytes.
    #[test]
    fn continuations_of_seen_files_are_found() {
        let (short, long) = (file("ab"), file("abcd"));
        let seen = SeenFiles::new([&short.hash, &long.hash, &file("").hash]);
        assert_eq!(
            short.hash.sha256,
            "fb8e20fc2e4c3f248c60c39bd652f3c1347298bb977b8b4d5903b85055620603"
        );
        assert!(seen.include(&file("ab").hash) && !seen.include(&file("ax").hash));
        for text in ["ab", "abx", "abcd", "abcde"] {
            assert!(seen.include_beginning_of(text.as_bytes()), "{text}");
        }
        for text in ["", "a", "ax", "xab", "axcd"] {
            assert!(!seen.include_beginning_of(text.as_bytes()), "{text}");
        }
    }
}
