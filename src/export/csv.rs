//! Tables as comma-separated values.

use std::fs::File;
use std::io::{self, BufWriter};

use super::TableWriter;
use super::table::{Table, Values};

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
            let names = batch.columns.iter().map(|column| &column.name);
            self.writer.write_record(names)?;
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

/// Text of a value, with as many digits as are needed to read the same number back.
fn cell(values: &Values, row: usize) -> String {
    match values {
        Values::Integers(values) => values[row].to_string(),
        Values::Singles(values) if values[row].is_nan() => String::new(),
        Values::Singles(values) => values[row].to_string(),
        Values::Doubles(values) if values[row].is_nan() => String::new(),
        Values::Doubles(values) => values[row].to_string(),
        Values::Texts(values) => values[row].clone(),
    }
}
