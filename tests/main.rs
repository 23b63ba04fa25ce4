//! All integration tests, in one binary: one link of polars and burn.

mod architecture;
mod browser;
mod cli;
mod crowd;
mod equations;
mod fuzz;
mod kinds;
mod maps;
mod needs;
mod oracle;
mod own_crate;
mod pipeline;
mod pipelines;
mod promises;
mod python_artifacts;
mod remote;
mod report;
mod store;
mod unet;
mod viewer;

#[global_allocator]
static ALLOCATOR: fuzz::memory::Counting = fuzz::memory::Counting;
