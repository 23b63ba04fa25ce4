//! Sightings joined to tracks.

use super::{RecordingConfig, RecordingError, Sighting};
use crate::domain::geometry::Point;
use crate::domain::map::OccupancyMap;
use crate::domain::tracks::{Sample, Tracks};

/// Tracks, and what became of the sightings.
#[derive(Debug, Clone, PartialEq)]
pub struct Joined {
    /// The tracks: one episode, people by their numbers.
    pub tracks: Tracks,
    /// Number of people.
    pub people: usize,
    /// Number of sightings.
    pub sightings: usize,
    /// Those among them that lie in walls or off the map.
    pub off_map: usize,
    /// How often somebody was lost for too long.
    pub breaks: usize,
}

/// Joins the sightings of each person, in the frame of the map, to tracks of a steady rate.
///
/// Between two sightings that are no further apart than `max_gap` a person walks straight ahead; beyond, they were lost: the
/// track breaks, and a new leg begins. A person who is slower than `standing` between two sightings stands. That is time spent
/// there, not a passage: the leg ends, and what they stand belongs to it; the next leg begins as they walk on.
///
/// # Errors
/// [`RecordingError`] if there is nothing to join, a person is in two places at once, or too many positions lie off the map.
pub fn join(
    mut sightings: Vec<Sighting>,
    map: &OccupancyMap,
    config: &RecordingConfig,
) -> Result<Joined, RecordingError> {
    if sightings.is_empty() {
        return Err(RecordingError::Empty);
    }
    let off_map = off_map(&sightings, map, config)?;
    let times = |least: f64, of: fn(f64, f64) -> f64| sightings.iter().map(|sighting| sighting.time).fold(least, of);
    let (start, end) = (times(f64::INFINITY, f64::min), times(f64::NEG_INFINITY, f64::max));
    let [from, to] = match config.span_s {
        Some(span) => span.map(|seconds| start + seconds),
        None => config.span.map(|share| start + share * (end - start)),
    };
    // What happens just then belongs to the part that begins.
    sightings.retain(|sighting| sighting.time >= from && (sighting.time < to || (to >= end && sighting.time == end)));
    if sightings.is_empty() {
        return Err(RecordingError::EmptySpan { from: from - start, to: to - start, length: end - start });
    }
    sightings.sort_by(|a, b| a.person.cmp(&b.person).then(a.time.total_cmp(&b.time)));
    sightings.dedup();
    let first = sightings.iter().map(|sighting| sighting.time).fold(f64::INFINITY, f64::min);
    let mut joined = Joined {
        tracks: Tracks { frame_rate: config.rate, radius: config.radius, samples: Vec::new() },
        people: 0,
        sightings: sightings.len(),
        off_map,
        breaks: 0,
    };
    for person in sightings.chunk_by(|a, b| a.person == b.person) {
        if let Some(pair) = person.windows(2).find(|pair| pair[0].time == pair[1].time) {
            return Err(RecordingError::TwoPlaces { person: pair[0].person, time: pair[0].time });
        }
        joined.people += 1;
        let mut walk = Walk { map, config, first, leg: 0, last: None };
        for (number, run) in person.chunk_by(|a, b| b.time - a.time <= config.max_gap + 1e-9).enumerate() {
            joined.breaks += usize::from(number > 0);
            walk.run(run, &mut joined);
        }
    }
    Ok(joined)
}

/// One person's way through a recording.
struct Walk<'a> {
    map: &'a OccupancyMap,
    config: &'a RecordingConfig,
    /// Time of the first frame.
    first: f64,
    leg: u32,
    /// The last frame that was written.
    last: Option<i64>,
}

impl Walk<'_> {
    /// Writes the frames of sightings that follow each other.
    fn run(&mut self, run: &[Sighting], joined: &mut Joined) {
        if self.last.is_some() {
            self.leg += 1;
        }
        let id = run[0].person;
        // Whether anybody has walked in this run, and whether the leg has ended by standing.
        let (mut walked, mut stood) = (false, false);
        if let [alone] = run {
            let frame = ((alone.time - self.first) * self.config.rate).round() as i64;
            self.write(id, frame, alone.position, Point::default(), joined);
        }
        for pair in run.windows(2) {
            let [a, b] = pair else { unreachable!("windows of two") };
            let seconds = b.time - a.time;
            let velocity = Point::new((b.position.x - a.position.x) / seconds, (b.position.y - a.position.y) / seconds);
            let stands = a.position.distance(b.position) < self.config.standing * seconds;
            if !stands {
                // Who stands before they have walked waits for the leg to come.
                self.leg += u32::from(stood && walked);
                walked = true;
            }
            stood = stands;
            let frame = |time: f64| (time - self.first) * self.config.rate;
            // A frame on a sighting is written once, by the step that ends there, or begins if it is the first.
            let (from, to) = ((frame(a.time) - 1e-6).ceil() as i64, (frame(b.time) + 1e-6).floor() as i64);
            for number in from..=to {
                let share = ((number as f64 / self.config.rate + self.first - a.time) / seconds).clamp(0.0, 1.0);
                let along = |from: f64, to: f64| from + share * (to - from);
                let position = Point::new(along(a.position.x, b.position.x), along(a.position.y, b.position.y));
                self.write(id, number, position, velocity, joined);
            }
        }
    }

    fn write(&mut self, id: i64, frame: i64, position: Point, velocity: Point, joined: &mut Joined) {
        if self.last.is_some_and(|last| last >= frame) {
            return;
        }
        self.last = Some(frame);
        let to_map = self.map.frame();
        let (position, velocity) = (to_map.to_local(position), to_map.vector_to_local(velocity));
        joined.tracks.samples.push(Sample { episode: 0, id, frame, position, velocity, path: self.leg });
    }
}

/// Counts the positions that lie in walls or off the map; refuses too many.
fn off_map(sightings: &[Sighting], map: &OccupancyMap, config: &RecordingConfig) -> Result<usize, RecordingError> {
    let frame = map.frame();
    let is_free = |position: Point| {
        // What a homography takes to infinity lies nowhere.
        position.x.is_finite() && position.y.is_finite() && {
            let (row, col) = frame.signed_cell(frame.to_local(position));
            map.is_free(row, col)
        }
    };
    let off = sightings.iter().filter(|sighting| !is_free(sighting.position)).count();
    let share = off as f64 / sightings.len() as f64;
    if share <= config.off_map {
        return Ok(off);
    }
    let (width, height) = (frame.cols as f64 * frame.resolution, frame.rows as f64 * frame.resolution);
    let corners = [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)];
    let corners = corners.map(|(x, y)| frame.to_map(Point::new(x, y)));
    let positions: Vec<Point> = sightings.iter().map(|sighting| sighting.position).collect();
    Err(RecordingError::OffMap {
        off,
        all: sightings.len(),
        share: 100.0 * share,
        span: span(&positions),
        map: span(&corners),
    })
}

/// Says between which coordinates points lie.
fn span(points: &[Point]) -> String {
    let range = |of: &dyn Fn(&Point) -> f64| {
        points.iter().map(of).fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
    };
    let ((left, right), (low, high)) = (range(&|p| p.x), range(&|p| p.y));
    format!("x from {left:.1} to {right:.1} and y from {low:.1} to {high:.1} m")
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::domain::geometry::{Frame, Grid};

    /// Free floor of 10 m × 4 m with its lower left corner at (−1, 2).
    fn floor() -> OccupancyMap {
        let frame = Frame { origin: Point::new(-1.0, 2.0), ..Frame::at_zero(0.1, 40, 100) };
        OccupancyMap::new(Grid::filled(40, 100, true), frame).expect("free cells")
    }

    fn config() -> RecordingConfig {
        let columns = json!({ "id": 1, "time": 2, "x": 3, "y": 4 });
        serde_json::from_value(json!({ "columns": columns, "unit": "m", "rate": 2.0 })).expect("a configuration")
    }

    /// Sightings of one person at height 3, given as (time, x).
    fn seen(person: i64, places: &[(f64, f64)]) -> Vec<Sighting> {
        let place = |(time, x): &(f64, f64)| Sighting { person, time: *time, position: Point::new(*x, 3.0) };
        places.iter().map(place).collect()
    }

    fn joined(sightings: Vec<Sighting>) -> Joined {
        join(sightings, &floor(), &config()).expect("tracks")
    }

    /// Frame, x in the frame of the map, and leg of every sample.
    fn samples(joined: &Joined) -> Vec<(i64, f64, u32)> {
        let x = |sample: &Sample| (floor().frame().to_map(sample.position).x * 1e6).round() / 1e6;
        joined.tracks.samples.iter().map(|sample| (sample.frame, x(sample), sample.path)).collect()
    }

    #[test]
    fn between_two_sightings_people_walk_straight_ahead() {
        // Two frames a second from the first sighting at 10.2 s on: at 10.2, 10.7, 11.2 s …
        let found = joined(seen(7, &[(10.2, 0.0), (11.0, 0.8), (12.4, 2.2)]));
        assert_eq!(samples(&found), [(0, 0.0, 0), (1, 0.5, 0), (2, 1.0, 0), (3, 1.5, 0), (4, 2.0, 0)]);
        let velocity = found.tracks.samples[1].velocity;
        assert!((velocity.x - 1.0).abs() < 1e-12 && velocity.y.abs() < 1e-12);
        assert_eq!((found.people, found.sightings, found.off_map, found.breaks), (1, 3, 0, 0));
    }

    #[test]
    fn tracks_break_where_a_person_was_lost() {
        // 1.5 s may pass, 1.6 s may not; who is seen only once is there for a frame.
        let found = joined(seen(7, &[(0.0, 0.0), (1.5, 1.5), (3.1, 3.0), (4.1, 4.0), (8.0, 5.0)]));
        let expected = [(0, 0.0, 0), (1, 0.5, 0), (2, 1.0, 0), (3, 1.5, 0), (7, 3.4, 1), (8, 3.9, 1), (16, 5.0, 2)];
        assert_eq!(samples(&found), expected);
        assert_eq!(found.breaks, 2);
    }

    #[test]
    fn who_stands_has_arrived_and_sets_out_anew() {
        // One second of walking, one of standing (0.1 m), one of walking: the time spent belongs to the leg that ended.
        let found = joined(seen(7, &[(0.0, 0.0), (1.0, 1.0), (2.0, 1.1), (3.0, 2.1)]));
        let expected = [(0, 0.0, 0), (1, 0.5, 0), (2, 1.0, 0), (3, 1.05, 0), (4, 1.1, 0), (5, 1.6, 1), (6, 2.1, 1)];
        assert_eq!(samples(&found), expected);
        // Who stands first waits for the leg to come.
        let found = joined(seen(7, &[(0.0, 0.0), (1.0, 0.0), (2.0, 1.0)]));
        assert!(samples(&found).iter().all(|sample| sample.2 == 0));
    }

    #[test]
    fn a_part_of_the_time_may_be_read() {
        let sightings = seen(7, &[(10.0, 0.0), (11.0, 1.0), (12.0, 2.0), (13.0, 3.0), (14.0, 4.0)]);
        let part = |span| {
            let config = RecordingConfig { span, ..config() };
            let found = join(sightings.clone(), &floor(), &config).expect("tracks");
            let places: Vec<f64> = samples(&found).iter().map(|sample| sample.1).collect();
            (found.sightings, places)
        };
        assert_eq!(part([0.0, 0.5]), (2, vec![0.0, 0.5, 1.0]));
        assert_eq!(part([0.5, 1.0]), (3, vec![2.0, 2.5, 3.0, 3.5, 4.0]));
        let seconds = |span_s| {
            let config = RecordingConfig { span_s: Some(span_s), ..config() };
            join(sightings.clone(), &floor(), &config).map(|found| found.sightings)
        };
        assert_eq!(seconds([0.0, 2.0]), Ok(2));
        assert_eq!(seconds([2.0, 60.0]), Ok(3));
        let late = seconds([4.5, 60.0]).expect_err("nobody").to_string();
        assert_eq!(late, "nobody was seen from 4.5 to 60 s; the recording is 4 s long");
    }

    #[test]
    fn people_are_kept_apart() {
        let mut both = seen(9, &[(1.0, 0.0), (2.0, 1.0)]);
        both.extend(seen(4, &[(0.0, 5.0), (0.5, 5.5)]));
        let found = joined(both);
        let ids: Vec<(i64, i64)> = found.tracks.samples.iter().map(|sample| (sample.id, sample.frame)).collect();
        assert_eq!(ids, [(4, 0), (4, 1), (9, 2), (9, 3), (9, 4)]);
    }

    #[test]
    fn what_cannot_be_joined_is_named() {
        let refused = |sightings| join(sightings, &floor(), &config()).expect_err("refused").to_string();
        assert_eq!(refused(Vec::new()), "there are no positions in it");
        assert_eq!(refused(seen(7, &[(0.0, 0.0), (0.0, 1.0)])), "person 7 is in two places at 0 s");
        // The same twice is the same; the left edge of the map is at −1.
        assert_eq!(joined(seen(7, &[(0.0, 0.0), (0.0, 0.0), (1.0, 1.0)])).sightings, 2);
        let mut places = vec![(0.0, -1.01)];
        places.extend((1..20).map(|i| (f64::from(i), -0.99)));
        assert_eq!(joined(seen(7, &places)).off_map, 1);
        places[1].1 = 30.0;
        assert_eq!(
            refused(seen(7, &places)),
            "2 of 20 positions (10.0 %) lie in walls or off the map; they span x from -1.0 to 30.0 and y from 3.0 to 3.0 m, the \
             map x from -1.0 to 9.0 and y from 2.0 to 6.0 m"
        );
    }
}
