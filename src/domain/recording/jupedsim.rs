//! SQLite of JuPedSim: who was where at which frame, and how many frames a second has.
//!
//! `trajectory_data` holds `frame`, `id`, `pos_x` and `pos_y` in meters, `metadata` the frame rate under `fps`.

use std::io::Read;

use rusqlite::{Connection, MAIN_DB, OptionalExtension};

use super::collect::{Collector, Found};
use super::preset::Said;
use super::{Format, RecordingConfig, RecordingError};

/// Bytes of the header that tell whether changes lie in a file of their own.
const JOURNAL: std::ops::Range<usize> = 18..20;
/// What a damaged file may be read beyond its end.
const BEYOND: usize = 1024;
/// The least that a row takes: four numbers, and how long they are.
const ROW: usize = 8;

/// Reads the sightings of a database.
///
/// # Errors
/// [`RecordingError`] says what of it is missing or damaged.
pub(super) fn sightings(bytes: &[u8], config: &RecordingConfig) -> Result<Found, RecordingError> {
    let damaged = |error: rusqlite::Error| RecordingError::Format { format: Format::Jupedsim, what: error.to_string() };
    let wrong = |what: String| RecordingError::Format { format: Format::Jupedsim, what };
    let database = open(bytes).map_err(damaged)?;
    let table = "SELECT COUNT(*) FROM sqlite_master WHERE type = 'table' AND rootpage > 0 AND name = ?1";
    for name in ["trajectory_data", "metadata"] {
        // A view could be anything, and take for ever.
        let count: i64 = database.query_row(table, [name], |row| row.get(0)).map_err(damaged)?;
        if count != 1 {
            return Err(wrong(format!("there is no table `{name}`")));
        }
    }
    let fps: Option<String> = database
        .query_row("SELECT CAST(value AS TEXT) FROM metadata WHERE key = 'fps'", [], |row| row.get(0))
        .optional()
        .map_err(damaged)?;
    let fps = fps.ok_or_else(|| wrong("its metadata have no `fps`".to_owned()))?;
    let rate = fps.parse().ok().filter(|rate: &f64| *rate > 0.0 && *rate <= 1000.0);
    let rate = rate.ok_or_else(|| wrong(format!("its metadata have `{fps}` in the place of a frame rate")))?;
    let said = Said { frame_rate: Some(rate), ..Format::Jupedsim.said() };
    let mut found = Collector::new(config, &said)?;
    let mut rows =
        database.prepare("SELECT id, frame, pos_x, pos_y FROM trajectory_data NOT INDEXED").map_err(damaged)?;
    let mut rows = rows.query([]).map_err(damaged)?;
    while let Some(row) = rows.next().map_err(damaged)? {
        let number = found.len() + 1;
        if number > bytes.len() / ROW {
            return Err(wrong("it has more rows than fit into it".to_owned()));
        }
        let whole = |column| row.get::<_, i64>(column);
        let real = |column| row.get::<_, f64>(column);
        let read = whole(0).and_then(|id| Ok((id, whole(1)?, real(2)?, real(3)?)));
        let (id, frame, x, y) = read.map_err(|error| wrong(format!("row {number} of `trajectory_data`: {error}")))?;
        if !(x.is_finite() && y.is_finite()) {
            return Err(wrong(format!("row {number} of `trajectory_data` has no finite position")));
        }
        found.push(id, frame as f64, [x, y]);
    }
    for fact in said.facts() {
        found.remark(fact);
    }
    found.finish()
}

/// Opens a database that lies in memory, to be read only.
fn open(bytes: &[u8]) -> rusqlite::Result<Connection> {
    let mut database = Connection::open_in_memory()?;
    let mut header: Vec<u8> = bytes[..bytes.len().min(JOURNAL.end)].to_vec();
    // A database that keeps its changes in a second file is whole without one if it was closed.
    header.iter_mut().skip(JOURNAL.start).filter(|version| **version == 2).for_each(|version| *version = 1);
    let rest = &bytes[header.len()..];
    let reader = header.chain(rest).chain(std::io::repeat(0));
    database.deserialize_read_exact(MAIN_DB, reader, bytes.len() + BEYOND, true)?;
    database.execute_batch("PRAGMA trusted_schema = OFF; PRAGMA cell_size_check = ON;")?;
    Ok(database)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A database of statements, as its bytes.
    fn database(statements: &str) -> Vec<u8> {
        let mut database = Connection::open_in_memory().expect("opens");
        database.execute_batch(statements).expect("statements");
        database.serialize(MAIN_DB).expect("serializes").to_vec()
    }

    const TABLES: &str = "CREATE TABLE trajectory_data (frame INTEGER NOT NULL, id INTEGER NOT NULL, pos_x REAL NOT NULL, \
                          pos_y REAL NOT NULL, ori_x REAL NOT NULL, ori_y REAL NOT NULL); \
                          CREATE TABLE metadata(key TEXT NOT NULL UNIQUE PRIMARY KEY, value TEXT NOT NULL);";

    fn read(statements: &str, config: &RecordingConfig) -> Result<Vec<(i64, f64, f64, f64)>, String> {
        let found = sightings(&database(statements), config).map_err(|error| error.to_string())?;
        Ok(found.sightings.into_iter().map(|s| (s.person, s.time, s.position.x, s.position.y)).collect())
    }

    #[test]
    fn frame_rate_and_unit_are_in_it() {
        let rows = format!(
            "{TABLES} INSERT INTO metadata VALUES ('version', '2'), ('fps', '25.0'); \
             INSERT INTO trajectory_data VALUES (0, 4, -1.5, 2, 0, 1), (50, 4, 1, 2.25, 0, 1);"
        );
        let config = RecordingConfig::default();
        assert_eq!(read(&rows, &config), Ok(vec![(4, 0.0, -1.5, 2.0), (4, 2.0, 1.0, 2.25)]));
        let slow = RecordingConfig { frame_rate: Some(10.0), ..config };
        assert_eq!(read(&rows, &slow), Err("`frame_rate` is `10`, but the recording says `25`".to_owned()));
    }

    #[test]
    fn what_is_missing_is_named() {
        let refused = |statements: &str| read(statements, &RecordingConfig::default()).expect_err("refused");
        assert_eq!(
            refused("CREATE TABLE other (a)"),
            "this is no sound recording of jupedsim: there is no table `trajectory_data`"
        );
        assert_eq!(refused(TABLES), "this is no sound recording of jupedsim: its metadata have no `fps`");
        let view = "CREATE TABLE metadata(key, value); CREATE VIEW trajectory_data AS SELECT 1;";
        assert_eq!(refused(view), "this is no sound recording of jupedsim: there is no table `trajectory_data`");
        let rate = format!("{TABLES} INSERT INTO metadata VALUES ('fps', 'fast');");
        assert_eq!(
            refused(&rate),
            "this is no sound recording of jupedsim: its metadata have `fast` in the place of a frame rate"
        );
        let empty = format!("{TABLES} INSERT INTO metadata VALUES ('fps', '25');");
        assert_eq!(refused(&empty), "there are no positions in it");
        let text = format!("{empty} INSERT INTO trajectory_data VALUES (0, 'anna', 1, 2, 0, 0);");
        assert!(refused(&text).contains("row 1 of `trajectory_data`"), "{}", refused(&text));
    }

    #[test]
    fn half_a_database_is_refused() {
        let rows: String = (0..2000).map(|i| format!("({i}, 1, {i}, 2, 0, 0),")).collect();
        let whole = database(&format!(
            "{TABLES} INSERT INTO metadata VALUES ('fps', '25'); INSERT INTO trajectory_data VALUES {}",
            rows.trim_end_matches(',')
        ));
        let read = |bytes: &[u8]| sightings(bytes, &RecordingConfig::default()).map(|found| found.sightings.len());
        assert_eq!(read(&whole), Ok(2000));
        for length in [0, 10, 100, 5000, whole.len() / 2] {
            assert!(read(&whole[..length]).is_err(), "{length}");
        }
        // As if it had kept changes in a file of their own.
        let mut walled = whole;
        walled[18..20].fill(2);
        assert_eq!(read(&walled), Ok(2000));
    }
}
