//! Looks at the footer of a Parquet file before its decoder does, which takes the lengths in it on trust.
//!
//! The schema is a tree, written as a list of elements that say how many children they have. The decoder makes room for as
//! many as an element says, so a flipped bit there asks for 16 GB.

use super::thrift::{Form, Thrift};

/// Tells whether the elements of the schema have no more children together than there are elements. It looks at the end of
/// the file, which must hold the footer.
pub(super) fn has_sound_schema(end_of_file: &[u8]) -> bool {
    schema(end_of_file).is_some_and(|(elements, children)| children < elements.max(1))
}

/// Returns how long the footer is with what follows it, by the last eight bytes of a file.
pub(super) fn length(last: [u8; 8]) -> Option<u64> {
    let [a, b, c, d, mark @ ..] = last;
    (mark == *b"PAR1").then(|| u64::from(u32::from_le_bytes([a, b, c, d])) + 8)
}

/// Returns the number of elements of the schema and of their children; `None` if there is none where it should be.
fn schema(file: &[u8]) -> Option<(u64, u64)> {
    const VERSION: i64 = 1;
    const SCHEMA: i64 = 2;
    const CHILDREN: i64 = 5;
    let (before, end) = file.split_last_chunk::<8>()?;
    let length = usize::try_from(length(*end)?).ok()? - 8;
    let mut thrift = Thrift { rest: &before[before.len().checked_sub(length)?..] };
    let mut field = 0;
    while !(thrift.list_field(&mut field)? && field == SCHEMA) {
        if field != VERSION {
            return None;
        }
        thrift.integer()?;
    }
    let elements = thrift.structures()?;
    let mut sum = Some(0u64);
    for _ in 0..elements {
        thrift.walk(element, &mut |path, value| {
            if path == [CHILDREN] {
                sum = sum.and_then(|sum| sum.checked_add(u64::try_from(value).ok()?));
            }
        })?;
    }
    Some((elements, sum?))
}

/// The fields of an element of the schema.
fn element(field: i64) -> Option<Form> {
    match field {
        1..=3 | 5..=9 => Some(Form::Integer),
        4 => Some(Form::Text),
        10 => Some(Form::Fields(logical_type)),
        _ => None,
    }
}

/// The logical types, of which an element has one.
fn logical_type(field: i64) -> Option<Form> {
    match field {
        5 => Some(Form::Fields(decimal)),
        7 | 8 => Some(Form::Fields(time)),
        10 => Some(Form::Fields(integer)),
        16 => Some(Form::Fields(variant)),
        17 | 18 => Some(Form::Fields(geometry)),
        1..=19 => Some(Form::Fields(nothing)),
        _ => None,
    }
}

fn decimal(field: i64) -> Option<Form> {
    (1..=2).contains(&field).then_some(Form::Integer)
}

fn time(field: i64) -> Option<Form> {
    match field {
        1 => Some(Form::Truth),
        2 => Some(Form::Fields(|unit| (1..=3).contains(&unit).then_some(Form::Fields(nothing)))),
        _ => None,
    }
}

fn integer(field: i64) -> Option<Form> {
    match field {
        1 => Some(Form::Byte),
        2 => Some(Form::Truth),
        _ => None,
    }
}

fn variant(field: i64) -> Option<Form> {
    (field == 1).then_some(Form::Byte)
}

fn geometry(field: i64) -> Option<Form> {
    match field {
        1 => Some(Form::Text),
        2 => Some(Form::Integer),
        _ => None,
    }
}

fn nothing(_: i64) -> Option<Form> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file of a footer alone: version 1, and a root with `children` beside one column.
    fn file(children: &[u8]) -> Vec<u8> {
        let root = [&[0x48, 1, b'r', 0x15][..], children, &[0]].concat();
        let column = [0x15, 2, 0x25, 0, 0x18, 1, b'c', 0x6c, 0x1c, 0, 0, 0];
        let footer = [&[0x15, 2, 0x19, 0x2c][..], &root, &column, &[0]].concat();
        [&footer[..], &(footer.len() as u32).to_le_bytes(), b"PAR1"].concat()
    }

    #[test]
    fn children_are_counted() {
        // One child, two of them, and 2³¹ − 1 of them, each with the sign as lowest bit.
        assert_eq!(schema(&file(&[2])), Some((2, 1)));
        assert!(has_sound_schema(&file(&[2])));
        assert!(!has_sound_schema(&file(&[4])));
        assert!(!has_sound_schema(&file(&[0xfe, 0xff, 0xff, 0xff, 0x0f])));
        assert!(!has_sound_schema(&file(&[1])), "minus one child");
    }

    #[test]
    fn a_number_by_another_type_is_still_a_number() {
        // The decoder passes over the type: many children by the type of a text, a long or a truth value.
        let whole = file(&[0xfe, 0xff, 0xff, 0xff, 0x0f]);
        let at = whole.windows(2).position(|pair| pair == [b'r', 0x15]).expect("the field of children") + 1;
        for kind in 1..=12 {
            let mut other = whole.clone();
            other[at] = 0x10 | kind;
            assert!(!has_sound_schema(&other), "{kind}");
        }
    }

    #[test]
    fn nothing_is_no_schema() {
        let whole = file(&[2]);
        for cut in 0..whole.len() - 1 {
            assert!(!has_sound_schema(&whole[whole.len() - cut..]), "{cut}");
        }
    }
}
