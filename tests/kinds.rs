//! Kinds: what is written comes back, as the same bytes every time; what is damaged or foreign is named.

use std::collections::BTreeMap;
use std::sync::Arc;

use arrow::array::{ArrayRef, Int8Array, Int64Array, RecordBatch, UInt32Array};
use arrow::datatypes::{DataType, Field, Schema};
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::file::metadata::KeyValue;
use proptest::prelude::*;
use trodden::domain::geometry::{Cell, Frame, Grid, Point};
use trodden::domain::map::OccupancyMap;
use trodden::domain::quantize::{ClassCounts, Labels};
use trodden::domain::raster::VisitCounts;
use trodden::domain::score::{ClassScores, Confusion};
use trodden::domain::social::{EpisodeCost, SocialCosts};
use trodden::domain::tiles::Tiles;
use trodden::domain::tracks::{Sample, Tracks, agent_id};
use trodden::domain::unet::{Array, EpochMetrics, TrainState};
use trodden::kinds::{
    Checkpoint, CheckpointConfig, Heat, Kind, KindError, NavEpisodes, NavSample, Placed, SingleFile, TrackReader,
    TrackWriter, Written, chunk_files,
};
use trodden::store::{Artifact, Digest, Store};

/// One value of every kind, small and without rotation, so that its bytes can be known.
pub mod samples {
    use super::*;

    pub fn frame() -> Frame {
        Frame { origin: Point::new(-1.5, 0.25), ..Frame::at_zero(0.1, 4, 5) }
    }

    pub fn map() -> OccupancyMap {
        OccupancyMap::new(Grid::from_fn(4, 5, |c| c.row != 0 && c.col != 4), frame()).expect("free cells")
    }

    pub fn visits() -> Placed<VisitCounts> {
        let counts = Grid::from_fn(4, 5, |c| if c.row != 0 && c.col != 4 { (c.row * 7 + c.col) as u32 } else { 0 });
        Placed::new(frame(), VisitCounts { counts, paths: 40 })
    }

    pub fn labels() -> Placed<Labels> {
        let classes = Grid::from_fn(4, 5, |c| if c.row == 0 { 0 } else { (c.row + c.col) as i8 % 5 - 1 });
        Placed::new(frame(), Labels { classes, count: 3 })
    }

    pub fn heat() -> Placed<Heat> {
        let part = |k: usize| Grid::from_fn(4, 5, |c: Cell| (c.row + 2 * c.col + k) as f32 / 64.0);
        let classes = labels().value.classes;
        Placed::new(frame(), Heat { heat: part(3), classes, probabilities: (0..4).map(part).collect() })
    }

    pub fn tiles() -> Tiles {
        let cells = 3 * 64;
        Tiles {
            size: 8,
            classes: 3,
            maps: ["home_00", "home_01", "home_02"].map(str::to_owned).to_vec(),
            origin: vec![(0, -8, 0), (0, 0, 8), (2, 16, -8)],
            occupancy: (0..cells).map(|i| u8::from(i % 3 != 0)).collect(),
            labels: (0..cells).map(|i| if i % 3 == 0 { 0 } else { (i % 5) as i8 - 1 }).collect(),
            labeled_share: vec![0.5, 0.25, 1.0],
        }
    }

    pub fn sample(episode: u32, agent: usize, frame: i64) -> Sample {
        let t = frame as f64 * 0.125;
        Sample {
            episode,
            id: agent_id(episode, agent),
            frame,
            position: Point::new(0.25 + t, 0.125 * agent as f64),
            velocity: Point::new(1.25, -0.5),
            path: (frame / 4) as u32,
        }
    }

    pub fn tracks(episodes: std::ops::Range<u32>, agents: usize, frames: i64) -> Placed<Tracks> {
        let ids = episodes.flat_map(|episode| (0..agents).map(move |agent| (episode, agent)));
        let samples =
            ids.flat_map(|(episode, agent)| (0..frames).map(move |frame| sample(episode, agent, frame))).collect();
        Placed::new(frame(), Tracks { frame_rate: 10.0, samples })
    }

    pub fn trips() -> Placed<NavEpisodes> {
        let samples = tracks(0..2, 3, 6).value.samples;
        let samples = samples.into_iter().map(|sample| NavSample { sample, robot: sample.id % 1000 == 0 }).collect();
        Placed::new(frame(), NavEpisodes { frame_rate: 10.0, samples })
    }

    pub fn scores() -> ClassScores {
        ClassScores {
            confusion: Confusion::from_counts(Grid::from_vec(2, 3, vec![1, 30, 4, 0, 2, 9])),
            weights: vec![0.125, 0.375, 0.5],
            spearman_visits: Some(0.625),
            spearman_classes: Some(0.5),
            auc: Some(0.75),
            auc_farther_from_walls: None,
        }
    }

    pub fn costs() -> SocialCosts {
        let episode = |i: u32| EpisodeCost {
            episode: i,
            truth: f64::from(i) * 0.5,
            prediction: 3.0 - f64::from(i),
            truth_rank: f64::from(i + 1),
            prediction_rank: 3.0 - f64::from(i),
            offset: (2.0 - 2.0 * f64::from(i)).abs() / 4.0,
        };
        SocialCosts {
            episodes: (0..3).map(episode).collect(),
            within_quarter: 0.25,
            chance: 0.5,
            chance_at_least: 0.125,
            spearman: Some(-1.0),
            kendall: None,
        }
    }

    pub fn checkpoint() -> Checkpoint {
        let array = |shape: &[usize], from: f32| {
            let count = shape.iter().product::<usize>();
            Array { shape: shape.to_vec(), values: (0..count).map(|i| from + i as f32 / 8.0).collect() }
        };
        let named =
            |list: Vec<(&str, Array)>| list.into_iter().map(|(n, a)| (n.to_owned(), a)).collect::<BTreeMap<_, _>>();
        let metrics = |epoch: u32| EpochMetrics {
            epoch,
            loss: 1.0 / f64::from(epoch),
            accuracy: 0.5,
            mean_recall: 0.25,
            recall: vec![0.75, 0.25, 0.125, 0.0],
            samples: 64,
        };
        Checkpoint {
            config: CheckpointConfig {
                window: 64,
                batch: 32,
                learning_rate: 0.001,
                counts: ClassCounts { obstacle: 3001, classes: vec![825, 141, 37], unlabeled: 17 },
            },
            state: TrainState {
                epoch: 2,
                model: named(vec![("head.weight", array(&[4, 2, 1, 1], -0.5)), ("head.bias", array(&[4], 0.0))]),
                optimizer: named(vec![("head.bias.exp_avg", array(&[4], 1.0)), ("step", array(&[1], 128.0))]),
            },
            metrics: vec![metrics(1), metrics(2)],
        }
    }
}

fn store() -> (tempfile::TempDir, Store) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let store = Store::open(folder.path()).expect("a store");
    (folder, store)
}

/// Puts a value into a store and reads it back.
fn through_store<K: Kind>(store: &Store, value: &K) -> (Artifact, K) {
    let artifact = match value.write(store).expect("written") {
        Written::File(file) => Artifact::single(file),
        Written::Bundle(files) => store.bundle(K::NAME, K::FORMAT, files).expect("a manifest"),
    };
    let read = K::read(store, &artifact).expect("read");
    (artifact, read)
}

#[test]
fn every_kind_comes_back() {
    fn check<K: Kind + PartialEq + std::fmt::Debug>(store: &Store, value: &K) {
        let (artifact, read) = through_store(store, value);
        assert_eq!(&read, value, "{}", K::NAME);
        assert_eq!(through_store(store, &read).0, artifact, "{}", K::NAME);
    }
    let (_folder, store) = store();
    check(&store, &samples::map());
    check(&store, &samples::visits());
    check(&store, &samples::labels());
    check(&store, &samples::heat());
    check(&store, &samples::tiles());
    check(&store, &Placed { frame: Frame::at_zero(0.1, 4, 5), ..samples::tracks(0..3, 2, 9) });
    check(&store, &Placed { frame: Frame::at_zero(0.1, 4, 5), ..samples::trips() });
    check(&store, &samples::scores());
    check(&store, &samples::costs());
    check(&store, &samples::checkpoint());
}

/// Bytes of equal values may only change together with the number of the format.
///
/// When this fails after an update of arrow, parquet, zstd or safetensors, the encoders write other bytes: raise all format
/// numbers, so that old artifacts are made again instead of being called nondeterministic.
#[test]
fn bytes_are_a_function_of_the_value() {
    fn single<K: SingleFile>(value: &K) -> (String, Vec<u8>) {
        (format!("{} {}", <K as SingleFile>::NAME, <K as SingleFile>::FORMAT), value.to_bytes().expect("encoded"))
    }
    let mut writer = TrackWriter::new(Vec::new(), samples::frame(), 10.0).expect("a writer");
    writer.extend(&samples::tracks(0..3, 2, 9).value.samples).expect("written");
    let mut files = vec![
        single(&samples::map()),
        single(&samples::visits()),
        single(&samples::labels()),
        single(&samples::heat()),
        single(&samples::tiles()),
        ("Trajectories 1".to_owned(), writer.finish().expect("finished")),
        single(&samples::trips()),
        single(&samples::scores()),
        single(&samples::costs()),
    ];
    let bundle = samples::checkpoint().to_files().expect("encoded");
    files.extend(bundle.into_iter().map(|(name, bytes)| (format!("Checkpoint 1 {name}"), bytes)));
    let digests: Vec<String> =
        files.iter().map(|(name, bytes)| format!("{name} {}", &Digest::of(bytes).to_hex()[..16])).collect();
    assert_eq!(
        digests,
        [
            "OccupancyMap 1 03fc8c598fd0f4c0",
            "VisitCounts 1 d56191366558d7e3",
            "Labels 1 f8093f86458d9cd5",
            "Heat 1 38c5120df7b5da53",
            "Tiles 1 f0fc843817eda3e6",
            "Trajectories 1 d43262b412477550",
            "NavEpisodes 1 01e57c5232a68792",
            "ClassScores 1 e5a03f6d49e0d58f",
            "SocialCosts 1 368a9f9f5ebb0204",
            "Checkpoint 1 config.json 91682a40df00340e",
            "Checkpoint 1 metrics.parquet 0bac909c836a541d",
            "Checkpoint 1 model.safetensors 8dfb677edd4b761f",
            "Checkpoint 1 optimizer.safetensors aaad0f91a84b7d08",
        ]
    );
}

#[test]
fn a_turned_map_brings_tracks_back_to_where_they_were() {
    let (_folder, store) = store();
    let frame = Frame { yaw: 0.7, origin: Point::new(12.0, -40.0), ..samples::frame() };
    let tracks = Placed { frame, ..samples::tracks(0..2, 2, 20) };
    let (_, read) = through_store(&store, &tracks);
    for (a, b) in tracks.value.samples.iter().zip(&read.value.samples) {
        assert_eq!((a.episode, a.id, a.frame, a.path), (b.episode, b.id, b.frame, b.path));
        assert!(a.position.distance(b.position) < 1e-9 && a.velocity.distance(b.velocity) < 1e-6, "{a:?} {b:?}");
    }
}

#[test]
fn chunks_are_read_in_the_order_of_their_numbers() {
    let (_folder, store) = store();
    let chunks: Vec<Artifact> = (0..103).map(|i| through_store(&store, &samples::tracks(i..i + 1, 1, 3)).0).collect();
    let files = chunk_files(&chunks).expect("single files");
    assert_eq!((files[0].name.as_str(), files[102].name.as_str()), ("chunk-00.parquet", "chunk-102.parquet"));
    let bundle = store.bundle("Trajectories", 1, files).expect("a manifest");
    let whole = <Placed<Tracks> as Kind>::read(&store, &bundle).expect("read");
    assert_eq!(whole.value.samples.len(), 309);
    assert!(whole.value.samples.is_sorted_by_key(|sample| (sample.episode, sample.id, sample.frame)));
}

#[test]
fn long_tracks_are_written_and_read_piece_by_piece() {
    let tracks = samples::tracks(0..30, 10, 1000);
    let mut writer = TrackWriter::new(Vec::new(), tracks.frame, 10.0).expect("a writer");
    writer.extend(&tracks.value.samples).expect("written");
    let bytes = writer.finish().expect("finished");
    let file = ParquetRecordBatchReaderBuilder::try_new(bytes::Bytes::from(bytes.clone())).expect("a file");
    let groups: Vec<i64> = file.metadata().row_groups().iter().map(|group| group.num_rows()).collect();
    assert_eq!(groups, [131_072, 131_072, 37_856]);
    let reader = TrackReader::open(bytes).expect("a file");
    assert_eq!((reader.rows, reader.frame_rate, reader.frame), (300_000, 10.0, tracks.frame));
    let pieces: Vec<Vec<Sample>> = reader.collect::<Result<_, _>>().expect("read");
    assert!(pieces.iter().all(|piece| piece.len() <= 1 << 16));
    assert_eq!(pieces.iter().map(Vec::len).sum::<usize>(), 300_000);
}

#[test]
fn tracks_that_repeat_or_are_no_numbers_are_refused() {
    let mut writer = TrackWriter::new(Vec::new(), samples::frame(), 10.0).expect("a writer");
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
    assert!(TrackWriter::new(Vec::new(), samples::frame(), 0.0).is_err());
}

#[test]
fn navigation_episodes_become_steps() {
    let steps = samples::trips().value.steps();
    assert_eq!(
        steps.iter().map(|s| (s.episode, s.robot.len(), s.pedestrians.len())).collect::<Vec<_>>(),
        [(0, 6, 6), (1, 6, 6)]
    );
    assert_eq!(steps[1].robot[2], samples::sample(1, 0, 2).position);
    assert_eq!(steps[1].pedestrians[2], [samples::sample(1, 1, 2).position, samples::sample(1, 2, 2).position]);
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
    let error = Placed::<Labels>::from_bytes(b"row,col,class".to_vec()).expect_err("no Parquet");
    assert_eq!(error.to_string(), "the Parquet file of `Labels` is damaged");
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
    check(&samples::tiles());
    check(&samples::trips());
    check(&samples::scores());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn any_raster_comes_back(
        (rows, cols, visits) in (1usize..20, 1usize..20).prop_flat_map(|(rows, cols)| {
            (Just(rows), Just(cols), proptest::collection::vec(any::<u32>(), rows * cols))
        }),
        (x, y, yaw) in (-1e6..1e6f64, -1e6..1e6f64, -7.0..7.0f64),
        resolution in 0.001..10.0f64,
    ) {
        let frame = Frame { origin: Point::new(x, y), yaw, ..Frame::at_zero(resolution, rows, cols) };
        let value = Placed::new(frame, VisitCounts { counts: Grid::from_vec(rows, cols, visits), paths: 3 });
        prop_assert_eq!(Placed::<VisitCounts>::from_bytes(value.to_bytes().expect("encoded")).expect("read"), value);
    }

    #[test]
    fn any_tiles_come_back(windows in 0usize..5, size in 1usize..3, seed in any::<u32>()) {
        let size = 8 * size;
        let cells = windows * size * size;
        let draw = |i: usize| (seed ^ (i as u32).wrapping_mul(2_654_435_761)) >> 7;
        let tiles = Tiles {
            size,
            classes: 4,
            maps: vec!["a".to_owned(), "b".to_owned()],
            origin: (0..windows).map(|i| (draw(i) % 2, draw(i + 9) as i32 % 99 - 50, draw(i + 18) as i32 % 99 - 50)).collect(),
            occupancy: (0..cells).map(|i| (draw(i) % 2) as u8).collect(),
            labels: (0..cells).map(|i| (draw(i) % 6) as i8 - 1).collect(),
            labeled_share: (0..windows).map(|i| (draw(i) % 65) as f32 / 64.0).collect(),
        };
        prop_assert_eq!(Tiles::from_bytes(tiles.to_bytes().expect("encoded")).expect("read"), tiles);
    }
}

#[test]
fn a_checkpoint_remembers_the_distribution_of_its_labels() {
    let (_folder, store) = store();
    let (artifact, read) = through_store(&store, &samples::checkpoint());
    let names: Vec<&str> = artifact.files.iter().map(|file| file.name.as_str()).collect();
    assert_eq!(names, ["config.json", "metrics.parquet", "model.safetensors", "optimizer.safetensors"]);
    assert_eq!(read.config.classes(), 3);
    assert_eq!(read.config.distribution(), samples::checkpoint().config.counts.distribution());
    assert_eq!(read.config.class_weights().len(), 4);
    let missing = Checkpoint::read(&store, &Artifact { files: artifact.files[..2].to_vec(), ..artifact });
    assert!(matches!(missing, Err(KindError::MissingFile { file, .. }) if file == "model.safetensors"));
}

#[test]
fn types_are_those_of_the_design_page() {
    let types = |bytes: Vec<u8>| {
        let file = ParquetRecordBatchReaderBuilder::try_new(bytes::Bytes::from(bytes)).expect("a file");
        let fields = file.schema().fields().iter().map(|f| (f.name().clone(), f.data_type().clone(), f.is_nullable()));
        fields.collect::<Vec<_>>()
    };
    let column = |name: &str, data: DataType| (name.to_owned(), data, false);
    let place = || {
        vec![
            column("row", DataType::UInt32),
            column("col", DataType::UInt32),
            column("x", DataType::Float64),
            column("y", DataType::Float64),
        ]
    };
    let mut expected = place();
    expected.push(column("free", DataType::Boolean));
    assert_eq!(types(samples::map().to_bytes().expect("encoded")), expected);
    let mut expected = place();
    expected.push(column("heat", DataType::Float32));
    expected.push(column("class", DataType::Int8));
    expected.extend((0..4).map(|class| column(&format!("p{class}"), DataType::Float32)));
    assert_eq!(types(samples::heat().to_bytes().expect("encoded")), expected);
    let expected = vec![
        column("episode", DataType::UInt32),
        column("id", DataType::Int64),
        column("frame", DataType::Int64),
        column("x", DataType::Float64),
        column("y", DataType::Float64),
        column("vx", DataType::Float32),
        column("vy", DataType::Float32),
        column("path", DataType::UInt32),
        column("robot", DataType::Boolean),
    ];
    assert_eq!(types(samples::trips().to_bytes().expect("encoded")), expected);
    let found = types(samples::tiles().to_bytes().expect("encoded"));
    let list = |item| DataType::FixedSizeList(Arc::new(Field::new("element", item, false)), 64);
    assert_eq!((&found[3].1, &found[4].1), (&list(DataType::UInt8), &list(DataType::Int8)));
}

/// Writes an artifact of every kind to the folder that `TRODDEN_KINDS_OUT` names, for `tests/python/open_artifacts.py`.
#[test]
fn examples_for_python() {
    let Some(folder) = std::env::var_os("TRODDEN_KINDS_OUT").map(std::path::PathBuf::from) else {
        println!("TRODDEN_KINDS_OUT is not set: no examples are written");
        return;
    };
    let write = |name: &str, bytes: Vec<u8>| {
        let path = folder.join(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("the folder can be made");
        std::fs::write(&path, bytes).expect("the folder can be written to");
    };
    write("map.parquet", samples::map().to_bytes().expect("encoded"));
    write("visits.parquet", samples::visits().to_bytes().expect("encoded"));
    write("labels.parquet", samples::labels().to_bytes().expect("encoded"));
    write("heat.parquet", samples::heat().to_bytes().expect("encoded"));
    write("tiles.parquet", samples::tiles().to_bytes().expect("encoded"));
    write("trips.parquet", samples::trips().to_bytes().expect("encoded"));
    write("scores.parquet", samples::scores().to_bytes().expect("encoded"));
    write("costs.parquet", samples::costs().to_bytes().expect("encoded"));
    for chunk in 0..2 {
        let tracks = samples::tracks(chunk * 20..chunk * 20 + 20, 10, 1000);
        let mut writer = TrackWriter::new(Vec::new(), tracks.frame, 10.0).expect("a writer");
        writer.extend(&tracks.value.samples).expect("written");
        write(&format!("walks/chunk-{chunk:02}.parquet"), writer.finish().expect("finished"));
    }
    for (name, bytes) in samples::checkpoint().to_files().expect("encoded") {
        write(&format!("model/{name}"), bytes);
    }
}
