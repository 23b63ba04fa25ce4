//! Tables in text, with columns that are named, or known of their format.

use super::collect::{Collector, Found};
use super::preset::Said;
use super::text::{lines, separator, split};
use super::{ColumnName, Columns, Format, RecordingConfig, RecordingError, Unit};

/// Places of the columns, from 0 on.
struct Places {
    id: usize,
    clock: usize,
    x: usize,
    y: usize,
}

impl Places {
    fn find(columns: &Columns, names: &[&str]) -> Result<Self, RecordingError> {
        let clock = columns.clock().ok_or(RecordingError::Clock("no time"))?;
        let place = |column: &ColumnName| column.place(names);
        Ok(Self { id: place(&columns.id)?, clock: place(clock)?, x: place(&columns.x)?, y: place(&columns.y)? })
    }
}

/// A line of a table, cut into cells.
struct Row<'a> {
    line: usize,
    cells: &'a [&'a str],
}

impl Row<'_> {
    fn cell(&self, place: usize) -> Result<&str, RecordingError> {
        let (line, found) = (self.line, self.cells.len());
        self.cells.get(place).copied().ok_or(RecordingError::ShortLine { line, found, wanted: place + 1 })
    }

    fn number(&self, place: usize, what: &'static str) -> Result<f64, RecordingError> {
        let text = self.cell(place)?;
        let number = text.parse().ok().filter(|number: &f64| number.is_finite());
        number.ok_or_else(|| RecordingError::NoNumber { line: self.line, text: text.to_owned(), what })
    }
}

/// Reads the sightings of a table of a format.
///
/// Lines before the first one that has numbers in the places of time and position are passed over, such as names and units.
///
/// # Errors
/// [`RecordingError`] names the column that is not there, or the line that cannot be read.
pub(super) fn sightings(text: &str, format: Format, config: &RecordingConfig) -> Result<Found, RecordingError> {
    let own = format.columns();
    let Some(columns) = own.as_ref().or(config.columns.as_ref()) else {
        let first = lines(text).next().map(|(_, line)| line.chars().take(60).collect());
        return Err(RecordingError::NoColumns { line: first });
    };
    let has_names = columns.all().any(|column| matches!(column, ColumnName::Name(_)));
    let mut lines = lines(text).peekable();
    let separator = lines.peek().and_then(|(_, first)| separator(first));
    let (mut names, mut cells) = (Vec::new(), Vec::new());
    if has_names && let Some((_, header)) = lines.next() {
        split(header, separator, &mut names);
    }
    let places = Places::find(columns, &names)?;
    let mut said = match format {
        Format::Juelich => comments(text),
        format => format.said(),
    };
    said.frames = columns.time.is_none();
    if format == Format::Pathfinder
        && let Some((_, units)) = lines.peek()
    {
        split(units, separator, &mut cells);
        said.unit = cells.get(places.x).and_then(|unit| unit.parse().ok());
    }
    let mut found = Collector::new(config, &said)?;
    let mut passed_over: Option<RecordingError> = None;
    for (line, text) in lines {
        split(text, separator, &mut cells);
        let row = Row { line, cells: &cells };
        let numbers = || -> Result<[f64; 3], RecordingError> {
            Ok([row.number(places.clock, "a time")?, row.number(places.x, "x")?, row.number(places.y, "y")?])
        };
        match numbers() {
            Ok([clock, x, y]) => {
                let person = found.person(row.cell(places.id)?);
                found.push(person, clock, [x, y]);
            }
            Err(error) if found.len() == 0 => _ = passed_over.get_or_insert(error),
            Err(error) => return Err(error),
        }
    }
    for fact in said.facts() {
        found.remark(fact);
    }
    // Where all lines were passed over, the first one tells why.
    found.finish().map_err(|empty| passed_over.unwrap_or(empty))
}

/// Reads what the comments of a text from Jülich say: `# framerate: 25 fps`, `# id frame x/cm y/cm z/cm`.
fn comments(text: &str) -> Said {
    let mut said = Format::Juelich.said();
    let comments = text.lines().map_while(|line| line.trim_start_matches('\u{feff}').trim().strip_prefix('#'));
    for comment in comments {
        let comment = comment.to_lowercase();
        if let Some((_, rate)) = comment.split_once("framerate") {
            let mut numbers = rate.split([' ', ':', '=', '\t']).filter_map(|word| word.parse::<f64>().ok());
            said.frame_rate = said.frame_rate.or_else(|| numbers.find(|rate| *rate > 0.0 && rate.is_finite()));
        }
        let units = comment.split_whitespace().filter_map(|word| word.strip_prefix("x/"));
        said.unit = said.unit.or_else(|| units.filter_map(|unit| unit.parse::<Unit>().ok()).next());
    }
    said
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

    fn found(text: &str, config: &RecordingConfig) -> Result<Vec<(i64, f64, f64, f64)>, String> {
        let format = config.format.unwrap_or(Format::Table);
        let found = sightings(text, format, config).map_err(|error| error.to_string())?;
        Ok(found.sightings.into_iter().map(|s| (s.person, s.time, s.position.x, s.position.y)).collect())
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
    fn a_text_from_juelich_may_tell_unit_and_frame_rate() {
        let text = "# framerate: 25 fps\n# id frame x/cm y/cm\n3 50 100 200 0\n";
        assert_eq!(found(text, &config(json!({ "format": "juelich" }))), Ok(vec![(3, 2.0, 1.0, 2.0)]));
        let same = config(json!({ "format": "juelich", "unit": "cm", "frame_rate": 25.0 }));
        assert_eq!(found(text, &same), Ok(vec![(3, 2.0, 1.0, 2.0)]));
        let refused = |more: Value| {
            let mut value = json!({ "format": "juelich" });
            value.as_object_mut().expect("an object").extend(more.as_object().expect("an object").clone());
            found(text, &config(value)).expect_err("contradicts")
        };
        assert_eq!(refused(json!({ "unit": "m" })), "`unit` is `m`, but the recording says `cm`");
        assert_eq!(refused(json!({ "frame_rate": 16.0 })), "`frame_rate` is `16`, but the recording says `25`");
        let bare = found("3 50 100 200 0\n", &config(json!({ "format": "juelich", "unit": "m" })));
        assert_eq!(bare.expect_err("no rate"), "`frame_rate` is missing: it says how many frames a second has");
    }

    #[test]
    fn formats_know_their_columns() {
        let read = |format: &str, more: Value, text: &str| {
            let mut value = json!({ "format": format });
            value.as_object_mut().expect("an object").extend(more.as_object().expect("an object").clone());
            found(text, &config(value))
        };
        let one = |time, x, y| Ok(vec![(7, time, x, y)]);
        assert_eq!(read("crowdit", json!({}), "time,pedID,posX,posY\n0.5,7,1,2\n"), one(0.5, 1.0, 2.0));
        // Frame, person, x, z, y, and velocities.
        let obsmat = "  7.8e+02 7.0e+00 8.4e+00 0 3.5e+00 1.6 0 0.1\n";
        assert_eq!(read("eth", json!({ "frame_rate": 15.0 }), obsmat), one(52.0, 8.4, 3.5));
        assert_eq!(read("atc", json!({}), "1350000000.25,7,1500,-250,1700,0,0,0\n"), one(1_350_000_000.25, 1.5, -0.25));
        assert_eq!(read("thor", json!({}), "0.02,7,-0.046,-3.443,0.141,2.356\n"), one(0.02, -0.046, -3.443));
        let pathfinder = |unit: &str| format!("\"t\",\"id\",\"x\",\"y\"\n\"s\",\"\",\"{unit}\",\"{unit}\"\n2,7,1,2\n");
        assert_eq!(read("pathfinder", json!({}), &pathfinder("m")), one(2.0, 1.0, 2.0));
        assert_eq!(read("pathfinder", json!({}), &pathfinder("ft")), one(2.0, 0.3048, 0.6096));
        assert_eq!(
            read("pathfinder", json!({}), "t,id,x,y\n2,7,1,2\n"),
            Err("`unit` is missing: it says what positions are counted in".to_owned())
        );
        assert_eq!(
            read("pathfinder", json!({ "unit": "m" }), &pathfinder("ft")),
            Err("`unit` is `m`, but the recording says `ft`".to_owned())
        );
    }
}
