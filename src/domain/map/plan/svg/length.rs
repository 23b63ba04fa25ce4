//! Lengths.

use std::str::FromStr;

use svgtypes::{Length, LengthUnit};

/// Returns a length in user units, of which an inch has 96; `None` if it is none, or relative to something.
pub(super) fn length(text: &str) -> Option<f64> {
    let Length { number, unit } = Length::from_str(text.trim()).ok()?;
    let pixels = match unit {
        LengthUnit::None | LengthUnit::Px => 1.0,
        LengthUnit::In => 96.0,
        LengthUnit::Cm => 96.0 / 2.54,
        LengthUnit::Mm => 96.0 / 25.4,
        LengthUnit::Pt => 96.0 / 72.0,
        LengthUnit::Pc => 16.0,
        LengthUnit::Em | LengthUnit::Ex | LengthUnit::Percent => return None,
    };
    Some(number * pixels)
}
