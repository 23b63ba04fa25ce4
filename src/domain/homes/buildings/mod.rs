//! Buildings of many kinds, as robots meet them: with circuits, halls, wide and doorless openings, columns, round and
//! slanted walls, things left about, turned by any angle, and shown as a scan shows them.
//!
//! A plan of rectangles is drawn and furnished on a grid of 0.1 m, as that of [homes](super) is; what does not follow
//! the grid is kept as outlines. The whole is then turned and scaled, and drawn in pixels of 0.05 m, from which the map is
//! made as an imported one is. What a scanner would show of it becomes what the map's cells are observed as; what is
//! free, where people walk and what labels come from, stays clean.

mod circuits;
mod config;
mod draw;
mod halls;
mod pose;
mod relief;
mod rows;
mod scan;
mod streets;

pub use config::{BuildingConfig, BuildingKind};
pub use draw::generate_building;

#[cfg(test)]
mod tests;
