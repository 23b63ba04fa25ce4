//! MCAP: messages of ROS, each on a channel with a topic and a type, some of them packed in chunks.
//!
//! Records follow each other, each with a kind and a length; those that only help to find others are passed over.

use std::collections::BTreeMap;
use std::io::Read;

use super::collect::{Collector, Found};
use super::ros::{Encoding, Seen, Type};
use super::{Format, RecordingConfig, RecordingError};

const MAGIC: &[u8] = b"\x89MCAP0\r\n";
/// The most bytes that a chunk may unpack to.
const LARGEST: u64 = 512 << 20;

/// Kinds of records.
const SCHEMA: u8 = 3;
const CHANNEL: u8 = 4;
const MESSAGE: u8 = 5;
const CHUNK: u8 = 6;
const DATA_END: u8 = 15;

/// A topic that people or poses come on.
struct Channel {
    topic: String,
    kind: Type,
    encoding: Encoding,
}

/// What has been read so far.
struct Reading<'a> {
    /// The topic that is asked for.
    topic: Option<&'a str>,
    /// Names of types by their numbers.
    schemas: BTreeMap<u16, String>,
    /// Channels with people or poses, by their numbers.
    channels: BTreeMap<u16, Channel>,
    /// What all topics are, for advice.
    topics: BTreeMap<String, String>,
    /// Who was seen, by topic.
    seen: BTreeMap<String, Vec<Seen>>,
}

/// Reads the sightings of a file.
///
/// # Errors
/// [`RecordingError`] if the file is damaged, its people are on no topic or several, or their frame is another one.
pub(super) fn sightings(bytes: &[u8], config: &RecordingConfig) -> Result<Found, RecordingError> {
    let wrong = |what: String| RecordingError::Format { format: Format::Mcap, what };
    let mut reading = Reading {
        topic: config.topic.as_deref(),
        schemas: BTreeMap::new(),
        channels: BTreeMap::new(),
        topics: BTreeMap::new(),
        seen: BTreeMap::new(),
    };
    let rest = bytes.strip_prefix(MAGIC).ok_or_else(|| wrong("it does not begin as such files do".to_owned()))?;
    if !reading.records(&mut Bytes::new(rest, MAGIC.len()), false).map_err(wrong)? {
        return Err(wrong("it ends before its data do: the end of the file is missing".to_owned()));
    }
    let Reading { topic, topics, seen, .. } = reading;
    let listed = || {
        let topics: Vec<String> = topics.iter().map(|(topic, kind)| format!("`{topic}` ({kind})")).collect();
        if topics.is_empty() { "none".to_owned() } else { topics.join(", ") }
    };
    let (name, messages) = match (seen.len(), topic, seen.into_iter().next()) {
        (1, _, Some(only)) => only,
        (0, Some(topic), _) => {
            return Err(RecordingError::Topic(format!("no people or poses are on `{topic}`; topics are {}", listed())));
        }
        (0, None, _) => {
            return Err(RecordingError::Topic(format!("no topic has people or poses; topics are {}", listed())));
        }
        _ => {
            return Err(RecordingError::Topic(format!("people or poses are on more than one topic: {}", listed())));
        }
    };
    let mut found = Collector::new(config, &Format::Mcap.said())?;
    let expected = config.frame_id.as_deref().unwrap_or("map");
    let mut unplaced = 0usize;
    let count = messages.len();
    for Seen { time, frame, people } in messages {
        if frame.trim_start_matches('/') != expected.trim_start_matches('/') {
            return Err(RecordingError::OtherFrame { found: frame, expected: expected.to_owned() });
        }
        for (name, [x, y]) in people {
            if x.is_finite() && y.is_finite() {
                let person = found.person(&name);
                found.push(person, time, [x, y]);
            } else {
                unplaced += 1;
            }
        }
    }
    found.remark(format!("{count} messages of `{name}` are read, in the frame `{expected}`"));
    if unplaced > 0 {
        found.remark(format!("{unplaced} positions are no finite numbers, and were left out"));
    }
    found.finish()
}

impl Reading<'_> {
    /// Reads records; returns whether their end was among them.
    fn records(&mut self, bytes: &mut Bytes, in_chunk: bool) -> Result<bool, String> {
        while !bytes.rest.is_empty() {
            let at = bytes.at;
            let ends = |_: String| format!("it ends in the middle of the record at byte {at}");
            let kind = bytes.number::<1>().map_err(ends)?[0];
            let length = u64::from_le_bytes(bytes.number().map_err(ends)?);
            let body = bytes.take(length).map_err(ends)?;
            let record = &mut Bytes::new(body, at + 9);
            let read = match kind {
                SCHEMA => self.schema(record),
                CHANNEL => self.channel(record),
                MESSAGE => self.message(record),
                CHUNK if in_chunk => Err("it holds a chunk in a chunk".to_owned()),
                CHUNK => self.chunk(record),
                DATA_END if !in_chunk => return Ok(true),
                _ => Ok(()),
            };
            read.map_err(
                |what| if what.contains("at byte") { what } else { format!("the record at byte {at}: {what}") },
            )?;
        }
        Ok(false)
    }

    fn schema(&mut self, record: &mut Bytes) -> Result<(), String> {
        let id = u16::from_le_bytes(record.number()?);
        let name = record.text()?;
        self.schemas.insert(id, name);
        Ok(())
    }

    fn channel(&mut self, record: &mut Bytes) -> Result<(), String> {
        let id = u16::from_le_bytes(record.number()?);
        let schema = u16::from_le_bytes(record.number()?);
        let (topic, encoding) = (record.text()?, record.text()?);
        let schema = self.schemas.get(&schema).cloned().unwrap_or_default();
        self.topics.insert(topic.clone(), schema.clone());
        let asked = self.topic.is_none_or(|asked| asked == topic);
        if let (true, Some(kind)) = (asked, Type::of(&schema)) {
            let known = Encoding::of(&encoding);
            let encoding =
                known.ok_or_else(|| format!("`{topic}` is in the encoding `{encoding}`, not cdr or ros1"))?;
            self.channels.insert(id, Channel { topic, kind, encoding });
        }
        Ok(())
    }

    fn message(&mut self, record: &mut Bytes) -> Result<(), String> {
        let id = u16::from_le_bytes(record.number()?);
        let Some(Channel { topic, kind, encoding }) = self.channels.get(&id) else { return Ok(()) };
        // Number and times of writing: people were seen at the time in the message.
        record.number::<20>()?;
        let seen = kind.read(record.rest, *encoding).map_err(|what| format!("a message of `{topic}` {what}"))?;
        self.seen.entry(topic.clone()).or_default().push(seen);
        Ok(())
    }

    fn chunk(&mut self, record: &mut Bytes) -> Result<(), String> {
        record.number::<16>()?;
        let size = u64::from_le_bytes(record.number()?);
        let sum = u32::from_le_bytes(record.number()?);
        let packing = record.text()?;
        let length = u64::from_le_bytes(record.number()?);
        let packed = record.take(length)?;
        if size > LARGEST {
            return Err(format!("a chunk of {size} bytes, more than {} MiB", LARGEST >> 20));
        }
        let damaged = |error: std::io::Error| format!("a chunk does not unpack: {error}");
        let mut unpacked = Vec::new();
        match packing.as_str() {
            "" => unpacked.extend_from_slice(packed),
            "zstd" => {
                let decoder = zstd::stream::read::Decoder::new(packed).map_err(damaged)?;
                decoder.take(size + 1).read_to_end(&mut unpacked).map_err(damaged)?;
            }
            "lz4" => {
                let decoder = lz4_flex::frame::FrameDecoder::new(packed);
                decoder.take(size + 1).read_to_end(&mut unpacked).map_err(damaged)?;
            }
            other => return Err(format!("a chunk is packed by `{other}`, not zstd or lz4")),
        }
        if unpacked.len() as u64 != size {
            return Err(format!("a chunk of {size} bytes unpacks to {}", unpacked.len()));
        }
        if sum != 0 && crc32fast::hash(&unpacked) != sum {
            return Err("a chunk is damaged: its checksum is another one".to_owned());
        }
        let records = &mut Bytes::new(&unpacked, 0);
        self.records(records, true).map(drop).map_err(|what| format!("in its chunk, {what}").replace("at byte", "at"))
    }
}

/// Bytes that are read from the front.
struct Bytes<'a> {
    rest: &'a [u8],
    /// Where the rest begins.
    at: usize,
}

impl<'a> Bytes<'a> {
    fn new(rest: &'a [u8], at: usize) -> Self {
        Self { rest, at }
    }

    fn take(&mut self, length: u64) -> Result<&'a [u8], String> {
        let length = usize::try_from(length).ok().filter(|length| *length <= self.rest.len());
        let (taken, rest) = self.rest.split_at(length.ok_or("it is shorter than it says")?);
        self.at += taken.len();
        self.rest = rest;
        Ok(taken)
    }

    fn number<const N: usize>(&mut self) -> Result<[u8; N], String> {
        Ok(self.take(N as u64)?.try_into().expect("as many as were taken"))
    }

    fn text(&mut self) -> Result<String, String> {
        let length = u32::from_le_bytes(self.number()?);
        let text = self.take(u64::from(length))?;
        String::from_utf8(text.to_vec()).map_err(|_| "a name in it is no text".to_owned())
    }
}

#[cfg(test)]
mod tests;
