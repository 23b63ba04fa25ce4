//! Looks at the footer of a Parquet file before its decoder does, which takes the lengths in it on trust.
//!
//! The schema is a tree, written as a list of elements that say how many children they have. The decoder makes room for as
//! many as an element says, so a flipped bit there asks for 16 GB.

/// The parts of Thrift's compact protocol that footers are made of.
struct Thrift<'a> {
    rest: &'a [u8],
}

/// Structures and lists within each other at most.
const DEEPEST: u32 = 16;

const LIST: u8 = 9;
const STRUCT: u8 = 12;

/// Tells whether the elements of the schema have no more children together than there are elements.
pub(super) fn has_sound_schema(file: &[u8]) -> bool {
    schema(file).is_some_and(|(elements, children)| children < elements.max(1))
}

/// Returns the number of elements of the schema and of their children; `None` if there is none where it should be.
fn schema(file: &[u8]) -> Option<(u64, u64)> {
    const VERSION: i64 = 1;
    const SCHEMA: i64 = 2;
    const CHILDREN: i64 = 5;
    let (before, end) = file.split_at_checked(file.len().checked_sub(8)?)?;
    let length = u32::from_le_bytes(end[..4].try_into().ok()?) as usize;
    let mut thrift = Thrift { rest: &before[before.len().checked_sub(length)?..] };
    let mut field = 0;
    loop {
        let kind = thrift.field(&mut field)?;
        match field {
            SCHEMA if kind == LIST => break,
            VERSION => thrift.skip(kind, 0)?,
            _ => return None,
        }
    }
    let (elements, kind) = thrift.list()?;
    let mut sum = 0u64;
    for _ in 0..elements {
        if kind != STRUCT {
            return None;
        }
        let mut field = 0;
        loop {
            let kind = thrift.field(&mut field)?;
            match (field, kind) {
                (_, 0) => break,
                (CHILDREN, 5) => sum = sum.checked_add(u64::try_from(thrift.integer()?).ok()?)?,
                _ => thrift.skip(kind, 0)?,
            }
        }
    }
    Some((elements, sum))
}

impl Thrift<'_> {
    fn byte(&mut self) -> Option<u8> {
        let (first, rest) = self.rest.split_first()?;
        self.rest = rest;
        Some(*first)
    }

    fn jump(&mut self, bytes: u64) -> Option<()> {
        self.rest = self.rest.get(usize::try_from(bytes).ok()?..)?;
        Some(())
    }

    fn number(&mut self) -> Option<u64> {
        let mut value = 0u64;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Some(value);
            }
        }
        None
    }

    /// Reads an integer with a sign, whose lowest bit it is.
    fn integer(&mut self) -> Option<i64> {
        let value = self.number()?;
        Some((value >> 1) as i64 ^ -((value & 1) as i64))
    }

    /// Reads the beginning of the next field of a structure: sets its number and returns its type, 0 at the end.
    fn field(&mut self, field: &mut i64) -> Option<u8> {
        let header = self.byte()?;
        let kind = header & 0x0f;
        if kind != 0 {
            *field = if header >> 4 == 0 { self.integer()? } else { *field + i64::from(header >> 4) };
        }
        Some(kind)
    }

    /// Reads the beginning of a list: its length, which no more bytes than there are can hold, and the type of its items.
    fn list(&mut self) -> Option<(u64, u8)> {
        let header = self.byte()?;
        let length = if header >> 4 == 15 { self.number()? } else { u64::from(header >> 4) };
        (length <= self.rest.len() as u64).then_some((length, header & 0x0f))
    }

    fn skip(&mut self, kind: u8, depth: u32) -> Option<()> {
        if depth > DEEPEST {
            return None;
        }
        match kind {
            // A truth value is in the type.
            1 | 2 => Some(()),
            3 => self.jump(1),
            4..=6 => self.number().map(drop),
            7 => self.jump(8),
            8 => {
                let length = self.number()?;
                self.jump(length)
            }
            LIST | 10 => {
                let (length, kind) = self.list()?;
                // In a list a truth value is a byte.
                let kind = if kind <= 2 { 3 } else { kind };
                (0..length).try_for_each(|_| self.skip(kind, depth + 1))
            }
            STRUCT => {
                let mut field = 0;
                loop {
                    match self.field(&mut field)? {
                        0 => return Some(()),
                        kind => self.skip(kind, depth + 1)?,
                    }
                }
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file of a footer alone: version 1, and a root with `children` beside one column.
    fn file(children: &[u8]) -> Vec<u8> {
        let root = [&[0x48, 1, b'r', 0x15][..], children, &[0]].concat();
        let column = [0x15, 2, 0x25, 0, 0x18, 1, b'c', 0x5c, 0x1c, 0, 0, 0];
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
    fn nothing_is_no_schema() {
        let whole = file(&[2]);
        for cut in 0..whole.len() - 1 {
            assert!(!has_sound_schema(&whole[whole.len() - cut..]), "{cut}");
        }
    }
}
