use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::RowAccessor;

use super::*;

fn table() -> Table {
    let column = |name: &str, values| Column { name: name.to_owned(), values };
    Table {
        columns: vec![
            column("axis.agents.controller", Values::Text(vec![Some("a, \"b\"".to_owned()), None])),
            column("seed", Values::Whole(vec![Some(u64::MAX), Some(2)])),
            column("t90_s", Values::Number(vec![None, Some(0.1)])),
        ],
    }
}

#[test]
fn csv_quotes_only_if_needed_and_leaves_missing_values_empty() {
    let text = String::from_utf8(csv(&table()).unwrap()).unwrap();
    assert_eq!(text, "axis.agents.controller,seed,t90_s\n\"a, \"\"b\"\"\",18446744073709551615,\n,2,0.1\n");
}

#[test]
fn parquet_round_trips() {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), parquet(&table()).unwrap()).unwrap();
    let reader = SerializedFileReader::new(file.reopen().unwrap()).unwrap();
    let rows: Vec<_> = reader.get_row_iter(None).unwrap().map(Result::unwrap).collect();
    assert_eq!(rows.len(), 2);
    assert_eq!(rows[0].get_string(0).unwrap(), "a, \"b\"");
    assert_eq!((rows[0].get_ulong(1).unwrap(), rows[1].get_double(2).unwrap()), (u64::MAX, 0.1));
    assert!(rows[1].get_string(0).is_err() && rows[0].get_double(2).is_err());
    assert_eq!(rows[0].get_column_iter().next().unwrap().0, "axis.agents.controller");
}

#[test]
fn tables_without_runs_have_columns() {
    for table in [runs(&[]), series(&[]), agents(&[])] {
        assert!(String::from_utf8(csv(&table).unwrap()).unwrap().starts_with("id,"));
        assert!(!parquet(&table).unwrap().is_empty());
    }
}

#[test]
fn cells_of_others_are_no_formulas_and_steer_no_terminal() {
    for (text, cell) in [
        ("=cmd|'/C calc'!A0", "'=cmd|'/C calc'!A0"),
        ("+1+cmd", "'+1+cmd"),
        ("-2+3", "'-2+3"),
        ("@SUM(A1)", "'@SUM(A1)"),
        ("\t=1", "\\t=1"),
        ("\u{1b}[2J", "\\u{1b}[2J"),
        ("-1.5", "-1.5"),
        ("+3", "+3"),
        ("lvd (visit_radius_m = 2.0)", "lvd (visit_radius_m = 2.0)"),
        ("", ""),
    ] {
        assert_eq!(csv_text(text), cell);
    }
    let column = Column { name: "axis.variant".to_owned(), values: Values::Text(vec![Some("=1+1".to_owned())]) };
    assert_eq!(csv(&Table { columns: vec![column] }).unwrap(), b"axis.variant\n'=1+1\n");
}
