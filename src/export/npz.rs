//! Tables as NumPy archives: one array per column.

use std::fs::File;
use std::io::{self, BufWriter, Cursor, Write};

use npyz::{AutoSerialize, DType, Serialize, WriteOptions, WriterBuilder};
use zip::write::SimpleFileOptions;

use super::TableWriter;
use super::table::{Table, Values};

/// Writes an `.npz` file. It contains the arrays one after the other, so that all batches are kept
/// until the end.
pub(super) struct NpzTable {
    file: BufWriter<File>,
    table: Table,
}

impl NpzTable {
    pub(super) fn new(file: BufWriter<File>) -> Self {
        Self {
            file,
            table: Table::default(),
        }
    }
}

impl TableWriter for NpzTable {
    fn write(&mut self, batch: Table) -> io::Result<()> {
        self.table.append(batch);
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> io::Result<()> {
        // In memory: on a full disk, `ZipWriter` would print an error of its own.
        let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
        // The same content gives the same bytes: the time of a file in the archive is constant.
        let options = SimpleFileOptions::default()
            .compression_method(zip::CompressionMethod::Deflated)
            .last_modified_time(zip::DateTime::default())
            .large_file(true);
        for column in self.table.columns {
            archive.start_file(format!("{}.npy", column.name), options)?;
            write_array(&mut archive, column.values)?;
        }
        let bytes = archive.finish()?.into_inner();
        self.file.write_all(&bytes)?;
        self.file.flush()
    }
}

fn write_array(file: &mut impl Write, values: Values) -> io::Result<()> {
    match values {
        Values::Integers(values) => write_numbers(file, &values),
        // Arrays have no missing numbers.
        Values::Singles(values) => {
            let values = values.into_iter().map(|value| value.unwrap_or(f32::NAN));
            write_numbers(file, &values.collect::<Vec<_>>())
        }
        Values::Doubles(values) => {
            let values = values.into_iter().map(|value| value.unwrap_or(f64::NAN));
            write_numbers(file, &values.collect::<Vec<_>>())
        }
        Values::Texts(values) => write_texts(file, &values),
    }
}

fn write_numbers<T: AutoSerialize + Copy>(file: &mut impl Write, values: &[T]) -> io::Result<()> {
    write_values(
        file,
        T::default_dtype(),
        values.len(),
        values.iter().copied(),
    )
}

/// Writes texts as an array of type `<Un`, where n is the length of the longest text.
fn write_texts(file: &mut impl Write, texts: &[String]) -> io::Result<()> {
    let lengths = texts.iter().map(|text| text.chars().count());
    let length = lengths.max().unwrap_or(0).max(1);
    let name = format!("<U{length}");
    let dtype = DType::Plain(name.parse().map_err(io::Error::other)?);
    write_values(file, dtype, texts.len(), texts.iter().cloned())
}

fn write_values<T: Serialize>(
    file: &mut impl Write,
    dtype: DType,
    length: usize,
    values: impl Iterator<Item = T>,
) -> io::Result<()> {
    let mut writer = WriteOptions::new()
        .dtype(dtype)
        .shape(&[length as u64])
        .writer(file)
        .begin_nd()?;
    writer.extend(values)?;
    writer.finish()
}
