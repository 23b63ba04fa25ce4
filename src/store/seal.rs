//! Seals records with a checksum, and tells a damaged one from one that a newer version wrote.
//!
//! A sealed record is a JSON object with its fields on lines of their own. Its last field is the BLAKE3 of the text before
//! it, so that a flipped bit is found wherever it is:
//!
//! ```text
//! {
//!   "format": 2,
//!   …,
//!   "checksum": "26ca4edc…"
//! }
//! ```
//!
//! Format 1 had neither field. A later version may add fields to a format: whoever does not know them passes over them. It
//! raises the format when a record means something else without them; older programs then leave the record alone.

use std::path::Path;

use serde::Deserialize;
use serde::de::{DeserializeOwned, Error as _};

use super::bounded::read_bounded;
use super::digest::Digest;

/// The format of the records that this version writes.
pub(super) const FORMAT: u32 = 2;
/// The most bytes that a record may have: a run of a million nodes has half as many.
const LIMIT: u64 = 1 << 30;
const MARK: &[u8] = b",\n  \"checksum\": \"";
const END: &[u8] = b"\"\n}\n";
/// How many hex digits a checksum has.
const DIGITS: usize = 64;

/// What a record says of itself, whatever it is.
#[derive(Deserialize)]
struct Head {
    #[serde(default = "first")]
    format: u32,
}

const fn first() -> u32 {
    1
}

/// What a record turned out to be that came from elsewhere.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Received<T> {
    /// What was written there.
    Good(T),
    /// A newer version wrote it, and this one does not understand it.
    Newer,
    /// It is no record, or not what was written.
    Damaged,
}

/// Why a record cannot be had.
#[derive(Debug)]
pub(super) enum Unread {
    Absent,
    /// A newer version wrote it, and this one does not understand it.
    Newer {
        found: u32,
    },
    /// It is no record, or not what was written.
    Damaged(serde_json::Error),
    Failed(std::io::Error),
}

/// Adds the checksum to a JSON object that ends with a brace on a line of its own.
pub(super) fn seal(mut text: Vec<u8>) -> Vec<u8> {
    let body =
        text.trim_ascii_end().strip_suffix(b"\n}").expect("a record ends with a brace on a line of its own").len();
    text.truncate(body);
    let checksum = Digest::of(&text).to_hex();
    text.extend([MARK, checksum.as_bytes(), END].concat());
    text
}

/// Tells whether the checksum of a text is that of the rest; `None` if it has none.
fn is_whole(text: &[u8]) -> Option<bool> {
    let (rest, checksum) = text.strip_suffix(END)?.split_last_chunk::<DIGITS>()?;
    let body = rest.strip_suffix(MARK)?;
    Some(Digest::of(body).to_hex().as_bytes() == checksum)
}

/// Returns the format of a record that says it first, as all do which this version writes, without reading the rest.
fn leading_format(text: &[u8]) -> Option<u32> {
    let number = text.strip_prefix(b"{\n  \"format\": ")?;
    let digits = number.iter().position(|byte| !byte.is_ascii_digit()).filter(|end| number[*end] == b',')?;
    str::from_utf8(&number[..digits]).ok()?.parse().ok()
}

/// Reads the text of a record; returns its format, too.
pub(super) fn unseal<T: DeserializeOwned>(text: &[u8]) -> Result<(T, u32), Unread> {
    let head = match leading_format(text) {
        Some(format) => Head { format },
        None => serde_json::from_slice(text).map_err(Unread::Damaged)?,
    };
    let record = || serde_json::from_slice(text).map(|record| (record, head.format));
    let damaged = |message| Err(Unread::Damaged(serde_json::Error::custom(message)));
    match is_whole(text) {
        // A newer version may seal its records in another way.
        Some(false) | None if head.format > FORMAT => Err(Unread::Newer { found: head.format }),
        Some(true) if head.format > FORMAT => record().map_err(|_| Unread::Newer { found: head.format }),
        Some(false) => damaged("its checksum is not that of its content"),
        None if head.format > first() => damaged("it has no checksum"),
        _ => record().map_err(Unread::Damaged),
    }
}

/// Reads a record from its file.
pub(super) fn read<T: DeserializeOwned>(path: &Path) -> Result<(T, u32), Unread> {
    match read_bounded(path, LIMIT) {
        Ok(text) => unseal(&text),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Err(Unread::Absent),
        // A folder, a pipe or a device in the place of a record: it can be set aside like any other damage.
        Err(error) if path.metadata().is_ok_and(|metadata| !metadata.is_file()) => {
            Err(Unread::Damaged(serde_json::Error::custom(error)))
        }
        Err(error) => Err(Unread::Failed(error)),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;

    fn sealed(format: u32) -> Vec<u8> {
        let record = json!({ "format": format, "name": "a", "values": [1, 2] });
        seal(serde_json::to_vec_pretty(&record).expect("is JSON"))
    }

    #[test]
    fn a_record_is_json_with_the_checksum_of_the_text_before() {
        let text = String::from_utf8(sealed(2)).expect("is text");
        let expected = "{\n  \"format\": 2,\n  \"name\": \"a\",\n  \"values\": [\n    1,\n    2\n  ]";
        let checksum = Digest::of(expected.as_bytes()).to_hex();
        assert_eq!(text, format!("{expected},\n  \"checksum\": \"{checksum}\"\n}}\n"));
        let (value, format) = unseal::<Value>(text.as_bytes()).expect("is whole");
        assert_eq!((value["name"].as_str(), format), (Some("a"), 2));
    }

    #[test]
    fn every_flipped_bit_is_found() {
        let whole = sealed(2);
        for position in 0..whole.len() {
            for bit in 0..8 {
                let mut text = whole.clone();
                text[position] ^= 1 << bit;
                let found = unseal::<Value>(&text);
                assert!(matches!(found, Err(Unread::Damaged(_) | Unread::Newer { .. })), "bit {bit} of {position}");
            }
            assert!(unseal::<Value>(&whole[..position]).is_err(), "cut at {position}");
        }
    }

    #[test]
    fn the_first_format_has_no_checksum() {
        let (value, format) = unseal::<Value>(b"{\"name\":\"a\"}").expect("is a record of the first format");
        assert_eq!((value["name"].as_str(), format), (Some("a"), 1));
        assert!(matches!(unseal::<Value>(b"{\"format\":2,\"name\":\"a\"}"), Err(Unread::Damaged(_))));
    }

    #[test]
    fn a_newer_record_is_newer_and_never_damaged() {
        #[derive(Debug, Deserialize)]
        struct Known {
            name: String,
        }
        let (known, format) = unseal::<Known>(&sealed(3)).expect("has all that is known");
        assert_eq!((known.name.as_str(), format), ("a", 3));
        for text in [&b"{\"format\":3}"[..], b"{\"format\":3,\"name\":7}\n", &seal(b"{\n  \"format\": 3\n}".to_vec())] {
            assert!(matches!(unseal::<Known>(text), Err(Unread::Newer { found: 3 })));
        }
    }

    #[test]
    fn what_is_no_file_is_damage() {
        let folder = tempfile::tempdir().expect("creates");
        assert!(matches!(read::<Value>(folder.path()), Err(Unread::Damaged(_))));
        assert!(matches!(read::<Value>(&folder.path().join("nowhere")), Err(Unread::Absent)));
    }
}
