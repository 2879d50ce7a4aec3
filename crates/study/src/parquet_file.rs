//! All draws as a Parquet file: one row group, plain values, no compression.

use std::io::Write;
use std::sync::Arc;

use metalith_core::{Error, Result};
use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::{Type, TypePtr};

use crate::columns::{Column, Values};

/// Write columns as one file.
///
/// # Errors
/// If the writer of the file fails.
pub(crate) fn write(columns: &[Column], to: &mut (impl Write + Send)) -> Result<()> {
    let told = |error: ParquetError| {
        Error::refused(
            "study/parquet-failed",
            format!("the Parquet file cannot be written: {error}"),
            "name a file that ends in .csv, .json or .jsonl",
        )
    };
    fields(columns)
        .and_then(|fields| {
            let schema = Type::group_type_builder("draws").with_fields(fields).build()?;
            let properties = WriterProperties::builder()
                .set_compression(Compression::UNCOMPRESSED)
                .set_created_by(format!("metalith {}", env!("CARGO_PKG_VERSION")));
            let mut file = SerializedFileWriter::new(to, Arc::new(schema), Arc::new(properties.build()))?;
            let mut group = file.next_row_group()?;
            for column in columns {
                write_column(&mut group, &column.values)?;
            }
            group.close()?;
            file.close().map(|_| ())
        })
        .map_err(told)
}

fn fields(columns: &[Column]) -> Result<Vec<TypePtr>, ParquetError> {
    let field = |column: &Column| {
        let (physical, logical, repetition) = match &column.values {
            Values::Whole(_) => (Physical::INT64, None, Repetition::REQUIRED),
            Values::Number(_) => (Physical::DOUBLE, None, Repetition::OPTIONAL),
            Values::Switch(_) => (Physical::BOOLEAN, None, Repetition::REQUIRED),
            Values::Text(_) => (Physical::BYTE_ARRAY, Some(LogicalType::String), Repetition::REQUIRED),
        };
        let field = Type::primitive_type_builder(&column.name, physical)
            .with_logical_type(logical)
            .with_repetition(repetition);
        field.build().map(Arc::new)
    };
    columns.iter().map(field).collect()
}

fn write_column<W: Write + Send>(
    group: &mut SerializedRowGroupWriter<'_, W>,
    values: &Values,
) -> Result<(), ParquetError> {
    let mut column = group
        .next_column()?
        .ok_or_else(|| ParquetError::General("a column is missing".into()))?;
    match values {
        Values::Whole(values) => {
            let values: Vec<i64> = values.iter().map(|v| *v as i64).collect();
            column.typed::<Int64Type>().write_batch(&values, None, None)?;
        }
        Values::Number(values) => {
            let there: Vec<f64> = values.iter().copied().flatten().collect();
            let levels: Vec<i16> = values.iter().map(|v| i16::from(v.is_some())).collect();
            column.typed::<DoubleType>().write_batch(&there, Some(&levels), None)?;
        }
        Values::Switch(values) => {
            column.typed::<BoolType>().write_batch(values, None, None)?;
        }
        Values::Text(values) => {
            let values: Vec<ByteArray> = values.iter().map(|v| ByteArray::from(v.as_str())).collect();
            column.typed::<ByteArrayType>().write_batch(&values, None, None)?;
        }
    }
    column.close()
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytes::Bytes;
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::Field;

    #[test]
    fn what_is_written_is_read() {
        let column = |name: &str, values| Column {
            name: name.into(),
            values,
        };
        let columns = [
            column("draw", Values::Whole(vec![0, 1, 2])),
            column("cell.pitch_nm", Values::Number(vec![Some(350.0), None, Some(-0.1)])),
            column(
                "mapping.basis",
                Values::Text(vec!["all_powers".into(), "b \u{e9}".into(), String::new()]),
            ),
            column("passed", Values::Switch(vec![true, false, true])),
        ];
        let mut bytes = Vec::new();
        write(&columns, &mut bytes).unwrap();
        let mut again = Vec::new();
        write(&columns, &mut again).unwrap();
        assert_eq!(bytes, again, "the same draws give the same bytes");
        let file = SerializedFileReader::new(Bytes::from(bytes)).unwrap();
        let rows: Vec<Vec<(String, Field)>> = file
            .get_row_iter(None)
            .unwrap()
            .map(|row| row.unwrap().into_columns())
            .collect();
        let row = |draw, number, text: &str, passed| {
            vec![
                ("draw".to_owned(), Field::Long(draw)),
                ("cell.pitch_nm".to_owned(), number),
                ("mapping.basis".to_owned(), Field::Str(text.into())),
                ("passed".to_owned(), Field::Bool(passed)),
            ]
        };
        assert_eq!(
            rows,
            [
                row(0, Field::Double(350.0), "all_powers", true),
                row(1, Field::Null, "b \u{e9}", false),
                row(2, Field::Double(-0.1), "", true),
            ]
        );
    }
}
