use super::*;

/// Appends a text of MCAP: its length, and itself.
fn text(out: &mut Vec<u8>, text: &str) {
    out.extend((text.len() as u32).to_le_bytes());
    out.extend(text.as_bytes());
}

fn record(kind: u8, body: &[u8]) -> Vec<u8> {
    [&[kind][..], &(body.len() as u64).to_le_bytes(), body].concat()
}

fn schema(id: u16, name: &str) -> Vec<u8> {
    let mut body = id.to_le_bytes().to_vec();
    text(&mut body, name);
    text(&mut body, "ros2msg");
    text(&mut body, "");
    record(SCHEMA, &body)
}

fn channel(id: u16, schema: u16, topic: &str, encoding: &str) -> Vec<u8> {
    let mut body = [id.to_le_bytes(), schema.to_le_bytes()].concat();
    text(&mut body, topic);
    text(&mut body, encoding);
    body.extend(0u32.to_le_bytes());
    record(CHANNEL, &body)
}

fn message(channel: u16, data: &[u8]) -> Vec<u8> {
    record(MESSAGE, &[&channel.to_le_bytes()[..], &[0; 20], data].concat())
}

fn chunk(packing: &str, records: &[u8], packed: &[u8]) -> Vec<u8> {
    let mut body = [0; 16].to_vec();
    body.extend((records.len() as u64).to_le_bytes());
    body.extend(crc32fast::hash(records).to_le_bytes());
    text(&mut body, packing);
    body.extend((packed.len() as u64).to_le_bytes());
    body.extend(packed);
    record(CHUNK, &body)
}

fn file(parts: &[Vec<u8>]) -> Vec<u8> {
    [MAGIC.to_vec(), record(1, &[]), parts.concat(), record(DATA_END, &[0; 4]), MAGIC.to_vec()].concat()
}

/// CDR in either byte order, aligned behind its first four bytes.
struct Cdr {
    out: Vec<u8>,
    is_little: bool,
}

impl Cdr {
    fn header(seconds: u32, nanoseconds: u32, frame: &str, is_little: bool) -> Self {
        let mut cdr = Self { out: vec![0, u8::from(is_little), 0, 0], is_little };
        cdr.number(seconds.to_le_bytes());
        cdr.number(nanoseconds.to_le_bytes());
        cdr.text(frame);
        cdr
    }

    fn number<const N: usize>(&mut self, mut little: [u8; N]) {
        while !(self.out.len() - 4).is_multiple_of(N) {
            self.out.push(0);
        }
        if !self.is_little {
            little.reverse();
        }
        self.out.extend(little);
    }

    fn text(&mut self, text: &str) {
        self.number((text.len() as u32 + 1).to_le_bytes());
        self.out.extend(text.as_bytes());
        self.out.push(0);
    }

    fn numbers(&mut self, numbers: &[f64]) {
        numbers.iter().for_each(|number| self.number(number.to_le_bytes()));
    }
}

fn people(seconds: u32, nanoseconds: u32, frame: &str, is_little: bool, seen: &[(&str, f64, f64)]) -> Vec<u8> {
    let mut cdr = Cdr::header(seconds, nanoseconds, frame, is_little);
    cdr.number((seen.len() as u32).to_le_bytes());
    for (name, x, y) in seen {
        cdr.text(name);
        cdr.numbers(&[*x, *y, 0.0, 1.0, 0.0, 0.0, 0.9]);
        cdr.number(1u32.to_le_bytes());
        cdr.text("tag");
        cdr.number(0u32.to_le_bytes());
    }
    cdr.out
}

fn poses(seconds: u32, seen: &[(f64, f64)]) -> Vec<u8> {
    let mut cdr = Cdr::header(seconds, 0, "map", true);
    cdr.number((seen.len() as u32).to_le_bytes());
    seen.iter().for_each(|(x, y)| cdr.numbers(&[*x, *y, 0.0, 0.0, 0.0, 0.0, 1.0]));
    cdr.out
}

fn read(bytes: &[u8], config: &RecordingConfig) -> Result<Vec<(i64, f64, f64, f64)>, String> {
    let found = sightings(bytes, config).map_err(|error| error.to_string())?;
    Ok(found.sightings.into_iter().map(|s| (s.person, s.time, s.position.x, s.position.y)).collect())
}

/// Two people at half past one, in either byte order.
fn walk(is_little: bool) -> Vec<u8> {
    let head = [schema(1, "people_msgs/msg/People"), channel(7, 1, "/people", "cdr")].concat();
    let seen = people(1, 500_000_000, "map", is_little, &[("anna", 1.0, 2.0), ("12", -3.0, 0.5)]);
    [head, message(7, &seen)].concat()
}

const EXPECTED: [(i64, f64, f64, f64); 2] = [(-1, 1.5, 1.0, 2.0), (12, 1.5, -3.0, 0.5)];

#[test]
fn people_are_read_in_either_byte_order() {
    for is_little in [true, false] {
        assert_eq!(read(&file(&[walk(is_little)]), &RecordingConfig::default()), Ok(EXPECTED.to_vec()));
    }
}

#[test]
fn chunks_are_unpacked() {
    let records = walk(true);
    let zstd = zstd::stream::encode_all(&records[..], 3).expect("packs");
    // A frame of LZ4 with one block that is not packed: flags (version 1, blocks by themselves), largest block, checksum of both.
    let mut lz4 = vec![0x04, 0x22, 0x4d, 0x18, 0x60, 0x40, 0x82];
    lz4.extend((records.len() as u32 | 1 << 31).to_le_bytes());
    lz4.extend(&records);
    lz4.extend([0; 4]);
    for (packing, packed) in [("", &records), ("zstd", &zstd), ("lz4", &lz4)] {
        let whole = file(&[chunk(packing, &records, packed)]);
        assert_eq!(read(&whole, &RecordingConfig::default()), Ok(EXPECTED.to_vec()), "{packing}");
    }
    let mut other = zstd::stream::encode_all(&[&records[1..], &[0]].concat()[..], 3).expect("packs");
    let refused = |packed: &[u8]| {
        read(&file(&[chunk("zstd", &records, packed)]), &RecordingConfig::default()).expect_err("damaged")
    };
    assert!(refused(&other).ends_with("a chunk is damaged: its checksum is another one"), "{}", refused(&other));
    other.truncate(other.len() / 2);
    assert!(refused(&other).contains("a chunk does not unpack"), "{}", refused(&other));
    assert!(
        read(&file(&[chunk("xz", &records, &records)]), &RecordingConfig::default())
            .expect_err("unknown")
            .ends_with("a chunk is packed by `xz`, not zstd or lz4")
    );
}

#[test]
fn poses_are_people_by_their_places() {
    let head = [schema(2, "geometry_msgs/msg/PoseArray"), channel(1, 2, "/crowd", "cdr")].concat();
    let bytes = file(&[head, message(1, &poses(10, &[(1.0, 2.0), (3.0, 4.0)])), message(1, &poses(11, &[(1.5, 2.0)]))]);
    let expected = [(0, 10.0, 1.0, 2.0), (1, 10.0, 3.0, 4.0), (0, 11.0, 1.5, 2.0)];
    assert_eq!(read(&bytes, &RecordingConfig::default()), Ok(expected.to_vec()));
}

/// Without alignment, in little-endian order, with a number in the header and no zero at the end of names.
#[test]
fn messages_of_ros_1_are_read_too() {
    let mut data = [9u32, 4, 250_000_000].map(u32::to_le_bytes).concat();
    text(&mut data, "map");
    data.extend(1u32.to_le_bytes());
    text(&mut data, "ben");
    data.extend([5.0f64, 6.0, 0.0, 0.0, 0.0, 0.0, 1.0].map(f64::to_le_bytes).concat());
    data.extend([0; 8]);
    let bytes = file(&[schema(1, "people_msgs/People"), channel(1, 1, "/people", "ros1"), message(1, &data)]);
    assert_eq!(read(&bytes, &RecordingConfig::default()), Ok(vec![(-1, 4.25, 5.0, 6.0)]));
}

#[test]
fn topics_and_frames_are_never_guessed() {
    let poses = [
        schema(2, "geometry_msgs/msg/PoseArray"),
        channel(1, 2, "/crowd", "cdr"),
        message(1, &poses(10, &[(1.0, 2.0)])),
    ]
    .concat();
    let both = file(&[walk(true), poses]);
    let default = RecordingConfig::default();
    assert_eq!(
        read(&both, &default),
        Err("people or poses are on more than one topic: `/crowd` (geometry_msgs/msg/PoseArray), `/people` \
             (people_msgs/msg/People)"
            .to_owned())
    );
    let on = |topic: &str| RecordingConfig { topic: Some(topic.to_owned()), ..default.clone() };
    assert_eq!(read(&both, &on("/crowd")), Ok(vec![(0, 10.0, 1.0, 2.0)]));
    assert!(read(&both, &on("/scan")).expect_err("none").starts_with("no people or poses are on `/scan`; topics are"));
    let odom = people(1, 0, "odom", true, &[("anna", 1.0, 2.0)]);
    let other = file(&[schema(1, "people_msgs/msg/People"), channel(7, 1, "/people", "cdr"), message(7, &odom)]);
    assert_eq!(read(&other, &default), Err("positions are in the frame `odom`, not in `map`".to_owned()));
    let named = RecordingConfig { frame_id: Some("odom".to_owned()), ..default };
    assert_eq!(read(&other, &named), Ok(vec![(-1, 1.0, 1.0, 2.0)]));
}

#[test]
fn truncated_files_are_refused() {
    let whole = file(&[walk(true)]);
    // Up to the record that ends the data: what follows only helps to find others.
    for length in 0..whole.len() - MAGIC.len() - 13 {
        assert!(read(&whole[..length], &RecordingConfig::default()).is_err(), "{length}");
    }
    let bare = file(&[schema(1, "std_msgs/msg/String"), channel(7, 1, "/chatter", "cdr")]);
    assert_eq!(
        read(&bare, &RecordingConfig::default()),
        Err("no topic has people or poses; topics are `/chatter` (std_msgs/msg/String)".to_owned())
    );
}
