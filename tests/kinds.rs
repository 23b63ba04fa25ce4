//! Kinds: what is written comes back, as the same bytes every time; what is damaged or foreign is named.

mod damage;
mod encoding;
pub mod samples;
mod tables;

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use proptest::prelude::*;
use trodden::domain::annotate::{AnnotateConfig, Mode};
use trodden::domain::geometry::{Cell, Frame, Grid, Point};
use trodden::domain::map::OccupancyMap;
use trodden::domain::planes::Plane;
use trodden::domain::raster::VisitCounts;
use trodden::domain::score::ClassScores;
use trodden::domain::tiles::{Target, Tiles};
use trodden::domain::tracks::{Sample, Tracks};
use trodden::domain::unet::{Compute, DeviceName, Outputs};
use trodden::kinds::{
    Checkpoint, Heat, Kind, KindError, Model, Placed, SingleFile, TrackReader, TrackWriter, Written, chunk_files,
};
use trodden::stages::annotate::heat;
use trodden::store::{Artifact, Store};

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
    check(&store, &samples::flowing_visits());
    check(&store, &samples::labels());
    check(&store, &samples::heat());
    check(&store, &samples::ranks());
    check(&store, &Placed { value: Heat { density: None, flow: None, ..samples::ranks().value }, ..samples::ranks() });
    check(
        &store,
        &Placed { value: Heat { density: samples::ranks().value.density, ..samples::heat().value }, ..samples::heat() },
    );
    check(&store, &samples::tiles());
    check(&store, &Placed { frame: Frame::at_zero(0.1, 4, 5), ..samples::tracks(0..3, 2, 9) });
    check(&store, &Placed { frame: Frame::at_zero(0.1, 4, 5), ..samples::trips() });
    check(&store, &samples::scores());
    check(&store, &ClassScores { weights: None, ..samples::scores() });
    check(&store, &ClassScores { floor: None, ..samples::scores() });
    check(&store, &samples::floor_only());
    check(&store, &samples::costs());
    check(&store, &samples::path_trials());
    check(&store, &samples::checkpoint());
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
    let mut writer = TrackWriter::new(Vec::new(), tracks.frame, 10.0, 0.2).expect("a writer");
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
fn navigation_episodes_become_steps() {
    let steps = samples::trips().value.steps();
    assert_eq!(
        steps.iter().map(|s| (s.episode, s.robot.len(), s.pedestrians.len())).collect::<Vec<_>>(),
        [(0, 6, 6), (1, 6, 6)]
    );
    assert_eq!(steps[1].robot[2], samples::sample(1, 0, 2).position);
    assert_eq!(steps[1].pedestrians[2], [samples::sample(1, 1, 2).position, samples::sample(1, 2, 2).position]);
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
        let value = Placed::new(frame, VisitCounts { counts: Grid::from_vec(rows, cols, visits), paths: 3, flow: None });
        prop_assert_eq!(Placed::<VisitCounts>::from_bytes(value.to_bytes().expect("encoded")).expect("read"), value);
    }

    #[test]
    fn any_tiles_come_back(windows in 0usize..5, size in 1usize..3, seed in any::<u32>()) {
        let size = 8 * size;
        let cells = windows * size * size;
        let draw = |i: usize| (seed ^ (i as u32).wrapping_mul(2_654_435_761)) >> 7;
        let ranks = |of: usize| (0..cells).map(|i| (draw(i + of) % 65) as f32 / 64.0).collect::<Vec<_>>();
        let target = match seed % 3 {
            0 => Target::Classes { classes: 4, labels: (0..cells).map(|i| (draw(i) % 6) as i8 - 1).collect() },
            1 => Target::Ranks { rank: ranks(1), density: None, flow: Some((0..8 * cells).map(|i| draw(i) as u8).collect()) },
            _ => Target::Ranks { rank: ranks(2), density: Some(ranks(3)), flow: None },
        };
        let tiles = Tiles {
            size,
            maps: vec!["a".to_owned(), "b".to_owned()],
            origin: (0..windows).map(|i| (draw(i) % 2, draw(i + 9) as i32 % 99 - 50, draw(i + 18) as i32 % 99 - 50)).collect(),
            occupancy: (0..cells).map(|i| (draw(i) % 2) as u8).collect(),
            besides: BTreeMap::from([(Plane::Paths, (0..cells).map(|i| (draw(i) % 256) as u8).collect())]),
            target,
            labeled_share: (0..windows).map(|i| (draw(i) % 65) as f32 / 64.0).collect(),
        };
        prop_assert_eq!(Tiles::from_bytes(tiles.to_bytes().expect("encoded")).expect("read"), tiles);
    }
}

#[test]
fn a_checkpoint_of_ranks_comes_back() {
    let (_folder, store) = store();
    let (_, read) = through_store(&store, &samples::ranking_checkpoint());
    assert_eq!(read, samples::ranking_checkpoint());
    assert_eq!((read.config.outputs(), read.config.counts()), (Outputs::Ranks { density: true, flow: true }, None));
}

/// 1 + 2⁻¹⁰ has the 11 bits of half precision, 1 + 2⁻¹² is rounded to 1; beyond 65,504 there is nothing.
#[test]
fn a_model_is_kept_in_half_precision() {
    let mut model = Model::from(samples::checkpoint());
    let bias = |model: &mut Model, values: [f32; 4]| {
        model.network.get_mut("head.bias").expect("there is one").values = values.to_vec();
    };
    bias(&mut model, [1.0 + 1.0 / 1024.0, 1.0 + 1.0 / 4096.0, -0.25, 65_504.0]);
    let mut files = model.to_half_files().expect("encoded");
    let read = Model::from_files(|name| Ok(files.remove(name).expect("one of its files"))).expect("read");
    assert_eq!(read.network["head.bias"].values, [1.0 + 1.0 / 1024.0, 1.0, -0.25, 65_504.0]);
    assert_eq!((&read.config, read.epoch), (&model.config, 2));
    bias(&mut model, [0.0, 0.0, 0.0, 70_000.0]);
    let error = model.to_half_files().expect_err("too large");
    assert!(error.to_string().contains("half precision"), "{error}");
}

/// Two rooms of 5 m and a door of 0.9 m between them: nobody has to be told where people are, and where not.
#[test]
fn the_shipped_model_knows_doors_from_corners() {
    let free = Grid::from_fn(52, 103, |cell| {
        let inside = (1..51).contains(&cell.row) && (1..102).contains(&cell.col);
        inside && (cell.col != 51 || (22..31).contains(&cell.row))
    });
    let map = OccupancyMap::new(free, Frame::at_zero(0.1, 52, 103)).expect("free cells");
    let compute = Compute::new(DeviceName::Flex, None).expect("everywhere");
    let config = AnnotateConfig { mode: Mode::Dense { offsets: 8, augment: true }, ..AnnotateConfig::default() };
    let heat = heat(&map, &Model::shipped(), &config, &compute, &mut |_, _| ControlFlow::Continue(()));
    let Heat { heat, density, .. } = heat.expect("a heat");
    let at = |row, col| heat[Cell::new(row, col)];
    assert!(at(26, 51) > 0.95, "in the door: {}", at(26, 51));
    for (row, col) in [(3, 3), (3, 99), (48, 3), (48, 99), (3, 49), (48, 53)] {
        assert!(at(row, col) < 0.2, "in a corner, at row {row} and column {col}: {}", at(row, col));
    }
    let density = density.expect("it says densities");
    let mean = density.as_slice().iter().map(|density| f64::from(*density)).sum::<f64>() / map.free_cells() as f64;
    assert!((mean - 1.0).abs() < 1e-4 && density[Cell::new(26, 51)] > 3.0, "{mean}");
}

#[test]
fn a_checkpoint_remembers_the_distribution_of_its_labels() {
    let (_folder, store) = store();
    let (artifact, read) = through_store(&store, &samples::checkpoint());
    let names: Vec<&str> = artifact.files.iter().map(|file| file.name.as_str()).collect();
    assert_eq!(names, ["config.json", "metrics.parquet", "model.safetensors", "optimizer.safetensors"]);
    assert_eq!(read.config.outputs(), Outputs::Classes(3));
    assert_eq!(read.config.counts(), samples::checkpoint().config.counts());
    let shares = [825, 141, 37].map(|cells| f64::from(cells) / 1003.0);
    assert_eq!(read.config.counts().expect("classes").distribution(), shares);
    let missing = Checkpoint::read(&store, &Artifact { files: artifact.files[..2].to_vec(), ..artifact });
    assert!(matches!(missing, Err(KindError::MissingFile { file, .. }) if file == "model.safetensors"));
}
