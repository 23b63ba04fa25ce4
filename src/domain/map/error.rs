//! What keeps a map from being read.

use image::ImageError;

use super::form::MapForm;
use super::occupancy::MapError;
use super::plan::PlanError;
use super::position::{Position, place};

/// What keeps a map from being read.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and their fields are")]
pub enum MapImportError {
    #[error("the YAML of the map is not understood: {message}{}", place(at))]
    Yaml { message: String, at: Option<Position> },
    #[error("`{field}` must be {expected}, not `{found}`{}", place(at))]
    Field { field: &'static str, expected: &'static str, found: String, at: Option<Position> },
    #[error("`occupied_thresh` ({occupied}) is below `free_thresh` ({free}): a pixel could be both{}", place(at))]
    Thresholds { occupied: f64, free: f64, at: Option<Position> },
    #[error("`{field}` is {value}, but must lie from {low} to {high}")]
    Parameter { field: &'static str, value: f64, low: f64, high: f64 },
    #[error("`{field}` does not fit {form}")]
    Unfit { field: &'static str, form: MapForm },
    #[error("a plain image needs `image_resolution`, the edge of its pixels in meters")]
    ImageResolution,
    #[error("`scale` and `image_resolution` both say how large a pixel is")]
    TwoScales,
    #[error("the point {x}, {y} of `scale` lies outside of the picture of {width} × {height} pixels")]
    ScaleOutside { x: f64, y: f64, width: usize, height: usize },
    #[error("the file is empty")]
    Empty,
    #[error("the file is a pointer of Git LFS, not the {what} itself")]
    LfsPointer { what: &'static str },
    #[error("the image is none of PGM, PNG, JPEG, BMP and TIFF")]
    ImageFormat,
    #[error("the image is cut short")]
    ImageCutShort,
    #[error("the image cannot be decoded")]
    Image { source: ImageError },
    #[error("the image cannot be decoded: {0}")]
    Pnm(&'static str),
    #[error("the image is damaged in a way that stops its decoder: {0}")]
    Decoder(String),
    #[error("{width} × {height} are too many pixels: at most {most} are read")]
    TooManyPixels { width: u64, height: u64, most: u64 },
    #[error("the map has no free cell: {percent:.0} % of its pixels are transparent, which means unknown")]
    Transparent { percent: f64 },
    #[error("only {area:.2} m² of floor are free, too little for anybody to walk on")]
    TooSmall { area: f64 },
    #[error("there is no free floor at {x}, {y}: the map reaches from {}, {} to {}, {}", low[0], low[1], high[0], high[1])]
    NoRegion { x: f64, y: f64, low: [f64; 2], high: [f64; 2] },
    #[error(transparent)]
    Plan(#[from] PlanError),
    #[error(transparent)]
    Map(#[from] MapError),
}

impl MapImportError {
    /// Returns the place in the text that is to blame, where there is one.
    #[must_use]
    pub const fn position(&self) -> Option<Position> {
        match self {
            Self::Yaml { at, .. } | Self::Field { at, .. } | Self::Thresholds { at, .. } => *at,
            Self::Plan(error) => error.position(),
            _ => None,
        }
    }
}
