//! Foresees how long a plan takes and how much it writes, from what is on record of earlier work.
//!
//! ```text
//! evidence   store, plan → observations: which node of which stage took how long, read and wrote how much
//! estimate   observations → seconds and bytes of one task, and how far the evidence ranges
//! schedule   seconds → the time that the whole takes on so many jobs, and the longest chain of tasks
//! ```
//!
//! The same node's own past is the best evidence, then that of other nodes of the stage. Times and sizes are taken to grow
//! with the amount of work that a stage says a part is ([`Stage::amount`](super::stage::Stage::amount)), and with the bytes
//! that are read as far as several observations show that. For what nothing is known of no number is made up.

mod estimate;
mod evidence;
mod foresee;
mod schedule;
mod work;

pub use estimate::{Basis, Estimate};
pub use foresee::{Forecast, errors, foresee};
