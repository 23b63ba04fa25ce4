//! Looks at the headers of pages before the decoder of Parquet does, which makes room for what they say.
//!
//! A column is a row of pages, each with a header: how long it is as it lies there and as it was before, and how many values
//! it has. A flipped bit in the number of values of a dictionary asks for 16 GB, one in a length for 2.

use parquet::file::metadata::ColumnChunkMetaData;

use super::thrift::{Form, Thrift};

/// How many times longer than it lies there a page can be, at most: zstd writes a block of 128 KiB of one value as four bytes.
const DENSEST: u64 = 1 << 15;
/// How long a page may be, however short it lies there.
const SHORT: u64 = 1 << 16;

/// What a header says.
#[derive(Debug, Default)]
struct Page {
    uncompressed: i64,
    compressed: i64,
    /// Values of a data page.
    values: i64,
    /// Values of a dictionary.
    entries: i64,
}

/// Tells whether the pages of a column lie in it, and whether what they say of themselves can be.
pub(super) fn are_sound(file: &[u8], chunk: &ColumnChunkMetaData) -> bool {
    column(file, chunk).is_some()
}

fn column(file: &[u8], chunk: &ColumnChunkMetaData) -> Option<()> {
    let start = chunk.dictionary_page_offset().unwrap_or_else(|| chunk.data_page_offset());
    let start = usize::try_from(start).ok()?;
    let length = usize::try_from(chunk.compressed_size()).ok()?;
    let mut thrift = Thrift { rest: file.get(start..start.checked_add(length)?)? };
    let mut values = 0i64;
    // What may follow the last value is not read.
    while values < chunk.num_values() && !thrift.rest.is_empty() {
        let page = page(&mut thrift)?;
        values = values.checked_add(page.values)?;
    }
    Some(())
}

/// Reads the header of a page and passes over what is in it.
fn page(thrift: &mut Thrift) -> Option<Page> {
    let mut page = Page::default();
    thrift.walk(header, &mut |path, value| match path {
        [2] => page.uncompressed = value,
        [3] => page.compressed = value,
        [5 | 8, 1] => page.values = value,
        [7, 1] => page.entries = value,
        _ => {}
    })?;
    let [uncompressed, compressed, _, entries] =
        [page.uncompressed, page.compressed, page.values, page.entries].map(u64::try_from);
    let (uncompressed, compressed, entries) = (uncompressed.ok()?, compressed.ok()?, entries.ok()?);
    // A value takes a byte at least.
    let can_be = uncompressed <= SHORT.max(compressed.saturating_mul(DENSEST)) && entries <= uncompressed;
    thrift.jump(compressed)?;
    (can_be && page.values >= 0).then_some(page)
}

/// The fields of a page's header.
fn header(field: i64) -> Option<Form> {
    match field {
        1..=4 => Some(Form::Integer),
        5 => Some(Form::Fields(|field| (1..=4).contains(&field).then_some(Form::Integer))),
        7 => Some(Form::Fields(dictionary)),
        8 => Some(Form::Fields(data_v2)),
        _ => None,
    }
}

fn dictionary(field: i64) -> Option<Form> {
    match field {
        1 | 2 => Some(Form::Integer),
        3 => Some(Form::Truth),
        _ => None,
    }
}

fn data_v2(field: i64) -> Option<Form> {
    match field {
        1..=6 => Some(Form::Integer),
        7 => Some(Form::Truth),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A header with numbers of up to 63 in one byte each, with the sign as lowest bit, before ten bytes.
    fn check(type_and_lengths: [u8; 3], rest: &[u8], expected: bool) {
        let [kind, uncompressed, compressed] = type_and_lengths.map(|number| number << 1);
        let bytes = [&[0x15, kind, 0x15, uncompressed, 0x15, compressed], rest, &[0], &[7; 10]].concat();
        let mut thrift = Thrift { rest: &bytes };
        assert_eq!(page(&mut thrift).is_some(), expected, "{bytes:?}");
        assert!(!expected || thrift.rest.is_empty());
    }

    #[test]
    fn what_a_page_says_of_itself_must_be_possible() {
        // A dictionary: field 7, four further than 3, with as many values as bytes.
        check([2, 40, 10], &[0x4c, 0x15, 40 << 1, 0x15, 0, 0], true);
        check([2, 40, 10], &[0x4c, 0x15, 41 << 1, 0x15, 0, 0], false);
        check([2, 40, 10], &[0x4c, 0x15, 0xfe, 0xff, 0xff, 0xff, 0x0f, 0x15, 0, 0], false);
        check([2, 40, 10], &[0x4c, 0x15, 1, 0x15, 0, 0], false);
        // The number of values by the type of a long.
        check([2, 40, 10], &[0x4c, 0x16, 2, 0x15, 0, 0], false);
        // A data page: field 5, values, encodings.
        check([0, 40, 10], &[0x2c, 0x15, 60 << 1, 0x15, 0, 0x15, 6, 0x15, 6, 0], true);
        // Longer than the file.
        check([0, 40, 11], &[0x2c, 0x15, 60 << 1, 0x15, 0, 0x15, 6, 0x15, 6, 0], false);
    }

    #[test]
    fn no_page_is_two_gigabytes_of_ten_bytes() {
        let long = [&[0x15, 0, 0x15, 0xfe, 0xff, 0xff, 0xff, 0x0f, 0x15, 20, 0][..], &[7; 10]].concat();
        assert!(page(&mut Thrift { rest: &long }).is_none());
    }
}
