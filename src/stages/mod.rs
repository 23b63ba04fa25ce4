//! Join. Each stage reads artifacts, lets the domain compute, and writes one artifact.
//!
//! Adding a stage means one file here and one line in [`REGISTER`].

pub mod annotate;
mod baseline;
pub mod betweenness;
pub mod compute;
pub mod cost;
pub mod criticality;
mod crowd;
pub mod crowd_heat;
mod definition;
mod episodes;
pub mod generate_map;
pub mod hide_rooms;
pub mod import_map;
pub mod import_tracks;
pub mod isovist;
pub mod map_origin;
pub mod maps;
pub mod navigate;
pub mod path_around;
mod plan_advice;
pub mod plan_paths;
pub mod quantize;
pub mod rank;
pub mod rasterize;
pub mod score;
pub mod simulate;
pub mod tile;
pub mod track_heat;
pub mod train;
pub mod uniform;
pub mod update;
pub mod wall_distance;

use crate::pipeline::stage::Register;
use definition::{
    Definition, kind, kind_failed, memory, parse, read, refused, refused_setting, same_frame, schema, to_json, write,
};

/// All stages and map sources.
pub const REGISTER: Register = Register {
    stages: &[
        simulate::Simulate::ENTRY,
        import_tracks::ImportTracks::ENTRY,
        rasterize::Rasterize::ENTRY,
        hide_rooms::HideRooms::ENTRY,
        quantize::Quantize::ENTRY,
        tile::Tile::ENTRY,
        train::Train::ENTRY,
        annotate::Annotate::ENTRY,
        rank::Rank::ENTRY,
        update::Update::ENTRY,
        wall_distance::WallDistance::ENTRY,
        betweenness::Betweenness::ENTRY,
        criticality::Criticality::ENTRY,
        isovist::Isovist::ENTRY,
        uniform::Uniform::ENTRY,
        score::Score::ENTRY,
        navigate::Navigate::ENTRY,
        cost::Cost::ENTRY,
        plan_paths::PlanPaths::ENTRY,
    ],
    maps: maps::SOURCES,
};
