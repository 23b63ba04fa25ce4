//! `import-tracks`: people who were recorded.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::{kind, read};
use crate::domain::map::OccupancyMap;
use crate::domain::recording::{self, ColumnName, Joined, RecordingConfig, RecordingError};
use crate::domain::tracks::Tracks;
use crate::kinds::{Placed, TrackWriter};
use crate::pipeline::stage::{
    Arity, Context, Entry, Inputs, Needs, Output, ParameterError, Part, Port, Source, Stage, StageError, StageSpec,
};
use crate::store::{Store, read_bounded};

/// The most bytes of a recording.
const MOST: u64 = 4 << 30;

/// Parameters of `import-tracks`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Fields {
    /// The recording: text with commas, semicolons, tabs or blanks between its columns, plain or gzipped; a relative path
    /// starts at the folder of the pipeline file.
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
        config.check().map_err(refused)?;
        Ok(Arc::new(Self { file: folder.join(file), config }))
    }

    fn failed(&self, error: RecordingError) -> StageError {
        let message = format!("{}: {error}", self.file.display());
        StageError::Failed { message, help: help(&error), source: Some(Box::new(error)) }
    }

    fn join(&self, map: &OccupancyMap) -> Result<Joined, StageError> {
        let unread = |source| StageError::Source { path: self.file.clone(), source };
        let bytes = read_bounded(&self.file, MOST).map_err(unread)?;
        let text = if bytes.starts_with(&[0x1f, 0x8b]) { unpacked(&bytes).map_err(unread)? } else { bytes };
        let columns = &self.config.columns;
        let all =
            [Some(&columns.id), columns.time.as_ref(), columns.frame.as_ref(), Some(&columns.x), Some(&columns.y)];
        let has_names = all.into_iter().flatten().any(|column| matches!(column, ColumnName::Name(_)));
        let cells = recording::read(&String::from_utf8_lossy(&text), has_names);
        let sightings = recording::sightings(&cells, &self.config).map_err(|error| self.failed(error))?;
        recording::join(sightings, map, &self.config).map_err(|error| self.failed(error))
    }
}

fn refused(error: RecordingError) -> ParameterError {
    let refused = ParameterError { help: help(&error), ..super::refused_setting(&error) };
    match error {
        // What is missing has no place of its own.
        RecordingError::FrameRate | RecordingError::NoUnit => {
            ParameterError { path: vec!["columns".to_owned()], ..refused }
        }
        _ => refused,
    }
}

/// Unpacks what gzip has packed, up to the most that a recording may have.
fn unpacked(bytes: &[u8]) -> std::io::Result<Vec<u8>> {
    use std::io::Read;
    let mut out = Vec::new();
    flate2::read::MultiGzDecoder::new(bytes).take(MOST + 1).read_to_end(&mut out)?;
    if out.len() as u64 > MOST {
        return Err(std::io::Error::other("it unpacks to more than 4 GiB"));
    }
    Ok(out)
}

/// Says what helps.
fn help(error: &RecordingError) -> Option<String> {
    let advice = match error {
        RecordingError::Range { .. } => return None,
        RecordingError::Clock(_) => {
            "write `time` for seconds, or `frame` and how many of them a second has (`frame_rate`)"
        }
        RecordingError::FrameRate => "write, say, `frame_rate: 25`: the file does not tell",
        RecordingError::NoUnit => "write `unit: m`, `cm`, `mm` or `ft`",
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
        Ok(vec![Source { role: "tracks".to_owned(), path: self.file.clone() }])
    }

    fn needs(&self, _: Part, _: &Inputs, _: &Store) -> Needs {
        // The text, its cells, sightings and samples.
        let bytes = std::fs::metadata(&self.file).map_or(0, |metadata| metadata.len());
        super::memory(bytes.saturating_mul(16))
    }

    fn run(&self, _: Part, inputs: &Inputs, context: &Context) -> Result<Output, StageError> {
        let (map, _): (OccupancyMap, _) = read(context, inputs.one("map"))?;
        let Joined { tracks, people, sightings, off_map, breaks } = self.join(&map)?;
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
