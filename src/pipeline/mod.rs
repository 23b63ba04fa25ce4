//! Decides. Reads a pipeline file, plans which nodes must run, and runs them over the store.
//!
//! It is handed a [`Register`](stage::Register) of stages and never names one.
//!
//! ```text
//! spec     YAML  → Pipeline   nodes and what they read; everything about the file is checked here
//! graph          → tasks      nodes, their chunks and steps, and what each reads
//! selection      → tasks      which of them are asked for, by names and patterns (`meaning`)
//! ledger         → states     recipes and keys; what is on record, what must run, what must be made again
//! environments                what was made already, only elsewhere
//! plan, execute               the ledger before a run, and while one goes on
//! forecast plan  → seconds    from what is on record of earlier work
//! share    tasks → run       some of them here, while others do the rest
//! event    run   → stream     folded once into a state, which bars, JSON and reports read
//! why      plan or run and the run before → differences
//! ```

mod asking;
mod environments;
pub mod error;
pub mod event;
pub mod execute;
pub mod forecast;
mod graph;
mod ledger;
pub mod meaning;
pub mod plan;
mod recipes;
pub mod schema;
pub mod selection;
pub mod share;
pub mod spec;
pub mod stage;
pub mod why;
