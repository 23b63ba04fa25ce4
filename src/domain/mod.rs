//! Computes. Pure algorithms on plain values: no files, no clock, no environment, no printing, no store.

pub mod annotate;
pub mod baselines;
pub mod crowd;
pub mod geometry;
pub mod hidden;
pub mod homes;
pub mod links;
pub mod map;
pub mod masks;
pub mod orca;
pub mod planes;
pub mod planner;
pub mod quantize;
pub mod random;
pub mod rank;
pub mod raster;
pub mod recording;
pub mod route_graph;
pub mod score;
pub mod social;
pub mod tiles;
pub mod tracks;
pub mod unet;
pub mod update;
