//! Join. Each stage reads artifacts, lets the domain compute, and writes one artifact.
//!
//! Adding a stage means one file here and one line in [`register`].

pub mod annotate;
mod baseline;
pub mod betweenness;
pub mod command;
pub mod compute;
pub mod cost;
pub mod criticality;
mod crowd;
pub mod crowd_heat;
mod definition;
mod episodes;
mod files;
pub mod generate_map;
pub mod hide_rooms;
pub mod import_map;
pub mod import_tracks;
pub mod isovist;
pub mod kinds;
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

/// All stages, sources and kinds.
#[must_use]
pub fn register() -> Register {
    let stages = vec![
        simulate::Simulate::entry(),
        import_tracks::ImportTracks::entry(),
        rasterize::Rasterize::entry(),
        hide_rooms::HideRooms::entry(),
        quantize::Quantize::entry(),
        tile::Tile::entry(),
        train::Train::entry(),
        annotate::Annotate::entry(),
        rank::Rank::entry(),
        update::Update::entry(),
        wall_distance::WallDistance::entry(),
        betweenness::Betweenness::entry(),
        criticality::Criticality::entry(),
        isovist::Isovist::entry(),
        uniform::Uniform::entry(),
        score::Score::entry(),
        navigate::Navigate::entry(),
        cost::Cost::entry(),
        plan_paths::PlanPaths::entry(),
        command::Command::entry(),
    ];
    Register { stages, sections: vec![maps::section(), files::section()], kinds: kinds::all() }
}
