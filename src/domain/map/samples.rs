//! Gray values, and how many of them there may be.

/// The most pixels that an image may have.
pub const MOST_PIXELS: u64 = 400_000_000;

/// The most cells that an imported grid may have: a square kilometer at 0.1 m.
pub const MOST_CELLS: u64 = 100_000_000;

/// The most bytes that a decoded image may take.
pub(super) const MOST_BYTES: u64 = 1 << 30;

/// Gray values of up to 8 or up to 16 bits.
#[derive(Debug)]
pub(super) enum Samples {
    Bytes(Vec<u8>),
    Deep(Vec<u16>),
}
