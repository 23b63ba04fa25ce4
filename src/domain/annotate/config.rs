//! The parameters of annotation: as people write them, flat, and each may be left out; and as the mode has them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::domain::map::Shown;
use crate::domain::unet::{DeviceName, Simd};

/// Parameters of annotation; each may be left out.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct AnnotateFields {
    /// Where the network looks: at the whole map (`dense`) or at sliding windows (`exact`, the paper's);
    /// by default dense, and exact where `stride` or `overlap` is given.
    pub mode: Option<ModeName>,
    /// Distance between neighboring windows in cells, from 1 to the window's size; the paper's is 1 (exact mode); by default 4.
    #[schemars(range(min = 1, max = 512))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stride: Option<u32>,
    /// Which cells of a window count; `none` and `per-pixel` are the paper's ablations (exact mode); by default full.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub overlap: Option<OverlapName>,
    /// How many of the offsets modulo the network's period (the paper's: 8, so there are 64) are averaged, 1 to 64
    /// (dense mode); by default 64.
    #[schemars(range(min = 1, max = 64))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offsets: Option<u32>,
    /// Whether each offset sees the map in another of the eight rotations and mirrorings (dense mode); by default true.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub augment: Option<bool>,
    /// What the heat is divided by at the end.
    pub normalize: Normalize,
    /// What the network is shown of the map: the `map` itself, or what is `observed` of it, and then only cells that are seen
    /// to be free are told of.
    #[serde(skip_serializing_if = "Shown::is_map")]
    pub shown: Shown,
    /// What computes.
    pub device: DeviceName,
    /// The instruction set it computes with, so that machines share results: `portable` is the same on every one, and slower;
    /// by default the best there is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub simd: Option<Simd>,
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
                Mode::Dense { offsets: fields.offsets.unwrap_or(64), augment: fields.augment.unwrap_or(true) }
            }
            ModeName::Exact => {
                absent(fields.offsets.is_some(), "offsets", "mode: dense", "mode: exact")?;
                absent(fields.augment.is_some(), "augment", "mode: dense", "mode: exact")?;
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
        let AnnotateFields { normalize, shown, device, simd, .. } = fields;
        Ok(Self { mode, normalize, shown, device, simd })
    }
}

impl From<AnnotateConfig> for AnnotateFields {
    fn from(config: AnnotateConfig) -> Self {
        let AnnotateConfig { normalize, shown, device, simd, .. } = config;
        let own = Self { normalize, shown, device, simd, ..Self::default() };
        let exact =
            |overlap, stride| Self { mode: Some(ModeName::Exact), overlap: Some(overlap), stride, ..own.clone() };
        match config.mode {
            Mode::Dense { offsets, augment } => {
                Self { mode: Some(ModeName::Dense), offsets: Some(offsets), augment: Some(augment), ..own }
            }
            Mode::Exact(Overlap::Full { stride }) => exact(OverlapName::Full, Some(stride)),
            Mode::Exact(Overlap::None) => exact(OverlapName::None, None),
            Mode::Exact(Overlap::PerPixel { stride }) => exact(OverlapName::PerPixel, Some(stride)),
        }
    }
}

/// Where the network looks, with what only this mode has to say about it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// At windows that slide over the map, as in the paper.
    Exact(Overlap),
    /// At the whole map, once for each of some offsets modulo the network's period: another estimator, many times as fast.
    Dense {
        /// How many of the offsets are averaged, 1 to 64.
        offsets: u32,
        /// Whether each sees the map in another of the eight rotations and mirrorings.
        augment: bool,
    },
}

/// How far windows lie apart, and which of their cells count (exact mode).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Overlap {
    /// All cells count; the windows lie `stride` cells apart and overlap.
    Full {
        /// Distance between neighboring windows in cells.
        stride: u32,
    },
    /// All cells count, and the windows lie side by side.
    None,
    /// Only the central `stride` × `stride` cells count, so that each cell is predicted once: with stride 1 the central one.
    PerPixel {
        /// Distance between neighboring windows in cells.
        stride: u32,
    },
}

/// What the heat is divided by at the end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Normalize {
    /// Nothing: the heat of different maps compares.
    #[default]
    None,
    /// The map's maximum.
    Max,
}

/// Parameters of annotation with all defaults filled in; those that another mode has are not there.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "AnnotateFields", into = "AnnotateFields")]
pub struct AnnotateConfig {
    /// Where the network looks.
    pub mode: Mode,
    /// What the heat is divided by at the end.
    pub normalize: Normalize,
    /// What the network is shown of the map.
    pub shown: Shown,
    /// What computes.
    pub device: DeviceName,
    /// The instruction set it computes with; by default the best there is.
    pub simd: Option<Simd>,
}

impl Default for Mode {
    fn default() -> Self {
        Self::Dense { offsets: 64, augment: true }
    }
}

/// What keeps a map from being annotated.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and their fields are")]
pub enum AnnotateError {
    #[error("`stride` is `{stride}`, allowed are 1 to the window's {window}")]
    Stride { stride: u32, window: usize },
    #[error("`offsets` is `{0}`, allowed are 1 to 64")]
    Offsets(u32),
    #[error("`{field}` goes with `{with}`, and here is `{here}`")]
    OtherMode { field: &'static str, with: &'static str, here: &'static str },
    #[error("the window's size is `{0}`, allowed are multiples of 8")]
    Window(usize),
    #[error("`offsets` is `{offsets}`, this network has {all} different ones")]
    OffsetsOfNetwork { offsets: u32, all: usize },
    #[error("the window's size is `{window}`, this network takes multiples of {period}")]
    WindowOfNetwork { window: usize, period: usize },
    #[error("annotation was cancelled")]
    Cancelled,
}

impl AnnotateConfig {
    /// Checks that every parameter is in its range, as far as that does not depend on the window's size.
    ///
    /// # Errors
    /// [`AnnotateError`] names the parameter and what is allowed.
    pub fn check(&self) -> Result<(), AnnotateError> {
        self.check_with(512)
    }

    /// Checks that every parameter is in its range, for windows of `window` cells.
    ///
    /// # Errors
    /// [`AnnotateError`] names the parameter and what is allowed.
    pub fn check_with(&self, window: usize) -> Result<(), AnnotateError> {
        if window == 0 || !window.is_multiple_of(8) {
            return Err(AnnotateError::Window(window));
        }
        match self.mode {
            Mode::Exact(Overlap::Full { stride } | Overlap::PerPixel { stride })
                if !(1..=window).contains(&(stride as usize)) =>
            {
                Err(AnnotateError::Stride { stride, window })
            }
            Mode::Dense { offsets, .. } if !(1..=64).contains(&offsets) => Err(AnnotateError::Offsets(offsets)),
            Mode::Exact(_) | Mode::Dense { .. } => Ok(()),
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
        let dense = json!({ "mode": "dense", "offsets": 64, "augment": true, "normalize": "none", "device": "flex" });
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
            json!({ "stride": 4, "augment": true }),
            Err("`augment` goes with `mode: dense`, and here is `mode: exact`"),
        );
        check(
            json!({ "mode": "exact", "overlap": "none", "stride": 4 }),
            Err("`stride` goes with `overlap: full`, and here is `overlap: none`"),
        );
    }
}
