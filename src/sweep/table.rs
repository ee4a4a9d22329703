//! Tables, row by row: CSV, and Parquet where the program is built with it.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use anyhow::{Context, Result};

use crate::host;
use crate::stats::csv_field;

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColumnKind {
    /// Whole numbers.
    Whole,
    /// Numbers. Those that are whole are written without a point.
    Number,
    /// Text.
    Text,
}

/// A field.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// Of a column of whole numbers.
    Whole(i64),
    /// Of a column of numbers.
    Number(f64),
    /// Of a column of text.
    Text(String),
    /// Nothing: the column does not apply to the row.
    Empty,
}

impl Cell {
    fn csv(&self) -> String {
        match self {
            Cell::Whole(value) => value.to_string(),
            Cell::Number(value) => number(*value),
            Cell::Text(text) => csv_field(text).into_owned(),
            Cell::Empty => String::new(),
        }
    }
}

/// A number as shortly as it reads back; whole ones without a point.
pub fn number(value: f64) -> String {
    // Above 2^53 not every whole number is one.
    if value.fract() == 0.0 && value.abs() < 9.0e15 { format!("{}", value as i64) } else { format!("{value}") }
}

/// The columns of a table, by name.
pub type Columns = [(String, ColumnKind)];

/// Takes rows.
pub struct Table<'t> {
    csv: &'t mut BufWriter<File>,
    #[cfg(feature = "parquet")]
    parquet: parquet_file::Rows<'t>,
}

impl Table<'_> {
    /// Adds a row, a cell per column.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn row(&mut self, cells: &[Cell]) -> Result<()> {
        let fields: Vec<String> = cells.iter().map(Cell::csv).collect();
        writeln!(self.csv, "{}", fields.join(","))?;
        #[cfg(feature = "parquet")]
        self.parquet.row(cells)?;
        Ok(())
    }
}

/// Writes `NAME.csv` and `NAME.parquet` in a folder; under these names they are complete.
///
/// # Errors
/// If one cannot be written, or `fill` fails.
pub fn write(folder: &Path, name: &str, columns: &Columns, fill: impl FnOnce(&mut Table<'_>) -> Result<()>) -> Result<()> {
    let path = folder.join(format!("{name}.csv"));
    let write = |csv: &mut BufWriter<File>| -> Result<()> {
        let header: Vec<String> = columns.iter().map(|(name, _)| Cell::Text(name.clone()).csv()).collect();
        writeln!(csv, "{}", header.join(","))?;
        #[cfg(not(feature = "parquet"))]
        return fill(&mut Table { csv });
        #[cfg(feature = "parquet")]
        {
            let path = folder.join(format!("{name}.parquet"));
            host::replace(&path, |file| -> Result<()> {
                let mut table = Table { csv, parquet: parquet_file::Rows::new(file, columns)? };
                fill(&mut table)?;
                table.parquet.end()
            })
            .with_context(|| format!("cannot write {}", path.display()))
        }
    };
    host::replace(&path, write).with_context(|| format!("cannot write {}", path.display()))
}

#[cfg(feature = "parquet")]
mod parquet_file {
    use std::fs::File;
    use std::io::BufWriter;
    use std::sync::Arc;

    use anyhow::{Result, bail};
    use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
    use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
    use parquet::file::properties::WriterProperties;
    use parquet::file::writer::SerializedFileWriter;
    use parquet::schema::types::Type;

    use super::{Cell, ColumnKind, Columns};

    /// Rows of a group: what is held before it is written.
    const GROUP: usize = 1 << 16;

    /// A column's part of a group: which rows have a value, and the values.
    struct Column {
        defined: Vec<i16>,
        values: Values,
    }

    enum Values {
        Whole(Vec<i64>),
        Number(Vec<f64>),
        Text(Vec<ByteArray>),
    }

    pub struct Rows<'f> {
        writer: SerializedFileWriter<&'f mut BufWriter<File>>,
        columns: Vec<Column>,
    }

    impl<'f> Rows<'f> {
        pub fn new(file: &'f mut BufWriter<File>, columns: &Columns) -> Result<Rows<'f>> {
            let mut fields = Vec::new();
            for (name, kind) in columns {
                let (physical, logical) = match kind {
                    ColumnKind::Whole => (Physical::INT64, None),
                    ColumnKind::Number => (Physical::DOUBLE, None),
                    ColumnKind::Text => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
                };
                let field = Type::primitive_type_builder(name, physical).with_repetition(Repetition::OPTIONAL);
                fields.push(Arc::new(field.with_logical_type(logical).build()?));
            }
            let schema = Arc::new(Type::group_type_builder("sweep").with_fields(fields).build()?);
            // Neither host nor library is in the file: the same rows are the same bytes.
            let properties = WriterProperties::builder().set_compression(Compression::SNAPPY).set_created_by("fillrate".into());
            let writer = SerializedFileWriter::new(file, schema, Arc::new(properties.build()))?;
            let column = |(_, kind): &(String, ColumnKind)| {
                let values = match kind {
                    ColumnKind::Whole => Values::Whole(Vec::new()),
                    ColumnKind::Number => Values::Number(Vec::new()),
                    ColumnKind::Text => Values::Text(Vec::new()),
                };
                Column { defined: Vec::new(), values }
            };
            Ok(Rows { writer, columns: columns.iter().map(column).collect() })
        }

        pub fn row(&mut self, cells: &[Cell]) -> Result<()> {
            if cells.len() != self.columns.len() {
                bail!("a row has {} cells for {} columns", cells.len(), self.columns.len());
            }
            for (column, cell) in self.columns.iter_mut().zip(cells) {
                column.defined.push(i16::from(*cell != Cell::Empty));
                match (&mut column.values, cell) {
                    (_, Cell::Empty) => {}
                    (Values::Whole(values), Cell::Whole(value)) => values.push(*value),
                    (Values::Number(values), Cell::Number(value)) => values.push(*value),
                    (Values::Number(values), Cell::Whole(value)) => values.push(*value as f64),
                    (Values::Text(values), Cell::Text(text)) => values.push(text.as_str().into()),
                    (_, cell) => bail!("{cell:?} is of another kind than its column"),
                }
            }
            if self.columns.first().is_some_and(|column| column.defined.len() >= GROUP) { self.group() } else { Ok(()) }
        }

        fn group(&mut self) -> Result<()> {
            let mut group = self.writer.next_row_group()?;
            for Column { defined, values } in &mut self.columns {
                let Some(mut column) = group.next_column()? else { bail!("the file has fewer columns than the table") };
                match values {
                    Values::Whole(values) => column.typed::<Int64Type>().write_batch(values, Some(defined), None)?,
                    Values::Number(values) => column.typed::<DoubleType>().write_batch(values, Some(defined), None)?,
                    Values::Text(values) => column.typed::<ByteArrayType>().write_batch(values, Some(defined), None)?,
                };
                column.close()?;
                defined.clear();
                match values {
                    Values::Whole(values) => values.clear(),
                    Values::Number(values) => values.clear(),
                    Values::Text(values) => values.clear(),
                }
            }
            group.close()?;
            Ok(())
        }

        pub fn end(mut self) -> Result<()> {
            if self.columns.first().is_some_and(|column| !column.defined.is_empty()) {
                self.group()?;
            }
            self.writer.close()?;
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(folder: &Path, rows: usize) {
        let columns =
            [("n".to_owned(), ColumnKind::Whole), ("x,y".to_owned(), ColumnKind::Number), ("t".to_owned(), ColumnKind::Text)];
        let fill = |table: &mut Table<'_>| {
            for at in 0..rows {
                let text = if at % 3 == 0 { Cell::Empty } else { Cell::Text(format!("\"{at}\",")) };
                table.row(&[Cell::Whole(at as i64), Cell::Number(at as f64 / 4.0), text])?;
            }
            Ok(())
        };
        write(folder, "t", &columns, fill).expect("written");
    }

    #[test]
    fn fields_are_quoted_where_they_must_be() {
        let home = tempfile::tempdir().expect("a folder");
        table(home.path(), 3);
        let csv = std::fs::read_to_string(home.path().join("t.csv")).expect("a table");
        assert_eq!(csv, "n,\"x,y\",t\n0,0,\n1,0.25,\"\"\"1\"\",\"\n2,0.5,\"\"\"2\"\",\"\n");
    }

    #[cfg(feature = "parquet")]
    #[test]
    fn parquet_reads_back_over_several_groups() {
        use parquet::file::reader::{FileReader, SerializedFileReader};
        use parquet::record::RowAccessor;

        let home = tempfile::tempdir().expect("a folder");
        let rows = (1 << 16) + 100;
        table(home.path(), rows);
        let bytes = std::fs::read(home.path().join("t.parquet")).expect("a table");
        table(home.path(), rows);
        assert_eq!(std::fs::read(home.path().join("t.parquet")).expect("a table"), bytes, "the same rows are the same bytes");
        let reader = SerializedFileReader::new(parquet_bytes(bytes)).expect("Parquet");
        assert_eq!(reader.num_row_groups(), 2);
        let mut count = 0;
        for (at, row) in reader.get_row_iter(None).expect("rows").enumerate() {
            let row = row.expect("a row");
            assert_eq!((row.get_long(0).expect("n"), row.get_double(1).expect("x")), (at as i64, at as f64 / 4.0));
            let text = if at % 3 == 0 { "null".to_owned() } else { format!("\"\"{at}\",\"") };
            assert_eq!(row.get_column_iter().nth(2).expect("t").1.to_string(), text);
            count += 1;
        }
        assert_eq!(count, rows);
    }

    #[cfg(feature = "parquet")]
    fn parquet_bytes(bytes: Vec<u8>) -> File {
        let mut file = tempfile::tempfile().expect("a file");
        file.write_all(&bytes).expect("written");
        file
    }
}
