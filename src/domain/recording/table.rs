//! The text of others: comma, semicolon, tab or blanks between columns, with or without a header.

use super::{ColumnName, Columns, RecordingConfig, RecordingError, Sighting};
use crate::domain::geometry::Point;

/// A table of cells: the names of its columns, if there are some, and its rows with the numbers of their lines.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Cells {
    /// Names of the columns; empty if there is no header.
    pub names: Vec<String>,
    /// Rows, each with the number of its line, from 1 on.
    pub rows: Vec<(usize, Vec<String>)>,
}

/// Splits a text into cells. Lines that begin with `#` and empty ones are passed over; where `header` is set, the first of the
/// others has the names.
#[must_use]
pub fn read(text: &str, header: bool) -> Cells {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let lines = text.lines().enumerate().map(|(number, line)| (number + 1, line.trim()));
    let mut lines = lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#')).peekable();
    let Some((_, first)) = lines.peek() else { return Cells::default() };
    let separator = [',', ';', '\t'].into_iter().find(|separator| first.contains(*separator));
    let names =
        if header { lines.next().map_or_else(Vec::new, |(_, line)| split(line, separator)) } else { Vec::new() };
    Cells { names, rows: lines.map(|(number, line)| (number, split(line, separator))).collect() }
}

/// Splits a line at its separators, or at blanks; quotes around a cell fall away, and within them separators are letters.
fn split(line: &str, separator: Option<char>) -> Vec<String> {
    let Some(separator) = separator else {
        return line.split_whitespace().map(|cell| cell.trim_matches('"').to_owned()).collect();
    };
    let mut cells = vec![String::new()];
    let mut quoted = false;
    for letter in line.chars() {
        match letter {
            '"' => quoted = !quoted,
            letter if letter == separator && !quoted => cells.push(String::new()),
            letter => cells.last_mut().expect("there is one").push(letter),
        }
    }
    cells.iter().map(|cell| cell.trim().to_owned()).collect()
}

/// Places of the columns, from 0 on.
struct Places {
    id: usize,
    clock: usize,
    x: usize,
    y: usize,
}

impl Places {
    fn find(columns: &Columns, names: &[String]) -> Result<Self, RecordingError> {
        let place = |column: &ColumnName| match column {
            ColumnName::Number(number) => Ok(usize::from(*number) - 1),
            ColumnName::Name(name) => names.iter().position(|found| found == name).ok_or_else(|| {
                let found: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
                RecordingError::NoColumn { name: name.clone(), found: found.join(", ") }
            }),
        };
        let clock = columns.time.as_ref().or(columns.frame.as_ref()).ok_or(RecordingError::Clock("no time"))?;
        Ok(Self { id: place(&columns.id)?, clock: place(clock)?, x: place(&columns.x)?, y: place(&columns.y)? })
    }
}

/// Reads the sightings of a table, in the frame of the map.
///
/// Lines before the first one that has numbers in the places of time and position are passed over, such as names and units.
///
/// # Errors
/// [`RecordingError`] names the column that is not there, or the line that cannot be read.
pub fn sightings(cells: &Cells, config: &RecordingConfig) -> Result<Vec<Sighting>, RecordingError> {
    let places = Places::find(&config.columns, &cells.names)?;
    let second =
        if config.columns.time.is_some() { 1.0 } else { config.frame_rate.ok_or(RecordingError::FrameRate)? };
    let unit = config.unit.ok_or(RecordingError::NoUnit)?.meters();
    let mut people = People::default();
    let (mut found, mut passed_over): (Vec<Sighting>, Option<RecordingError>) = (Vec::new(), None);
    for (line, row) in &cells.rows {
        let number = |place: usize, what: &'static str| -> Result<f64, RecordingError> {
            let (line, short) = (*line, row.len());
            let text = row.get(place).ok_or(RecordingError::ShortLine { line, found: short, wanted: place + 1 })?;
            let number = text.parse().ok().filter(|number: &f64| number.is_finite());
            number.ok_or_else(|| RecordingError::NoNumber { line, text: text.clone(), what })
        };
        let numbers = || -> Result<[f64; 3], RecordingError> {
            Ok([number(places.clock, "a time")?, number(places.x, "x")?, number(places.y, "y")?])
        };
        let [time, x, y] = match numbers() {
            Ok(numbers) => numbers,
            Err(error) if found.is_empty() => {
                passed_over.get_or_insert(error);
                continue;
            }
            Err(error) => return Err(error),
        };
        let Some(id) = row.get(places.id) else {
            return Err(RecordingError::ShortLine { line: *line, found: row.len(), wanted: places.id + 1 });
        };
        let meters = Point::new(x * unit, y * unit);
        let position = config.transform.as_ref().map_or(meters, |transform| transform.apply(meters));
        found.push(Sighting { person: people.number(id), time: time / second, position });
    }
    if found.is_empty() {
        // All lines were passed over: the first one tells why.
        return Err(passed_over.unwrap_or(RecordingError::Empty));
    }
    Ok(found)
}

/// The numbers of people: their own if they have whole ones, else that of the first line in which a name appears, below zero.
#[derive(Default)]
struct People {
    named: std::collections::BTreeMap<String, i64>,
}

impl People {
    fn number(&mut self, name: &str) -> i64 {
        let whole = |number: f64| (number.fract() == 0.0 && number.abs() < 1e15).then_some(number as i64);
        if let Some(number) = name.parse().ok().or_else(|| name.parse().ok().and_then(whole)).filter(|id| *id >= 0) {
            return number;
        }
        let next = -1 - self.named.len() as i64;
        *self.named.entry(name.to_owned()).or_insert(next)
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;

    fn config(value: Value) -> RecordingConfig {
        let config: RecordingConfig = serde_json::from_value(value).expect("a configuration");
        config.check().expect("in range");
        config
    }

    fn named(columns: &Columns) -> bool {
        matches!(columns.id, ColumnName::Name(_))
    }

    fn found(text: &str, config: &RecordingConfig) -> Result<Vec<(i64, f64, f64, f64)>, String> {
        let sightings = sightings(&read(text, named(&config.columns)), config).map_err(|error| error.to_string())?;
        Ok(sightings.into_iter().map(|s| (s.person, s.time, s.position.x, s.position.y)).collect())
    }

    /// As Jülich's experiments have it: no header, id, frame, x and y in centimeters, 16 frames a second.
    #[test]
    fn columns_by_number_need_no_header() {
        let config = config(json!({
            "columns": { "id": 1, "frame": 2, "x": 3, "y": 4 }, "unit": "cm", "frame_rate": 16.0,
        }));
        let text = "# id frame x/cm y/cm z/cm\n1 43 79.0 774.0 183.02\n2\t48  -50 25 183.02\n";
        assert_eq!(found(text, &config), Ok(vec![(1, 43.0 / 16.0, 0.79, 7.74), (2, 3.0, -0.5, 0.25)]));
        assert_eq!(
            found("1 43 79.0 774.0\n1 44 79.0\n", &config).expect_err("short"),
            "line 2 has 3 columns, column 4 was asked for"
        );
        assert_eq!(found("", &config).expect_err("nothing"), "there are no positions in it");
        assert_eq!(found("a b c d\n", &config).expect_err("names"), "line 1 has `b` in the place of a time");
    }

    /// As Pathfinder has it: names, units, and quotes around names of people.
    #[test]
    fn columns_by_name_may_have_lines_of_units() {
        let config = config(json!({
            "columns": { "id": "name", "time": "t", "x": "x", "y": "y" }, "unit": "m",
            "transform": { "offset": [10.0, 0.0] },
        }));
        let text = "\u{feff}\"t\",\"name\",\"x\",\"y\"\n\"s\",\"\",\"m\",\"m\"\n0.5,\"a, b\",1,2\n1.0,c,3,4\n1.5,\"a, b\",5,6\n";
        assert_eq!(found(text, &config), Ok(vec![(-1, 0.5, 11.0, 2.0), (-2, 1.0, 13.0, 4.0), (-1, 1.5, 15.0, 6.0)]));
        assert_eq!(
            found("t;name;x\n1;2;3\n", &config).expect_err("a column lacks"),
            "there is no column `y`; there are `t`, `name`, `x`"
        );
        assert_eq!(
            found("t,name,x,y\n1,2,3,4\n2,2,nan,4\n", &config).expect_err("no number"),
            "line 3 has `nan` in the place of x"
        );
    }

    #[test]
    fn clocks_and_ranges_are_checked() {
        let check = |value: Value| -> String {
            let config: RecordingConfig = serde_json::from_value(value).expect("a configuration");
            config.check().expect_err("out of range").to_string()
        };
        let columns = json!({ "id": 1, "frame": 2, "x": 3, "y": 4 });
        let missing = check(json!({ "columns": columns, "unit": "m" }));
        assert_eq!(missing, "`frame_rate` is missing: it says how many frames a second has");
        let none = check(json!({ "columns": { "id": 1, "x": 3, "y": 4 }, "unit": "m" }));
        assert_eq!(none, "`columns` names neither `time` nor `frame`: one is needed");
        let unit = check(json!({ "columns": columns, "frame_rate": 25.0 }));
        assert_eq!(unit, "`unit` is missing: it says what positions are counted in");
        let zero = check(json!({ "columns": { "id": 0, "time": 2, "x": 3, "y": 4 }, "unit": "m" }));
        assert_eq!(zero, "`columns` names column 0: the first is 1");
        let rate = check(json!({ "columns": columns, "unit": "m", "frame_rate": 0.0 }));
        assert_eq!(rate, "`frame_rate` is `0`, allowed is above 0 and up to 1000");
    }
}
