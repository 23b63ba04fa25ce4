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
}

impl fmt::Display for MapForm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Ros => "a map of ROS",
            Self::Image => "a plain image",
            Self::Igibson => "an iGibson scene",
        })
    }
}
