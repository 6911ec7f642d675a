//! Tables of runs and time series, and their encodings as CSV and Parquet.
//!
//! The columns of runs are declared in [`crate::rows`]. Deterministic columns come first; those of
//! wall time begin with `wall_`. Lengths in metres, times in seconds.

use std::borrow::Cow;
use std::sync::Arc;

use msgs::printable;
use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::column::writer::ColumnWriter;
use parquet::data_type::ByteArray;
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;

use crate::columns::{Cells, Column, Values};
use crate::rows::{RunRecord, RunRow, Sample};

/// A table, column by column. A missing value is an empty field in CSV and null in Parquet.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Table {
    /// Columns of the same length.
    pub columns: Vec<Column>,
}

impl Values {
    fn len(&self) -> usize {
        match self {
            Self::Text(values) => values.len(),
            Self::Whole(values) => values.len(),
            Self::Number(values) => values.len(),
        }
    }

    /// A cell of CSV.
    fn field(&self, row: usize) -> String {
        match self {
            Self::Text(values) => values[row].as_deref().map(|text| csv_text(text).into_owned()),
            Self::Whole(values) => values[row].map(|value| value.to_string()),
            Self::Number(values) => values[row].map(|value| value.to_string()),
        }
        .unwrap_or_default()
    }
}

/// One row per run.
#[must_use]
pub fn runs(records: &[RunRecord]) -> Table {
    let rows: Vec<&RunRow> = records.iter().map(|record| &record.row).collect();
    Table { columns: RunRow::columns("", &rows) }
}

/// One row per sample of each run; `id` is that of the run.
#[must_use]
pub fn series(records: &[RunRecord]) -> Table {
    let samples: Vec<_> =
        records.iter().flat_map(|record| record.series.iter().map(|sample| (&record.row.id, sample))).collect();
    let columns = [
        column("id", &samples, |(id, _)| (*id).clone()),
        column("t_s", &samples, |(_, sample)| sample.t_s),
        column("explored", &samples, |(_, sample)| sample.explored),
        column("covered", &samples, |(_, sample)| sample.covered),
        column("believed_mean", &samples, |(_, sample)| sample.believed_mean),
        column("distance_m", &samples, |(_, sample)| sample.distance_m),
        column("message_bytes", &samples, |(_, sample)| sample.message_bytes),
        column("pairs_in_contact", &samples, |(_, sample)| sample.pairs_in_contact),
    ];
    // Only plans with base stations have this column.
    let known = column("known_at_base", &samples, |(_, sample)| sample.known_at_base);
    let known = known.into_iter().filter(|_| samples.iter().any(|(_, sample)| sample.known_at_base.is_some()));
    Table { columns: columns.into_iter().flatten().chain(known).collect() }
}

/// One row per agent and sample of each run.
#[must_use]
pub fn agents(records: &[RunRecord]) -> Table {
    let of_sample = |(record, sample): (&RunRecord, &Sample)| {
        let (id, t_s) = (record.row.id.clone(), sample.t_s);
        let numbered: Vec<_> = (0_u64..).zip(sample.agents.iter().copied()).collect();
        numbered.into_iter().map(move |(number, agent)| (id.clone(), t_s, number, agent))
    };
    let samples: Vec<_> = records
        .iter()
        .flat_map(|record| record.series.iter().map(move |sample| (record, sample)))
        .flat_map(of_sample)
        .collect();
    let columns = [
        column("id", &samples, |(id, ..)| id.clone()),
        column("t_s", &samples, |&(_, t_s, ..)| t_s),
        column("agent", &samples, |&(_, _, number, _)| number),
        column("explored", &samples, |(.., agent)| agent.explored),
        column("covered", &samples, |(.., agent)| agent.covered),
        column("believed", &samples, |(.., agent)| agent.believed),
        column("distance_m", &samples, |(.., agent)| agent.distance_m),
    ];
    Table { columns: columns.into_iter().flatten().collect() }
}

/// The columns of one value of each row.
pub fn column<R, V: Cells>(name: &str, rows: &[R], value: impl Fn(&R) -> V) -> Vec<Column> {
    let values: Vec<V> = rows.iter().map(value).collect();
    V::columns(name, &values.iter().collect::<Vec<_>>())
}

/// Encodes a table as CSV with a header. Numbers have the digits that round-trip.
///
/// # Errors
/// The message of the CSV writer.
pub fn csv(table: &Table) -> Result<Vec<u8>, String> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let rows = table.columns.first().map_or(0, |column| column.values.len());
    writer.write_record(table.columns.iter().map(|column| &column.name)).map_err(|error| error.to_string())?;
    for row in 0..rows {
        let fields = table.columns.iter().map(|column| column.values.field(row));
        writer.write_record(fields).map_err(|error| error.to_string())?;
    }
    writer.into_inner().map_err(|error| error.to_string())
}

/// A text of others as a cell of CSV: control characters are escaped, and what a spreadsheet would
/// take for a formula begins with an apostrophe.
#[must_use]
pub fn csv_text(text: &str) -> Cow<'_, str> {
    let line = printable::line(text);
    let is_formula = line.starts_with(['=', '+', '-', '@']) && line.parse::<f64>().is_err();
    if is_formula { Cow::Owned(format!("'{line}")) } else { line }
}

/// Encodes a table as a Parquet file.
///
/// # Errors
/// The message of the Parquet writer.
pub fn parquet(table: &Table) -> Result<Vec<u8>, String> {
    write_parquet(table).map_err(|error| error.to_string())
}

fn write_parquet(table: &Table) -> Result<Vec<u8>, ParquetError> {
    let mut fields = Vec::new();
    for column in &table.columns {
        let (kind, meaning) = match column.values {
            Values::Text(_) => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
            Values::Whole(_) => (Physical::INT64, Some(LogicalType::integer(64, false))),
            Values::Number(_) => (Physical::DOUBLE, None),
        };
        let field = Type::primitive_type_builder(&column.name, kind)
            .with_repetition(Repetition::OPTIONAL)
            .with_logical_type(meaning)
            .build()?;
        fields.push(Arc::new(field));
    }
    let schema = Arc::new(Type::group_type_builder("schema").with_fields(fields).build()?);
    let mut bytes = Vec::new();
    let mut file = SerializedFileWriter::new(&mut bytes, schema, Arc::new(WriterProperties::builder().build()))?;
    let mut group = file.next_row_group()?;
    for column in &table.columns {
        let mut writer = group.next_column()?.expect("the schema has a column for each");
        match (writer.untyped(), &column.values) {
            (ColumnWriter::ByteArrayColumnWriter(writer), Values::Text(values)) => {
                let present: Vec<ByteArray> = values.iter().flatten().map(|text| text.as_str().into()).collect();
                writer.write_batch(&present, Some(&levels(values)), None)?;
            }
            (ColumnWriter::Int64ColumnWriter(writer), Values::Whole(values)) => {
                let present: Vec<i64> = values.iter().flatten().map(|value| value.cast_signed()).collect();
                writer.write_batch(&present, Some(&levels(values)), None)?;
            }
            (ColumnWriter::DoubleColumnWriter(writer), Values::Number(values)) => {
                let present: Vec<f64> = values.iter().flatten().copied().collect();
                writer.write_batch(&present, Some(&levels(values)), None)?;
            }
            _ => unreachable!("the schema was made from the columns"),
        }
        writer.close()?;
    }
    group.close()?;
    file.close()?;
    Ok(bytes)
}

/// The definition levels of Parquet: 1 for a value, 0 for null.
fn levels<V>(values: &[Option<V>]) -> Vec<i16> {
    values.iter().map(|value| i16::from(value.is_some())).collect()
}

#[cfg(test)]
mod tests;
