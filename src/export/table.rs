//! A table in columns.

use std::path::Path;

use serde::Serialize;

use crate::record::table::{TableError, read_complete_rows};

/// Columns of equal length.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Table {
    pub columns: Vec<Column>,
}

/// A named column.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Column {
    pub name: String,
    /// Unit; empty for pure numbers and if it is not known.
    pub unit: String,
    pub values: Values,
}

/// Values of a column. A missing number is `None`, which is not the same as NaN: the action in the last
/// state of an episode is missing, and a value that was recorded as NaN is NaN.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Values {
    Integers(Vec<i64>),
    Singles(Vec<Option<f32>>),
    Doubles(Vec<Option<f64>>),
    Texts(Vec<String>),
}

impl Table {
    /// A table with the columns of `episodes.csv` or `rounds.csv`.
    pub(super) fn of_rows<R: Serialize>(rows: &[R]) -> Self {
        let mut writer = ::csv::Writer::from_writer(Vec::new());
        let serialized = rows.iter().try_for_each(|row| writer.serialize(row));
        let bytes = writer.into_inner().expect("memory can be written");
        let text = String::from_utf8_lossy(&bytes);
        let table = serialized.and_then(|()| parse_csv(&text));
        table.expect("rows of numbers are written to memory and read back")
    }

    /// Number of rows.
    pub(super) fn len(&self) -> usize {
        self.columns.first().map_or(0, |column| column.values.len())
    }

    /// Adds the rows of a table with the same columns.
    pub(super) fn append(&mut self, other: Self) {
        if self.columns.is_empty() {
            *self = other;
            return;
        }
        for (column, more) in self.columns.iter_mut().zip(other.columns) {
            column.values.append(more.values);
        }
    }
}

impl Values {
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Integers(values) => values.len(),
            Self::Singles(values) => values.len(),
            Self::Doubles(values) => values.len(),
            Self::Texts(values) => values.len(),
        }
    }

    fn append(&mut self, other: Self) {
        match (self, other) {
            (Self::Integers(values), Self::Integers(more)) => values.extend(more),
            (Self::Singles(values), Self::Singles(more)) => values.extend(more),
            (Self::Doubles(values), Self::Doubles(more)) => values.extend(more),
            (Self::Texts(values), Self::Texts(more)) => values.extend(more),
            _ => unreachable!("batches of a table have the same types"),
        }
    }

    /// Integers if all cells are integers, numbers if all cells are numbers or empty, otherwise
    /// texts.
    fn parse(cells: Vec<String>) -> Self {
        if let Ok(integers) = cells.iter().map(|cell| cell.parse()).collect() {
            return Self::Integers(integers);
        }
        let number = |cell: &String| match cell.as_str() {
            "" => Ok(None),
            cell => cell.parse().map(Some),
        };
        match cells.iter().map(number).collect() {
            Ok(numbers) => Self::Doubles(numbers),
            Err(_) => Self::Texts(cells),
        }
    }
}

/// Reads a table with a header. An incomplete last row is ignored.
pub(super) fn read_csv(path: &Path) -> Result<Table, TableError> {
    let text = read_complete_rows(path)?;
    parse_csv(&text).map_err(|error| TableError {
        path: path.to_owned(),
        reason: error.to_string(),
    })
}

fn parse_csv(text: &str) -> Result<Table, ::csv::Error> {
    let mut reader = ::csv::Reader::from_reader(text.as_bytes());
    let header = reader.headers()?.clone();
    let mut cells: Vec<Vec<String>> = vec![Vec::new(); header.len()];
    for row in reader.records() {
        for (column, cell) in cells.iter_mut().zip(&row?) {
            column.push(cell.to_owned());
        }
    }
    let columns = header.iter().zip(cells).map(|(name, cells)| Column {
        name: name.to_owned(),
        unit: String::new(),
        values: Values::parse(cells),
    });
    Ok(Table {
        columns: columns.collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_follow_from_all_cells_of_a_column() {
        let parse = |cells: &[&str]| Values::parse(cells.iter().map(|&cell| cell.into()).collect());
        assert_eq!(parse(&["1", "-2"]), Values::Integers(vec![1, -2]));
        let doubles = |values: &[f64]| Values::Doubles(values.iter().copied().map(Some).collect());
        assert_eq!(parse(&["1", "2.5"]), doubles(&[1.0, 2.5]));
        assert_eq!(parse(&["1", ""]), Values::Doubles(vec![Some(1.0), None]));
        assert!(
            matches!(parse(&["1", "NaN"]), Values::Doubles(values) if values[1].unwrap().is_nan())
        );
        assert_eq!(
            parse(&["1", "x"]),
            Values::Texts(vec!["1".into(), "x".into()])
        );
    }
}
