//! A file of whatever kind as the table that it is, after its own reader has looked at it.

use super::parquet::{AnyTable, read_any};
use super::{Heat, KindError, NavEpisodes, Placed, SingleFile, TrackReader};
use crate::domain::map::OccupancyMap;
use crate::domain::planner::Trials;
use crate::domain::quantize::Labels;
use crate::domain::raster::VisitCounts;
use crate::domain::score::ClassScores;
use crate::domain::social::SocialCosts;
use crate::domain::tiles::Tiles;

/// What a file is called as long as its kind is not known.
const ANY: &str = "artifact";

/// Reads a table of one of our kinds, and checks it as the reader of that kind does.
///
/// # Errors
/// [`KindError`] if it is no Parquet file, names no kind, or holds what no stage would have written. Tables that are parts of
/// bundles and have no reader of their own are only decoded.
pub fn checked(bytes: Vec<u8>) -> Result<AnyTable, KindError> {
    let table = read_any(bytes.clone()).map_err(|source| KindError::Decode { kind: ANY, source })?;
    let Some(kind) = table.metadata.get("kind") else { return Err(KindError::NoKind { expected: ANY }) };
    match kind.as_str() {
        "OccupancyMap" => OccupancyMap::from_bytes(bytes).map(drop)?,
        "Heat" => Placed::<Heat>::from_bytes(bytes).map(drop)?,
        "VisitCounts" => Placed::<VisitCounts>::from_bytes(bytes).map(drop)?,
        "Labels" => Placed::<Labels>::from_bytes(bytes).map(drop)?,
        "Tiles" => Tiles::from_bytes(bytes).map(drop)?,
        "ClassScores" => ClassScores::from_bytes(bytes).map(drop)?,
        "SocialCosts" => SocialCosts::from_bytes(bytes).map(drop)?,
        "NavEpisodes" => Placed::<NavEpisodes>::from_bytes(bytes).map(drop)?,
        "PathTrials" => Placed::<Trials>::from_bytes(bytes).map(drop)?,
        "Trajectories" => TrackReader::open(bytes)?.try_for_each(|samples| samples.map(drop))?,
        _ => {}
    }
    Ok(table)
}
