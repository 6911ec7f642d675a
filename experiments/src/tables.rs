//! Tables of runs and time series, and their encodings as CSV and Parquet.
//!
//! Deterministic columns come first; those of wall time begin with `wall_`. An axis is a column
//! `axis.<key>`, the bytes of a kind of agent message are `message_bytes_kind_<kind>`. Lengths in
//! metres, times in seconds.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::sync::Arc;

use msgs::printable;
use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::column::writer::ColumnWriter;
use parquet::data_type::ByteArray;
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;

use crate::rows::{OracleRow, RunRecord, Sample};

/// A table, column by column. A missing value is an empty field in CSV and null in Parquet.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Table {
    /// Columns of the same length.
    pub columns: Vec<Column>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    pub name: String,
    pub values: Values,
}

/// Values of one type; `None` is missing.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    Text(Vec<Option<String>>),
    Whole(Vec<Option<u64>>),
    Number(Vec<Option<f64>>),
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
    let mut table = Builder::new(records);
    table.text("id", |record| record.row.id.clone());
    table.text("build", |record| record.row.build.clone());
    table.text("controller", |record| record.row.controller.clone());
    table.whole("seed", |record| record.row.seed);
    for (axis, name) in ["size_x", "size_y", "size_z"].into_iter().enumerate() {
        table.whole(name, move |record| record.row.size[axis].into());
    }
    table.whole("agents", |record| record.row.agents.into());
    for axis in records.iter().flat_map(|record| record.row.axes.keys()).collect::<BTreeSet<_>>() {
        table.some_text(&format!("axis.{axis}"), |record| record.row.axes.get(axis).cloned());
    }
    table.number("duration_s", |record| record.row.duration_s);
    table.number("end_s", |record| record.row.end_s);
    table.text("reason", |record| record.row.reason.to_string());
    table.whole("free_cells", |record| record.row.free_cells);
    table.number("explored", |record| record.row.explored);
    table.some_number("explored_m3", |record| record.row.explored_m3);
    table.some_number("attainable", |record| record.row.attainable);
    table.number("covered", |record| record.row.covered);
    table.number("believed_mean", |record| record.row.believed_mean);
    table.number("believed_min", |record| record.row.believed_min);
    table.some_number("t50_s", |record| record.row.t50_s);
    table.some_number("t90_s", |record| record.row.t90_s);
    table.some_number("t99_s", |record| record.row.t99_s);
    table.some_number("t99_9_s", |record| record.row.t99_9_s);
    table.some_number("t100_s", |record| record.row.t100_s);
    table.number("area_under_explored", |record| record.row.area_under_explored);
    table.number("distance_m", |record| record.row.distance_m);
    table.number("distance_max_m", |record| record.row.distance_max_m);
    table.number("redundancy", |record| record.row.redundancy);
    table.some_number("redundancy_known", |record| record.row.redundancy_known);
    table.some_number("redundancy_unknown", |record| record.row.redundancy_unknown);
    table.some_number("redundancy_first_minute", |record| record.row.redundancy_first_minute);
    table.number("exploring_s", |record| record.row.exploring_s);
    table.number("relocating_s", |record| record.row.relocating_s);
    table.number("carrying_s", |record| record.row.carrying_s);
    table.number("waiting_s", |record| record.row.waiting_s);
    table.number("imbalance", |record| record.row.imbalance);
    table.number("contact_share", |record| record.row.contact_share);
    table.whole("messages", |record| record.row.messages);
    table.whole("message_bytes", |record| record.row.message_bytes);
    for kind in records.iter().flat_map(|record| record.row.bytes_by_kind.keys()).collect::<BTreeSet<_>>() {
        let bytes = move |record: &RunRecord| record.row.bytes_by_kind.get(kind).copied().unwrap_or(0);
        table.whole(&format!("message_bytes_kind_{kind}"), bytes);
    }
    table.number("staleness", |record| record.row.staleness);
    table.whole("decisions", |record| record.row.decisions);
    table.whole("collisions", |record| record.row.collisions);
    table.whole("search_failures", |record| record.row.search_failures);
    table.whole("refusals", |record| record.row.refusals);
    table.text("digest", |record| record.row.digest.clone());
    if records.iter().any(|record| record.row.oracle.is_some()) {
        type Of = fn(&OracleRow) -> Option<f64>;
        let columns: [(&str, Of); 6] = [
            ("oracle_t90_s", |oracle| oracle.flown.t90_s),
            ("oracle_t99_s", |oracle| oracle.flown.t99_s),
            ("oracle_t100_s", |oracle| oracle.flown.t100_s),
            ("bound_t90_s", |oracle| oracle.bound.t90_s),
            ("bound_t99_s", |oracle| oracle.bound.t99_s),
            ("bound_t100_s", |oracle| oracle.bound.t100_s),
        ];
        for (name, of) in columns {
            table.some_number(name, move |record| record.row.oracle.as_ref().and_then(of));
        }
    }
    table.number("wall_s", |record| record.row.wall.wall_s);
    table.number("wall_real_time_factor", |record| record.row.wall.real_time_factor);
    table.some_number("wall_decision_p50_us", |record| record.row.wall.decision_p50_us);
    table.some_number("wall_decision_p95_us", |record| record.row.wall.decision_p95_us);
    table.some_number("wall_decision_p99_us", |record| record.row.wall.decision_p99_us);
    table.text("wall_machine", |record| record.row.wall.machine.clone());
    table.done
}

/// One row per sample of each run; `id` is that of the run.
#[must_use]
pub fn series(records: &[RunRecord]) -> Table {
    let samples: Vec<_> =
        records.iter().flat_map(|record| record.series.iter().map(|sample| (&record.row.id, sample))).collect();
    let mut table = Builder::new(&samples);
    table.text("id", |(id, _)| (*id).clone());
    table.number("t_s", |(_, sample)| sample.t_s);
    table.number("explored", |(_, sample)| sample.explored);
    table.number("covered", |(_, sample)| sample.covered);
    table.number("believed_mean", |(_, sample)| sample.believed_mean);
    table.number("distance_m", |(_, sample)| sample.distance_m);
    table.whole("message_bytes", |(_, sample)| sample.message_bytes);
    table.whole("pairs_in_contact", |(_, sample)| sample.pairs_in_contact.into());
    table.done
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
    let mut table = Builder::new(&samples);
    table.text("id", |(id, ..)| id.clone());
    table.number("t_s", |&(_, t_s, ..)| t_s);
    table.whole("agent", |&(_, _, number, _)| number);
    table.number("explored", |(.., agent)| agent.explored);
    table.number("covered", |(.., agent)| agent.covered);
    table.number("believed", |(.., agent)| agent.believed);
    table.number("distance_m", |(.., agent)| agent.distance_m);
    table.done
}

/// Builds a table column by column.
struct Builder<'a, R> {
    rows: &'a [R],
    done: Table,
}

impl<'a, R> Builder<'a, R> {
    fn new(rows: &'a [R]) -> Self {
        Self { rows, done: Table::default() }
    }

    fn add(&mut self, name: &str, values: Values) {
        self.done.columns.push(Column { name: name.to_owned(), values });
    }

    fn text(&mut self, name: &str, value: impl Fn(&R) -> String) {
        self.some_text(name, |row| Some(value(row)));
    }

    fn some_text(&mut self, name: &str, value: impl Fn(&R) -> Option<String>) {
        self.add(name, Values::Text(self.rows.iter().map(value).collect()));
    }

    fn whole(&mut self, name: &str, value: impl Fn(&R) -> u64) {
        self.add(name, Values::Whole(self.rows.iter().map(|row| Some(value(row))).collect()));
    }

    fn number(&mut self, name: &str, value: impl Fn(&R) -> f64) {
        self.some_number(name, |row| Some(value(row)));
    }

    fn some_number(&mut self, name: &str, value: impl Fn(&R) -> Option<f64>) {
        self.add(name, Values::Number(self.rows.iter().map(value).collect()));
    }
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
