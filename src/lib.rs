//! `trodden` learns where people walk.
//!
//! From the floor plan of a building it predicts how often each spot is visited. It simulates crowds on maps, counts where
//! they go, trains a small segmentation network on windows of map and counts, annotates maps that it has never seen and
//! measures how well the annotation predicts the social cost of a robot's path, and plans paths by it. Every step is a stage
//! of a pipeline over a store of content-hashed artifacts.
//!
//! # Bird's-eye view
//!
//! ```text
//!  pipeline.yaml ──► pipeline ──► plan ──► execute ──► events ──► report (bars, pictures, HTML)
//!                       │  ▲                  │
//!             register  │  │ recipes          ▼
//!                    stages ◄────────────── store (objects, recipes, runs, latest)
//!                    │    │                   ▲
//!                 domain  kinds ──────────────┘
//!                (computes) (values ⇄ bytes)
//! ```
//!
//! # Code map
//!
//! | room | what it does | may import |
//! |---|---|---|
//! | [`domain`] | computes: maps, crowds, recordings, counts, labels, windows, the network, annotation, updates, baselines, scores, costs, paths, route graphs | nothing of ours |
//! | [`store`] | keeps: objects, recipes, runs, plain names, collection, verification | nothing of ours |
//! | [`remote`] | shares: a store elsewhere that takes and gives what local stores hold | store |
//! | [`kinds`] | encodes: one file per artifact kind, value to bytes and back | domain, store |
//! | [`pipeline`] | decides: file, plan, execution, events | store |
//! | [`stages`] | join: read artifacts, let the domain compute, write one artifact | domain, kinds, pipeline, store |
//! | [`cluster`] | spreads: one run over many machines, by units of work in a store elsewhere | pipeline, remote, store |
//! | [`report`] | shows: bars, terminal pictures, PNG, HTML | domain, kinds, store, `pipeline::event` |
//! | [`cli`] | speaks: one file per command | all but python |
//! | `python` | serves: the Python package's compiled half, with the feature `python` alone, and its Python files | all |
//!
//! `tests/architecture.rs` holds the sources against this table.
//!
//! Beside the domain's rooms for maps, crowds and the network stand `random` (named streams of random numbers), `tracks`
//! (positions frame by frame), `links` (steps over a grid), `rank` (what a heat is) and `planes` (what a network is shown of a
//! cell), which several of them share. In the pipeline, `graph` expands nodes into chunks and steps and `ledger` knows what is
//! on record; plan and execution are two readers of the same ledger, so that they cannot disagree.
//!
//! # Invariants
//!
//! - Same inputs, same bytes, whatever the number of threads. Randomness comes from [`domain::random::Stream`], named by what
//!   it is for; sums run in a fixed order; transcendental functions come from `libm`.
//! - An artifact's bytes are a function of its content alone; provenance lives in recipes and runs.
//! - The key of a node is the BLAKE3 of its recipe: stage, version, kind and format, all parameters with defaults filled in,
//!   the seed where it is used, and the digests of its inputs.
//! - An object appears under its final name complete and synced, and a recipe only after its objects.
//! - Everything that can be checked is checked before anything runs.
//!
//! # Deliberately absent
//!
//! No database, no daemon, no server of our own for what is shared, no scheduler of our own beyond one machine. No provenance inside artifacts. No global state: the register
//! of stages, the store and the environment are handed in.

pub mod cli;
pub mod cluster;
pub mod domain;
pub mod kinds;
pub mod pipeline;
#[cfg(feature = "python")]
mod python;
pub mod remote;
pub mod report;
pub mod stages;
pub mod store;

/// Runs a program with these stages, sources and kinds on the arguments of this process, and returns its exit code.
///
/// [`stages::register`] has ours; what a crate of one's own adds to it stands beside them:
///
/// ```ignore
/// fn main() -> std::process::ExitCode {
///     trodden::run(&trodden::stages::register().with_stage(mine::entry()))
/// }
/// ```
#[must_use]
pub fn run(register: &pipeline::stage::Register) -> std::process::ExitCode {
    cli::main(register, std::env::args_os())
}
