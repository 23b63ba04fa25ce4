//! `import-tracks`: people who were recorded.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::{kind, read};
use crate::domain::map::OccupancyMap;
use crate::domain::recording::{self, Format, Found, Joined, RecordingConfig, RecordingError};
use crate::domain::tracks::Tracks;
use crate::kinds::{Placed, TrackWriter, recorded_rows};
use crate::pipeline::stage::{
    Arity, Context, Entry, Inputs, Needs, Output, ParameterError, Part, Port, Source, Stage, StageError, StageSpec,
};
use crate::store::{Store, open_regular, read_bounded};

/// The most bytes of a recording.
const MOST: u64 = 4 << 30;
/// The first bytes of what gzip has packed.
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// How columns are named, for advice.
const COLUMNS: &str = "{ id: 1, time: 2, x: 3, y: 4 }";

/// Parameters of `import-tracks`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Fields {
    /// The recording: a table, or one of the formats of `format`, plain or gzipped; a relative path starts at the folder of the
    /// pipeline file.
    file: PathBuf,
    #[serde(flatten)]
    recording: RecordingConfig,
}

/// One recording to import.
#[derive(Debug, Clone)]
pub struct ImportTracks {
    /// Where it lies.
    file: PathBuf,
    config: RecordingConfig,
}

impl ImportTracks {
    /// What is the same for every use.
    pub const SPEC: StageSpec = StageSpec {
        name: "import-tracks",
        version: 1,
        ports: &[Port { name: "map", kind: "OccupancyMap", arity: Arity::One, doc: "The map that people walked on." }],
        output: kind::<Placed<Tracks>>(),
        seeded: false,
        doc: "Reads people who were recorded on a map: what follows works as with simulated ones.",
    };

    /// The line of the register.
    pub(super) const ENTRY: Entry = Entry { spec: &Self::SPEC, parse: Self::parse, schema: super::schema::<Fields> };

    fn parse(value: &Value, folder: &Path) -> Result<Arc<dyn Stage>, ParameterError> {
        let Fields { file, recording: config } = super::parse(value)?;
        config.check().map_err(|error| refused(&error, &config))?;
        Ok(Arc::new(Self { file: folder.join(file), config }))
    }
}

/// Reads the people of a recording as tracks on a map; hands back what is to be said of it, too.
///
/// # Errors
/// [`StageError`] names the file, and what of it cannot be read.
pub fn tracks(
    file: &Path,
    map: &OccupancyMap,
    config: &RecordingConfig,
) -> Result<(Joined, Vec<String>), StageError> {
    let Found { sightings, remarks } = sightings(file, config)?;
    Ok((recording::join(sightings, map, config).map_err(|error| failed(file, error))?, remarks))
}

fn sightings(file: &Path, config: &RecordingConfig) -> Result<Found, StageError> {
    let unread = |source| StageError::Source { path: file.to_owned(), source };
    let bytes = read_bounded(file, MOST).map_err(unread)?;
    let bytes = if bytes.starts_with(&GZIP) { unpacked(&bytes[..]).map_err(unread)? } else { bytes };
    let read = || match (recording::format_of(&bytes, config)?, &config.columns) {
        (Format::Parquet, Some(columns)) => recording::sightings_of(&recorded_rows(bytes.clone(), columns)?, config),
        (format, _) => recording::sightings(&bytes, format, config),
    };
    read().map_err(|error| failed(file, error))
}

/// Checks by the first bytes of a recording that the configuration fits it. Whatever keeps them from being read is said when
/// all is read.
///
/// # Errors
/// [`StageError`] names the file, and what does not fit.
pub fn check(file: &Path, config: &RecordingConfig) -> Result<(), StageError> {
    const HEAD: u64 = 1 << 16;
    let mut head = Vec::new();
    let Ok(file_head) = open_regular(file).and_then(|file| file.take(HEAD).read_to_end(&mut head)) else { return Ok(()) };
    if file_head == 0 {
        return Err(failed(file, RecordingError::Empty));
    }
    if head.starts_with(&GZIP) {
        let mut plain = Vec::new();
        // It ends where the head was cut off.
        drop(flate2::read::MultiGzDecoder::new(&head[..]).take(HEAD).read_to_end(&mut plain));
        head = plain;
    }
    recording::format_of(&head, config).map(drop).map_err(|error| failed(file, error))
}

fn failed(file: &Path, error: RecordingError) -> StageError {
    let message = format!("{}: {error}", file.display());
    StageError::Failed { message, help: help(&error), source: Some(Box::new(error)) }
}

fn refused(error: &RecordingError, config: &RecordingConfig) -> ParameterError {
    let refused = ParameterError { help: help(error), ..super::refused_setting(error) };
    match error {
        // What is missing has no place of its own.
        RecordingError::FrameRate | RecordingError::NoUnit | RecordingError::NoColumns { .. } => {
            let place = if config.columns.is_some() { "columns" } else { "format" };
            ParameterError { path: vec![place.to_owned()], ..refused }
        }
        RecordingError::TwoSpans => ParameterError { path: vec!["span_s".to_owned()], ..refused },
        _ => refused,
    }
}

/// Unpacks what gzip has packed, up to the most that a recording may have.
fn unpacked(bytes: &[u8]) -> std::io::Result<Vec<u8>> {
    let mut out = Vec::new();
    flate2::read::MultiGzDecoder::new(bytes).take(MOST + 1).read_to_end(&mut out)?;
    if out.len() as u64 > MOST {
        return Err(std::io::Error::other("it unpacks to more than 4 GiB"));
    }
    Ok(out)
}

/// Says what helps.
pub fn help(error: &RecordingError) -> Option<String> {
    let advice = match error {
        RecordingError::Range { .. } => return None,
        RecordingError::TwoSpans => "leave one of them out",
        RecordingError::EmptySpan { .. } => "seconds count from the first sighting on",
        RecordingError::Unfit { .. } => "leave it out: a recording of this format says it itself, or has none",
        RecordingError::Contradicts { .. } => "leave it out, or correct it",
        RecordingError::OtherFormat { .. } => "leave `format` out, or correct it",
        RecordingError::Format { .. } => "check that the file is whole, and its `format`",
        RecordingError::NoText => "name its `format`; of tables, text and Parquet are read",
        RecordingError::Topic(_) => "name one of them with `topic`: people_msgs/People and geometry_msgs/PoseArray are read",
        RecordingError::OtherFrame { .. } => {
            "name the frame with `frame_id`, and say with `transform` how it lies in that of the map"
        }
        RecordingError::NoColumns { line } => {
            let like = line.as_deref().and_then(Format::looks_like);
            return Some(match like {
                Some(format) => format!("`format: {format}` may fit; or write, say, `columns: {COLUMNS}`"),
                None => format!("write, say, `columns: {COLUMNS}`, by names or numbers; or the `format`"),
            });
        }
        RecordingError::NoValue { .. } => "check `columns`, or remove the row",
        RecordingError::Clock(_) => {
            "write `time` for seconds, or `frame` and how many of them a second has (`frame_rate`)"
        }
        RecordingError::FrameRate => "write, say, `frame_rate: 25`: the file does not tell",
        RecordingError::NoUnit => "write `unit: m`, `cm`, `mm`, `ft`, or `px` with a `transform`",
        RecordingError::NoTransform(_) => {
            "write `transform: { yaw: 1.57, offset: [3, 4] }`, two `pairs` of positions, or a `homography`"
        }
        RecordingError::NoColumn { .. } | RecordingError::ShortLine { .. } => {
            "name columns as the first line does, or by their numbers from 1 on"
        }
        RecordingError::NoNumber { .. } => "check `columns`, or remove the line",
        RecordingError::Empty => "check `columns`: no line has numbers there",
        RecordingError::TwoPlaces { .. } => "check which column is `id`, and which `time` or `frame`",
        RecordingError::OffMap { .. } => {
            "check `unit`, and give `transform` if the recording has a frame of its own; `off_map: 0.2` allows a fifth"
        }
    };
    Some(advice.to_owned())
}

impl Stage for ImportTracks {
    fn parameters(&self) -> Value {
        super::to_json(&self.config)
    }

    fn sources(&self) -> Result<Vec<Source>, StageError> {
        check(&self.file, &self.config)?;
        Ok(vec![Source { role: "tracks".to_owned(), path: self.file.clone() }])
    }

    fn needs(&self, _: Part, _: &Inputs, _: &Store) -> Needs {
        // The text, its cells, sightings and samples.
        let bytes = std::fs::metadata(&self.file).map_or(0, |metadata| metadata.len());
        super::memory(bytes.saturating_mul(16))
    }

    fn run(&self, _: Part, inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
        let (map, _): (OccupancyMap, _) = read(context, inputs.one("map"))?;
        let (joined, _) = tracks(&self.file, &map, &self.config)?;
        let Joined { tracks, people, sightings, off_map, breaks } = joined;
        if off_map > 0 {
            (context.warn)(format!("{off_map} of {sightings} positions lie in walls or off the map"));
        }
        let mut writer = TrackWriter::new(context.store.create()?, *map.frame(), tracks.frame_rate, tracks.radius)
            .map_err(super::kind_failed)?;
        writer.extend(&tracks.samples).map_err(super::kind_failed)?;
        let facts = json!({ "people": people, "positions": sightings, "off_map": off_map, "breaks": breaks });
        writer.note("recording", &facts.to_string());
        Ok(Output::File(writer.finish().map_err(super::kind_failed)?.finish("")?))
    }
}
