//! All integration tests, in one binary: one link of polars and burn.

mod architecture;
#[cfg(feature = "pages")]
mod browser;
#[cfg(all(feature = "pages", feature = "sql"))]
mod cli;
#[cfg(all(feature = "pages", feature = "sql"))]
mod cluster;
mod crowd;
mod equations;
mod fuzz;
mod kinds;
#[cfg(not(all(feature = "pages", feature = "sql")))]
mod lacking;
mod lean;
mod maps;
mod needs;
mod oracle;
mod own_crate;
mod pipeline;
mod pipelines;
#[cfg(all(feature = "pages", feature = "sql"))]
mod promises;
mod python_artifacts;
mod remote;
#[cfg(feature = "pages")]
mod report;
mod store;
mod unet;
#[cfg(feature = "pages")]
mod viewer;

#[global_allocator]
static ALLOCATOR: fuzz::memory::Counting = fuzz::memory::Counting;
