//! What is in the files: digests of their bytes, the types of their columns, examples for other tools.

use std::sync::Arc;

use arrow::datatypes::{DataType, Field};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use trodden::kinds::{SingleFile, TrackWriter};
use trodden::store::Digest;

use super::samples;

/// Bytes of equal values may only change together with the number of the format.
///
/// When this fails after an update of arrow, parquet, zstd or safetensors, the encoders write other bytes: raise all format
/// numbers, so that old artifacts are made again instead of being called nondeterministic.
#[test]
fn bytes_are_a_function_of_the_value() {
    fn single<K: SingleFile>(value: &K) -> (String, Vec<u8>) {
        (format!("{} {}", <K as SingleFile>::NAME, <K as SingleFile>::FORMAT), value.to_bytes().expect("encoded"))
    }
    let mut writer = TrackWriter::new(Vec::new(), samples::frame(), 10.0, 0.2).expect("a writer");
    writer.extend(&samples::tracks(0..3, 2, 9).value.samples).expect("written");
    let mut files = vec![
        single(&samples::map()),
        single(&samples::visits()),
        single(&samples::labels()),
        single(&samples::heat()),
        single(&samples::ranks()),
        single(&samples::tiles()),
        single(&samples::ranked_tiles()),
        ("Trajectories 2".to_owned(), writer.finish().expect("finished")),
        single(&samples::trips()),
        single(&samples::scores()),
        single(&samples::costs()),
        single(&samples::path_trials()),
    ];
    let bundle = samples::checkpoint().to_files().expect("encoded");
    files.extend(bundle.into_iter().map(|(name, bytes)| (format!("Checkpoint 1 {name}"), bytes)));
    let digests: Vec<String> =
        files.iter().map(|(name, bytes)| format!("{name} {}", &Digest::of(bytes).to_hex()[..16])).collect();
    assert_eq!(
        digests,
        [
            "OccupancyMap 1 5bed279c14fcc5b0",
            "VisitCounts 1 d56191366558d7e3",
            "Labels 1 f8093f86458d9cd5",
            "Heat 1 38c5120df7b5da53",
            "Heat 1 0c307f2a72a9c779",
            "Tiles 1 f0fc843817eda3e6",
            "Tiles 1 92f02ebec66850a4",
            "Trajectories 2 dd87c0e9c6a8bbba",
            "NavEpisodes 2 4de0c2097ea3d8c0",
            "ClassScores 4 f8fefe8284ac0fe3",
            "SocialCosts 3 09cb5b1702ab991b",
            "PathTrials 1 7f50e4fdbeb16ef1",
            "Checkpoint 1 config.json 92c5b34320f9facc",
            "Checkpoint 1 metrics.parquet 0bac909c836a541d",
            "Checkpoint 1 model.safetensors 8dfb677edd4b761f",
            "Checkpoint 1 optimizer.safetensors aaad0f91a84b7d08",
        ]
    );
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
    expected.push(column("observed", DataType::UInt8));
    assert_eq!(types(samples::map().to_bytes().expect("encoded")), expected);
    let mut expected = place();
    expected.push(column("heat", DataType::Float32));
    expected.push(column("class", DataType::Int8));
    expected.extend((0..4).map(|class| column(&format!("p{class}"), DataType::Float32)));
    assert_eq!(types(samples::heat().to_bytes().expect("encoded")), expected);
    let mut expected = place();
    expected.push(column("free", DataType::Boolean));
    expected.extend(["heat", "density"].map(|name| column(name, DataType::Float32)));
    expected.extend((0..8).map(|direction| column(&format!("flow_{direction}"), DataType::Float32)));
    assert_eq!(types(samples::ranks().to_bytes().expect("encoded")), expected);
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
    write("ranks.parquet", samples::ranks().to_bytes().expect("encoded"));
    write("tiles.parquet", samples::tiles().to_bytes().expect("encoded"));
    write("trips.parquet", samples::trips().to_bytes().expect("encoded"));
    write("floor.parquet", samples::floor_only().to_bytes().expect("encoded"));
    write("scores.parquet", samples::scores().to_bytes().expect("encoded"));
    write("costs.parquet", samples::costs().to_bytes().expect("encoded"));
    for chunk in 0..2 {
        let tracks = samples::tracks(chunk * 20..chunk * 20 + 20, 10, 1000);
        let mut writer = TrackWriter::new(Vec::new(), tracks.frame, 10.0, 0.2).expect("a writer");
        writer.extend(&tracks.value.samples).expect("written");
        write(&format!("walks/chunk-{chunk:02}.parquet"), writer.finish().expect("finished"));
    }
    for (name, bytes) in samples::checkpoint().to_files().expect("encoded") {
        write(&format!("model/{name}"), bytes);
    }
}
