//! Which columns hold what, and the units of length.

use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Which columns hold what.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Columns {
    /// Who: a number or a name.
    pub id: ColumnName,
    /// When, in seconds; or `frame`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time: Option<ColumnName>,
    /// When, in frames; or `time`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frame: Option<ColumnName>,
    /// Position from left to right.
    pub x: ColumnName,
    /// Position upwards.
    pub y: ColumnName,
}

impl Columns {
    /// Returns all columns that are asked for.
    pub fn all(&self) -> impl Iterator<Item = &ColumnName> {
        let Self { id, time, frame, x, y } = self;
        [Some(id), time.as_ref(), frame.as_ref(), Some(x), Some(y)].into_iter().flatten()
    }

    /// Returns the column that says when; [`RecordingConfig::check`](super::RecordingConfig::check) sees to it that there is one.
    #[must_use]
    pub fn clock(&self) -> Option<&ColumnName> {
        self.time.as_ref().or(self.frame.as_ref())
    }
}

impl FromStr for Columns {
    type Err = String;

    /// Reads `id=2,time=1,x=3,y=4`: names or numbers.
    fn from_str(text: &str) -> Result<Self, String> {
        let (mut id, mut time, mut frame, mut x, mut y) = (None, None, None, None, None);
        for part in text.split(',') {
            let (role, column) = part.split_once('=').ok_or_else(|| format!("`{part}` is not as `x=3`"))?;
            let column = column.trim();
            let name = column.parse().map_or_else(|_| ColumnName::Name(column.to_owned()), ColumnName::Number);
            let place = match role.trim() {
                "id" => &mut id,
                "time" => &mut time,
                "frame" => &mut frame,
                "x" => &mut x,
                "y" => &mut y,
                role => return Err(format!("`{role}` is none of id, time, frame, x and y")),
            };
            if place.replace(name).is_some() {
                return Err(format!("`{}` is there twice", role.trim()));
            }
        }
        let needed = |column: Option<ColumnName>, role: &str| column.ok_or_else(|| format!("`{role}` is missing"));
        Ok(Self { id: needed(id, "id")?, time, frame, x: needed(x, "x")?, y: needed(y, "y")? })
    }
}

/// A column.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum ColumnName {
    /// By its number, from 1 on: there is no header, or it does not matter.
    Number(u16),
    /// By its name in the header.
    Name(String),
}

impl ColumnName {
    /// Finds the column among `names`; returns its place, from 0 on. A number may lie beyond them.
    ///
    /// # Errors
    /// [`RecordingError::NoColumn`](super::RecordingError::NoColumn) lists the columns that there are.
    pub fn place<N: AsRef<str>>(&self, names: &[N]) -> Result<usize, super::RecordingError> {
        match self {
            Self::Number(number) => Ok(usize::from(*number).saturating_sub(1)),
            Self::Name(name) => names.iter().position(|found| found.as_ref() == name).ok_or_else(|| {
                let found: Vec<String> = names.iter().map(|name| format!("`{}`", name.as_ref())).collect();
                super::RecordingError::NoColumn { name: name.clone(), found: found.join(", ") }
            }),
        }
    }
}

/// A unit of length.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Unit {
    /// Meters.
    M,
    /// Centimeters.
    Cm,
    /// Millimeters.
    Mm,
    /// Feet.
    Ft,
    /// Pixels of a camera's picture, which a transform takes to meters.
    Px,
}

impl Unit {
    const ALL: [Self; 5] = [Self::M, Self::Cm, Self::Mm, Self::Ft, Self::Px];

    /// Returns the unit in meters; pixels are as they are, for a transform.
    #[must_use]
    pub const fn meters(self) -> f64 {
        match self {
            Self::M | Self::Px => 1.0,
            Self::Cm => 0.01,
            Self::Mm => 0.001,
            Self::Ft => 0.3048,
        }
    }

    /// Returns how it is written.
    #[must_use]
    pub const fn symbol(self) -> &'static str {
        match self {
            Self::M => "m",
            Self::Cm => "cm",
            Self::Mm => "mm",
            Self::Ft => "ft",
            Self::Px => "px",
        }
    }
}

impl FromStr for Unit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let unit = Self::ALL.into_iter().find(|unit| unit.symbol() == text);
        unit.ok_or_else(|| format!("`{text}` is none of m, cm, mm, ft and px"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_written_in_one_line() {
        let read = |text: &str| text.parse::<Columns>();
        let number = ColumnName::Number;
        let expected = Columns { id: number(2), time: Some(number(1)), frame: None, x: number(3), y: number(4) };
        assert_eq!(read("id=2,time=1,x=3,y=4"), Ok(expected));
        let name = |name: &str| ColumnName::Name(name.to_owned());
        let expected = Columns { id: name("who"), time: None, frame: Some(name("f")), x: name("X"), y: number(9) };
        assert_eq!(read("id=who, frame=f, x=X, y=9"), Ok(expected));
        assert_eq!(read("id=1,time=2,x=3"), Err("`y` is missing".to_owned()));
        assert_eq!(read("id=1,t=2,x=3,y=4"), Err("`t` is none of id, time, frame, x and y".to_owned()));
        assert_eq!(read("id=1,id=2"), Err("`id` is there twice".to_owned()));
        assert_eq!(read("1,2,3,4"), Err("`1` is not as `x=3`".to_owned()));
    }
}
