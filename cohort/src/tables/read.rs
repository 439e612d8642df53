//! Reading tables back from Parquet: by column, every text once.

use std::{collections::HashMap, fs::File, path::Path};

use glioscope_core::Progress;
use parquet::{
    column::reader::{ColumnReader, ColumnReaderImpl},
    data_type::DataType,
    errors::ParquetError,
    file::reader::{FileReader, SerializedFileReader},
};

use super::{Kind, Type};
use crate::CohortError;

/// Rows that are read at a time.
const BATCH: usize = 1 << 13;
/// The most rows of a table: some hundred for each of a hundred thousand cases.
const MAX_ROWS: i64 = 1 << 28;
/// Stands for a text that isn't there.
const NO_TEXT: u32 = u32::MAX;
const EXPECTED: &str = "a table of glioscope cohort IN OUT group";

/// Texts by number, each once.
#[derive(Debug, Default)]
pub(crate) struct Names {
    list: Vec<String>,
    numbers: HashMap<String, u32>,
}

impl Names {
    /// The number of a text, a new one where it has none.
    fn add(&mut self, text: &str) -> u32 {
        if let Some(number) = self.numbers.get(text) {
            return *number;
        }
        let number = self.list.len() as u32;
        self.list.push(text.to_owned());
        self.numbers.insert(text.to_owned(), number);
        number
    }

    /// The number of a text; `None` where no table has it.
    pub(crate) fn number(&self, text: &str) -> Option<u32> {
        self.numbers.get(text).copied()
    }

    /// The text of a number; `None` where it stands for none.
    pub(crate) fn text(&self, number: u32) -> Option<&str> {
        self.list.get(number as usize).map(String::as_str)
    }
}

/// The fields of a column.
#[derive(Debug)]
pub(crate) enum Values {
    /// Numbers of texts.
    Texts(Vec<u32>),
    /// Numbers, whole ones and 0 and 1 for false and true, too; NaN where there is none.
    Numbers(Vec<f64>),
}

/// A table by columns, as many as its kind has.
#[derive(Debug)]
pub(crate) struct Table {
    /// Its columns.
    columns: Vec<Values>,
    /// Number of its rows.
    pub(crate) rows: usize,
}

impl Table {
    /// A table without rows.
    pub(crate) fn empty(kind: &Kind) -> Self {
        let columns = kind.columns.iter().map(|column| match column.kind {
            Type::Text => Values::Texts(Vec::new()),
            Type::Whole | Type::Number | Type::Bool => Values::Numbers(Vec::new()),
        });
        Self { columns: columns.collect(), rows: 0 }
    }

    /// The column at a position.
    pub(crate) fn column(&self, position: usize) -> Option<&Values> {
        self.columns.get(position)
    }

    /// The number of the text in a row; one that stands for none where there is none.
    pub(crate) fn text(&self, position: usize, row: usize) -> u32 {
        match self.columns.get(position) {
            Some(Values::Texts(texts)) => texts.get(row).copied().unwrap_or(NO_TEXT),
            _ => NO_TEXT,
        }
    }

    /// The number in a row; NaN where there is none.
    pub(crate) fn number(&self, position: usize, row: usize) -> f64 {
        match self.columns.get(position) {
            Some(Values::Numbers(numbers)) => numbers.get(row).copied().unwrap_or(f64::NAN),
            _ => f64::NAN,
        }
    }
}

/// The table of a kind at `path`. A column that the file lacks has no values.
///
/// # Errors
/// [`CohortError`]: not readable, no Parquet, a column of another type, too many rows, or cancelled.
pub(crate) fn read(
    kind: &Kind,
    path: &Path,
    names: &mut Names,
    progress: &Progress,
) -> Result<Table, CohortError> {
    let file = File::open(path).map_err(|e| CohortError::io(path, &e, EXPECTED))?;
    let bytes = file.metadata().map_or(0, |metadata| metadata.len());
    let wrong =
        |e: ParquetError| CohortError::at(path, format!("no Parquet that can be read ({e})"), EXPECTED);
    let reader = SerializedFileReader::new(file).map_err(wrong)?;
    let metadata = reader.metadata().file_metadata();
    if metadata.num_rows() > MAX_ROWS {
        let found = format!("{} rows", metadata.num_rows());
        return Err(CohortError::at(path, found, format!("at most {MAX_ROWS}")));
    }
    let schema = metadata.schema_descr();
    let position = |name: &str| {
        schema.columns().iter().position(|column| column.name() == name && column.max_rep_level() == 0)
    };
    let positions: Vec<Option<usize>> = kind.columns.iter().map(|column| position(column.name)).collect();
    let mut table = Table::empty(kind);
    let groups = reader.num_row_groups();
    progress.expect(bytes);
    for group in 0..groups {
        let group = reader.get_row_group(group).map_err(wrong)?;
        let rows = usize::try_from(group.metadata().num_rows()).unwrap_or_default();
        table.rows += rows;
        for ((column, place), values) in kind.columns.iter().zip(&positions).zip(&mut table.columns) {
            progress.check()?;
            let found = place.map(|place| group.get_column_reader(place)).transpose().map_err(wrong)?;
            let done = match (values, found) {
                (Values::Texts(texts), Some(ColumnReader::ByteArrayColumnReader(reader))) => {
                    texts_of(reader, names, texts)
                }
                (Values::Numbers(numbers), Some(ColumnReader::DoubleColumnReader(reader))) => {
                    numbers_of(reader, numbers, |value| *value)
                }
                (Values::Numbers(numbers), Some(ColumnReader::Int64ColumnReader(reader))) => {
                    numbers_of(reader, numbers, |value| *value as f64)
                }
                (Values::Numbers(numbers), Some(ColumnReader::BoolColumnReader(reader))) => {
                    numbers_of(reader, numbers, |value| f64::from(u8::from(*value)))
                }
                (_, None) => Ok(()),
                (_, Some(_)) => {
                    let found = format!("a column {} of another type", column.name);
                    return Err(CohortError::at(path, found, EXPECTED));
                }
            };
            done.map_err(wrong)?;
        }
        for values in &mut table.columns {
            match values {
                Values::Texts(texts) => texts.resize(table.rows, NO_TEXT),
                Values::Numbers(numbers) => numbers.resize(table.rows, f64::NAN),
            }
        }
        progress.advance(bytes / groups as u64)?;
    }
    Ok(table)
}

fn texts_of(
    reader: ColumnReaderImpl<parquet::data_type::ByteArrayType>,
    names: &mut Names,
    texts: &mut Vec<u32>,
) -> Result<(), ParquetError> {
    // Neighbours are mostly equal.
    let mut last: Option<(Vec<u8>, u32)> = None;
    for_each(reader, |value| {
        let Some(value) = value else {
            texts.push(NO_TEXT);
            return Ok(());
        };
        let number = match &last {
            Some((bytes, number)) if bytes == value.data() => *number,
            _ => {
                let number = names.add(value.as_utf8()?);
                last = Some((value.data().to_vec(), number));
                number
            }
        };
        texts.push(number);
        Ok(())
    })
}

fn numbers_of<T: DataType>(
    reader: ColumnReaderImpl<T>,
    numbers: &mut Vec<f64>,
    number: impl Fn(&T::T) -> f64,
) -> Result<(), ParquetError> {
    for_each(reader, |value| {
        numbers.push(value.map_or(f64::NAN, &number));
        Ok(())
    })
}

/// Calls `take` with each field of a column; `None` for null.
fn for_each<T: DataType>(
    mut reader: ColumnReaderImpl<T>,
    mut take: impl FnMut(Option<&T::T>) -> Result<(), ParquetError>,
) -> Result<(), ParquetError> {
    let (mut levels, mut values) = (Vec::new(), Vec::new());
    loop {
        levels.clear();
        values.clear();
        let (records, _, _) = reader.read_records(BATCH, Some(&mut levels), None, &mut values)?;
        if records == 0 {
            return Ok(());
        }
        let mut present = values.iter();
        for record in 0..records {
            // A column without nulls has no levels.
            let is_there = levels.get(record).is_none_or(|level| *level > 0);
            take(if is_there { present.next() } else { None })?;
        }
    }
}
