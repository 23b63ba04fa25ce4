//! Artifacts: Parquet of every kind, and checkpoints.

use std::sync::Arc;

use arrow::array::{Array, ArrayRef, AsArray, BooleanArray, PrimitiveArray, RecordBatch, StringArray, UInt32Array};
use arrow::compute::{concat_batches, take_record_batch};
use arrow::datatypes::{
    ArrowPrimitiveType, DataType, Field, Float32Type, Float64Type, Int8Type, Int32Type, Int64Type, Schema, UInt8Type,
    UInt32Type, UInt64Type,
};
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, Encoding, ZstdLevel};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use serde_json::Value;
use trodden::domain::quantize::class_weights;
use trodden::domain::unet::{Compute, DeviceName, Network, Simd};
use trodden::kinds::parquet::read_any;
use trodden::kinds::{Checkpoint, CheckpointConfig, KindError, SingleFile, TrackReader, TrackWriter};
use trodden::report::table;

use super::Target;
use super::mutate::{Dice, bytes, number, times, tree};
use crate::kinds::samples;

pub fn target(name: &str) -> Option<Target> {
    Some(match name {
        "OccupancyMap" => kind("OccupancyMap", &samples::map()),
        "VisitCounts" => kind("VisitCounts", &samples::visits()),
        "Labels" => kind("Labels", &samples::labels()),
        "Tiles" => kinds("Tiles", &[samples::tiles(), samples::ranked_tiles()]),
        "Heat" => kind("Heat", &samples::heat()),
        "NavEpisodes" => kind("NavEpisodes", &samples::trips()),
        "ClassScores" => kind("ClassScores", &samples::scores()),
        "SocialCosts" => kind("SocialCosts", &samples::costs()),
        "PathTrials" => kind("PathTrials", &samples::path_trials()),
        "Trajectories" => Target::new("Trajectories", vec![walks()], parquet_file, |input| {
            let Ok(reader) = TrackReader::open(input.to_vec()) else { return false };
            // It stops at what is wrong, as its readers do.
            reader.map_while(Result::ok).map(|samples| samples.len()).sum::<usize>() > 0
        }),
        "table" => {
            let encoded = |bytes: Result<Vec<u8>, KindError>| bytes.expect("a sample can be written");
            let seeds = vec![encoded(samples::tiles().to_bytes()), encoded(samples::scores().to_bytes()), walks()];
            Target::new("table", seeds, parquet_file, |input| {
                read_any(input.to_vec()).is_ok_and(|read| {
                    !table::text(&read, 50).is_empty() && table::json_rows(&read).count() == read.rows()
                })
            })
        }
        "checkpoint" => checkpoint(),
        _ => return None,
    })
}

/// What is read can be written again, unless it is nothing that a stage writes.
fn kind<K: SingleFile>(name: &'static str, sample: &K) -> Target {
    kinds(name, std::slice::from_ref(sample))
}

fn kinds<K: SingleFile>(name: &'static str, samples: &[K]) -> Target {
    let seeds = samples.iter().map(|sample| sample.to_bytes().expect("a sample can be written")).collect();
    Target::new(name, seeds, parquet_file, |input| {
        K::from_bytes(input.to_vec()).is_ok_and(|value| value.to_bytes().is_ok())
    })
}

fn walks() -> Vec<u8> {
    let tracks = samples::tracks(0..3, 3, 6);
    let mut writer = TrackWriter::new(Vec::new(), tracks.frame, tracks.value.frame_rate, 0.2).expect("a writer");
    writer.extend(&tracks.value.samples).expect("in order");
    writer.finish().expect("finished")
}

/// Changes a Parquet file: what it says, written by another hand, or its bytes where they lie.
pub(super) fn parquet_file(dice: &mut Dice, seeds: &[Vec<u8>]) -> Vec<u8> {
    let mut input = dice.of(seeds).clone();
    if dice.one_in(2) {
        input = forged(dice, &input);
        if !dice.one_in(3) {
            return input;
        }
    }
    // The last eight bytes are the footer's length and a magic word; they stay right, mostly.
    let end = input.len() - 8;
    let length = u32::from_le_bytes(input[end..end + 4].try_into().expect("four bytes")) as usize;
    let mut footer = input[end - length..end].to_vec();
    let mut pages = input[..end - length].to_vec();
    times(dice, |dice| match dice.below(4) {
        0 => bytes(dice, &mut pages, seeds),
        1 => number(dice, &mut footer),
        _ => bytes(dice, &mut footer, seeds),
    });
    let length = u32::try_from(footer.len()).expect("a short footer");
    let mut input = [&pages[..], &footer, &length.to_le_bytes(), b"PAR1"].concat();
    if dice.one_in(20) {
        bytes(dice, &mut input, seeds);
    }
    input
}

/// Writes the content of a file again, with changes to metadata, columns and values.
fn forged(dice: &mut Dice, input: &[u8]) -> Vec<u8> {
    let table = read_any(input.to_vec()).expect("a seed is a table");
    let batch = concat_batches(&table.schema, &table.batches).expect("of one schema");
    let mut metadata: Vec<(String, String)> = table.metadata.into_iter().collect();
    let mut columns: Vec<(String, ArrayRef)> =
        batch.schema().fields().iter().zip(batch.columns()).map(|(f, a)| (f.name().clone(), a.clone())).collect();
    times(dice, |dice| change(dice, &mut metadata, &mut columns));
    let rows = columns.iter().map(|(_, array)| array.len()).min().unwrap_or(0);
    let fields: Vec<Field> = columns
        .iter()
        .map(|(name, array)| Field::new(name, array.data_type().clone(), array.null_count() > 0 || dice.one_in(10)))
        .collect();
    let schema = Arc::new(Schema::new(fields));
    let arrays = columns.iter().map(|(_, array)| array.slice(0, rows)).collect();
    let mut batch = RecordBatch::try_new(schema.clone(), arrays).expect("columns of one length");
    if dice.one_in(4) {
        let order: Vec<u32> = (0..dice.below(2 * rows + 2)).map(|_| dice.below(rows) as u32).collect();
        if rows > 0 {
            batch = take_record_batch(&batch, &UInt32Array::from(order)).expect("rows that are there");
        }
    }
    let compression = *dice.of(&[Compression::UNCOMPRESSED, Compression::ZSTD(ZstdLevel::default())]);
    let mut properties = WriterProperties::builder()
        .set_compression(compression)
        .set_max_row_group_row_count(Some(1 + dice.below(40)))
        .set_data_page_size_limit(1 + dice.below(2000))
        .set_dictionary_enabled(dice.one_in(2));
    if dice.one_in(3) {
        properties =
            properties.set_encoding(*dice.of(&[Encoding::PLAIN, Encoding::RLE, Encoding::DELTA_BINARY_PACKED]));
    }
    // Not every encoding serves for every type.
    let write = |properties| {
        let mut writer = ArrowWriter::try_new(Vec::new(), schema.clone(), properties).ok()?;
        writer.write(&batch).ok()?;
        for (key, value) in &metadata {
            writer.append_key_value_metadata(KeyValue::new(key.clone(), value.clone()));
        }
        writer.into_inner().ok()
    };
    let forged = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| write(Some(properties.build()))));
    forged.ok().flatten().or_else(|| write(None)).expect("plain columns can be written")
}

fn change(dice: &mut Dice, metadata: &mut Vec<(String, String)>, columns: &mut Vec<(String, ArrayRef)>) {
    let (entry, at, other) = (dice.below(metadata.len()), dice.below(columns.len()), dice.below(columns.len()));
    match dice.below(10) {
        0 if metadata.len() > 1 => drop(metadata.remove(entry)),
        1 if !metadata.is_empty() => metadata.push((metadata[entry].0.clone(), "1".to_owned())),
        2..=4 if !metadata.is_empty() => {
            let mut value = metadata[entry].1.clone().into_bytes();
            if dice.one_in(3) {
                bytes(dice, &mut value, &[b"[]".to_vec()])
            } else {
                number(dice, &mut value)
            }
            metadata[entry].1 = String::from_utf8_lossy(&value).into_owned();
        }
        5 if columns.len() > 1 => drop(columns.remove(at)),
        6 => {
            let array = columns[other].1.clone();
            columns[at].1 = array;
        }
        7 => columns.swap(at, other),
        _ => {
            let array = changed(dice, &columns[at].1);
            columns[at].1 = array;
        }
    }
}

/// Puts odd values into a column.
fn changed(dice: &mut Dice, array: &ArrayRef) -> ArrayRef {
    fn numbers<T: ArrowPrimitiveType>(dice: &mut Dice, array: &ArrayRef, odd: &[T::Native]) -> ArrayRef {
        let change = 1 + dice.below(8);
        let gaps = dice.one_in(4);
        let values = array.as_primitive::<T>().iter().map(|value| match dice.one_in(change) {
            true if gaps => None,
            true => Some(*dice.of(odd)),
            false => value,
        });
        Arc::new(values.collect::<PrimitiveArray<T>>())
    }
    let floats = [0.0, -0.0, 1.0, -1.0, f64::NAN, f64::INFINITY, f64::MAX, f64::MIN_POSITIVE];
    match array.data_type() {
        DataType::Int8 => numbers::<Int8Type>(dice, array, &[0, -1, 1, 3, 4, i8::MAX, i8::MIN]),
        DataType::UInt8 => numbers::<UInt8Type>(dice, array, &[0, 1, 2, u8::MAX]),
        DataType::Int32 => numbers::<Int32Type>(dice, array, &[0, -1, 1, i32::MAX, i32::MIN]),
        DataType::UInt32 => numbers::<UInt32Type>(dice, array, &[0, 1, u32::MAX]),
        DataType::Int64 => numbers::<Int64Type>(dice, array, &[0, -1, 1, i64::MAX, i64::MIN]),
        DataType::UInt64 => numbers::<UInt64Type>(dice, array, &[0, 1, u64::MAX]),
        DataType::Float32 => numbers::<Float32Type>(dice, array, &floats.map(|value| value as f32)),
        DataType::Float64 => numbers::<Float64Type>(dice, array, &floats),
        DataType::Boolean => {
            let flip = 1 + dice.below(8);
            Arc::new(
                array.as_boolean().iter().map(|flag| flag.map(|f| f ^ dice.one_in(flip))).collect::<BooleanArray>(),
            )
        }
        DataType::Utf8 => {
            let odd = ["", "home_00", "\u{1b}[31m", "../../x", "ö"];
            let texts =
                array.as_string::<i32>().iter().map(|text| if dice.one_in(3) { Some(*dice.of(&odd)) } else { text });
            Arc::new(texts.collect::<StringArray>())
        }
        // A list becomes a number: another type.
        _ => Arc::new(UInt32Array::from(vec![7; array.len()])),
    }
}

/// Sets files behind each other, each after its length.
fn packed(files: &[Vec<u8>]) -> Vec<u8> {
    files.iter().flat_map(|file| [&(file.len() as u32).to_le_bytes()[..], file].concat()).collect()
}

fn unpacked(mut input: &[u8]) -> Vec<Vec<u8>> {
    let mut files = Vec::new();
    while let [a, b, c, d, rest @ ..] = input {
        let (file, after) = rest.split_at((u32::from_le_bytes([*a, *b, *c, *d]) as usize).min(rest.len()));
        files.push(file.to_vec());
        input = after;
    }
    files
}

fn checkpoint() -> Target {
    let seeds = [samples::checkpoint(), samples::ranking_checkpoint()].map(|sample| {
        let files = sample.to_files().expect("a sample can be written");
        packed(&Checkpoint::FILES.map(|name| files[name].clone()))
    });
    let compute = Compute::new(DeviceName::Flex, Some(Simd::Portable)).expect("everywhere");
    Target::new("checkpoint", seeds.to_vec(), bundle, move |input| {
        let files = unpacked(input);
        let file = |name: &'static str| {
            let at = Checkpoint::FILES.iter().position(|file| *file == name).expect("one of four");
            Ok(files.get(at).cloned().unwrap_or_default())
        };
        let Ok(checkpoint) = Checkpoint::from_files(file) else { return false };
        drop(checkpoint.config.counts().map(class_weights));
        let CheckpointConfig { network, besides, .. } = &checkpoint.config;
        drop(Network::new(network, besides, checkpoint.config.outputs(), &checkpoint.state.model, &compute));
        checkpoint.to_files().is_ok()
    })
}

fn bundle(dice: &mut Dice, seeds: &[Vec<u8>]) -> Vec<u8> {
    let mut files = unpacked(dice.of::<Vec<u8>>(seeds));
    let at = dice.below(files.len());
    let file = std::mem::take(&mut files[at]);
    files[at] = match Checkpoint::FILES[at] {
        "config.json" => {
            let mut value: Value = serde_json::from_slice(&file).expect("a seed is JSON");
            times(dice, |dice| tree(dice, &mut value));
            serde_json::to_vec(&value).expect("JSON")
        }
        "metrics.parquet" => parquet_file(dice, &[file]),
        _ => safetensors(dice, &file),
    };
    packed(&files)
}

/// Changes the header of a safetensors file, whose length stays right, mostly, or its numbers.
fn safetensors(dice: &mut Dice, file: &[u8]) -> Vec<u8> {
    let length = u64::from_le_bytes(file[..8].try_into().expect("eight bytes")) as usize;
    let (mut header, mut data) = (file[8..8 + length].to_vec(), file[8 + length..].to_vec());
    times(dice, |dice| match dice.below(4) {
        0 => bytes(dice, &mut data, &[file.to_vec()]),
        1 => number(dice, &mut header),
        2 => bytes(dice, &mut header, &[file.to_vec()]),
        _ => {
            if let Ok(mut value) = serde_json::from_slice::<Value>(&header) {
                tree(dice, &mut value);
                header = serde_json::to_vec(&value).expect("JSON");
            }
        }
    });
    let mut length = (header.len() as u64).to_le_bytes().to_vec();
    if dice.one_in(10) {
        bytes(dice, &mut length, &[file.to_vec()]);
    }
    [length, header, data].concat()
}
