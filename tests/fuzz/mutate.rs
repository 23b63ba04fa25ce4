//! Changes to good inputs: of bytes, of numbers in texts, of lines, of trees.

use serde_json::Value;

/// Reproducible choices (SplitMix64).
pub struct Dice(u64);

impl Dice {
    /// Returns the choices of a case.
    pub fn new(target: &str, case: u64) -> Self {
        let name = target
            .bytes()
            .fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3));
        let mut dice = Self(name ^ case.wrapping_mul(0xd6e8_feb8_6659_fd93));
        dice.bits();
        dice
    }

    /// Returns 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Returns a number below `n`, or 0 if there is none.
    pub fn below(&mut self, n: usize) -> usize {
        if n == 0 { 0 } else { (self.bits() % n as u64) as usize }
    }

    /// Tells whether something of a chance of one in `n` happens.
    pub fn one_in(&mut self, n: usize) -> bool {
        self.below(n) == 0
    }

    /// Chooses one.
    pub fn of<'a, T>(&mut self, items: &'a [T]) -> &'a T {
        &items[self.below(items.len())]
    }

    /// Chooses a range within `length`, mostly a short one.
    fn range(&mut self, length: usize) -> std::ops::Range<usize> {
        let start = self.below(length + 1);
        let most = if self.one_in(4) { length - start } else { (length - start).min(16) };
        start..start + self.below(most + 1)
    }
}

/// Whole numbers at the ends of types.
const EDGES: [u64; 16] = [
    0,
    1,
    2,
    0x7f,
    0x80,
    0xff,
    0x7fff,
    0x8000,
    0xffff,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    0x1_0000_0000,
    i64::MAX as u64,
    1 << 63,
    u64::MAX,
];

/// Numbers, and what is none, as people and programs write them.
const NUMBERS: [&str; 34] = [
    "0",
    "1",
    "-1",
    "-0",
    "2",
    "7",
    "255",
    "256",
    "65535",
    "65536",
    "2147483647",
    "2147483648",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "9223372036854775808",
    "18446744073709551615",
    "18446744073709551616",
    "1e308",
    "1e309",
    "-1e308",
    "5e-324",
    "1e-400",
    "0.1",
    "0.10000000149011612",
    "1000",
    "nan",
    ".nan",
    ".inf",
    "-.inf",
    "null",
    "true",
    "\"\"",
    "00000000000000000000000000000000000000007",
];

/// Changes bytes once, in one of many ways; `others` are inputs to take parts from.
pub fn bytes(dice: &mut Dice, bytes: &mut Vec<u8>, others: &[Vec<u8>]) {
    let length = bytes.len();
    let at = dice.below(length);
    match dice.below(11) {
        0 if length > 0 => bytes[at] ^= 1 << dice.below(8),
        1 if length > 0 => bytes[at] = dice.bits() as u8,
        2 if length > 0 => bytes[at] = *dice.of(&[0, 1, 0x7f, 0x80, 0xfe, 0xff]),
        3 => {
            let width = *dice.of(&[2, 4, 8]);
            let edge = *dice.of(&EDGES);
            let value =
                if dice.one_in(2) { edge.to_le_bytes() } else { edge.rotate_right(width as u32 * 8).to_be_bytes() };
            if let Some(place) = bytes.get_mut(at..at + width) {
                place.copy_from_slice(&value[..width]);
            }
        }
        4 => bytes.truncate(at),
        5 => drop(bytes.drain(dice.range(length))),
        6 => {
            let again = bytes[dice.range(length)].to_vec();
            bytes.splice(at..at, again);
        }
        7 => {
            let new: Vec<u8> = (0..=dice.below(8)).map(|_| dice.bits() as u8).collect();
            bytes.splice(at..at, new);
        }
        8 => {
            let other = dice.of(others);
            let part = other[dice.range(other.len())].to_vec();
            bytes.splice(dice.range(length), part);
        }
        9 => number(dice, bytes),
        _ => {
            let range = dice.range(length);
            let value = dice.bits() as u8;
            bytes[range].fill(value);
        }
    }
}

/// Puts another number in the place of one that stands in the bytes as text.
pub fn number(dice: &mut Dice, bytes: &mut Vec<u8>) {
    let mut runs = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let length = bytes[at..].iter().take_while(|byte| byte.is_ascii_digit() || **byte == b'.').count();
        if length > 0 {
            runs.push(at..at + length);
        }
        at += length + 1;
    }
    if !runs.is_empty() {
        let run = dice.of(&runs).clone();
        bytes.splice(run, dice.of(&NUMBERS).bytes());
    }
}

/// Changes a text once: its bytes, its numbers, its lines, or what stands between two words of it.
pub fn text(dice: &mut Dice, bytes: &mut Vec<u8>, others: &[Vec<u8>], words: &[&str]) {
    match dice.below(8) {
        0 => self::bytes(dice, bytes, others),
        1 | 2 => number(dice, bytes),
        3..=5 => lines(dice, bytes, others),
        _ => {
            let edges: Vec<usize> = (0..bytes.len()).filter(|at| !bytes[*at].is_ascii_alphanumeric()).collect();
            if !edges.is_empty() {
                let (start, word) = (*dice.of(&edges), *dice.of(words));
                let end = edges.iter().copied().find(|edge| *edge > start).unwrap_or(bytes.len());
                let end = if dice.one_in(2) { start } else { end };
                bytes.splice(start..end, word.bytes());
            }
        }
    }
}

fn lines(dice: &mut Dice, bytes: &mut Vec<u8>, others: &[Vec<u8>]) {
    let mut lines: Vec<Vec<u8>> = bytes.split(|byte| *byte == b'\n').map(<[u8]>::to_vec).collect();
    let (from, to) = (dice.below(lines.len()), dice.below(lines.len()));
    match dice.below(5) {
        0 => drop(lines.remove(from)),
        1 => lines.insert(to, lines[from].clone()),
        2 => lines.swap(from, to),
        3 => {
            let foreign: Vec<&[u8]> = dice.of(others).split(|byte| *byte == b'\n').collect();
            lines.insert(to, dice.of(&foreign).to_vec());
        }
        _ => {
            let indent = dice.below(6);
            let line = lines[from].trim_ascii_start().to_vec();
            lines[from] = [vec![b' '; indent], line].concat();
        }
    }
    *bytes = lines.join(&b'\n');
}

/// Changes one node of a tree: another value, one less, one more, or many levels around it.
pub fn tree(dice: &mut Dice, value: &mut Value) {
    let down = match value {
        Value::Array(items) => !items.is_empty(),
        Value::Object(fields) => !fields.is_empty(),
        _ => false,
    };
    if down && !dice.one_in(5) {
        match value {
            Value::Array(items) => {
                let at = dice.below(items.len());
                match dice.below(8) {
                    0 => drop(items.remove(at)),
                    1 => items.push(items[at].clone()),
                    _ => tree(dice, &mut items[at]),
                }
            }
            Value::Object(fields) => {
                let at = dice.below(fields.len());
                let name = fields.keys().nth(at).expect("below their number").clone();
                match dice.below(8) {
                    0 => drop(fields.remove(&name)),
                    1 => drop(fields.insert(format!("{name}2"), fields[&name].clone())),
                    _ => tree(dice, &mut fields[&name]),
                }
            }
            _ => unreachable!("nothing else goes down"),
        }
        return;
    }
    *value = match dice.below(8) {
        0 => Value::Null,
        1 => Value::Bool(dice.one_in(2)),
        2 => Value::from(*dice.of(&EDGES)),
        3 => Value::from(*dice.of(&[0.5, -1.0, 1e308, -1e308, 5e-324, 0.1])),
        4 => Value::from(*dice.of(&NUMBERS)),
        5 => Value::from(*dice.of(&["", "\u{1b}[31m", "../..", "a/b", "ö\u{0}", "latest"])),
        6 => Value::Array(Vec::new()),
        _ => {
            let levels = if dice.one_in(8) { 200 } else { 2 };
            (0..levels).fold(value.take(), |inner, _| Value::Array(vec![inner]))
        }
    };
}

/// Does something once, mostly, and sometimes up to eight times.
pub fn times(dice: &mut Dice, mut change: impl FnMut(&mut Dice)) {
    let times = if dice.one_in(2) { 1 } else { 1 + dice.below(8) };
    (0..times).for_each(|_| change(dice));
}
