//! What a format says of itself, so that nobody has to.

use super::{ColumnName, Columns, Format, Unit};

/// What the positions and times of a format are counted in.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Said {
    /// Unit of the positions, if the format or the file says it.
    pub unit: Option<Unit>,
    /// Frames in a second, if the format or the file says it.
    pub frame_rate: Option<f64>,
    /// Whether times are frames; else they are seconds.
    pub frames: bool,
}

impl Format {
    /// Returns the columns of a table of this format, if it is one with columns of its own.
    #[must_use]
    pub fn columns(self) -> Option<Columns> {
        let number = ColumnName::Number;
        let name = |name: &str| ColumnName::Name(name.to_owned());
        let timed = |time, id, x, y| Columns { id, time: Some(time), frame: None, x, y };
        let framed = |frame, id, x, y| Columns { id, time: None, frame: Some(frame), x, y };
        match self {
            Self::Juelich => Some(framed(number(2), number(1), number(3), number(4))),
            Self::Crowdit => Some(timed(name("time"), name("pedID"), name("posX"), name("posY"))),
            Self::Pathfinder => Some(timed(name("t"), name("id"), name("x"), name("y"))),
            Self::Eth => Some(framed(number(1), number(2), number(3), number(5))),
            Self::Atc | Self::Thor => Some(timed(number(1), number(2), number(3), number(4))),
            Self::Table | Self::Parquet | Self::Jupedsim | Self::Vadere | Self::Trajnet | Self::Mcap => None,
        }
    }

    /// Returns what every file of this format says; a single one may say more.
    #[must_use]
    pub fn said(self) -> Said {
        let unit = match self {
            Self::Jupedsim | Self::Vadere | Self::Crowdit | Self::Eth | Self::Trajnet | Self::Thor | Self::Mcap => {
                Some(Unit::M)
            }
            Self::Atc => Some(Unit::Mm),
            Self::Table | Self::Parquet | Self::Juelich | Self::Pathfinder => None,
        };
        let frames = matches!(self, Self::Jupedsim | Self::Juelich | Self::Eth | Self::Trajnet);
        Said { unit, frame_rate: None, frames }
    }

    /// Tells whether `columns` says where things stand.
    #[must_use]
    pub const fn needs_columns(self) -> bool {
        matches!(self, Self::Table | Self::Parquet)
    }

    /// Tells whether files of this format may say themselves what the format leaves open.
    pub(super) const fn may_say_more(self) -> bool {
        matches!(self, Self::Juelich | Self::Pathfinder | Self::Jupedsim | Self::Trajnet)
    }
}

impl Said {
    /// Says what the recording itself told.
    pub(super) fn facts(&self) -> Vec<String> {
        let unit = self.unit.map(|unit| format!("positions are in {}", unit.symbol()));
        let rate = self.frame_rate.map(|rate| format!("a second has {rate} frames"));
        let facts: Vec<String> = [unit, rate].into_iter().flatten().collect();
        if facts.is_empty() { Vec::new() } else { vec![format!("the recording says: {}", facts.join(", "))] }
    }
}
