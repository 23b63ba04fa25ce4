//! Lines of JSON as TrajNet++ has them: `{"track": {"f": 10, "p": 3, "x": 1.5, "y": 2}}`, in meters.
//!
//! Frames `f` are those of the video; positions were taken every few of them. Scenes say how many positions a second has
//! (`fps`), and the least distance between two positions of a person how many frames lie between them: together the
//! frame rate. Without scenes it must be given. Tracks with a `prediction_number` are what somebody predicted, no people.

use std::collections::BTreeMap;

use serde::Deserialize;

use super::collect::{Collector, Found};
use super::preset::Said;
use super::{Format, RecordingConfig, RecordingError};

#[derive(Deserialize)]
struct Line {
    track: Option<Track>,
    scene: Option<Scene>,
}

#[derive(Deserialize)]
struct Track {
    f: i64,
    p: i64,
    x: f64,
    y: f64,
    prediction_number: Option<serde_json::Value>,
}

#[derive(Deserialize)]
struct Scene {
    fps: Option<f64>,
}

/// Reads the sightings of a text of lines.
///
/// # Errors
/// [`RecordingError`] names the line that cannot be read.
pub(super) fn sightings(text: &str, config: &RecordingConfig) -> Result<Found, RecordingError> {
    let wrong = |what: String| RecordingError::Format { format: Format::Trajnet, what };
    let (mut tracks, mut rates, mut predicted) = (Vec::new(), Vec::new(), 0usize);
    for (number, line) in super::text::lines(text) {
        let line: Line = serde_json::from_str(line).map_err(|error| wrong(format!("line {number}: {error}")))?;
        match line {
            Line { track: Some(track), .. } if track.prediction_number.as_ref().is_some_and(|n| !n.is_null()) => {
                predicted += 1;
            }
            Line { track: Some(track), .. } => tracks.push(track),
            Line { scene: Some(scene), .. } => rates.extend(scene.fps),
            Line { track: None, scene: None } => {
                return Err(wrong(format!("line {number} has neither a `track` nor a `scene`")));
            }
        }
    }
    let said = Said { frame_rate: frame_rate(&tracks, &rates).map_err(wrong)?, ..Format::Trajnet.said() };
    let mut found = Collector::new(config, &said)?;
    for Track { f, p, x, y, .. } in tracks {
        found.push(p, f as f64, [x, y]);
    }
    for fact in said.facts() {
        found.remark(fact);
    }
    if predicted > 0 {
        found.remark(format!("{predicted} positions are predictions, and were left out"));
    }
    found.finish()
}

/// Computes the frames of a second, if the scenes say how many positions it has.
fn frame_rate(tracks: &[Track], rates: &[f64]) -> Result<Option<f64>, String> {
    let Some(rate) = rates.first().copied() else { return Ok(None) };
    if let Some(other) = rates.iter().find(|other| **other != rate) {
        return Err(format!("its scenes have {rate} positions a second, and {other}"));
    }
    let mut last: BTreeMap<i64, i64> = BTreeMap::new();
    let steps = tracks.iter().filter_map(|track| {
        let before = last.insert(track.p, track.f)?;
        track.f.checked_sub(before).filter(|step| *step > 0)
    });
    let Some(step) = steps.min() else { return Ok(None) };
    let rate = rate * step as f64;
    if rate > 0.0 && rate <= 1000.0 { Ok(Some(rate)) } else { Err(format!("its scenes say {rate} frames a second")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str, frame_rate: Option<f64>) -> Result<Vec<(i64, f64, f64, f64)>, String> {
        let config = RecordingConfig { frame_rate, ..RecordingConfig::default() };
        let found = sightings(text, &config).map_err(|error| error.to_string())?;
        Ok(found.sightings.into_iter().map(|s| (s.person, s.time, s.position.x, s.position.y)).collect())
    }

    const SCENE: &str = "{\"scene\": {\"id\": 0, \"p\": 4, \"s\": 100, \"e\": 120, \"fps\": 2.5, \"tag\": [1, []]}}\n";
    const TRACKS: &str = "{\"track\": {\"f\": 100, \"p\": 4, \"x\": 1.5, \"y\": 2}}\n\
                          {\"track\": {\"f\": 110, \"p\": 4, \"x\": 2, \"y\": 2}}\n";

    #[test]
    fn scenes_tell_the_frame_rate() {
        // A position every ten frames, 2.5 of them a second: 25 frames.
        let expected = vec![(4, 4.0, 1.5, 2.0), (4, 4.4, 2.0, 2.0)];
        assert_eq!(read(&format!("{SCENE}{TRACKS}"), None), Ok(expected.clone()));
        assert_eq!(read(TRACKS, Some(25.0)), Ok(expected));
        assert_eq!(
            read(&format!("{SCENE}{TRACKS}"), Some(2.5)),
            Err("`frame_rate` is `2.5`, but the recording says `25`".to_owned())
        );
        assert_eq!(read(TRACKS, None), Err("`frame_rate` is missing: it says how many frames a second has".to_owned()));
    }

    #[test]
    fn predictions_are_no_people() {
        let predicted =
            "{\"track\": {\"f\": 120, \"p\": 4, \"x\": 9, \"y\": 9, \"prediction_number\": 0, \"scene_id\": 0}}\n";
        let config = RecordingConfig::default();
        let found = sightings(&format!("{SCENE}{TRACKS}{predicted}"), &config).expect("tracks");
        assert_eq!(found.sightings.len(), 2);
        assert_eq!(found.remarks[1], "1 positions are predictions, and were left out");
    }

    #[test]
    fn what_cannot_be_read_is_named() {
        let refused = |text: &str| read(text, Some(25.0)).expect_err("refused");
        assert!(refused(&format!("{TRACKS}{{\"track\": ")).contains("line 3: EOF while parsing"));
        assert!(refused("{\"track\": {\"f\": 1, \"p\": 2, \"x\": 3}}").contains("line 1: missing field `y`"));
        assert!(refused("{\"tracks\": {}}").contains("line 1 has neither a `track` nor a `scene`"));
        assert_eq!(refused(""), "there are no positions in it");
    }
}
