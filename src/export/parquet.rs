//! Tables as Apache Parquet: one row group per batch, compressed with Snappy. The metadata of the file have
//! the units of columns as JSON, with the key `units`.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter};
use std::sync::Arc;

use parquet::basic::{Compression, LogicalType, Repetition, Type as PhysicalType};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, FloatType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::types::{Type, TypePtr};

use super::TableWriter;
use super::table::{Column, Table, Values};

/// Writes a Parquet file. The first batch determines the schema.
pub(super) struct ParquetTable {
    state: State,
}

enum State {
    /// Before the first batch.
    Empty(Option<BufWriter<File>>),
    Open(SerializedFileWriter<BufWriter<File>>),
}

impl ParquetTable {
    pub(super) fn new(file: BufWriter<File>) -> Self {
        Self {
            state: State::Empty(Some(file)),
        }
    }

    /// The writer, which is opened with the columns of `batch`.
    fn writer(
        &mut self,
        batch: &Table,
    ) -> Result<&mut SerializedFileWriter<BufWriter<File>>, ParquetError> {
        if let State::Empty(file) = &mut self.state {
            let file = file.take().expect("the file is taken once");
            let properties = WriterProperties::builder()
                .set_compression(Compression::SNAPPY)
                .set_key_value_metadata(Some(vec![units(batch)]));
            let properties = Arc::new(properties.build());
            self.state = State::Open(SerializedFileWriter::new(file, schema(batch)?, properties)?);
        }
        match &mut self.state {
            State::Open(writer) => Ok(writer),
            State::Empty(_) => unreachable!("the writer was opened above"),
        }
    }
}

impl TableWriter for ParquetTable {
    fn write(&mut self, batch: Table) -> io::Result<()> {
        self.write_group(&batch).map_err(into_io)
    }

    fn finish(mut self: Box<Self>) -> io::Result<()> {
        self.writer(&Table::default()).map_err(into_io)?;
        if let State::Open(writer) = self.state {
            writer.close().map_err(into_io)?;
        }
        Ok(())
    }
}

/// The error of the file itself, if it is one.
fn into_io(error: ParquetError) -> io::Error {
    match error {
        ParquetError::External(error) => match error.downcast::<io::Error>() {
            Ok(error) => *error,
            Err(error) => io::Error::other(error),
        },
        error => io::Error::other(error),
    }
}

impl ParquetTable {
    fn write_group(&mut self, batch: &Table) -> Result<(), ParquetError> {
        let mut group = self.writer(batch)?.next_row_group()?;
        for column in &batch.columns {
            let mut writer = group
                .next_column()?
                .expect("the schema has as many columns as each batch");
            write_column(&mut writer, &column.values)?;
            writer.close()?;
        }
        group.close()?;
        Ok(())
    }
}

/// The units of the columns that have one, by name: `{"x": "m"}`.
fn units(table: &Table) -> KeyValue {
    let units = table
        .columns
        .iter()
        .map(|column| (&column.name, &column.unit));
    let units: BTreeMap<_, _> = units.filter(|(_, unit)| !unit.is_empty()).collect();
    let json = serde_json::to_string(&units).expect("texts can be serialized");
    KeyValue::new("units".to_owned(), json)
}

fn schema(table: &Table) -> Result<TypePtr, ParquetError> {
    let fields: Result<Vec<TypePtr>, ParquetError> = table.columns.iter().map(field).collect();
    let schema = Type::group_type_builder("seedbed").with_fields(fields?);
    Ok(Arc::new(schema.build()?))
}

fn field(column: &Column) -> Result<TypePtr, ParquetError> {
    let (physical, repetition, logical) = match column.values {
        Values::Integers(_) => (PhysicalType::INT64, Repetition::REQUIRED, None),
        Values::Singles(_) => (PhysicalType::FLOAT, Repetition::OPTIONAL, None),
        Values::Doubles(_) => (PhysicalType::DOUBLE, Repetition::OPTIONAL, None),
        Values::Texts(_) => (
            PhysicalType::BYTE_ARRAY,
            Repetition::REQUIRED,
            Some(LogicalType::String),
        ),
    };
    let field = Type::primitive_type_builder(&column.name, physical)
        .with_repetition(repetition)
        .with_logical_type(logical);
    Ok(Arc::new(field.build()?))
}

fn write_column(
    writer: &mut SerializedColumnWriter<'_>,
    values: &Values,
) -> Result<(), ParquetError> {
    match values {
        Values::Integers(values) => {
            writer
                .typed::<Int64Type>()
                .write_batch(values, None, None)?;
        }
        Values::Singles(values) => {
            let (present, levels) = present(values);
            writer
                .typed::<FloatType>()
                .write_batch(&present, Some(&levels), None)?;
        }
        Values::Doubles(values) => {
            let (present, levels) = present(values);
            writer
                .typed::<DoubleType>()
                .write_batch(&present, Some(&levels), None)?;
        }
        Values::Texts(values) => {
            let texts: Vec<ByteArray> = values
                .iter()
                .map(|text| ByteArray::from(text.as_str()))
                .collect();
            writer
                .typed::<ByteArrayType>()
                .write_batch(&texts, None, None)?;
        }
    }
    Ok(())
}

/// The values that are not missing, and for each value 1 if it is present and 0 if it is missing.
fn present<T: Copy>(values: &[Option<T>]) -> (Vec<T>, Vec<i16>) {
    let levels = values.iter().map(|value| i16::from(value.is_some()));
    let present = values.iter().copied().flatten();
    (present.collect(), levels.collect())
}
