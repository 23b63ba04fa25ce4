//! Spreads. One run over many machines: units of work in a shared store, and workers that take them.
//!
//! ```text
//! submit   plan → job      what is to be made is cut into units (`cut`), each told what it makes from what; sources go along
//! worker   unit → end      takes a unit under a lease, pulls what it reads, makes it, pushes, and notes what came of it
//! follow   ends → record   hears of the ends as they come, and puts the run on record at home
//! slurm                    has a scheduler start workers, an array of them for each wave
//! kubernetes               describes workers for another one to start
//! ```
//!
//! A job lies below `jobs/<id>/` in the shared store:
//!
//! ```text
//! job.json.zst              text of the pipeline, settings, sources, units and waves; written last
//! units/0007.json.zst       what a unit makes, from what recipes, and what of others it reads
//! leases/0007/000002.json   who works on it: the second try
//! ends/0007.json.zst        what came of it: outcomes, and the records of what it made
//! waves/01.json.zst         what a whole wave made, for units that read many others
//! objects                   the sources that it needs, for `gc`
//! state.json                which array jobs a scheduler has for it
//! ```
//!
//! # What holds
//! - Results are what recipes say, in the shared store; a job only says who looks after what. A unit that is done twice gives
//!   the same bytes twice, one that is lost costs the work that it had not pushed yet.
//! - A worker does a unit only if its own program, text and machine make the same of it: it holds the recipes of all tasks
//!   against what the unit was told, and says what differs.
//! - No clock is compared with another: a lease is dead when its holder has not touched it for as long as the watcher's own
//!   clock says. Trying to take it over is a conditional put, so one of several succeeds.

pub mod cut;
mod error;
mod follow;
mod job;
mod kubernetes;
mod lease;
mod place;
mod record;
mod shelf;
pub mod slurm;
mod submit;
mod worker;

pub use error::ClusterError;
pub use follow::Follower;
pub use job::{End, Job, Unit, UnitHead};
pub use kubernetes::manifest;
pub use lease::Pace;
pub use place::Place;
pub use record::{keep_records, record};
pub use shelf::Shelf;
pub use submit::{Submission, bulky, preview, submit};
pub use worker::{Worked, Worker};
