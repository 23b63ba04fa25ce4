//! The bytes of a recording as sightings, by its format.

use super::collect::{Collector, Found};
use super::preset::Said;
use super::{Format, RecordingConfig, RecordingError, jupedsim, mcap, table, trajnet, vadere};

/// Finds the format of a recording: what its bytes say, or what is given; a text with `columns` is a table.
///
/// # Errors
/// [`RecordingError`] if the bytes are not of the format that is given, or something of the configuration does not fit it.
pub fn format_of(bytes: &[u8], config: &RecordingConfig) -> Result<Format, RecordingError> {
    let told = Format::of(bytes);
    let format = match (config.format, told) {
        (Some(given), Some(found)) if given != found && !(given == Format::Table && found == Format::Vadere) => {
            return Err(RecordingError::OtherFormat { given, found });
        }
        (Some(given @ (Format::Jupedsim | Format::Parquet | Format::Mcap)), None) => {
            let what = "it does not begin as such files do".to_owned();
            return Err(RecordingError::Format { format: given, what });
        }
        (Some(given), _) => given,
        (None, Some(Format::Vadere)) if config.columns.is_some() => Format::Table,
        (None, Some(found)) => found,
        (None, None) => Format::Table,
    };
    if !matches!(format, Format::Jupedsim | Format::Parquet | Format::Mcap) && bytes.iter().take(4096).any(|b| *b == 0)
    {
        return Err(RecordingError::NoText);
    }
    config.check_format(format).map_err(|error| match error {
        RecordingError::NoColumns { .. } if format == Format::Table => {
            RecordingError::NoColumns { line: first_line(bytes) }
        }
        error => error,
    })?;
    Ok(format)
}

/// Returns the beginning of the first line that is no comment.
fn first_line(bytes: &[u8]) -> Option<String> {
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(4096)]);
    text.lines().find(|line| !line.trim().is_empty()).map(|line| line.trim().chars().take(60).collect())
}

/// Reads the sightings of a recording in the frame of the map; of Parquet, whose columns others decode, see
/// [`sightings_of`].
///
/// # Errors
/// [`RecordingError`] names what cannot be read, and where.
pub fn sightings(bytes: &[u8], format: Format, config: &RecordingConfig) -> Result<Found, RecordingError> {
    let text = || String::from_utf8_lossy(bytes);
    match format {
        Format::Jupedsim => jupedsim::sightings(bytes, config),
        Format::Mcap => mcap::sightings(bytes, config),
        Format::Vadere => vadere::sightings(&text(), config),
        Format::Trajnet => trajnet::sightings(&text(), config),
        Format::Parquet => Err(RecordingError::Format { format, what: "its columns are not decoded".to_owned() }),
        Format::Table
        | Format::Juelich
        | Format::Crowdit
        | Format::Pathfinder
        | Format::Eth
        | Format::Atc
        | Format::Thor => table::sightings(&text(), format, config),
    }
}

/// Columns of a table that has been decoded: as many people as times and positions.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Rows {
    /// Who, as text.
    pub people: Vec<String>,
    /// When: seconds, or frames.
    pub clock: Vec<f64>,
    /// Positions from left to right.
    pub x: Vec<f64>,
    /// Positions upwards.
    pub y: Vec<f64>,
}

/// Returns the sightings of decoded columns in the frame of the map.
///
/// # Errors
/// [`RecordingError`] names the row that has no number.
pub fn sightings_of(rows: &Rows, config: &RecordingConfig) -> Result<Found, RecordingError> {
    let frames = config.columns.as_ref().is_some_and(|columns| columns.time.is_none());
    let mut found = Collector::new(config, &Said { frames, ..Said::default() })?;
    let numbers = rows.clock.iter().zip(&rows.x).zip(&rows.y);
    for (row, (person, ((clock, x), y))) in rows.people.iter().zip(numbers).enumerate() {
        for (number, what) in [(clock, "a time"), (x, "x"), (y, "y")] {
            if !number.is_finite() {
                return Err(RecordingError::NoValue { row: row + 1, what });
            }
        }
        let person = found.person(person);
        found.push(person, *clock, [*x, *y]);
    }
    found.finish()
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;

    fn config(value: Value) -> RecordingConfig {
        serde_json::from_value(value).expect("a configuration")
    }

    #[test]
    fn what_the_bytes_say_counts() {
        let of = |bytes: &[u8], value: Value| format_of(bytes, &config(value)).map_err(|error| error.to_string());
        let columns = json!({ "id": 1, "time": 2, "x": 3, "y": 4 });
        let table = json!({ "columns": columns, "unit": "m" });
        assert_eq!(of(b"1 2 3 4\n", table.clone()), Ok(Format::Table));
        assert_eq!(of(b"PAR1 and so on", table.clone()), Ok(Format::Parquet));
        assert_eq!(of(b"#IDXCOL=2,DATACOL=6\n", table.clone()), Ok(Format::Table));
        assert_eq!(of(b"#IDXCOL=2,DATACOL=6\n", json!({})), Ok(Format::Vadere));
        assert_eq!(of(b"SQLite format 3\0", json!({})), Ok(Format::Jupedsim));
        let refused = |bytes: &[u8], value: Value| of(bytes, value).expect_err("refused");
        assert_eq!(refused(b"SQLite format 3\0", table.clone()), "`columns` does not fit a recording of jupedsim");
        assert_eq!(
            refused(b"SQLite format 3\0", json!({ "format": "mcap" })),
            "it begins as a recording of jupedsim does, not as one of mcap"
        );
        assert_eq!(
            refused(b"time,pedID", json!({ "format": "mcap" })),
            "this is no sound recording of mcap: it does not begin as such files do"
        );
        assert_eq!(refused(b"a\0b", table), "it is no text");
        assert_eq!(
            refused(b"time,pedID,posX,posY\n", json!({})),
            "`columns` is missing: it says what stands where; the first line is `time,pedID,posX,posY`"
        );
        assert_eq!(refused(b"\x89MCAP0\r\n", json!({ "unit": "cm" })), "`unit` is `cm`, but the recording says `m`");
        let framed = json!({ "frame_rate": 10.0 });
        assert_eq!(refused(b"\x89MCAP0\r\n", framed), "`frame_rate` does not fit a recording of mcap");
        assert_eq!(
            refused(b"1 2 3 4", json!({ "format": "eth" })),
            "`frame_rate` is missing: it says how many frames a second has"
        );
    }

    #[test]
    fn decoded_columns_are_sightings() {
        let rows = Rows {
            people: vec!["4".to_owned(), "anna".to_owned()],
            clock: vec![10.0, 20.0],
            x: vec![100.0, 200.0],
            y: vec![-50.0, 0.0],
        };
        let columns = json!({ "id": 1, "frame": 2, "x": 3, "y": 4 });
        let config = config(json!({ "columns": columns, "unit": "cm", "frame_rate": 10.0 }));
        let found = sightings_of(&rows, &config).expect("sightings").sightings;
        let found: Vec<_> = found.iter().map(|s| (s.person, s.time, s.position.x, s.position.y)).collect();
        assert_eq!(found, [(4, 1.0, 1.0, -0.5), (-1, 2.0, 2.0, 0.0)]);
        let broken = Rows { x: vec![1.0, f64::NAN], ..rows };
        assert_eq!(
            sightings_of(&broken, &config).expect_err("no number").to_string(),
            "row 2 has no number in the place of x"
        );
    }
}
