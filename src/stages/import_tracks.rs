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
use crate::kinds::{Placed, TrackWriter, chunk_files, recorded_rows};
use crate::pipeline::stage::{
    Arity, Context, Division, Entry, Inputs, Needs, Output, ParameterError, Part, Port, Source, Stage, StageError,
    StageSpec, Surroundings,
};
use crate::store::{Artifact, Store, open_regular, read_bounded};

/// The most bytes of a recording.
const MOST: u64 = 4 << 30;
/// The most recordings.
const MOST_FILES: usize = 10_000;
/// The first bytes of what gzip has packed.
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// How columns are named, for advice.
const COLUMNS: &str = "{ id: 1, time: 2, x: 3, y: 4 }";

/// Parameters of `import-tracks`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Fields {
    /// The recording, or some that belong together, such as days: tables, or one of the formats of `format`, plain or gzipped;
    /// a relative path starts at the folder of the pipeline file.
    file: Files,
    #[serde(flatten)]
    recording: RecordingConfig,
}

/// Where recordings lie.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
enum Files {
    /// One of them.
    One(PathBuf),
    /// Some, each a part of its own: where one is added, only that is read.
    Many(Vec<PathBuf>),
}

/// Recordings to import.
#[derive(Debug, Clone)]
pub struct ImportTracks {
    /// Where they lie.
    files: Vec<PathBuf>,
    /// Whether each of them is a part of its own: then more may come.
    is_list: bool,
    config: RecordingConfig,
}

impl ImportTracks {
    /// What is the same for every use.
    pub fn spec() -> StageSpec {
        StageSpec::new(
            "import-tracks",
            1,
            vec![Port::new("map", "OccupancyMap", Arity::One, "The map that people walked on.")],
            kind::<Placed<Tracks>>(),
            "Reads people who were recorded on a map: what follows works as with simulated ones.",
        )
    }

    /// The line of the register.
    pub(super) fn entry() -> Entry {
        Entry::new(Self::spec(), Self::parse, super::schema::<Fields>)
    }

    fn parse(value: &Value, surroundings: &Surroundings) -> Result<Arc<dyn Stage>, ParameterError> {
        let folder = surroundings.folder;
        let Fields { file, recording: config } = super::parse(value)?;
        config.check().map_err(|error| refused(&error, &config))?;
        let (files, is_list) = match file {
            Files::One(file) => (vec![folder.join(file)], false),
            Files::Many(files) if (1..=MOST_FILES).contains(&files.len()) => {
                (files.into_iter().map(|file| folder.join(file)).collect(), true)
            }
            Files::Many(files) => {
                let message = format!("`file` has {} files, allowed are 1 to {MOST_FILES}", files.len());
                return Err(super::refused("file", message));
            }
        };
        Ok(Arc::new(Self { files, is_list, config }))
    }

    /// Names a file in recipes.
    fn role(&self, number: usize) -> String {
        if self.is_list { format!("tracks-{number:02}") } else { "tracks".to_owned() }
    }

    /// Returns the file that a part reads, and its number.
    fn file(&self, part: Part) -> Option<(u32, &Path)> {
        let number = match part {
            Part::Whole => 0,
            Part::Chunk(number) => number,
            _ => return None,
        };
        Some((number, &self.files[number as usize]))
    }
}

/// Reads the people of a recording as tracks on a map; hands back what is to be said of it, too.
///
/// # Errors
/// [`StageError`] names the file, and what of it cannot be read.
pub fn tracks(file: &Path, map: &OccupancyMap, config: &RecordingConfig) -> Result<(Joined, Vec<String>), StageError> {
    let Found { sightings, remarks } = sightings(file, config)?;
    Ok((recording::join(sightings, map, config).map_err(|error| failed(file, error))?, remarks))
}

fn sightings(file: &Path, config: &RecordingConfig) -> Result<Found, StageError> {
    let unread = |source| StageError::Source { path: file.to_owned(), source };
    let bytes = read_bounded(file, MOST).map_err(unread)?;
    let bytes =
        if bytes.starts_with(&GZIP) { unpacked(&bytes).map_err(|source| packed(file, &source))? } else { bytes };
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
    let Ok(file_head) = open_regular(file).and_then(|file| file.take(HEAD).read_to_end(&mut head)) else {
        return Ok(());
    };
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

fn packed(file: &Path, source: &std::io::Error) -> StageError {
    let message = format!("{}: gzip cannot unpack it: {source}", file.display());
    StageError::Failed { message, help: Some("check that the file is whole".to_owned()), source: None }
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
        RecordingError::Topic(_) => {
            "name one of them with `topic`: people_msgs/People and geometry_msgs/PoseArray are read"
        }
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

    fn part_parameters(&self, part: Part) -> Value {
        if part == Part::Gather { json!({}) } else { self.parameters() }
    }

    fn division(&self) -> Division {
        let count = u32::try_from(self.files.len()).expect("as many as were checked");
        if self.is_list { Division::Chunks(count) } else { Division::Whole }
    }

    fn part_ports(&self, part: Part) -> Option<&'static [&'static str]> {
        (part == Part::Gather).then_some(&[])
    }

    fn part_sources(&self, part: Part) -> Option<Vec<String>> {
        match part {
            Part::Chunk(number) => Some(vec![self.role(number as usize)]),
            Part::Gather => Some(Vec::new()),
            _ => None,
        }
    }

    fn sources(&self) -> Result<Vec<Source>, StageError> {
        let source = |(number, file): (usize, &PathBuf)| {
            check(file, &self.config)?;
            Ok(Source { role: self.role(number), path: file.clone() })
        };
        self.files.iter().enumerate().map(source).collect()
    }

    fn needs(&self, part: Part, _: &Inputs, _: &Store) -> Needs {
        // What the file holds as it lies there and unpacked, its sightings and samples.
        let bytes = |file: &Path| std::fs::metadata(file).map_or(0, |metadata| metadata.len());
        super::memory(self.file(part).map_or(0, |(_, file)| bytes(file).saturating_mul(16)))
    }

    fn run(&self, part: Part, inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
        let Some((episode, file)) = self.file(part) else {
            let chunks: Vec<Artifact> = inputs.parts.iter().map(|(_, artifact)| artifact.clone()).collect();
            return Ok(Output::Bundle(chunk_files(&chunks).map_err(super::kind_failed)?));
        };
        let (map, _): (OccupancyMap, _) = read(context, inputs.one("map"))?;
        let (joined, _) = tracks(file, &map, &self.config)?;
        let Joined { mut tracks, people, sightings, off_map, breaks } = joined;
        // People of one recording are not those of another, whatever their numbers.
        tracks.samples.iter_mut().for_each(|sample| sample.episode = episode);
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
