//! Occupancy maps: which cells of a floor are free.

mod config;
mod distance;
mod error;
mod form;
mod import;
mod indoors;
mod jpeg;
mod observed;
mod occupancy;
mod picture;
mod plan;
mod pnm;
mod position;
mod ratio;
mod reading;
mod regions;
mod resample;
mod rooms;
mod ros;
mod samples;
mod scale_bar;
mod separation;
mod shown;
mod unit;
mod yaml;

pub use config::{ImportConfig, Region};
pub use distance::squared_distances;
pub use error::MapImportError;
pub use form::{MapForm, PlanForm};
pub use import::{
    IGIBSON_RESOLUTION, Imported, free_pixels, igibson_floor, igibson_image, import_grid, import_igibson, import_image,
    import_ros,
};
pub use indoors::Survey;
pub use observed::Observed;
pub use occupancy::{MapError, OccupancyMap};
pub use picture::{DECODER_THREAD, Pixel, is_image};
pub use plan::{PlanError, import_plan, is_dxf, is_svg, is_wkt, plan_cells};
pub use position::Position;
pub use reading::Reading;
pub use regions::{neighbors4, regions};
pub use resample::{refined, resample};
pub use rooms::rooms;
pub use ros::{MapYaml, Mode};
pub use samples::{MOST_CELLS, MOST_PIXELS};
pub use scale_bar::ScaleBar;
pub use shown::Shown;
pub use unit::Unit;
