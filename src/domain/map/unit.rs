//! Units of length in which plans are drawn.

use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A unit of length.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Unit {
    /// A meter.
    #[serde(rename = "m")]
    Meter,
    /// A centimeter.
    #[serde(rename = "cm")]
    Centimeter,
    /// A millimeter.
    #[serde(rename = "mm")]
    Millimeter,
    /// An inch, 0.0254 m.
    #[serde(rename = "in")]
    Inch,
    /// A foot, 0.3048 m.
    #[serde(rename = "ft")]
    Foot,
}

impl Unit {
    const ALL: [Self; 5] = [Self::Meter, Self::Centimeter, Self::Millimeter, Self::Inch, Self::Foot];

    /// Returns its length in meters.
    #[must_use]
    pub const fn meters(self) -> f64 {
        match self {
            Self::Meter => 1.0,
            Self::Centimeter => 0.01,
            Self::Millimeter => 0.001,
            Self::Inch => 0.0254,
            Self::Foot => 0.3048,
        }
    }

    /// Returns how it is written.
    #[must_use]
    pub const fn symbol(self) -> &'static str {
        match self {
            Self::Meter => "m",
            Self::Centimeter => "cm",
            Self::Millimeter => "mm",
            Self::Inch => "in",
            Self::Foot => "ft",
        }
    }

    /// Returns the name of many of them.
    #[must_use]
    pub const fn plural(self) -> &'static str {
        match self {
            Self::Meter => "meters",
            Self::Centimeter => "centimeters",
            Self::Millimeter => "millimeters",
            Self::Inch => "inches",
            Self::Foot => "feet",
        }
    }
}

impl FromStr for Unit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|unit| unit.symbol() == text);
        found.ok_or_else(|| format!("`unit` must be `m`, `cm`, `mm`, `in` or `ft`, not `{text}`"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_is_read_as_it_is_written() {
        for unit in Unit::ALL {
            assert_eq!(unit.symbol().parse(), Ok(unit));
            assert_eq!(serde_json::to_value(unit).expect("is JSON"), unit.symbol());
        }
        let error = "meter".parse::<Unit>().expect_err("no symbol");
        assert_eq!(error, "`unit` must be `m`, `cm`, `mm`, `in` or `ft`, not `meter`");
    }
}
