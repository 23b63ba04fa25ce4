//! Gray values, and how many of them there may be.

/// The most pixels that an image, and the most cells that an imported grid, may have.
pub const MOST_PIXELS: u64 = 400_000_000;

/// Gray values of up to 8 or up to 16 bits.
#[derive(Debug)]
pub(super) enum Samples {
    Bytes(Vec<u8>),
    Deep(Vec<u16>),
}
