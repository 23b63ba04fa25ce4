//! Floor plans that are no grids: areas, walls and doors in meters.
//!
//! Each reader makes a [`Plan`](shapes::Plan) of the bytes of a file; one rasterizer makes cells of all of them. The frame of
//! such a map is the plan's own: x to the right, y upwards, in meters, no rotation, so that what is recorded in the plan's
//! coordinates fits the map as it is.

mod building;
mod dxf;
mod error;
mod geojson;
mod import;
mod level;
mod pattern;
mod polygons;
mod raster;
mod scan;
mod shapes;
mod svg;
mod wkt;

pub use dxf::is_dxf;
pub use error::PlanError;
pub use import::{import_plan, plan_cells};
pub use svg::is_svg;
pub use wkt::is_wkt;
