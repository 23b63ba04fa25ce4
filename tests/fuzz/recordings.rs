//! Recordings of people, in each of the formats that are read.

use std::sync::Arc;

use arrow::array::{Float64Array, Int64Array, RecordBatch};
use parquet::arrow::ArrowWriter;
use rusqlite::{Connection, MAIN_DB};
use serde_json::{Value, json};
use trodden::domain::geometry::{Frame, Grid};
use trodden::domain::map::OccupancyMap;
use trodden::domain::recording::{self, Format, RecordingConfig, RecordingError};
use trodden::kinds::recorded_rows;

use super::Target;
use super::mutate::{Dice, bytes, text, times};
use super::tables::parquet_file;

pub fn target(name: &str) -> Option<Target> {
    let columns = json!({ "id": "id", "frame": "frame", "x": "x", "y": "y" });
    Some(match name {
        "tracks-table" => {
            let seeds = [
                "id;frame;x;y\nanna;0;1;2\nanna;4;1.5;2\n7;4;-3;\"2\"\n",
                "\"frame\",\"id\",\"x\",\"y\"\n\"\",\"\",\"m\",\"m\"\n0,1,2,3\n8,1,2.5,3\n",
                "# framerate: 16\nframe id x y\n1 43 0.79 7.7\n2\t43 0.8 7.7\n",
            ];
            let config = json!({ "columns": columns, "unit": "m", "frame_rate": 16 });
            Target::new("tracks-table", seeds.map(|seed| seed.as_bytes().to_vec()).to_vec(), letters, reader(config))
        }
        "tracks-vadere" => {
            let seed = "#IDXCOL=2,DATACOL=6,SEP=' '\npedestrianId simTime endTime-PID1 startX-PID1 startY-PID1 endX-PID1 \
                        endY-PID1 targetId-PID2\n1 0.4 1 2 3 2.5 3 8\n1 1 1.5 2.5 3 3 3.25 8\n2 0.4 1 5 5 5 5.5 8\n";
            Target::new("tracks-vadere", vec![seed.as_bytes().to_vec()], letters, reader(json!({})))
        }
        "tracks-trajnet" => {
            let seed = "{\"scene\": {\"id\": 0, \"p\": 4, \"s\": 100, \"e\": 120, \"fps\": 2.5, \"tag\": [1, []]}}\n\
                        {\"track\": {\"f\": 100, \"p\": 4, \"x\": 1.5, \"y\": 2}}\n\
                        {\"track\": {\"f\": 110, \"p\": 4, \"x\": 2, \"y\": 2.5}}\n\
                        {\"track\": {\"f\": 120, \"p\": 4, \"x\": 2, \"y\": 2, \"prediction_number\": 0}}\n";
            Target::new("tracks-trajnet", vec![seed.as_bytes().to_vec()], letters, reader(json!({})))
        }
        "tracks-jupedsim" => Target::new("tracks-jupedsim", vec![database()], binary, reader(json!({}))),
        "tracks-mcap" => {
            Target::new("tracks-mcap", vec![mcap(&messages()), mcap(&chunk(&messages()))], binary, reader(json!({})))
        }
        "tracks-parquet" => {
            let config = json!({ "columns": columns, "unit": "m", "frame_rate": 10 });
            Target::new("tracks-parquet", vec![table()], parquet_file, reader(config))
        }
        _ => return None,
    })
}

/// Reads a recording and joins its people on a floor of 20 m × 20 m, wherever they are.
fn reader(config: Value) -> impl FnMut(&[u8]) -> bool {
    let config: RecordingConfig = serde_json::from_value(config).expect("a configuration");
    let config = RecordingConfig { off_map: 1.0, ..config };
    let map = OccupancyMap::new(Grid::filled(40, 40, true), Frame::at_zero(0.5, 40, 40)).expect("free cells");
    move |input| {
        let read = || {
            let found = match (recording::format_of(input, &config)?, &config.columns) {
                (Format::Parquet, Some(columns)) => {
                    recording::sightings_of(&recorded_rows(input.to_vec(), columns)?, &config)?
                }
                (format, _) => recording::sightings(input, format, &config)?,
            };
            recording::join(found.sightings, &map, &config)
        };
        let joined: Result<_, RecordingError> = read();
        joined.is_ok_and(|joined| !joined.tracks.samples.is_empty())
    }
}

fn letters(dice: &mut Dice, seeds: &[Vec<u8>]) -> Vec<u8> {
    const WORDS: [&str; 14] = [",", ";", "\t", " ", "\"", "\n", "\r\n", "#", "\0", "\u{feff}", "{", "}", "null", "nan"];
    let mut input = dice.of(seeds).clone();
    times(dice, |dice| text(dice, &mut input, seeds, &WORDS));
    input
}

fn binary(dice: &mut Dice, seeds: &[Vec<u8>]) -> Vec<u8> {
    let mut input = dice.of(seeds).clone();
    times(dice, |dice| bytes(dice, &mut input, seeds));
    input
}

/// A database of JuPedSim with some pages.
fn database() -> Vec<u8> {
    let rows: Vec<String> = (0..300).map(|i| format!("({}, {}, {}.5, 2, 0, 1)", i / 3, i % 3, i % 20)).collect();
    let mut database = Connection::open_in_memory().expect("opens");
    let statements = format!(
        "PRAGMA page_size = 512; CREATE TABLE trajectory_data (frame INTEGER NOT NULL, id INTEGER NOT NULL, pos_x REAL NOT \
         NULL, pos_y REAL NOT NULL, ori_x REAL NOT NULL, ori_y REAL NOT NULL); CREATE TABLE metadata(key TEXT NOT NULL \
         UNIQUE PRIMARY KEY, value TEXT NOT NULL); CREATE INDEX frame_id_idx ON trajectory_data(frame, id); INSERT INTO \
         metadata VALUES ('version', '2'), ('fps', '10.0'); INSERT INTO trajectory_data VALUES {}",
        rows.join(",")
    );
    database.execute_batch(&statements).expect("statements");
    database.serialize(MAIN_DB).expect("serializes").to_vec()
}

fn table() -> Vec<u8> {
    let columns: Vec<(&str, arrow::array::ArrayRef)> = vec![
        ("id", Arc::new(Int64Array::from_iter_values((0..60).map(|i| i % 3)))),
        ("frame", Arc::new(Int64Array::from_iter_values((0..60).map(|i| i / 3)))),
        ("x", Arc::new(Float64Array::from_iter_values((0..60).map(|i| f64::from(i) / 4.0)))),
        ("y", Arc::new(Float64Array::from_iter_values((0..60).map(|i| f64::from(i % 7))))),
    ];
    let batch = RecordBatch::try_from_iter(columns).expect("columns of one length");
    let mut bytes = Vec::new();
    let mut writer = ArrowWriter::try_new(&mut bytes, batch.schema(), None).expect("a writer");
    writer.write(&batch).expect("writes");
    writer.close().expect("closes");
    bytes
}

fn record(kind: u8, body: &[&[u8]]) -> Vec<u8> {
    let body = body.concat();
    [&[kind][..], &(body.len() as u64).to_le_bytes(), &body].concat()
}

fn named(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat()
}

/// Two messages with two poses each, in the order of the machine that most are.
fn messages() -> Vec<u8> {
    let message = |second: u32| {
        let mut data = vec![0, 1, 0, 0];
        for number in [second, 0, 4] {
            data.extend(number.to_le_bytes());
        }
        data.extend(b"map\0");
        data.extend(2u32.to_le_bytes());
        // Numbers of eight bytes begin at a multiple of eight behind the first four.
        data.extend([0; 4]);
        for pose in 0..2 {
            for number in [f64::from(second) + f64::from(pose), 3.0, 0.0, 0.0, 0.0, 0.0, 1.0] {
                data.extend(number.to_le_bytes());
            }
        }
        record(5, &[&1u16.to_le_bytes(), &[0; 20], &data])
    };
    let schema =
        record(3, &[&1u16.to_le_bytes(), &named("geometry_msgs/msg/PoseArray"), &named("ros2msg"), &named("")]);
    let channel = record(4, &[&[1, 0, 1, 0], &named("/people"), &named("cdr"), &[0; 4]]);
    [schema, channel, message(1), message(2)].concat()
}

/// A chunk without a checksum, so that what is in it matters.
fn chunk(records: &[u8]) -> Vec<u8> {
    let packed = zstd::stream::encode_all(records, 3).expect("packs");
    let size = (records.len() as u64).to_le_bytes();
    record(6, &[&[0; 16], &size, &[0; 4], &named("zstd"), &(packed.len() as u64).to_le_bytes(), &packed])
}

fn mcap(records: &[u8]) -> Vec<u8> {
    let magic = b"\x89MCAP0\r\n";
    [&magic[..], &record(1, &[]), records, &record(15, &[&[0; 4]]), magic].concat()
}
