//! Episodes to play: who was where, about five times a second and to the centimeter.

use crate::domain::tracks::Sample;

/// Positions of an agent that are kept in a second, about; between them the page draws straight lines.
const KEPT_PER_SECOND: f64 = 5.0;
/// Units of a coordinate in a meter.
const UNITS: f64 = 100.0;

/// An episode to play.
#[derive(Debug, Clone, PartialEq)]
pub struct Episode {
    pub(super) name: String,
    /// Kept frames per second.
    pub(super) rate: f64,
    /// Radius of everybody's disc in meters.
    pub(super) radius: f64,
    pub(super) tracks: Vec<Track>,
}

/// An agent from one kept frame to the next without a gap.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Track {
    pub robot: bool,
    /// The kept frame at which it begins.
    pub start: u32,
    /// Where it is, in centimeters of the local frame.
    pub points: Vec<[i32; 2]>,
}

impl Episode {
    /// Takes the samples of one episode, ordered by agent and frame, with whether the agent is the robot.
    ///
    /// `rate` is the number of frames in a second, `radius` that of everybody's disc in meters.
    #[must_use]
    pub fn new(name: &str, rate: f64, radius: f64, samples: &[(Sample, bool)]) -> Self {
        let stride = ((rate / KEPT_PER_SECOND).round() as i64).max(1);
        let first = samples.iter().map(|(sample, _)| sample.frame).min().unwrap_or(0);
        let mut tracks: Vec<Track> = Vec::new();
        let mut before = None;
        for (sample, robot) in samples.iter().filter(|(sample, _)| (sample.frame - first) % stride == 0) {
            let frame = (sample.frame - first) / stride;
            if before != Some((sample.id, frame - 1)) {
                let start = u32::try_from(frame).unwrap_or(u32::MAX);
                tracks.push(Track { robot: *robot, start, points: Vec::new() });
            }
            before = Some((sample.id, frame));
            let units = |meters: f64| (meters * UNITS).round() as i32;
            let at = [units(sample.position.x), units(sample.position.y)];
            tracks.last_mut().expect("there is one by now").points.push(at);
        }
        let mut people: Vec<i64> = samples.iter().filter(|(_, robot)| !robot).map(|(sample, _)| sample.id).collect();
        people.sort_unstable();
        people.dedup();
        let who = if people.len() == 1 { "1 person".to_owned() } else { format!("{} people", people.len()) };
        Self { name: format!("{name}, {who}"), rate: rate / stride as f64, radius, tracks }
    }

    /// Returns the number of kept frames.
    pub(super) fn frames(&self) -> usize {
        self.tracks.iter().map(|track| track.start as usize + track.points.len()).max().unwrap_or(0)
    }
}

/// Writes a track: coordinate after coordinate as the change of its change, which is small where somebody walks on evenly.
pub(super) fn write(track: &Track, bytes: &mut Vec<u8>) {
    for axis in 0..2 {
        let (mut last, mut change) = (0i32, 0i32);
        for point in &track.points {
            let step = point[axis].wrapping_sub(last);
            put(step.wrapping_sub(change), bytes);
            (last, change) = (point[axis], step);
        }
    }
}

/// Writes a number in as few bytes as it needs: zigzag, then seven bits a byte, the lowest first.
fn put(number: i32, bytes: &mut Vec<u8>) {
    let mut rest = ((number << 1) ^ (number >> 31)) as u32;
    while rest >= 0x80 {
        bytes.push((rest & 0x7f) as u8 | 0x80);
        rest >>= 7;
    }
    bytes.push(rest as u8);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::geometry::Point;

    fn sample(id: i64, frame: i64, x: f64) -> (Sample, bool) {
        let at = Point::new(x, 1.0);
        (Sample { episode: 0, id, frame, position: at, velocity: Point::default(), path: 0 }, id == 2)
    }

    /// At 10 frames a second every other one is kept; agent 1 is away for a second.
    #[test]
    fn every_other_frame_is_kept_and_a_gap_begins_another_track() {
        let walk = |id, frames: std::ops::Range<i64>| frames.map(move |frame| sample(id, frame, 0.13 * frame as f64));
        let samples: Vec<_> = walk(1, 7..12).chain(walk(1, 21..24)).chain(walk(2, 9..10)).collect();
        let episode = Episode::new("a", 10.0, 0.2, &samples);
        let told: Vec<_> = episode.tracks.iter().map(|t| (t.robot, t.start, t.points.clone())).collect();
        let expected = [
            (false, 0, vec![[91, 100], [117, 100], [143, 100]]),
            (false, 7, vec![[273, 100], [299, 100]]),
            (true, 1, vec![[117, 100]]),
        ];
        assert_eq!((told, episode.rate, episode.frames()), (expected.to_vec(), 5.0, 9));
    }

    /// 91, +26, +26: the first position, the first step less none, and no change; in zigzag 182, 52 less 65 steps of 91…
    #[test]
    fn numbers_take_few_bytes() {
        let check = |number: i32, expected: &[u8]| {
            let mut bytes = Vec::new();
            put(number, &mut bytes);
            assert_eq!(bytes, expected, "{number}");
        };
        check(0, &[0]);
        check(-1, &[1]);
        check(1, &[2]);
        check(-64, &[127]);
        check(64, &[0x80, 1]);
        check(91, &[0x80 | (182 - 128), 1]);
        check(i32::MIN, &[0xff, 0xff, 0xff, 0xff, 0x0f]);
    }

    #[test]
    fn even_walking_costs_a_byte_a_coordinate() {
        let points = (0..100).map(|i| [26 * i, 500]).collect();
        let mut bytes = Vec::new();
        write(&Track { robot: false, start: 0, points }, &mut bytes);
        // Of y the first position takes two bytes, and so does taking back the step that led there.
        assert_eq!(bytes.len(), 2 * 100 + 2);
    }
}
