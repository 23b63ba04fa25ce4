//! What a network is made of, as data: its levels and their sizes.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::UnetError;

/// The fewest levels: the kernels take images whose sides are multiples of 8.
const FEWEST_LEVELS: usize = 3;
/// The most levels; the sixth sees 64 cells as one pixel.
const MOST_LEVELS: usize = 6;
/// Channels come in multiples of this, which fill the registers of every instruction set.
pub(super) const LANES: usize = 16;
/// The most channels of a level.
const WIDEST: u32 = 512;

/// The network's form: how many levels, how wide, how many convolutions each.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "NetworkField", into = "Custom")]
#[schemars(with = "NetworkField")]
pub struct Architecture {
    /// Channels of each level, the finest (full resolution) first; each level has half the resolution of the one before.
    pub widths: Vec<u32>,
    /// 3×3 convolutions of each level on the way down and on the way up, 1 or 2.
    pub convolutions: u32,
}

/// A network by its name, or by its parameters.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum NetworkField {
    /// One that has a name.
    Named(NetworkName),
    /// Any other.
    Custom(Custom),
}

/// The networks that have names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum NetworkName {
    /// The paper's (appendix E): 32, 64 and 128 channels; it sees 2.8 m to every side.
    Paper,
    /// Five levels of 32, 64, 96, 128 and 160 channels; it sees 12.4 m to every side.
    Deep,
}

/// A network by its parameters.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Custom {
    /// Channels of each level, the finest (full resolution) first: 3 to 6 levels, each a multiple of 16 up to 512.
    pub widths: Vec<u32>,
    /// 3×3 convolutions of each level, 1 or 2.
    #[schemars(range(min = 1, max = 2))]
    #[serde(default = "one")]
    pub convolutions: u32,
}

const fn one() -> u32 {
    1
}

impl Architecture {
    /// The paper's network (appendix E).
    #[must_use]
    pub fn paper() -> Self {
        Self { widths: vec![32, 64, 128], convolutions: 1 }
    }

    /// A network that sees further: five levels.
    #[must_use]
    pub fn deep() -> Self {
        Self { widths: vec![32, 64, 96, 128, 160], convolutions: 1 }
    }

    /// Checks that the kernels can compute it.
    ///
    /// # Errors
    /// [`UnetError::Range`] names the parameter and what is allowed.
    pub fn check(&self) -> Result<(), UnetError> {
        let Self { widths, convolutions } = self;
        let levels = (FEWEST_LEVELS..=MOST_LEVELS).contains(&widths.len());
        if !levels
            || widths.iter().any(|width| *width == 0 || *width > WIDEST || !(*width as usize).is_multiple_of(LANES))
        {
            let allowed = "3 to 6 levels, each a multiple of 16 up to 512";
            return Err(UnetError::Range { field: "network.widths", value: format!("{widths:?}"), allowed });
        }
        if !(1..=2).contains(convolutions) {
            let value = convolutions.to_string();
            return Err(UnetError::Range { field: "network.convolutions", value, allowed: "1 or 2" });
        }
        Ok(())
    }

    /// Returns 2^levels: images have sides that are multiples of it, and an input that is shifted by it shifts the
    /// prediction and does nothing else.
    #[must_use]
    pub fn period(&self) -> usize {
        1 << self.widths.len()
    }
}

impl Default for Architecture {
    fn default() -> Self {
        Self::paper()
    }
}

impl TryFrom<NetworkField> for Architecture {
    type Error = UnetError;

    fn try_from(field: NetworkField) -> Result<Self, UnetError> {
        let network = match field {
            NetworkField::Named(NetworkName::Paper) => Self::paper(),
            NetworkField::Named(NetworkName::Deep) => Self::deep(),
            NetworkField::Custom(Custom { widths, convolutions }) => Self { widths, convolutions },
        };
        network.check()?;
        Ok(network)
    }
}

impl From<Architecture> for Custom {
    fn from(Architecture { widths, convolutions }: Architecture) -> Self {
        Self { widths, convolutions }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn networks_go_by_name_or_parameters_and_recipes_have_the_parameters() {
        let read = |value| serde_json::from_value::<Architecture>(value);
        assert_eq!(read(json!("paper")).expect("a name"), Architecture::paper());
        assert_eq!(read(json!({ "widths": [32, 64, 128] })).expect("parameters"), Architecture::paper());
        let deep = serde_json::to_value(Architecture::deep()).expect("is JSON");
        assert_eq!(deep, json!({ "widths": [32, 64, 96, 128, 160], "convolutions": 1 }));
        assert_eq!(read(deep).expect("reads back"), Architecture::deep());
    }

    #[test]
    fn what_the_kernels_cannot_compute_is_refused() {
        let check = |widths: &[u32], convolutions, expected: &str| {
            let network = Architecture { widths: widths.to_vec(), convolutions };
            assert_eq!(network.check().expect_err("out of range").to_string(), expected);
        };
        let widths = "allowed are 3 to 6 levels, each a multiple of 16 up to 512";
        check(&[32, 64], 1, &format!("`network.widths` is `[32, 64]`, {widths}"));
        check(&[32, 64, 100], 1, &format!("`network.widths` is `[32, 64, 100]`, {widths}"));
        check(&[32, 64, 0], 1, &format!("`network.widths` is `[32, 64, 0]`, {widths}"));
        check(&[32, 64, 128], 3, "`network.convolutions` is `3`, allowed are 1 or 2");
    }
}
