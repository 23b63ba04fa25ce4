//! Recorded people where a command takes them: the options that say how they are read.

use std::path::PathBuf;

use super::error::CliError;
use super::screen::Screen;
use crate::domain::map::OccupancyMap;
use crate::domain::recording::{Columns, Format, RecordingConfig, RecordingError, Transform, TransformFields, Unit};
use crate::domain::update::UpdateConfig;
use crate::kinds::Heat;
use crate::pipeline::stage::StageError;
use crate::stages::import_tracks;
use crate::stages::track_heat::{self, Recorded};

/// People who were recorded: what `import-tracks` of a pipeline file takes too.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "People who were recorded on the map")]
pub(super) struct TrackArgs {
    /// Recordings of people: the prediction is updated by where they went. Text with columns, Parquet, or one of the formats of
    /// --tracks-format, plain or gzipped.
    #[arg(long, value_name = "FILE", num_args = 1..)]
    tracks: Vec<PathBuf>,
    /// What the recordings are [default: what their first bytes say]: table, parquet, juelich, jupedsim, vadere, crowdit,
    /// pathfinder, eth, trajnet, atc, thor or mcap.
    #[arg(long, value_name = "FORMAT", requires = "tracks")]
    tracks_format: Option<Format>,
    /// Which columns hold what, by names or numbers: `id=2,time=1,x=3,y=4`, or `frame` in the place of `time`.
    #[arg(long, value_name = "COLUMNS", requires = "tracks")]
    columns: Option<Columns>,
    /// What positions are counted in, where the recording does not say: m, cm, mm, ft, or px with a homography or pairs.
    #[arg(long, value_name = "UNIT", requires = "tracks")]
    tracks_unit: Option<Unit>,
    /// Frames in a second, where times are frames and the recording does not say.
    #[arg(long, value_name = "RATE", requires = "tracks")]
    frame_rate: Option<f64>,
    /// Topic of an MCAP file [default: the only one with people or poses].
    #[arg(long, value_name = "TOPIC", requires = "tracks")]
    topic: Option<String>,
    /// Frame of an MCAP file that positions must be in [default: map].
    #[arg(long, value_name = "FRAME", requires = "tracks")]
    frame_id: Option<String>,
    /// Where the origin of the recording lies on the map, in meters, and by how many radians it is turned: `x,y,yaw`.
    #[arg(long, value_name = "POSE", requires = "tracks", allow_hyphen_values = true, value_parser = numbers::<3>)]
    tracks_pose: Option<[f64; 3]>,
    /// Two positions of the recording and where they lie on the map: `0,0=3,4:5,0=8,4`.
    #[arg(long, value_name = "PAIRS", requires = "tracks", allow_hyphen_values = true, value_parser = pairs,
        conflicts_with = "tracks_pose")]
    tracks_pairs: Option<[[[f64; 2]; 2]; 2]>,
    /// Nine numbers, the rows of a matrix that takes (x, y, 1) to the map.
    #[arg(long, value_name = "NUMBERS", requires = "tracks", allow_hyphen_values = true, value_parser = numbers::<9>,
        conflicts_with_all = ["tracks_pose", "tracks_pairs"])]
    tracks_homography: Option<[f64; 9]>,
    /// Share of the positions that may lie in walls or off the map [default: 0.05].
    #[arg(long, value_name = "SHARE", requires = "tracks")]
    off_map: Option<f64>,
    /// How often the mean cell must have been visited for what was seen to weigh as much as the prediction.
    #[arg(long, value_name = "VISITS", requires = "tracks", default_value_t = UpdateConfig::default().prior)]
    prior: f64,
}

impl TrackArgs {
    /// Returns the recordings that are given.
    pub(super) fn files(&self) -> &[PathBuf] {
        &self.tracks
    }

    /// Reads how recordings are to be read, and checks it against their first bytes.
    ///
    /// # Errors
    /// [`CliError`] names the option that does not fit or is missing.
    pub(super) fn config(&self) -> Result<RecordingConfig, CliError> {
        let default = RecordingConfig::default();
        let config = RecordingConfig {
            format: self.tracks_format,
            columns: self.columns.clone(),
            unit: self.tracks_unit,
            frame_rate: self.frame_rate,
            topic: self.topic.clone(),
            frame_id: self.frame_id.clone(),
            transform: self.transform().map_err(|error| refused(&error))?,
            off_map: self.off_map.unwrap_or(default.off_map),
            ..default
        };
        if !self.tracks.is_empty() {
            config.check().map_err(|error| refused(&error))?;
            self.settings().check().map_err(|error| CliError::request(error.to_string()))?;
            self.tracks.iter().try_for_each(|file| import_tracks::check(file, &config)).map_err(advised)?;
        }
        Ok(config)
    }

    fn transform(&self) -> Result<Option<Transform>, RecordingError> {
        let pose = self.tracks_pose.map(|[x, y, yaw]| TransformFields {
            offset: Some([x, y]),
            yaw: Some(yaw),
            ..TransformFields::default()
        });
        let pairs = self.tracks_pairs.map(|pairs| TransformFields { pairs: Some(pairs), ..TransformFields::default() });
        let homography = self.tracks_homography.map(|[a, b, c, d, e, f, g, h, i]| TransformFields {
            homography: Some([[a, b, c], [d, e, f], [g, h, i]]),
            ..TransformFields::default()
        });
        pose.or(pairs).or(homography).map(Transform::try_from).transpose()
    }

    /// Reads the recordings, if some are given, and says what they held.
    ///
    /// # Errors
    /// [`CliError`] names the file, and what of it cannot be read.
    pub(super) fn seen(
        &self,
        map: &OccupancyMap,
        config: &RecordingConfig,
        screen: &Screen,
    ) -> Result<Option<Recorded>, CliError> {
        if self.tracks.is_empty() {
            return Ok(None);
        }
        let seen = track_heat::recorded(&self.tracks, map, config).map_err(advised)?;
        seen.found.iter().for_each(|line| screen.remark(line));
        let mean = seen.visits.counts.as_slice().iter().map(|count| f64::from(*count)).sum::<f64>()
            / map.free_cells().max(1) as f64;
        let share = 100.0 * mean / (mean + self.prior);
        screen.remark(format!("the mean cell was visited {mean:.2} times: what was seen weighs {share:.0} %"));
        Ok(Some(seen))
    }

    /// Updates a prediction by the people who were seen, if some were.
    ///
    /// # Errors
    /// [`CliError`] if a setting is out of its range.
    pub(super) fn update(&self, map: &OccupancyMap, prior: Heat, seen: Option<&Recorded>) -> Result<Heat, CliError> {
        match seen {
            None => Ok(prior),
            Some(seen) => Ok(track_heat::heat(map, prior, seen, &self.settings())?),
        }
    }

    fn settings(&self) -> UpdateConfig {
        UpdateConfig { prior: self.prior, ..UpdateConfig::default() }
    }
}

/// Gives the advice in options.
fn advised(error: StageError) -> CliError {
    let StageError::Failed { message, source: Some(source), .. } = &error else { return error.into() };
    let Some(option) = source.downcast_ref::<RecordingError>().and_then(advice) else { return error.into() };
    CliError::advised(message.clone(), option)
}

fn refused(error: &RecordingError) -> CliError {
    match advice(error) {
        Some(advice) => CliError::advised(error.to_string(), advice),
        None => CliError::request(error.to_string()),
    }
}

/// Says what helps, where a pipeline file is told something else.
fn advice(error: &RecordingError) -> Option<String> {
    let advice = match error {
        RecordingError::FrameRate => "say, for example, `--frame-rate 25`: the file does not tell",
        RecordingError::NoUnit => "say `--tracks-unit m`, cm, mm or ft",
        RecordingError::NoColumns { line } => {
            let like = line.as_deref().and_then(Format::looks_like);
            let format = like.map_or_else(String::new, |format| format!("`--tracks-format {format}` may fit; or "));
            return Some(format!("{format}say, for example, `--columns id=1,time=2,x=3,y=4`, by names or numbers"));
        }
        RecordingError::NoTransform(_) => "`--tracks-pose`, `--tracks-pairs` or `--tracks-homography` gives it",
        RecordingError::Topic(_) => {
            "name one of them with `--topic`: people_msgs/People and geometry_msgs/PoseArray are read"
        }
        RecordingError::OtherFrame { .. } => {
            "name the frame with `--frame-id`, and say with `--tracks-pose` how it lies in that of the map"
        }
        RecordingError::OtherFormat { .. } => "leave `--tracks-format` out, or correct it",
        RecordingError::OffMap { .. } => {
            "check `--tracks-unit`, and give `--tracks-pose` or `--tracks-pairs` if the recording has a frame of its own; \
             `--off-map 0.2` allows a fifth"
        }
        error => return import_tracks::help(error),
    };
    Some(advice.to_owned())
}

/// Reads numbers with commas between them.
fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|number| number.trim().parse::<f64>()).collect();
    let numbers = numbers.ok().filter(|numbers| numbers.iter().all(|number| number.is_finite()));
    let found = numbers.and_then(|numbers| numbers.try_into().ok());
    found.ok_or_else(|| format!("`{text}` is not {N} numbers with commas between them"))
}

/// Reads two pairs of positions.
fn pairs(text: &str) -> Result<[[[f64; 2]; 2]; 2], String> {
    let wrong = || format!("`{text}` is not as `0,0=3,4:5,0=8,4`");
    let pair = |text: &str| -> Result<[[f64; 2]; 2], String> {
        let (from, to) = text.split_once('=').ok_or_else(wrong)?;
        Ok([numbers(from).map_err(|_| wrong())?, numbers(to).map_err(|_| wrong())?])
    };
    let (first, second) = text.split_once(':').ok_or_else(wrong)?;
    Ok([pair(first)?, pair(second)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_pairs_are_read() {
        assert_eq!(numbers::<3>("1, -2.5,0"), Ok([1.0, -2.5, 0.0]));
        assert_eq!(numbers::<3>("1,2"), Err("`1,2` is not 3 numbers with commas between them".to_owned()));
        assert!(numbers::<1>("nan").is_err());
        assert_eq!(pairs("0,0=3,4:5,0=8,4"), Ok([[[0.0, 0.0], [3.0, 4.0]], [[5.0, 0.0], [8.0, 4.0]]]));
        for wrong in ["0,0=3,4", "0,0:5,0", "0=3,4:5,0=8,4"] {
            assert!(pairs(wrong).is_err(), "{wrong}");
        }
    }
}
