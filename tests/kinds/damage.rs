//! Damaged and foreign files are named, and nothing panics.

use std::collections::BTreeMap;
use std::error::Error;
use std::sync::Arc;

use arrow::array::{ArrayRef, BooleanArray, Int8Array, Int64Array, RecordBatch, UInt8Array, UInt32Array};
use arrow::datatypes::{Field, Schema};
use parquet::arrow::ArrowWriter;
use parquet::file::metadata::KeyValue;
use trodden::domain::geometry::{Cell, Frame, Grid, Point};
use trodden::domain::map::{Observed, OccupancyMap};
use trodden::domain::quantize::Labels;
use trodden::domain::tracks::Sample;
use trodden::kinds::{Checkpoint, Heat, Placed, SingleFile, TrackWriter, checked};

use super::samples;

#[test]
fn tracks_that_repeat_or_are_no_numbers_are_refused() {
    let mut writer = TrackWriter::new(Vec::new(), samples::frame(), 10.0, 0.2).expect("a writer");
    writer.push(&samples::sample(0, 0, 5)).expect("in order");
    let error = writer.push(&samples::sample(0, 0, 5)).expect_err("twice the same frame");
    assert_eq!(
        error.to_string(),
        "the column `frame` of `Trajectories` holds `5` in row 1, expected was a frame after that of the row before, \
         by episode, id and frame"
    );
    let lost = Sample { position: Point::new(f64::NAN, 0.0), ..samples::sample(0, 0, 6) };
    let error = writer.push(&lost).expect_err("no position");
    assert_eq!(
        error.to_string(),
        "the column `x` of `Trajectories` holds `NaN` in row 1, expected was a finite number"
    );
    assert!(TrackWriter::new(Vec::new(), samples::frame(), 0.0, 0.2).is_err());
}

/// Writes a file of our shape with things changed: what others, or other versions, might write.
struct Forged {
    columns: Vec<(&'static str, ArrayRef)>,
    metadata: BTreeMap<&'static str, &'static str>,
}

impl Forged {
    fn labels() -> Self {
        let numbers = |values: Vec<u32>| -> ArrayRef { Arc::new(UInt32Array::from(values)) };
        let places = || -> ArrayRef { Arc::new(arrow::array::Float64Array::from(vec![0.0; 4])) };
        Self {
            columns: vec![
                ("row", numbers(vec![0, 0, 1, 1])),
                ("col", numbers(vec![0, 1, 0, 1])),
                ("x", places()),
                ("y", places()),
                ("class", Arc::new(Int8Array::from(vec![0, -1, 1, 3]))),
            ],
            metadata: BTreeMap::from([
                ("kind", "Labels"),
                ("format", "1"),
                ("classes", "3"),
                ("resolution", "0.1"),
                ("origin_x", "0"),
                ("origin_y", "0"),
                ("yaw", "0"),
                ("rows", "2"),
                ("cols", "2"),
            ]),
        }
    }

    fn with(mut self, key: &'static str, value: &'static str) -> Self {
        self.metadata.insert(key, value);
        self
    }

    fn column(mut self, name: &'static str, array: ArrayRef) -> Self {
        self.columns.iter_mut().find(|column| column.0 == name).expect("a column").1 = array;
        self
    }

    fn bytes(&self) -> Vec<u8> {
        let nullable = |array: &ArrayRef| array.null_count() > 0;
        let fields =
            self.columns.iter().map(|(name, array)| Field::new(*name, array.data_type().clone(), nullable(array)));
        let schema = Arc::new(Schema::new(fields.collect::<Vec<_>>()));
        let mut writer = ArrowWriter::try_new(Vec::new(), schema.clone(), None).expect("a writer");
        let arrays = self.columns.iter().map(|column| column.1.clone()).collect();
        writer.write(&RecordBatch::try_new(schema, arrays).expect("a batch")).expect("written");
        for (key, value) in &self.metadata {
            writer.append_key_value_metadata(KeyValue::new((*key).to_owned(), (*value).to_owned()));
        }
        writer.into_inner().expect("finished")
    }

    fn refused(&self, message: &str, help: &str) {
        let error = Placed::<Labels>::from_bytes(self.bytes()).expect_err(message);
        assert_eq!(error.to_string(), message);
        assert!(error.help().is_some_and(|text| text.contains(help)), "{:?}", error.help());
    }
}

#[test]
fn foreign_and_wrong_files_are_named() {
    Placed::<Labels>::from_bytes(Forged::labels().bytes()).expect("as it should be");
    let verify = "trodden verify";
    let mut forged = Forged::labels();
    forged.metadata.remove("kind");
    forged.refused("the file holds no `Labels`: its metadata name no kind", "trodden ls");
    Forged::labels().with("kind", "Heat").refused("the file holds `Heat`, expected was `Labels`", "trodden ls");
    let newer = "`Labels` is of format 2, this version of trodden reads format 1";
    Forged::labels().with("format", "2").refused(newer, "a newer version");
    Forged::labels().with("format", "0").refused(&newer.replace('2', "0"), "run the pipeline again");
    let number = "the metadata `yaw` of `Labels` are `NaN`, expected was a finite number";
    Forged::labels().with("yaw", "NaN").refused(number, verify);
    let cells = "the metadata `resolution` of `Labels` are `-1`, expected was a positive number of meters";
    Forged::labels().with("resolution", "-1").refused(cells, verify);
    Forged::labels().with("rows", "3").refused("`Labels` has 4 rows, its metadata tell 6", verify);
    let many = "the metadata `rows` of `Labels` are `18446744073709551615`, expected was a number of rows";
    Forged::labels().with("rows", "18446744073709551615").refused(many, verify);
    let mut forged = Forged::labels();
    forged.columns.pop();
    forged.refused("`Labels` has no column `class`", verify);
    let wide: ArrayRef = Arc::new(Int64Array::from(vec![0, 1, 2, 3]));
    let wrong = "the column `class` of `Labels` is of type Int64, expected was Int8";
    Forged::labels().column("class", wide).refused(wrong, verify);
    let wild: ArrayRef = Arc::new(Int8Array::from(vec![0, 1, 4, 3]));
    let wrong = "the column `class` of `Labels` holds `4` in row 2, expected was a class from -1 to 3";
    Forged::labels().column("class", wild).refused(wrong, "trodden show");
    let holes: ArrayRef = Arc::new(Int8Array::from(vec![Some(0), None, Some(1), Some(1)]));
    let wrong = "the column `class` of `Labels` holds `null` in row 1, expected was a value";
    Forged::labels().column("class", holes).refused(wrong, "trodden show");
    let shuffled: ArrayRef = Arc::new(UInt32Array::from(vec![0, 1, 1, 0]));
    let wrong = "the column `row` of `Labels` holds `1` in row 1, expected was row-major order";
    Forged::labels().column("row", shuffled).refused(wrong, "trodden show");
    // Found by a million random changes: a byte of a name that makes it that of another column.
    let mut twice = Forged::labels();
    twice.columns.push(twice.columns[0].clone());
    twice.refused("the Parquet file of `Labels` is damaged", verify);
    let cause = "it has more than one column `row`";
    let errors: [Box<dyn Error>; 2] = [
        Box::new(Placed::<Labels>::from_bytes(twice.bytes()).expect_err("two columns of a name")),
        Box::new(checked(twice.bytes()).map(drop).expect_err("two columns of a name")),
    ];
    assert!(errors.iter().all(|error| error.source().is_some_and(|source| source.to_string() == cause)), "{errors:?}");
    let error = Placed::<Labels>::from_bytes(b"row,col,class".to_vec()).expect_err("no Parquet");
    assert_eq!(error.to_string(), "the Parquet file of `Labels` is damaged");
}

#[test]
fn maps_without_that_column_show_what_is_free() {
    let mut forged = Forged::labels().with("kind", "OccupancyMap");
    forged.columns.pop();
    forged.columns.push(("free", Arc::new(BooleanArray::from(vec![false, true, false, false]))));
    let map = OccupancyMap::from_bytes(forged.bytes()).expect("a map");
    let free = Grid::from_fn(2, 2, |cell| cell == Cell::new(0, 1));
    assert_eq!(map, OccupancyMap::new(free, Frame::at_zero(0.1, 2, 2)).expect("a free cell"));
    let names = |map: &OccupancyMap| {
        let file = checked(map.to_bytes().expect("encoded")).expect("a table");
        file.schema.fields().iter().map(|field| field.name().clone()).collect::<Vec<_>>()
    };
    assert_eq!(names(&map), ["row", "col", "x", "y", "free"]);

    forged.columns.push(("observed", Arc::new(UInt8Array::from(vec![0, 1, 2, 1]))));
    let map = OccupancyMap::from_bytes(forged.bytes()).expect("a map that shows more");
    assert_eq!(map.observed().as_slice(), [Observed::Occupied, Observed::Free, Observed::Unknown, Observed::Free]);
    assert_eq!(names(&map), ["row", "col", "x", "y", "free", "observed"]);
    let forged = forged.column("observed", Arc::new(UInt8Array::from(vec![0, 1, 3, 1])));
    let error = OccupancyMap::from_bytes(forged.bytes()).expect_err("no such code");
    assert_eq!(
        error.to_string(),
        "the column `observed` of `OccupancyMap` holds `3` in row 2, expected was 0 (occupied), 1 (free) or 2 (unknown)"
    );
}

#[test]
fn heat_that_is_no_share_is_refused() {
    for wrong in [f32::NAN, -0.1, 1.5, f32::INFINITY] {
        let mut heat = samples::heat();
        heat.value.heat.as_mut_slice()[7] = wrong;
        let error = heat.to_bytes().expect_err("no share").to_string();
        assert_eq!(
            error,
            format!("the column `heat` of `Heat` holds `{wrong}` in row 7, expected was a number from 0 to 1")
        );
    }
}

#[test]
fn parts_of_a_heat_hold_together() {
    let refused = |change: fn(&mut Heat), message: &str| {
        let mut heat = samples::ranks();
        change(&mut heat.value);
        assert_eq!(heat.to_bytes().expect_err(message).to_string(), message);
    };
    let density = "the column `density` of `Heat` holds `inf` in row 7, expected was a finite number from 0";
    let set = |heat: &mut Heat| heat.density.as_mut().expect("a density").as_mut_slice()[7] = f32::INFINITY;
    refused(set, density);
    let flow = "the column `flow_5` of `Heat` holds `-1` in row 3, expected was a number from 0 to 1";
    refused(|heat| heat.flow.as_mut().expect("a flow")[5].as_mut_slice()[3] = -1.0, flow);
    let walls = "`Heat` does not fit together: its classes and its walls disagree";
    refused(|heat| heat.classes = samples::heat().value.classes, walls);
}

#[test]
fn damaged_checkpoints_are_named() {
    let files = samples::checkpoint().to_files().expect("encoded");
    let read = |name: &str, bytes: Vec<u8>| {
        let mut files = files.clone();
        *files.get_mut(name).expect("a file of the bundle") = bytes;
        Checkpoint::from_files(|name| Ok(files[name].clone())).expect_err("damaged").to_string()
    };
    let config = String::from_utf8(files["config.json"].clone()).expect("text");
    let changed = |from: &str, to: &str| {
        assert!(config.contains(from), "{config}");
        config.replace(from, to).into_bytes()
    };
    assert_eq!(read("config.json", b"{".to_vec()), "the file `config.json` of `Checkpoint` is damaged");
    let newer = read("config.json", changed("\"format\": 1", "\"format\": 7"));
    assert_eq!(newer, "`Checkpoint` is of format 7, this version of trodden reads format 1");
    let window = read("config.json", changed("\"window\": 64", "\"window\": 60"));
    assert_eq!(window, "the metadata `window` of `Checkpoint` are `60`, expected was a multiple of 8 from 8 to 512");
    let short = files["model.safetensors"][..100].to_vec();
    assert_eq!(read("model.safetensors", short), "the file `model.safetensors` of `Checkpoint` is damaged");
    let mut lost = samples::checkpoint();
    lost.state.model.get_mut("head.bias").expect("an array").values[1] = f32::NAN;
    let lost = lost.to_files().expect("encoded").remove("model.safetensors").expect("a file");
    assert_eq!(
        read("model.safetensors", lost),
        "the column `model.safetensors/head.bias` of `Checkpoint` holds `NaN` in row 0, expected was finite numbers"
    );
}

#[test]
fn damaged_bytes_never_panic() {
    fn check<K: SingleFile>(value: &K) {
        let bytes = value.to_bytes().expect("encoded");
        for length in (0..bytes.len()).step_by(7) {
            assert!(K::from_bytes(bytes[..length].to_vec()).is_err(), "{} cut at {length}", <K as SingleFile>::NAME);
        }
        for at in 0..bytes.len() {
            for change in [0x01, 0xff] {
                let mut bytes = bytes.clone();
                bytes[at] ^= change;
                // A changed value may be one that is allowed; the store's digests are there for that.
                let _ = K::from_bytes(bytes);
            }
        }
    }
    check(&samples::labels());
    check(&samples::ranks());
    check(&samples::tiles());
    check(&samples::trips());
    check(&samples::scores());
    check(&samples::floor_only());
}
