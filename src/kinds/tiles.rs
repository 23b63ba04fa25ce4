//! `Tiles`: one row per window: `map` (name), `row`, `col` i32 of the top left cell; `occupancy` u8, possibly
//! `unknown`, `paths` and `ways` u8, and what is known of the cells as lists of `size`² values in row-major order; `labeled_share`
//! f32. Size and the names of all maps are metadata.
//!
//! Known are either `classes` i8, with C in the metadata, or `rank` f32 (−1 on blocked cells) and possibly `density` f32 and
//! `flow` u8, of 8 · `size`² values: the share of passages in each direction, one direction behind the other, in 255ths.

use std::collections::BTreeMap;
use std::sync::Arc;

use arrow::array::{
    Array, ArrayRef, AsArray, FixedSizeListArray, Float32Array, Int8Array, Int32Array, StringArray, UInt8Array,
};
use arrow::datatypes::{ArrowPrimitiveType, DataType, Field, Float32Type, Int8Type, Int32Type, UInt8Type};

use super::labels::{check_classes, class_count};
use super::parquet::{Batch, Column, Layout, Table, wrong_value};
use super::{KindError, SingleFile};
use crate::domain::planes::Plane;
use crate::domain::quantize::UNLABELED;
use crate::domain::raster::DIRECTIONS;
use crate::domain::tiles::{NO_RANK, Target, Tiles};

const KIND: &str = "Tiles";
/// Windows of a row group: four million cells at 64 cells a side.
const GROUP_WINDOWS: usize = 1024;

fn columns<'a>(size: usize, besides: impl Iterator<Item = &'a Plane>, target: &Target) -> Vec<Column> {
    let lists = |name: &str, item, planes: usize| {
        let length = i32::try_from(planes * size * size).expect("windows have at most 512 cells a side");
        Column::new(name, DataType::FixedSizeList(Arc::new(Field::new("element", item, false)), length))
    };
    let list = |name: &str, item| lists(name, item, 1);
    let mut columns = vec![
        Column::new("map", DataType::Utf8),
        Column::new("row", DataType::Int32),
        Column::new("col", DataType::Int32),
        list("occupancy", DataType::UInt8),
    ];
    columns.extend(besides.map(|plane| list(plane.name(), DataType::UInt8)));
    match target {
        Target::Classes { .. } => columns.push(list("classes", DataType::Int8)),
        Target::Ranks { density, flow, .. } => {
            columns.push(list("rank", DataType::Float32));
            columns.extend(density.as_ref().map(|_| list("density", DataType::Float32)));
            columns.extend(flow.as_ref().map(|_| lists("flow", DataType::UInt8, DIRECTIONS)));
        }
    }
    columns.push(Column::new("labeled_share", DataType::Float32));
    columns
}

impl SingleFile for Tiles {
    const NAME: &'static str = KIND;
    const FORMAT: u32 = 1;

    fn to_bytes(&self) -> Result<Vec<u8>, KindError> {
        check(self)?;
        let columns = columns(self.size, self.besides.keys(), &self.target);
        let lists = |column: usize, values: ArrayRef| -> Result<ArrayRef, KindError> {
            let DataType::FixedSizeList(item, length) = &columns[column].data else { unreachable!("a list") };
            let array = FixedSizeListArray::try_new(item.clone(), *length, values, None);
            Ok(Arc::new(array.map_err(|e| KindError::Shape { kind: KIND, what: e.to_string() })?))
        };
        let names: Result<Vec<&str>, KindError> = self
            .origin
            .iter()
            .enumerate()
            .map(|(i, origin)| {
                let name = self.maps.get(origin.0 as usize).map(String::as_str);
                name.ok_or_else(|| wrong_value(KIND, "map", i, origin.0, "the index of a map"))
            })
            .collect();
        let mut arrays: Vec<ArrayRef> = vec![
            Arc::new(StringArray::from_iter_values(names?)),
            Arc::new(Int32Array::from_iter_values(self.origin.iter().map(|origin| origin.1))),
            Arc::new(Int32Array::from_iter_values(self.origin.iter().map(|origin| origin.2))),
        ];
        for codes in std::iter::once(&self.occupancy).chain(self.besides.values()) {
            arrays.push(lists(arrays.len(), Arc::new(UInt8Array::from(codes.clone())))?);
        }
        match &self.target {
            Target::Classes { labels, .. } => {
                arrays.push(lists(arrays.len(), Arc::new(Int8Array::from(labels.clone())))?);
            }
            Target::Ranks { rank, density, flow } => {
                for values in std::iter::once(rank).chain(density) {
                    arrays.push(lists(arrays.len(), Arc::new(Float32Array::from(values.clone())))?);
                }
                if let Some(codes) = flow {
                    arrays.push(lists(arrays.len(), Arc::new(UInt8Array::from(codes.clone())))?);
                }
            }
        }
        arrays.push(Arc::new(Float32Array::from(self.labeled_share.clone())));
        let maps = serde_json::to_string(&self.maps).expect("names are JSON");
        let layout = Layout { group_rows: GROUP_WINDOWS, ..Layout::new(KIND, <Self as SingleFile>::FORMAT, columns) };
        let layout = layout.with("size", self.size);
        let layout = match &self.target {
            Target::Classes { classes, .. } => layout.with("classes", *classes),
            Target::Ranks { .. } => layout,
        };
        layout.with("maps", maps).bytes(arrays)
    }

    fn from_bytes(bytes: Vec<u8>) -> Result<Self, KindError> {
        let table = Table::open(KIND, <Self as SingleFile>::FORMAT, bytes)?;
        let size: usize = table.parsed("size", "a number of cells")?;
        if !(1..=512).contains(&size) {
            return Err(table.wrong_metadata("size", "a number of cells from 1 to 512"));
        }
        let maps: Vec<String> =
            serde_json::from_str(table.text("maps")?).map_err(|_| table.wrong_metadata("maps", "a list of names"))?;
        let target = if table.has("rank") {
            let (density, flow) = (table.has("density").then(Vec::new), table.has("flow").then(Vec::new));
            Target::Ranks { rank: Vec::new(), density, flow }
        } else {
            Target::Classes { classes: class_count(&table)?, labels: Vec::new() }
        };
        let besides: BTreeMap<Plane, Vec<u8>> =
            Plane::ALL.into_iter().filter(|plane| table.has(plane.name())).map(|plane| (plane, Vec::new())).collect();
        let columns = columns(size, besides.keys(), &target);
        let mut tiles =
            Self { size, maps, origin: Vec::new(), occupancy: Vec::new(), besides, target, labeled_share: Vec::new() };
        for batch in table.batches(&columns)? {
            tiles.append(&batch?)?;
        }
        check(&tiles)?;
        Ok(tiles)
    }
}

/// Checks that all values are in their ranges.
fn check(tiles: &Tiles) -> Result<(), KindError> {
    let cells = tiles.size * tiles.size;
    match &tiles.target {
        Target::Classes { classes, labels } => check_classes(KIND, "classes", *classes, UNLABELED, labels)?,
        Target::Ranks { rank, density, .. } => {
            if let Some(i) = rank.iter().position(|rank| *rank != NO_RANK && !(0.0..=1.0).contains(rank)) {
                return Err(wrong_value(KIND, "rank", i / cells, rank[i], "a share from 0 to 1, or -1 where blocked"));
            }
            let density = density.as_deref().unwrap_or_default();
            if let Some(i) = density.iter().position(|density| !(density.is_finite() && *density >= 0.0)) {
                return Err(wrong_value(
                    KIND,
                    "density",
                    i / cells,
                    density[i],
                    "a finite number that is not negative",
                ));
            }
        }
    }
    if let Some(i) = tiles.occupancy.iter().position(|cell| *cell > 1) {
        return Err(wrong_value(KIND, "occupancy", i / cells, tiles.occupancy[i], "0 or 1"));
    }
    for (plane, codes) in &tiles.besides {
        if let Some(i) = codes.iter().position(|code| *code > plane.most()) {
            let expected = format!("0 to {}", plane.most());
            return Err(wrong_value(KIND, plane.name(), i / cells, codes[i], &expected));
        }
    }
    if let Some(i) = tiles.labeled_share.iter().position(|share| !(0.0..=1.0).contains(share)) {
        return Err(wrong_value(KIND, "labeled_share", i, tiles.labeled_share[i], "a share from 0 to 1"));
    }
    Ok(())
}

/// Appends windows as they come from a file.
trait Append {
    fn append(&mut self, batch: &Batch) -> Result<(), KindError>;
}

impl Append for Tiles {
    fn append(&mut self, batch: &Batch) -> Result<(), KindError> {
        let names = batch.arrays[0].as_string::<i32>();
        let (rows, cols) = (batch.numbers::<Int32Type>(1), batch.numbers::<Int32Type>(2));
        for i in 0..batch.rows {
            let map = self.maps.iter().position(|name| name == names.value(i)).and_then(|map| u32::try_from(map).ok());
            let unknown =
                || wrong_value(KIND, "map", batch.first + i, names.value(i), "one of the `maps` in the metadata");
            self.origin.push((map.ok_or_else(unknown)?, rows[i], cols[i]));
        }
        let cells = self.size * self.size;
        append_lists::<UInt8Type>(&mut self.occupancy, "occupancy", batch, 3, cells)?;
        let mut column = 4;
        for (plane, codes) in &mut self.besides {
            append_lists::<UInt8Type>(codes, plane.name(), batch, column, cells)?;
            column += 1;
        }
        match &mut self.target {
            Target::Classes { labels, .. } => append_lists::<Int8Type>(labels, "classes", batch, column, cells)?,
            Target::Ranks { rank, density, flow } => {
                append_lists::<Float32Type>(rank, "rank", batch, column, cells)?;
                if let Some(density) = density {
                    column += 1;
                    append_lists::<Float32Type>(density, "density", batch, column, cells)?;
                }
                if let Some(flow) = flow {
                    column += 1;
                    append_lists::<UInt8Type>(flow, "flow", batch, column, DIRECTIONS * cells)?;
                }
            }
        }
        self.labeled_share.extend_from_slice(batch.numbers::<Float32Type>(column + 1));
        Ok(())
    }
}

/// Appends the values of lists that all have `length` values.
fn append_lists<T: ArrowPrimitiveType>(
    out: &mut Vec<T::Native>,
    name: &str,
    batch: &Batch,
    column: usize,
    length: usize,
) -> Result<(), KindError> {
    let array = &batch.arrays[column];
    for i in 0..batch.rows {
        let list = match array.data_type() {
            DataType::FixedSizeList(..) => array.as_fixed_size_list().value(i),
            _ => array.as_list::<i32>().value(i),
        };
        if list.len() != length || list.null_count() > 0 {
            let value = format!("a list of {} values", list.len());
            return Err(wrong_value(KIND, name, batch.first + i, value, &format!("a list of {length} values")));
        }
        out.extend_from_slice(list.as_primitive::<T>().values());
    }
    Ok(())
}
