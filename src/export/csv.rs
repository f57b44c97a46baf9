//! Tables as comma-separated values.

use std::fs::File;
use std::io::{self, BufWriter};

use super::TableWriter;
use super::table::{Table, Values};
use crate::text::spreadsheet_cell;

/// Writes a CSV file with a header.
pub(super) struct CsvTable {
    writer: ::csv::Writer<BufWriter<File>>,
    has_header: bool,
}

impl CsvTable {
    pub(super) fn new(file: BufWriter<File>) -> Self {
        Self {
            writer: ::csv::Writer::from_writer(file),
            has_header: false,
        }
    }
}

impl TableWriter for CsvTable {
    fn write(&mut self, batch: Table) -> io::Result<()> {
        if !self.has_header {
            for column in &batch.columns {
                let name = spreadsheet_cell(&column.name);
                self.writer.write_field(name.as_bytes())?;
            }
            self.writer.write_record(None::<&[u8]>)?;
            self.has_header = true;
        }
        for row in 0..batch.len() {
            for column in &batch.columns {
                self.writer.write_field(cell(&column.values, row))?;
            }
            self.writer.write_record(None::<&[u8]>)?;
        }
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> io::Result<()> {
        self.writer.flush()
    }
}

/// Text of a value, with as many digits as are needed to read the same number back: also `NaN`, `inf` and
/// `-inf`. Empty if the value is missing.
fn cell(values: &Values, row: usize) -> String {
    match values {
        Values::Integers(values) => values[row].to_string(),
        Values::Singles(values) => values[row].map_or_else(String::new, |value| value.to_string()),
        Values::Doubles(values) => values[row].map_or_else(String::new, |value| value.to_string()),
        Values::Texts(values) => spreadsheet_cell(&values[row]).into_owned(),
    }
}
