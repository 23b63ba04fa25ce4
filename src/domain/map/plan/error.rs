//! What keeps a floor plan from being read.

use crate::domain::map::position::{Position, place};

/// What keeps a floor plan from being read.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and their fields are")]
pub enum PlanError {
    #[error("the building has no level")]
    NoLevels,
    #[error("the building has several levels ({levels}), and `level` names none")]
    LevelMissing { levels: String },
    #[error("the building has no level `{level}`, only {levels}")]
    LevelUnknown { level: String, levels: String },
    #[error("coordinates in `{system}` are not read, only `reference_image` and `cartesian_meters`{}", place(at))]
    Coordinates { system: String, at: Option<Position> },
    #[error("{what} of level `{level}` names vertex {vertex}, but there are {vertices}, counted from 0{}", place(at))]
    Vertex { what: &'static str, level: String, vertex: u64, vertices: usize, at: Option<Position> },
    #[error("no measurement says how large level `{level}` is")]
    Measurements { level: String },
    #[error("a measurement of level `{level}` needs a positive `distance` between two places{}", place(at))]
    Distance { level: String, at: Option<Position> },
    #[error("a pixel of level `{level}` is {meters} m, but must be from 0.00001 to 1000 m")]
    Scale { level: String, meters: f64 },
    #[error("the WKT is not understood: expected {expected}, not {found}{}", place(&Some(*at)))]
    Wkt { expected: &'static str, found: String, at: Position },
    #[error("the GeoJSON is not understood: {message}{}", place(&Some(*at)))]
    Json { message: String, at: Position },
    #[error("{path} must be {expected}, not {found}")]
    GeoJson { path: String, expected: &'static str, found: String },
    #[error("the coordinates of GeoJSON are degrees by its standard, and no `unit` says otherwise")]
    Degrees,
    #[error("the drawing is a binary DXF, only text is read")]
    DxfBinary,
    #[error("the DXF is not understood: expected {expected}, not {found}{}", place(&Some(*at)))]
    Dxf { expected: &'static str, found: String, at: Position },
    #[error("a `{entity}` lacks the group {code}{}", place(&Some(*at)))]
    DxfGroup { entity: String, code: i32, at: Position },
    #[error("the header of the drawing names {found}")]
    DxfUnit { found: String },
    #[error("no layer of the drawing is one of walls; its layers: {layers}")]
    Layers { layers: String },
    #[error("the XML is not understood: {message}{}", place(&Some(*at)))]
    Xml { message: String, at: Position },
    #[error("the SVG is not understood: {what} is {found}{}", place(&Some(*at)))]
    Svg { what: String, found: String, at: Position },
    #[error("an SVG does not say how large the building is")]
    SvgScale,
    #[error("nothing in the drawing is a wall by its layers, classes or colors, there is {names}")]
    SvgNames { names: String },
    #[error("a ring ends where it begins and has three corners or more{path}{}", place(at))]
    Ring { path: String, at: Option<Position> },
    #[error("{what} needs at least {least} points, not {points}{}", place(at))]
    Points { what: &'static str, least: usize, points: usize, at: Option<Position> },
    #[error("the coordinate `{value}` is no number of meters from -40,000,000 to 40,000,000{}", place(at))]
    Coordinate { value: f64, at: Option<Position> },
    #[error("the plan shows neither walls nor areas")]
    Nothing,
    #[error("{points} are too many points: at most {most} are read")]
    TooManyPoints { points: u64, most: u64 },
    #[error("the plan is {width:.0} × {height:.0} m large, too many cells of {resolution} m: at most {most} are made")]
    TooManyCells { width: f64, height: f64, resolution: f64, most: u64 },
    #[error("the lines of the plan are {cells:.0} cells long in all, more than {most}")]
    TooManyLines { cells: f64, most: u64 },
}

impl PlanError {
    /// Returns the place in the text that is to blame, where there is one.
    #[must_use]
    pub const fn position(&self) -> Option<Position> {
        match self {
            Self::Coordinates { at, .. }
            | Self::Vertex { at, .. }
            | Self::Distance { at, .. }
            | Self::Points { at, .. }
            | Self::Ring { at, .. }
            | Self::Coordinate { at, .. } => *at,
            Self::Wkt { at, .. }
            | Self::Json { at, .. }
            | Self::Dxf { at, .. }
            | Self::DxfGroup { at, .. }
            | Self::Xml { at, .. }
            | Self::Svg { at, .. } => Some(*at),
            _ => None,
        }
    }
}
