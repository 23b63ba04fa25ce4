//! The forms that maps of others come in.

use std::fmt;

/// What kind of file a map comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MapForm {
    /// A YAML of ROS `map_server` and the image that it names.
    Ros,
    /// An image without a description.
    Image,
    /// The folder of an iGibson scene.
    Igibson,
    /// A floor plan of areas, walls and doors.
    Plan(PlanForm),
}

/// What kind of file a floor plan comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PlanForm {
    /// A `building.yaml` of Open-RMF.
    Building,
    /// Polygons in well-known text, such as JuPedSim's.
    Wkt,
    /// Polygons in GeoJSON.
    GeoJson,
    /// A drawing with layers.
    Dxf,
    /// A drawing of a web page.
    Svg,
}

impl PlanForm {
    /// Returns the form's name in recipes.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Building => "building",
            Self::Wkt => "wkt",
            Self::GeoJson => "geojson",
            Self::Dxf => "dxf",
            Self::Svg => "svg",
        }
    }
}

impl fmt::Display for MapForm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Ros => "a map of ROS",
            Self::Image => "a plain image",
            Self::Igibson => "an iGibson scene",
            Self::Plan(PlanForm::Building) => "a building of Open-RMF",
            Self::Plan(PlanForm::Wkt) => "polygons in WKT",
            Self::Plan(PlanForm::GeoJson) => "GeoJSON",
            Self::Plan(PlanForm::Dxf) => "a DXF drawing",
            Self::Plan(PlanForm::Svg) => "an SVG drawing",
        })
    }
}
