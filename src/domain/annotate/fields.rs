//! The parameters of annotation as people write them: flat, and each may be left out.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{AnnotateConfig, AnnotateError, Mode, Normalize, Overlap};
use crate::domain::unet::DeviceName;

/// Parameters of annotation; what is left out is as in brackets.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct AnnotateFields {
    /// Where the network looks: at the whole map (`dense`) or at sliding windows (`exact`, the paper's) [dense; exact where
    /// `stride` or `overlap` is given].
    pub mode: Option<ModeName>,
    /// Distance between neighboring windows in cells, from 1 to the window's size; the paper's is 1 (exact mode) [4].
    #[schemars(range(min = 1, max = 512))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stride: Option<u32>,
    /// Which cells of a window count; `none` and `per-pixel` are the paper's ablations (exact mode) [full].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub overlap: Option<OverlapName>,
    /// How many of the 64 offsets modulo 8 are averaged, 1 to 64 (dense mode) [64].
    #[schemars(range(min = 1, max = 64))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offsets: Option<u32>,
    /// What the heat is divided by at the end.
    pub normalize: Normalize,
    /// What computes.
    pub device: DeviceName,
}

/// The name of a [`Mode`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ModeName {
    /// At windows that slide over the map, as in the paper.
    Exact,
    /// At the whole map, once for each of some offsets: another estimator, many times as fast.
    Dense,
}

/// The name of an [`Overlap`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum OverlapName {
    /// All; the windows lie `stride` cells apart and overlap.
    #[default]
    Full,
    /// All, and the windows lie side by side; there is no `stride`.
    None,
    /// Only the central `stride` × `stride` cells, so that each cell is predicted once: with stride 1 the central cell.
    PerPixel,
}

impl TryFrom<AnnotateFields> for AnnotateConfig {
    type Error = AnnotateError;

    /// Fills in defaults.
    ///
    /// # Errors
    /// [`AnnotateError::OtherMode`] if a field is given that the mode does not have.
    fn try_from(fields: AnnotateFields) -> Result<Self, AnnotateError> {
        let absent = |given: bool, field, with, here| match given {
            true => Err(AnnotateError::OtherMode { field, with, here }),
            false => Ok(()),
        };
        let stride = fields.stride.unwrap_or(4);
        // Whoever names what only windows have means windows.
        let of_windows = fields.stride.is_some() || fields.overlap.is_some();
        let named = fields.mode.unwrap_or(if of_windows { ModeName::Exact } else { ModeName::Dense });
        let mode = match named {
            ModeName::Dense => {
                absent(fields.stride.is_some(), "stride", "mode: exact", "mode: dense")?;
                absent(fields.overlap.is_some(), "overlap", "mode: exact", "mode: dense")?;
                Mode::Dense { offsets: fields.offsets.unwrap_or(64) }
            }
            ModeName::Exact => {
                absent(fields.offsets.is_some(), "offsets", "mode: dense", "mode: exact")?;
                Mode::Exact(match fields.overlap.unwrap_or_default() {
                    OverlapName::Full => Overlap::Full { stride },
                    OverlapName::PerPixel => Overlap::PerPixel { stride },
                    OverlapName::None => {
                        absent(fields.stride.is_some(), "stride", "overlap: full", "overlap: none")?;
                        Overlap::None
                    }
                })
            }
        };
        Ok(Self { mode, normalize: fields.normalize, device: fields.device })
    }
}

impl From<AnnotateConfig> for AnnotateFields {
    fn from(config: AnnotateConfig) -> Self {
        let own = Self { normalize: config.normalize, device: config.device, ..Self::default() };
        let exact =
            |overlap, stride| Self { mode: Some(ModeName::Exact), overlap: Some(overlap), stride, ..own.clone() };
        match config.mode {
            Mode::Dense { offsets } => Self { mode: Some(ModeName::Dense), offsets: Some(offsets), ..own },
            Mode::Exact(Overlap::Full { stride }) => exact(OverlapName::Full, Some(stride)),
            Mode::Exact(Overlap::None) => exact(OverlapName::None, None),
            Mode::Exact(Overlap::PerPixel { stride }) => exact(OverlapName::PerPixel, Some(stride)),
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    /// Checks what fields mean, with what enters a recipe, or how they are refused.
    fn check(fields: serde_json::Value, expected: Result<serde_json::Value, &str>) {
        let fields: AnnotateFields = serde_json::from_value(fields).expect("fields that are known");
        let found = AnnotateConfig::try_from(fields);
        let found = found.map(|config| {
            let json = serde_json::to_value(&config).expect("is JSON");
            assert_eq!(serde_json::from_value::<AnnotateConfig>(json.clone()).ok(), Some(config), "it reads back");
            json
        });
        assert_eq!(found.map_err(|error| error.to_string()), expected.map_err(str::to_owned));
    }

    #[test]
    fn each_mode_has_its_own_parameters() {
        let dense = json!({ "mode": "dense", "offsets": 64, "normalize": "none", "device": "flex" });
        check(json!({}), Ok(dense.clone()));
        check(json!({ "mode": "dense", "offsets": 64 }), Ok(dense));
        let exact = |more: serde_json::Value| {
            let mut exact = json!({ "mode": "exact", "normalize": "none", "device": "flex" });
            exact.as_object_mut().expect("an object").extend(more.as_object().expect("an object").clone());
            Ok(exact)
        };
        check(json!({ "mode": "exact" }), exact(json!({ "stride": 4, "overlap": "full" })));
        check(json!({ "stride": 16 }), exact(json!({ "stride": 16, "overlap": "full" })));
        check(json!({ "overlap": "none" }), exact(json!({ "overlap": "none" })));
        check(json!({ "mode": "exact", "overlap": "none" }), exact(json!({ "overlap": "none" })));
        let centers = json!({ "stride": 2, "overlap": "per-pixel" });
        check(json!({ "mode": "exact", "stride": 2, "overlap": "per-pixel" }), exact(centers));
    }

    #[test]
    fn parameters_of_another_mode_are_refused_by_name() {
        check(
            json!({ "mode": "dense", "stride": 4 }),
            Err("`stride` goes with `mode: exact`, and here is `mode: dense`"),
        );
        check(
            json!({ "stride": 4, "offsets": 64 }),
            Err("`offsets` goes with `mode: dense`, and here is `mode: exact`"),
        );
        check(
            json!({ "mode": "dense", "overlap": "full" }),
            Err("`overlap` goes with `mode: exact`, and here is `mode: dense`"),
        );
        check(
            json!({ "mode": "exact", "offsets": 64 }),
            Err("`offsets` goes with `mode: dense`, and here is `mode: exact`"),
        );
        check(
            json!({ "mode": "exact", "overlap": "none", "stride": 4 }),
            Err("`stride` goes with `overlap: full`, and here is `overlap: none`"),
        );
    }
}
