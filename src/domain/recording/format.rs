//! The formats of recordings, and what their first bytes tell.

use std::fmt;
use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A format of recordings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Format {
    /// Text with commas, semicolons, tabs or blanks between its columns, which `columns` names.
    Table,
    /// Parquet with columns that `columns` names.
    Parquet,
    /// Text of Jülich's archive and PeTrack: person, frame, x, y; comments may tell unit and frame rate.
    Juelich,
    /// SQLite of JuPedSim.
    Jupedsim,
    /// Footsteps of Vadere.
    Vadere,
    /// CSV of crowd:it.
    Crowdit,
    /// CSV of Pathfinder.
    Pathfinder,
    /// `obsmat.txt` of ETH: frame, person, x, z, y in meters.
    Eth,
    /// Lines of JSON, as TrajNet++ has them.
    Trajnet,
    /// CSV of ATC: time, person, x, y in millimeters.
    Atc,
    /// CSV of THÖR, as CLiFF-LHMP has it: time, person, x, y in meters.
    Thor,
    /// MCAP with people or arrays of poses of ROS.
    Mcap,
}

impl Format {
    /// All of them.
    pub const ALL: [Self; 12] = [
        Self::Table,
        Self::Parquet,
        Self::Juelich,
        Self::Jupedsim,
        Self::Vadere,
        Self::Crowdit,
        Self::Pathfinder,
        Self::Eth,
        Self::Trajnet,
        Self::Atc,
        Self::Thor,
        Self::Mcap,
    ];

    /// Returns how it is written.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Table => "table",
            Self::Parquet => "parquet",
            Self::Juelich => "juelich",
            Self::Jupedsim => "jupedsim",
            Self::Vadere => "vadere",
            Self::Crowdit => "crowdit",
            Self::Pathfinder => "pathfinder",
            Self::Eth => "eth",
            Self::Trajnet => "trajnet",
            Self::Atc => "atc",
            Self::Thor => "thor",
            Self::Mcap => "mcap",
        }
    }

    /// Tells the format by the first bytes of a file, where they leave no doubt.
    #[must_use]
    pub fn of(bytes: &[u8]) -> Option<Self> {
        let marks: [(&[u8], Self); 4] = [
            (b"SQLite format 3\0", Self::Jupedsim),
            (b"PAR1", Self::Parquet),
            (b"\x89MCAP0\r\n", Self::Mcap),
            (b"#IDXCOL=", Self::Vadere),
        ];
        let marked = marks.into_iter().find(|(mark, _)| bytes.starts_with(mark)).map(|(_, format)| format);
        let line = || {
            let text = bytes.trim_ascii_start();
            let opens = text.strip_prefix(b"{")?.trim_ascii_start();
            let is_line = [&b"\"scene\""[..], b"\"track\""].iter().any(|key| opens.starts_with(key));
            is_line.then_some(Self::Trajnet)
        };
        marked.or_else(line)
    }

    /// Guesses the format by the names in the first line of a text, for advice alone.
    #[must_use]
    pub fn looks_like(text: &str) -> Option<Self> {
        let first = text.trim_start_matches('\u{feff}').lines().next()?.replace('"', "");
        match first.trim() {
            "time,pedID,posX,posY" => Some(Self::Crowdit),
            line if line.starts_with("t,id,name,active,x,y") => Some(Self::Pathfinder),
            line if line.starts_with('#') && line.contains("framerate") => Some(Self::Juelich),
            _ => None,
        }
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Format {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::ALL.into_iter().find(|format| format.name() == text).ok_or_else(|| {
            let names = Self::ALL.map(Self::name).join(", ");
            format!("`{text}` is none of {names}")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_bytes_tell_where_they_can() {
        assert_eq!(Format::of(b"SQLite format 3\0\x10\0"), Some(Format::Jupedsim));
        assert_eq!(Format::of(b"PAR1\x15"), Some(Format::Parquet));
        assert_eq!(Format::of(b"\x89MCAP0\r\n\x01"), Some(Format::Mcap));
        assert_eq!(Format::of(b" { \"track\": {}}"), Some(Format::Trajnet));
        assert_eq!(Format::of(b"{\"scene\": {}}"), Some(Format::Trajnet));
        assert_eq!(Format::of(b"#IDXCOL=2,DATACOL=6\n"), Some(Format::Vadere));
        for other in [&b"{\"levels\": 1}"[..], b"SQLite", b"1 2 3 4", b"", b"time,pedID,posX,posY"] {
            assert_eq!(Format::of(other), None);
        }
    }

    #[test]
    fn names_are_those_of_pipeline_files() {
        for format in Format::ALL {
            assert_eq!(format.name().parse(), Ok(format));
            assert_eq!(serde_json::to_value(format).expect("is JSON"), format.name());
        }
        assert!("xml".parse::<Format>().expect_err("none").starts_with("`xml` is none of table, parquet"));
    }
}
