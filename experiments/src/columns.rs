//! Rows whose fields are columns of a table: name, type and meaning of a metric are declared once.

use std::collections::{BTreeMap, BTreeSet};

use simulation::end_reason::EndReason;

use crate::rows::OracleRow;

/// A column of a table.
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

/// The declaration of a column, or of columns that are alike.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ColumnInfo {
    /// As in the tables; what varies is in angle brackets.
    pub name: &'static str,
    /// One sentence or more, with unit and range.
    pub meaning: &'static str,
}

/// A type whose values are cells of one column or of several.
pub trait Cells: Sized {
    /// The columns of a field with this name, which has these values in the rows of a table.
    fn columns(name: &str, values: &[&Self]) -> Vec<Column>;
}

/// Declares a struct with the columns of its fields, in their order: `Self::COLUMNS`, and
/// [`Cells`]. A field is `name: type = "meaning";`. Its column has its name, or that after `as`.
macro_rules! row {
    ($(#[$of_row:meta])* $row:ident {
        $($(#[$attribute:meta])* $field:ident $(as $name:literal)?: $type:ty = $meaning:literal;)*
    }) => {
        $(#[$of_row])*
        #[derive(Debug, Clone, Default, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        pub struct $row {
            $(#[doc = $meaning] $(#[$attribute])* pub $field: $type,)*
        }

        impl $row {
            /// Its columns.
            pub const COLUMNS: &'static [$crate::columns::ColumnInfo] =
                &[$($crate::columns::ColumnInfo { name: row!(@name $field $($name)?), meaning: $meaning }),*];
        }

        impl $crate::columns::Cells for $row {
            fn columns(name: &str, rows: &[&Self]) -> Vec<$crate::columns::Column> {
                let (prefix, _) = name.split_once('<').unwrap_or((name, ""));
                let mut columns = Vec::new();
                $(
                    let name = format!("{prefix}{}", row!(@name $field $($name)?));
                    let values: Vec<&$type> = rows.iter().map(|row| &row.$field).collect();
                    columns.extend(<$type as $crate::columns::Cells>::columns(&name, &values));
                )*
                columns
            }
        }
    };
    (@name $field:ident) => { stringify!($field) };
    (@name $field:ident $name:literal) => { $name };
}
pub(crate) use row;

/// One column with the name of its field.
macro_rules! one_column {
    ($($type:ty => $values:ident, $cell:expr;)*) => {$(
        impl Cells for $type {
            fn columns(name: &str, values: &[&Self]) -> Vec<Column> {
                let cell: fn(&Self) -> Option<_> = $cell;
                vec![Column { name: name.to_owned(), values: Values::$values(values.iter().map(|value| cell(value)).collect()) }]
            }
        }
    )*};
}

one_column! {
    String => Text, |text| Some(text.clone());
    Option<String> => Text, Option::clone;
    EndReason => Text, |reason| Some(reason.to_string());
    u64 => Whole, |value| Some(*value);
    u32 => Whole, |value| Some((*value).into());
    f64 => Number, |value| Some(*value);
    Option<f64> => Number, |value| *value;
    Option<u64> => Whole, |value| *value;
}

/// The values along x, y and z.
impl Cells for [u32; 3] {
    fn columns(name: &str, values: &[&Self]) -> Vec<Column> {
        let of = |(axis, name): (usize, &str)| {
            let values = values.iter().map(|value| Some(value[axis].into())).collect();
            Column { name: name.to_owned(), values: Values::Whole(values) }
        };
        name.split(", ").enumerate().map(of).collect()
    }
}

/// A column for each key, empty where a row lacks it.
impl Cells for BTreeMap<String, String> {
    fn columns(name: &str, values: &[&Self]) -> Vec<Column> {
        by_key(name, values, |of_key| Values::Text(of_key.map(|value| value.cloned()).collect()))
    }
}

/// A column for each key, 0 where a row lacks it.
impl Cells for BTreeMap<u8, u64> {
    fn columns(name: &str, values: &[&Self]) -> Vec<Column> {
        by_key(name, values, |of_key| Values::Whole(of_key.map(|value| Some(value.copied().unwrap_or(0))).collect()))
    }
}

fn by_key<K: Ord + std::fmt::Display, V>(
    name: &str,
    rows: &[&BTreeMap<K, V>],
    values: impl Fn(&mut dyn Iterator<Item = Option<&V>>) -> Values,
) -> Vec<Column> {
    let (before, _) = name.split_once('<').unwrap_or((name, ""));
    let keys: BTreeSet<&K> = rows.iter().flat_map(|row| row.keys()).collect();
    let of =
        |key: &K| Column { name: format!("{before}{key}"), values: values(&mut rows.iter().map(|row| row.get(key))) };
    keys.into_iter().map(of).collect()
}

/// No columns if no row has a value.
impl Cells for Option<OracleRow> {
    fn columns(_name: &str, values: &[&Self]) -> Vec<Column> {
        if values.iter().all(|value| value.is_none()) {
            return Vec::new();
        }
        type Of = fn(&OracleRow) -> Option<f64>;
        let times: [(&str, Of); 6] = [
            ("oracle_t90_s", |oracle| oracle.flown.t90_s),
            ("oracle_t99_s", |oracle| oracle.flown.t99_s),
            ("oracle_t100_s", |oracle| oracle.flown.t100_s),
            ("bound_t90_s", |oracle| oracle.bound.t90_s),
            ("bound_t99_s", |oracle| oracle.bound.t99_s),
            ("bound_t100_s", |oracle| oracle.bound.t100_s),
        ];
        let column = |(name, of): (&str, Of)| {
            let values = values.iter().map(|value| value.as_ref().and_then(of)).collect();
            Column { name: name.to_owned(), values: Values::Number(values) }
        };
        times.map(column).into()
    }
}
