//! What the stages have in common that tell without a network where people walk.

use std::sync::atomic::{AtomicU64, Ordering};

use super::{memory, read, write};
use crate::domain::geometry::Grid;
use crate::domain::map::OccupancyMap;
use crate::domain::rank::{relative_to_mean, share_below};
use crate::kinds::{Heat, Placed, outline};
use crate::pipeline::stage::{Arity, Context, Inputs, Needs, Output, Port, StageError};
use crate::store::{Digest, Store};

/// The port of the map.
pub(super) const MAP: Port = Port::new("map", "OccupancyMap", Arity::One, "The map to tell of.");

/// Reads the map.
pub(super) fn map(inputs: &Inputs, context: &Context) -> Result<(OccupancyMap, Digest), StageError> {
    read(context, inputs.one("map"))
}

/// Asks for so many bytes a cell of the map.
pub(super) fn needs(inputs: &Inputs, store: &Store, bytes_per_cell: u64) -> Needs {
    memory(outline(store, inputs.one("map")).rows.saturating_mul(bytes_per_cell))
}

/// Returns what is asked after each of `all` pieces of work: it tells how far the work is, and whether to go on.
pub(super) fn watch<'a>(context: &'a Context<'a>, all: u64) -> impl Fn() -> bool + Sync + 'a {
    let done = AtomicU64::new(0);
    move || {
        (context.progress)(done.fetch_add(1, Ordering::Relaxed) + 1, all);
        !(context.cancelled)()
    }
}

/// Writes values of the cells as a heat: their ranks, and the density of what counts people, if something does.
pub(super) fn write_heat<T: Copy + Into<f64>>(
    context: &Context,
    map: &OccupancyMap,
    values: &Grid<T>,
    people: Option<&Grid<T>>,
) -> Result<Output, StageError> {
    write(context, &Placed::new(*map.frame(), heat_of(map, values, people)))
}

/// Ranks values of the cells; people stand for a density.
pub(super) fn heat_of<T: Copy + Into<f64>>(map: &OccupancyMap, values: &Grid<T>, people: Option<&Grid<T>>) -> Heat {
    let density = people.and_then(|people| relative_to_mean(people, map.free()));
    Heat { density, ..Heat::new(map.free().clone(), share_below(values, map.free())) }
}
