//! Writing tables as Parquet and CSV at once, row group by row group, the same bytes for the same rows.

use std::{
    fs::{File, OpenOptions},
    io::BufWriter,
    path::{Path, PathBuf},
    sync::Arc,
};

use csv::{Terminator, WriterBuilder};
use glioscope_core::csv::text;
use parquet::{
    basic::{LogicalType, Repetition, Type as Physical},
    data_type::{BoolType, ByteArray, ByteArrayType, DataType, DoubleType, Int64Type},
    errors::ParquetError,
    file::{
        properties::WriterProperties,
        writer::{SerializedFileWriter, SerializedRowGroupWriter},
    },
    schema::types::Type as SchemaType,
};

use super::{Field, Kind, Type};
use crate::CohortError;

/// Rows that are kept in memory before they are written.
const GROUP_ROWS: usize = 1 << 15;
const WRITABLE: &str = "a place that can be written";

/// Writes one table.
pub(crate) struct Writer {
    kind: &'static Kind,
    path: PathBuf,
    csv: csv::Writer<BufWriter<File>>,
    parquet: SerializedFileWriter<File>,
    rows: Vec<Vec<Field>>,
    written: u64,
}

impl Writer {
    /// The files `NAME.parquet` and `NAME.csv` in `folder`, which has neither.
    ///
    /// # Errors
    /// [`CohortError`] where they can't be written.
    pub(crate) fn new(kind: &'static Kind, folder: &Path, version: &str) -> Result<Self, CohortError> {
        let create = |ending: &str| {
            let path = folder.join(format!("{}.{ending}", kind.name));
            let file = OpenOptions::new().create_new(true).write(true).open(&path);
            file.map_err(|e| CohortError::io(&path, &e, WRITABLE))
        };
        let path = folder.join(format!("{}.parquet", kind.name));
        let columns = kind.columns.iter().map(|column| {
            let (physical, logical) = match column.kind {
                Type::Text => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
                Type::Whole => (Physical::INT64, None),
                Type::Number => (Physical::DOUBLE, None),
                Type::Bool => (Physical::BOOLEAN, None),
            };
            let of = SchemaType::primitive_type_builder(column.name, physical)
                .with_repetition(Repetition::OPTIONAL);
            of.with_logical_type(logical).build().map(Arc::new)
        });
        let failed = |e: ParquetError| failed(&path, &e);
        let columns = columns.collect::<Result<Vec<_>, _>>().map_err(failed)?;
        let schema =
            SchemaType::group_type_builder(kind.name).with_fields(columns).build().map_err(failed)?;
        let properties = WriterProperties::builder().set_created_by(format!("glioscope {version}")).build();
        let parquet = SerializedFileWriter::new(create("parquet")?, Arc::new(schema), Arc::new(properties))
            .map_err(failed)?;
        let mut csv =
            WriterBuilder::new().terminator(Terminator::CRLF).from_writer(BufWriter::new(create("csv")?));
        csv.write_record(kind.columns.iter().map(|column| column.name)).map_err(|e| failed_csv(&path, &e))?;
        Ok(Self { kind, path, csv, parquet, rows: Vec::new(), written: 0 })
    }

    /// Adds a row with a field for every column.
    ///
    /// # Errors
    /// [`CohortError`] where it can't be written.
    pub(crate) fn row(&mut self, row: Vec<Field>) -> Result<(), CohortError> {
        debug_assert_eq!(row.len(), self.kind.columns.len(), "{}", self.kind.name);
        let fields = row.iter().map(csv_field);
        self.csv.write_record(fields).map_err(|e| failed_csv(&self.path, &e))?;
        self.rows.push(row);
        if self.rows.len() == GROUP_ROWS {
            self.write_group()?;
        }
        Ok(())
    }

    /// Finishes both files and returns the number of rows.
    ///
    /// # Errors
    /// [`CohortError`] where they can't be written.
    pub(crate) fn close(mut self) -> Result<u64, CohortError> {
        if !self.rows.is_empty() {
            self.write_group()?;
        }
        self.csv.flush().map_err(|e| CohortError::io(&self.path, &e, WRITABLE))?;
        self.parquet.close().map_err(|e| failed(&self.path, &e))?;
        Ok(self.written)
    }

    fn write_group(&mut self) -> Result<(), CohortError> {
        let rows = std::mem::take(&mut self.rows);
        self.written += rows.len() as u64;
        let write = || -> Result<(), ParquetError> {
            let mut group = self.parquet.next_row_group()?;
            for (n, column) in self.kind.columns.iter().enumerate() {
                let fields = || rows.iter().map(|row| row.get(n).unwrap_or(&Field::Null));
                match column.kind {
                    Type::Text => write_column::<ByteArrayType>(&mut group, fields(), |field| match field {
                        Field::Text(text) => Some(ByteArray::from(text.as_bytes().to_vec())),
                        _ => None,
                    }),
                    Type::Whole => write_column::<Int64Type>(&mut group, fields(), |field| match field {
                        Field::Whole(number) => Some(*number),
                        _ => None,
                    }),
                    Type::Number => write_column::<DoubleType>(&mut group, fields(), |field| match field {
                        Field::Number(number) => Some(*number),
                        _ => None,
                    }),
                    Type::Bool => write_column::<BoolType>(&mut group, fields(), |field| match field {
                        Field::Bool(is) => Some(*is),
                        _ => None,
                    }),
                }?;
            }
            group.close().map(drop)
        };
        let mut write = write;
        write().map_err(|e| failed(&self.path, &e))
    }
}

/// Writes the fields of a column: those that `of` gives, others as null.
fn write_column<'a, T: DataType>(
    group: &mut SerializedRowGroupWriter<'_, File>,
    fields: impl Iterator<Item = &'a Field>,
    of: impl Fn(&Field) -> Option<T::T>,
) -> Result<(), ParquetError> {
    let Some(mut column) = group.next_column()? else {
        return Err(ParquetError::General("a column more than the schema has".into()));
    };
    let values: Vec<Option<T::T>> = fields.map(of).collect();
    let levels: Vec<i16> = values.iter().map(|value| i16::from(value.is_some())).collect();
    let values: Vec<T::T> = values.into_iter().flatten().collect();
    column.typed::<T>().write_batch(&values, Some(&levels), None)?;
    column.close()
}

fn csv_field(field: &Field) -> String {
    match field {
        Field::Null => String::new(),
        Field::Text(content) => text(content),
        Field::Whole(number) => number.to_string(),
        // inf, -inf: what R, pandas and DuckDB read.
        Field::Number(number) => number.to_string(),
        Field::Bool(is) => is.to_string(),
    }
}

fn failed(path: &Path, e: &ParquetError) -> CohortError {
    CohortError::at(path, format!("writing failed: {e}"), WRITABLE)
}

fn failed_csv(path: &Path, e: &csv::Error) -> CohortError {
    CohortError::at(&path.with_extension("csv"), format!("writing failed: {e}"), WRITABLE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use parquet::{
        file::reader::{FileReader, SerializedFileReader},
        record::RowAccessor,
    };

    static KIND: Kind = Kind {
        name: "things",
        about: "",
        columns: &[
            crate::Column { name: "name", kind: Type::Text, unit: "", about: "" },
            crate::Column { name: "n", kind: Type::Whole, unit: "", about: "" },
            crate::Column { name: "x_mm", kind: Type::Number, unit: "mm", about: "" },
            crate::Column { name: "is", kind: Type::Bool, unit: "", about: "" },
        ],
    };

    fn rows() -> impl Iterator<Item = Vec<Field>> {
        // More than a row group.
        (0..GROUP_ROWS as i64 + 10).map(|n| match n % 3 {
            0 => vec![
                Field::Text(format!("ü, {n}")),
                Field::Whole(n),
                Field::Number(n as f64 / 7.0),
                Field::Bool(n % 2 == 0),
            ],
            1 => vec![Field::Text(String::new()), Field::Null, Field::Number(f64::INFINITY), Field::Null],
            _ => vec![Field::Null; 4],
        })
    }

    fn written(folder: &Path) -> [Vec<u8>; 2] {
        let mut writer = Writer::new(&KIND, folder, "1.2.3").unwrap();
        rows().for_each(|row| writer.row(row).unwrap());
        assert_eq!(writer.close().unwrap(), GROUP_ROWS as u64 + 10);
        ["parquet", "csv"].map(|ending| std::fs::read(folder.join(format!("things.{ending}"))).unwrap())
    }

    #[test]
    fn rows_come_back_and_bytes_are_the_same_each_time() {
        let folders = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
        let [first, second] = [&folders[0], &folders[1]].map(|folder| written(folder.path()));
        assert!(first == second);
        let file = File::open(folders[0].path().join("things.parquet")).unwrap();
        let reader = SerializedFileReader::new(file).unwrap();
        assert_eq!(reader.metadata().num_row_groups(), 2);
        let mut count = 0;
        for (found, row) in reader.get_row_iter(None).unwrap().zip(rows()) {
            let found = found.unwrap();
            match &row[0] {
                Field::Text(text) => assert_eq!(found.get_string(0).unwrap(), text),
                _ => assert!(found.get_string(0).is_err()),
            }
            match row[1] {
                Field::Whole(n) => assert_eq!(found.get_long(1).unwrap(), n),
                _ => assert!(found.get_long(1).is_err()),
            }
            match row[2] {
                Field::Number(x) => assert_eq!(found.get_double(2).unwrap(), x),
                _ => assert!(found.get_double(2).is_err()),
            }
            match row[3] {
                Field::Bool(is) => assert_eq!(found.get_bool(3).unwrap(), is),
                _ => assert!(found.get_bool(3).is_err()),
            }
            count += 1;
        }
        assert_eq!(count, GROUP_ROWS + 10);
        let csv = String::from_utf8(first[1].clone()).unwrap();
        assert!(csv.starts_with(
            "name,n,x_mm,is\r\n\"ü, 0\",0,0,true\r\n,,inf,\r\n,,,\r\n\"ü, 3\",3,0.42857142857142855,false\r\n"
        ));
    }
}
