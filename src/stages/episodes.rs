//! How many episodes a map gets: a number, or so many for its area.
//!
//! The chunks of either are cached one by one, so neither may depend on the total, and a plan must know how many there are
//! before the map is made. By number, a chunk holds a fixed number of episodes. By area, it holds those that raise the
//! density from one level to the next, in episodes for each 100 m², so a larger map has larger chunks, not more of them.

use std::borrow::Cow;
use std::fmt;
use std::ops::Range;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, Deserializer, MapAccess, Visitor};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use crate::pipeline::stage::ParameterError;

/// Episodes of a chunk. It is fixed, so that more episodes leave the chunks that exist as they are.
const CHUNK: u32 = 20;
/// Episodes for each 100 m² of a chunk.
const CHUNK_DENSITY: u32 = 10;
/// Most episodes of a map, and for each 100 m² of it.
const MOST: u32 = 1_000_000;
const MOST_PER_100_M2: u32 = 100_000;

/// How many episodes a map gets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(untagged)]
pub enum Episodes {
    /// So many.
    Number(u32),
    /// So many for an area.
    Density {
        /// Episodes for each 100 m² of free floor; every map gets at least one.
        per_100_m2: u32,
    },
}

impl Default for Episodes {
    fn default() -> Self {
        Self::Number(100)
    }
}

impl Episodes {
    /// Checks that the number is in its range.
    ///
    /// # Errors
    /// [`ParameterError`] that names it.
    pub fn check(self) -> Result<(), ParameterError> {
        let (path, value, most): (&[&str], u32, &str) = match self {
            Self::Number(number) if !(1..=MOST).contains(&number) => (&["episodes"], number, "1,000,000"),
            Self::Density { per_100_m2 } if !(1..=MOST_PER_100_M2).contains(&per_100_m2) => {
                (&["episodes", "per_100_m2"], per_100_m2, "100,000")
            }
            _ => return Ok(()),
        };
        let message = format!("`{}` is {value}, allowed are 1 to {most}", path.join("."));
        Err(ParameterError { path: path.iter().map(|field| (*field).to_owned()).collect(), message, help: None })
    }

    /// Returns the number of chunks.
    #[must_use]
    pub const fn chunks(self) -> u32 {
        match self {
            Self::Number(number) => number.div_ceil(CHUNK),
            Self::Density { per_100_m2 } => per_100_m2.div_ceil(CHUNK_DENSITY),
        }
    }

    /// Returns what enters the recipe of a chunk: where it starts and how much it holds.
    #[must_use]
    pub fn chunk_parameters(self, chunk: u32) -> Map<String, Value> {
        let levels = self.levels(chunk);
        let (first, count) = match self {
            Self::Number(_) => ("first", "count"),
            Self::Density { .. } => ("first_per_100_m2", "count_per_100_m2"),
        };
        Map::from_iter([(first.to_owned(), json!(levels.start)), (count.to_owned(), json!(levels.end - levels.start))])
    }

    /// Returns how many episodes a chunk holds, or how many for each 100 m².
    #[must_use]
    pub fn amount(self, chunk: u32) -> u32 {
        let levels = self.levels(chunk);
        levels.end - levels.start
    }

    /// Returns the numbers of the episodes of a chunk on a floor of `free_area` square meters.
    #[must_use]
    pub fn span(self, chunk: u32, free_area: f64) -> Range<u32> {
        let levels = self.levels(chunk);
        match self {
            Self::Number(_) => levels,
            Self::Density { .. } => {
                let up_to = |level: u32| match level {
                    0 => 0,
                    level => (f64::from(level) * free_area / 100.0).round().clamp(1.0, f64::from(u32::MAX)) as u32,
                };
                up_to(levels.start)..up_to(levels.end)
            }
        }
    }

    /// Returns the episodes of a chunk, or the densities that it leads from and to.
    fn levels(self, chunk: u32) -> Range<u32> {
        let (size, total) = match self {
            Self::Number(number) => (CHUNK, number),
            Self::Density { per_100_m2 } => (CHUNK_DENSITY, per_100_m2),
        };
        chunk * size..((chunk + 1) * size).min(total)
    }
}

/// The keys of the mapping.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ByArea {
    per_100_m2: u32,
}

impl<'de> Deserialize<'de> for Episodes {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either;

        impl<'de> Visitor<'de> for Either {
            type Value = Episodes;

            fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
                formatter.write_str("a number of episodes or `{ per_100_m2: NUMBER }`")
            }

            fn visit_u64<E: de::Error>(self, number: u64) -> Result<Episodes, E> {
                let number = u32::try_from(number);
                number.map(Episodes::Number).map_err(|_| E::custom("there may be at most 1,000,000 episodes"))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Episodes, A::Error> {
                let ByArea { per_100_m2 } = ByArea::deserialize(de::value::MapAccessDeserializer::new(map))?;
                Ok(Episodes::Density { per_100_m2 })
            }
        }

        deserializer.deserialize_any(Either)
    }
}

impl JsonSchema for Episodes {
    fn schema_name() -> Cow<'static, str> {
        "Episodes".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "anyOf": [
                { "type": "integer", "minimum": 1, "maximum": MOST },
                {
                    "type": "object",
                    "properties": {
                        "per_100_m2": {
                            "description": "Episodes for each 100 m² of free floor; every map gets at least one.",
                            "type": "integer",
                            "minimum": 1,
                            "maximum": MOST_PER_100_M2
                        }
                    },
                    "required": ["per_100_m2"],
                    "additionalProperties": false
                }
            ]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(value: Value) -> Result<Episodes, String> {
        serde_json::from_value(value).map_err(|error| error.to_string())
    }

    fn spans(episodes: Episodes, area: f64) -> Vec<Range<u32>> {
        (0..episodes.chunks()).map(|chunk| episodes.span(chunk, area)).collect()
    }

    #[test]
    fn a_number_or_a_density_is_read_and_written() {
        for (value, expected) in
            [(json!(45), Episodes::Number(45)), (json!({"per_100_m2": 25}), Episodes::Density { per_100_m2: 25 })]
        {
            assert_eq!(read(value.clone()), Ok(expected));
            assert_eq!(serde_json::to_value(expected).expect("JSON"), value);
            assert_eq!(expected.check(), Ok(()));
        }
        let error = read(json!("many")).expect_err("no number");
        assert!(error.contains("per_100_m2"), "{error}");
        let error = read(json!({"per_m2": 3})).expect_err("a misspelt field");
        assert!(error.contains("`per_m2`") && error.contains("`per_100_m2`"), "{error}");
        let zero = Episodes::Density { per_100_m2: 0 }.check().expect_err("none");
        assert_eq!(
            (zero.path.join("."), Episodes::Number(0).check().is_err()),
            ("episodes.per_100_m2".to_owned(), true)
        );
    }

    #[test]
    fn chunks_by_number_hold_twenty() {
        assert_eq!(spans(Episodes::Number(45), 999.0), [0..20, 20..40, 40..45]);
        let third = Episodes::Number(45).chunk_parameters(2);
        assert_eq!(Value::from(third), json!({"first": 40, "count": 5}));
    }

    #[test]
    fn chunks_by_area_grow_with_the_floor_and_leave_no_gap() {
        let density = |per_100_m2| Episodes::Density { per_100_m2 };
        assert_eq!(spans(density(25), 60.0), [0..6, 6..12, 12..15]);
        assert_eq!(spans(density(25), 1000.0), [0..100, 100..200, 200..250]);
        // On a floor of one square meter 25 for each 100 m² are a quarter of one; there is at least one.
        assert_eq!(spans(density(25), 1.0), [0..1, 1..1, 1..1]);
        assert_eq!(
            Value::from(density(25).chunk_parameters(2)),
            json!({"first_per_100_m2": 20, "count_per_100_m2": 5})
        );
        // A denser crowd of episodes goes on where this one's whole chunks end.
        for area in [1.0, 37.5, 60.0, 333.0] {
            assert_eq!(spans(density(40), area)[..2], spans(density(25), area)[..2]);
            assert_eq!(density(40).chunk_parameters(1), density(25).chunk_parameters(1));
        }
    }
}
