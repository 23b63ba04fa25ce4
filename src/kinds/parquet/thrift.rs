//! Thrift's compact protocol, as far as footers and page headers of Parquet files need it.
//!
//! The decoder of Parquet takes a field of a number that it knows for what it should be, whatever type the file gives it. So
//! what it would read is only known where all types are right, and [`Thrift::walk`] accepts nothing else.

/// Bytes of a structure that has not been read yet.
pub(super) struct Thrift<'a> {
    pub(super) rest: &'a [u8],
}

/// Structures and lists within each other at most.
const DEEPEST: u32 = 16;

const LIST: u8 = 9;
const STRUCT: u8 = 12;

/// What a field must be.
pub(super) enum Form {
    Truth,
    Byte,
    Integer,
    Text,
    Fields(Grammar),
}

/// Tells by its number what a field of a structure must be; `None` for one that is passed over, whatever it is.
pub(super) type Grammar = fn(i64) -> Option<Form>;

impl Thrift<'_> {
    fn byte(&mut self) -> Option<u8> {
        let (first, rest) = self.rest.split_first()?;
        self.rest = rest;
        Some(*first)
    }

    /// Passes over bytes; `None` if there are not as many.
    pub(super) fn jump(&mut self, bytes: u64) -> Option<()> {
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
    pub(super) fn integer(&mut self) -> Option<i64> {
        let value = self.number()?;
        Some((value >> 1) as i64 ^ -((value & 1) as i64))
    }

    /// Reads the beginning of the next field of a structure: sets its number and returns its type, 0 at the end.
    fn field(&mut self, field: &mut i64) -> Option<u8> {
        let header = self.byte()?;
        let kind = header & 0x0f;
        if kind != 0 {
            let number = if header >> 4 == 0 { self.integer()? } else { *field + i64::from(header >> 4) };
            *field = i16::try_from(number).ok()?.into();
        }
        Some(kind)
    }

    /// Reads a structure; `found` hears each integer with the numbers of the fields that lead to it. `None` if a field is not of
    /// its form, or the bytes end before.
    pub(super) fn walk(&mut self, grammar: Grammar, found: &mut dyn FnMut(&[i64], i64)) -> Option<()> {
        self.walk_below(grammar, &mut Vec::new(), found)
    }

    fn walk_below(&mut self, grammar: Grammar, path: &mut Vec<i64>, found: &mut dyn FnMut(&[i64], i64)) -> Option<()> {
        let mut field = 0;
        loop {
            let kind = self.field(&mut field)?;
            if kind == 0 {
                return Some(());
            }
            path.push(field);
            match (grammar(field), kind) {
                (None, _) => self.skip(kind, 0)?,
                (Some(Form::Truth), 1 | 2) => {}
                (Some(Form::Byte), 3) => self.jump(1)?,
                (Some(Form::Integer), 5) => found(path, self.integer()?),
                (Some(Form::Text), 8) => self.skip(kind, 0)?,
                (Some(Form::Fields(grammar)), STRUCT) => self.walk_below(grammar, path, found)?,
                _ => return None,
            }
            path.pop();
        }
    }

    /// Reads the beginning of a list of structures: its length, which no more bytes than there are can hold.
    pub(super) fn structures(&mut self) -> Option<u64> {
        self.list().filter(|(_, kind)| *kind == STRUCT).map(|(length, _)| length)
    }

    /// Reads the beginning of the next field, and tells its number and whether it is a list.
    pub(super) fn list_field(&mut self, field: &mut i64) -> Option<bool> {
        Some(self.field(field)? == LIST)
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
