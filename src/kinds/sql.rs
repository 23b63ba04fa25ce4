//! Questions in SQL whose tables are Parquet files, answered by polars: `trodden sql`.
//!
//! Arrow goes in and comes out; nothing else of the program knows that polars is between.

mod columns;

use std::ops::ControlFlow;

use arrow::array::RecordBatch;
use arrow::datatypes::DataType as ArrowType;
use polars::prelude::{AnyValue, Column, DataFrame, DataType, IntoLazy, PlSmallStr, PolarsError, Scalar};
use polars::sql::SQLContext;
use sqlparser::ast::{Ident, ObjectNamePart, visit_relations_mut};
use sqlparser::dialect::GenericDialect;
use sqlparser::parser::{Parser, ParserOptions};

use columns::{answered, column};

use super::parquet::{AnyTable, read_any};

/// Why a query could not be answered.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and their fields are")]
pub enum SqlError {
    #[error("the file is no Parquet file, or a damaged one")]
    Parquet(#[source] Box<dyn std::error::Error + Send + Sync>),
    #[error("the column `{column}` is of type {data}, which cannot be asked")]
    Type { column: String, data: ArrowType },
    #[error("there is no table `{0}`")]
    NoTable(String),
    #[error("the files of `{table}` do not have the same columns")]
    Columns {
        table: String,
        #[source]
        source: PolarsError,
    },
    #[error("{}", query_message(.0))]
    Query(#[source] PolarsError),
}

impl SqlError {
    /// Returns advice for a help line, if there is any.
    #[must_use]
    pub fn help(&self) -> Option<String> {
        match self {
            Self::Parquet(_) => {
                Some("`trodden verify` names damaged objects; the next run makes them again".to_owned())
            }
            Self::Type { column, .. } => Some(format!("the types of our own files work; leave `{column}` out")),
            Self::NoTable(_) => Some("tables are nodes (`trodden ls`) or Parquet files, in quotes".to_owned()),
            Self::Columns { .. } => Some("a glob should match files of one kind".to_owned()),
            Self::Query(PolarsError::SQLInterface(message)) if message.contains("was not found") => {
                Some("put the name of a table in quotes: FROM 'labels/home_00'".to_owned())
            }
            Self::Query(_) => None,
        }
    }
}

/// Returns what polars has to say in one line.
fn query_message(error: &PolarsError) -> String {
    let message = error.to_string();
    let message = message.lines().next().unwrap_or_default();
    let message =
        message.strip_prefix("SQL error: ").or_else(|| message.strip_prefix("sql parser error: ")).unwrap_or(message);
    format!("the query does not work: {message}")
}

/// The bytes of one of a table's files, and what to call it in the column `file`, if it is to have one.
#[derive(Debug, Clone)]
pub struct TableFile {
    /// What the column `file` calls it; `None` if there is to be no such column.
    pub name: Option<String>,
    /// The content.
    pub bytes: Vec<u8>,
}

impl From<Vec<u8>> for TableFile {
    fn from(bytes: Vec<u8>) -> Self {
        Self { name: None, bytes }
    }
}

impl From<(String, Vec<u8>)> for TableFile {
    fn from((name, bytes): (String, Vec<u8>)) -> Self {
        Self { name: Some(name), bytes }
    }
}

/// Reads a Parquet file into a data frame.
fn data_frame(bytes: Vec<u8>) -> Result<DataFrame, SqlError> {
    let table = read_any(bytes).map_err(SqlError::Parquet)?;
    let empty = [RecordBatch::new_empty(table.schema.clone())];
    let batches = if table.batches.is_empty() { &empty[..] } else { &table.batches[..] };
    let read = |name: &String, array| column(name, array).map_err(|data| SqlError::Type { column: name.clone(), data });
    let mut frame = DataFrame::default();
    for (i, batch) in batches.iter().enumerate() {
        let fields = table.schema.fields().iter().zip(batch.columns());
        let columns: Result<Vec<Column>, _> = fields.map(|(field, array)| read(field.name(), array)).collect();
        let part = DataFrame::new(batch.num_rows(), columns?).expect("columns of a batch are of one length");
        if i == 0 {
            frame = part;
        } else {
            frame.vstack_mut(&part).expect("batches of a file have the same columns");
        }
    }
    frame.rechunk_mut_par();
    Ok(frame)
}

/// Answers an SQL query whose tables are files.
///
/// A table is a quoted name after FROM, JOIN or a comma between tables: `FROM 'labels/*.parquet'`, or in double quotes if
/// the name has a slash, a dot or an asterisk. `files` returns the files that a name stands for, one below the other, and
/// `None` or nothing if there are none. Where it names them, their names become a column `file`.
///
/// # Errors
/// [`SqlError`] if there is no such table, its files do not go together, or polars does not understand the query.
pub fn sql<F: Into<TableFile>>(
    query: &str,
    files: &mut dyn FnMut(&str) -> Option<Vec<F>>,
) -> Result<AnyTable, SqlError> {
    let mut context = SQLContext::new();
    let (query, tables) = with_names(query);
    for table in tables {
        let parts = files(&table).filter(|parts| !parts.is_empty());
        let parts = parts.ok_or_else(|| SqlError::NoTable(table.clone()))?;
        context.register(&table, stacked(&table, parts)?.lazy());
    }
    let answer = context.execute(&query).and_then(|lazy| lazy.collect()).map_err(SqlError::Query)?;
    Ok(answered(answer))
}

/// Puts the files of a table below each other.
fn stacked<F: Into<TableFile>>(table: &str, files: Vec<F>) -> Result<DataFrame, SqlError> {
    let mut all: Option<DataFrame> = None;
    for file in files {
        let TableFile { name, bytes } = file.into();
        let mut part = data_frame(bytes)?;
        if let Some(name) = name {
            let name = Scalar::new(DataType::String, AnyValue::StringOwned(name.into()));
            let column = Column::new_scalar(PlSmallStr::from_static("file"), name, part.height());
            part.with_column(column).expect("a column of the frame's height");
        }
        match &mut all {
            None => all = Some(part),
            Some(all) => {
                let columns = |source| SqlError::Columns { table: table.to_owned(), source };
                all.vstack_mut(&part).map_err(columns)?;
            }
        }
    }
    let mut all = all.expect("a table has files");
    all.rechunk_mut_par();
    Ok(all)
}

/// Puts the names of files in a query into the quotes of names; lists them in the order of the query, each once.
///
/// A query that does not parse stays as it is: whoever answers it says what is wrong with it.
fn with_names(query: &str) -> (String, Vec<String>) {
    // As polars reads queries.
    let options = ParserOptions { trailing_commas: true, ..ParserOptions::default() };
    let parser = Parser::new(&GenericDialect).with_options(options);
    let Ok(mut statements) = parser.try_with_sql(query).and_then(|mut parser| parser.parse_statements()) else {
        return (query.to_owned(), Vec::new());
    };
    let mut tables = Vec::new();
    let _ = visit_relations_mut(&mut statements, |name| {
        if let [ObjectNamePart::Identifier(name)] = name.0.as_mut_slice()
            && is_file(name)
        {
            name.quote_style = Some('"');
            if !tables.contains(&name.value) {
                tables.push(name.value.clone());
            }
        }
        ControlFlow::<()>::Continue(())
    });
    let statements: Vec<String> = statements.iter().map(ToString::to_string).collect();
    (statements.join("; "), tables)
}

/// Tells the name of a file from that of something in the query.
fn is_file(name: &Ident) -> bool {
    match name.quote_style {
        Some('\'') => true,
        Some(_) => name.value.contains(['/', '.', '*']),
        None => false,
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use arrow::array::{Array, AsArray};
    use arrow::datatypes::{Float64Type, Int8Type, UInt32Type};

    use super::*;
    use crate::domain::geometry::{Frame, Grid, Point};
    use crate::domain::quantize::Labels;
    use crate::domain::tiles::{Target, Tiles};
    use crate::kinds::{Placed, SingleFile};

    fn check(query: &str, expected: &[&str]) {
        assert_eq!(with_names(query).1, expected, "{query}");
    }

    #[test]
    fn quoted_tables_are_found() {
        check("SELECT * FROM 'a/b.parquet'", &["a/b.parquet"]);
        check("select x from\n  'a' as l JOIN \"b/*.parquet\" AS r ON l.x = r.x", &["a", "b/*.parquet"]);
        check("SELECT * FROM 'it''s', 'ö' WHERE x IN ('no', 'table')", &["it's", "ö"]);
        check("WITH t AS (SELECT * FROM 'a') SELECT * FROM \"t\" WHERE name = 'FROM'", &["a"]);
        check("SELECT TRIM('x' FROM 'xax'), 'b' FROM 'a' -- FROM 'c'\n", &["a"]);
        check("SELECT 1 /* FROM 'c' */ FROM (SELECT * FROM 'a') ORDER BY x, 'y'", &["a"]);
        check("SELECT * FROM 'a' UNION ALL SELECT * FROM 'b' WHERE x > (SELECT MIN(x) FROM 'a')", &["a", "b"]);
        check("SELECT EXTRACT(YEAR FROM 'day') FROM 'a'", &["a"]);
        check("FROM 'a' SELECT x, 'b'", &["a"]);
        check("SELECT 'open", &[]);
        let (query, _) = with_names("SELECT 'it''s' AS t FROM 'a ''b\"' AS x");
        assert_eq!(query, r#"SELECT 'it''s' AS t FROM "a 'b""" AS x"#);
    }

    /// Labels of 2 × 2 cells, with the origin at (−1.5, 0.25).
    fn labels() -> Vec<u8> {
        let frame = Frame { origin: Point::new(-1.5, 0.25), ..Frame::at_zero(0.1, 2, 2) };
        let labels = Labels { classes: Grid::from_vec(2, 2, vec![0, -1, 2, 2]), count: 3 };
        Placed::new(frame, labels).to_bytes().expect("encoded")
    }

    fn tiles() -> Vec<u8> {
        let tiles = Tiles {
            size: 2,
            maps: vec!["home_00".to_owned(), "home_02".to_owned()],
            origin: vec![(0, 0, 0), (1, -2, 4)],
            occupancy: vec![1; 8],
            besides: BTreeMap::new(),
            target: Target::Classes { classes: 3, labels: vec![-1, 1, 2, 3, 3, 2, 1, -1] },
            labeled_share: vec![0.75, 0.75],
        };
        tiles.to_bytes().expect("encoded")
    }

    fn files(name: &str) -> Option<Vec<(String, Vec<u8>)>> {
        match name {
            "labels/*" => Some(vec![("labels/a".to_owned(), labels()), ("labels/b".to_owned(), labels())]),
            "labels" => Some(vec![("labels".to_owned(), labels())]),
            "tiles" => Some(vec![("tiles".to_owned(), tiles())]),
            "mixed" => Some(vec![("labels".to_owned(), labels()), ("tiles".to_owned(), tiles())]),
            _ => None,
        }
    }

    fn ask(query: &str) -> Result<AnyTable, SqlError> {
        sql(query, &mut files)
    }

    /// Answers with a column of texts, `null` for none.
    fn texts(query: &str, at: usize) -> Vec<String> {
        let answer = ask(query).expect("an answer");
        let column = answer.batches[0].column(at).clone();
        column.as_string::<i64>().iter().map(|text| text.unwrap_or("null").to_owned()).collect()
    }

    #[test]
    fn a_row_for_each_cell_with_centers_in_the_map_frame() {
        let frame = data_frame(labels()).expect("a table");
        assert_eq!(frame.get_column_names(), ["row", "col", "x", "y", "class"]);
        assert_eq!(frame.height(), 4);
        let at = |name: &str| frame.column(name).expect("a column").f64().expect("numbers").get(1).expect("a value");
        // Row 0, column 1 of 2 × 2 cells of 0.1 m.
        assert!((at("x") - (-1.35)).abs() < 1e-12 && (at("y") - 0.4).abs() < 1e-12);
    }

    #[test]
    fn queries_ask_files() {
        let query = "SELECT class, COUNT(*) AS cells FROM 'labels' GROUP BY class ORDER BY class DESC";
        let answer = ask(query).expect("an answer");
        let [class, cells] = answer.batches[0].columns() else { panic!("{:?}", answer.schema) };
        assert_eq!(class.as_primitive::<Int8Type>().values(), &[2, 0, -1]);
        assert_eq!(cells.as_primitive::<UInt32Type>().values(), &[2, 1, 1]);
        assert_eq!(texts("SELECT DISTINCT file FROM \"labels/*\" ORDER BY file", 0), ["labels/a", "labels/b"]);
        let joined = "SELECT l.class FROM 'labels' AS l JOIN 'labels/*' AS r ON l.row = r.row AND l.col = r.col";
        assert_eq!(ask(joined).expect("an answer").rows(), 8);
        let none = ask("SELECT x, class FROM 'labels' WHERE class > 5").expect("an answer");
        assert_eq!((none.rows(), none.schema.fields().len()), (0, 2));
    }

    #[test]
    fn answers_have_the_types_of_their_values() {
        let query = "SELECT map, classes FROM 'tiles' WHERE row < 0";
        assert_eq!(texts(query, 0), ["home_02"]);
        let lists = ask(query).expect("an answer").batches[0].column(1).clone();
        assert_eq!(lists.as_list::<i64>().value(0).as_primitive::<Int8Type>().values(), &[3, 2, 1, -1]);
        let none = ask("SELECT classes FROM 'tiles' WHERE row > 99").expect("an answer").schema;
        assert_eq!(none.field(0).data_type(), lists.data_type());
        let query = "SELECT CAST('2024-03-01' AS DATE) AS day, class > 1 AS high, class / 0.5 AS twice, NULL AS none, \
                     CASE WHEN class > 1 THEN 'high' END AS word FROM 'labels' ORDER BY class DESC LIMIT 3";
        let answer = ask(query).expect("an answer");
        let [day, high, twice, none, _] = answer.batches[0].columns() else { panic!("{:?}", answer.schema) };
        assert_eq!((day.as_string::<i64>().value(0), none.logical_null_count()), ("2024-03-01", 3));
        assert_eq!(answer.schema.field(0).metadata()[AnyTable::TYPE], "date");
        assert_eq!(high.as_boolean().iter().collect::<Vec<_>>(), [Some(true), Some(true), Some(false)]);
        assert_eq!(twice.as_primitive::<Float64Type>().values(), &[4.0, 4.0, 0.0]);
        assert_eq!(texts(query, 4), ["high", "high", "null"]);
    }

    #[test]
    fn queries_without_an_answer_say_why() {
        assert_eq!(ask("SELECT * FROM 'costs'").expect_err("no table").to_string(), "there is no table `costs`");
        let error = ask("SELECT * FROM costs").expect_err("no quotes");
        assert!(error.help().is_some_and(|help| help.contains("in quotes")), "{error}");
        let error = ask("SELECT wrong FROM 'labels'").expect_err("no such column").to_string();
        assert!(error.starts_with("the query does not work: ") && error.contains("wrong"), "{error}");
        assert!(matches!(ask("SELECT * FROM 'mixed'"), Err(SqlError::Columns { .. })));
        assert!(matches!(data_frame(b"PAR1 but not really".to_vec()), Err(SqlError::Parquet(_))));
    }
}
