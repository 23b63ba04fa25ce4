//! Footsteps of Vadere: who set a foot where, from when to when.
//!
//! A row is a step: the person, the time and place at which it begins, and those at which it ends; columns have names such as
//! `startX-PID1`, where what follows the dash is the number of the processor that wrote them. Between the two the person moves
//! straight ahead, as between two sightings.

use super::collect::{Collector, Found};
use super::text::{lines, separator, split};
use super::{Format, RecordingConfig, RecordingError};

/// The columns in which a step stands: the person, then time and place of its beginning and of its end.
const COLUMNS: [&str; 7] = ["pedestrianId", "simTime", "startX", "startY", "endTime", "endX", "endY"];

/// Reads the sightings of a file of footsteps.
///
/// # Errors
/// [`RecordingError`] names the column that is not there, or the line that cannot be read.
pub(super) fn sightings(text: &str, config: &RecordingConfig) -> Result<Found, RecordingError> {
    let mut lines = lines(text);
    let Some((_, header)) = lines.next() else { return Err(RecordingError::Empty) };
    let separator = separator(header);
    let (mut names, mut cells) = (Vec::new(), Vec::new());
    split(header, separator, &mut names);
    let bare = |name: &str| name.split("-PID").next().unwrap_or_default().to_owned();
    let bare: Vec<String> = names.iter().map(|name| bare(name)).collect();
    let mut places = [0; COLUMNS.len()];
    for (place, name) in places.iter_mut().zip(COLUMNS) {
        *place = bare.iter().position(|found| found == name).ok_or_else(|| {
            let found: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
            RecordingError::NoColumn { name: name.to_owned(), found: found.join(", ") }
        })?;
    }
    let mut found = Collector::new(config, &Format::Vadere.said())?;
    let [id, numbers @ ..] = places;
    for (line, text) in lines {
        split(text, separator, &mut cells);
        let cell = |place: usize| {
            let short = RecordingError::ShortLine { line, found: cells.len(), wanted: place + 1 };
            cells.get(place).copied().ok_or(short)
        };
        let mut step = [0.0; 6];
        for ((number, place), name) in step.iter_mut().zip(numbers).zip(&COLUMNS[1..]) {
            let text = cell(place)?;
            let read = text.parse().ok().filter(|number: &f64| number.is_finite());
            *number = read.ok_or_else(|| RecordingError::NoNumber { line, text: text.to_owned(), what: name })?;
        }
        let person = found.person(cell(id)?);
        let [start, start_x, start_y, end, end_x, end_y] = step;
        found.push(person, start, [start_x, start_y]);
        found.push(person, end, [end_x, end_y]);
    }
    found.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "#IDXCOL=2,DATACOL=6,SEP=' '\n\
                          pedestrianId simTime endTime-PID1 startX-PID1 startY-PID1 endX-PID1 endY-PID1 targetId-PID2\n";

    fn read(rows: &str) -> Result<Vec<(i64, f64, f64, f64)>, String> {
        let found = sightings(&format!("{HEADER}{rows}"), &RecordingConfig::default()).map_err(|e| e.to_string())?;
        Ok(found.sightings.into_iter().map(|s| (s.person, s.time, s.position.x, s.position.y)).collect())
    }

    #[test]
    fn a_step_is_two_sightings() {
        let steps = read("3 0.5 1.0 2 3 2.5 3 8\n3 1.0 1.5 2.5 3 3 3.25 8\n");
        let expected = [(3, 0.5, 2.0, 3.0), (3, 1.0, 2.5, 3.0), (3, 1.0, 2.5, 3.0), (3, 1.5, 3.0, 3.25)];
        assert_eq!(steps, Ok(expected.to_vec()));
    }

    #[test]
    fn what_cannot_be_read_is_named() {
        let refused = |rows: &str| read(rows).expect_err("refused");
        assert_eq!(refused("3 0.5 1.0 2 3 2.5\n"), "line 3 has 6 columns, column 7 was asked for");
        assert_eq!(refused("3 0.5 1.0 2 3 2.5 NaN 8\n"), "line 3 has `NaN` in the place of endY");
        assert_eq!(refused(""), "there are no positions in it");
        // As older versions wrote it: a place at a time, which `columns` reads.
        let old = sightings("timeStep pedestrianId x y targetId\n1 1 2 3 4\n", &RecordingConfig::default());
        let message = old.expect_err("no steps").to_string();
        assert_eq!(message, "there is no column `simTime`; there are `timeStep`, `pedestrianId`, `x`, `y`, `targetId`");
    }
}
