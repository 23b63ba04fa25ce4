//! A `building.yaml` of Open-RMF as it is written: what of it matters here.

use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;

use serde::Deserialize;
use serde::de::{Deserializer, Error, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde_saphyr::Spanned;

/// The file. Fields that are not named here are ignored.
#[derive(Deserialize)]
pub(super) struct Written {
    pub coordinate_system: Option<Spanned<String>>,
    pub levels: Option<BTreeMap<String, Level>>,
}

/// A level: places, and what joins them by their numbers.
#[derive(Deserialize)]
pub(super) struct Level {
    pub vertices: Option<Vec<Spanned<Vertex>>>,
    pub walls: Option<Vec<Spanned<Edge>>>,
    pub doors: Option<Vec<Spanned<Edge>>>,
    pub measurements: Option<Vec<Spanned<Edge>>>,
    pub floors: Option<Vec<Spanned<Ring>>>,
    pub holes: Option<Vec<Spanned<Ring>>>,
    pub lanes: Option<Count>,
    pub models: Option<Count>,
}

/// `[x, y, …]`: a place; elevation, name and parameters may follow.
pub(super) struct Vertex {
    pub x: f64,
    pub y: f64,
}

/// `[from, to, { … }]`: two places by their numbers; parameters may follow.
pub(super) struct Edge {
    pub from: u64,
    pub to: u64,
    /// How far apart they are in meters, in a measurement.
    pub distance: Option<f64>,
}

/// The corners of a floor or a hole, by their numbers.
#[derive(Deserialize)]
pub(super) struct Ring {
    pub vertices: Vec<u64>,
}

/// How many items there are, whatever they are.
pub(super) struct Count(pub usize);

/// Parameters are pairs: the number of a type, and a value.
#[derive(Deserialize, Default)]
struct Parameters {
    distance: Option<(IgnoredAny, f64)>,
}

/// What is made of a sequence.
trait FromItems: Sized {
    const EXPECTED: &'static str;

    fn from_items<'de, A: SeqAccess<'de>>(items: &mut A) -> Result<Self, A::Error>;
}

struct ItemsVisitor<T>(PhantomData<T>);

impl<'de, T: FromItems> Visitor<'de> for ItemsVisitor<T> {
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(T::EXPECTED)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<T, A::Error> {
        let value = T::from_items(&mut items)?;
        while items.next_element::<IgnoredAny>()?.is_some() {}
        Ok(value)
    }
}

fn item<'de, V: Deserialize<'de>, A: SeqAccess<'de>>(items: &mut A, at: usize, expected: &str) -> Result<V, A::Error> {
    items.next_element()?.ok_or_else(|| A::Error::invalid_length(at, &expected))
}

impl FromItems for Vertex {
    const EXPECTED: &'static str = "a vertex, [x, y, …]";

    fn from_items<'de, A: SeqAccess<'de>>(items: &mut A) -> Result<Self, A::Error> {
        Ok(Self { x: item(items, 0, Self::EXPECTED)?, y: item(items, 1, Self::EXPECTED)? })
    }
}

impl FromItems for Edge {
    const EXPECTED: &'static str = "the numbers of two vertices, [from, to, …]";

    fn from_items<'de, A: SeqAccess<'de>>(items: &mut A) -> Result<Self, A::Error> {
        let (from, to) = (item(items, 0, Self::EXPECTED)?, item(items, 1, Self::EXPECTED)?);
        let parameters: Option<Option<Parameters>> = items.next_element()?;
        let distance = parameters.flatten().unwrap_or_default().distance.map(|(_, distance)| distance);
        Ok(Self { from, to, distance })
    }
}

impl<'de> Deserialize<'de> for Vertex {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_seq(ItemsVisitor(PhantomData))
    }
}

impl<'de> Deserialize<'de> for Edge {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_seq(ItemsVisitor(PhantomData))
    }
}

impl<'de> Deserialize<'de> for Count {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct CountVisitor;
        impl<'de> Visitor<'de> for CountVisitor {
            type Value = Count;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a list")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Count, A::Error> {
                let mut count = 0;
                while items.next_element::<IgnoredAny>()?.is_some() {
                    count += 1;
                }
                Ok(Count(count))
            }

            fn visit_map<A: MapAccess<'de>>(self, mut items: A) -> Result<Count, A::Error> {
                let mut count = 0;
                while items.next_entry::<IgnoredAny, IgnoredAny>()?.is_some() {
                    count += 1;
                }
                Ok(Count(count))
            }
        }
        deserializer.deserialize_any(CountVisitor)
    }
}
