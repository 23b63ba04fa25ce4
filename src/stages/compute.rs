//! The device and the instruction set that `train` and `annotate` compute with.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::Value;

use crate::domain::unet::{Compute, DeviceName, Simd, UnetError};
use crate::pipeline::stage::{ParameterError, StageError};

/// The environment variable that chooses the instruction set, so that two machines can be made to agree.
pub const SIMD_VARIABLE: &str = "TRODDEN_SIMD";

/// What makes machines share what `train` and `annotate` give.
pub(super) const SHARING: &str = "`simd: portable` at this stage gives the same bytes on every machine";

/// Opens a device with the pinned instruction set, or that which [`SIMD_VARIABLE`] names, by default the best there is.
///
/// # Errors
/// [`StageError::Failed`] if this build has no such device, this machine no GPU for it or this processor no such instruction
/// set.
pub fn open(device: DeviceName, pinned: Option<Simd>) -> Result<Compute, StageError> {
    let simd = match std::env::var(SIMD_VARIABLE) {
        _ if pinned.is_some() => pinned,
        Ok(name) if !name.is_empty() => Some(name.parse().map_err(failed)?),
        _ => None,
    };
    Compute::new(device, simd).map_err(failed)
}

fn failed(error: UnetError) -> StageError {
    let advice = match &error {
        UnetError::MissingGpu { device: "cuda", .. } => {
            "install NVIDIA's driver and CUDA, or leave `device` out to compute on the processor".to_owned()
        }
        UnetError::MissingGpu { .. } => {
            "install a Vulkan driver (Debian: `mesa-vulkan-drivers`, which can also compute on \
            the processor), or leave `device` out"
                .to_owned()
        }
        UnetError::MissingDevice(_) => "leave `device` out to compute on the processor".to_owned(),
        _ => format!("set `simd` or {SIMD_VARIABLE} to `avx512`, `avx2` or `portable`, or leave both out"),
    };
    StageError::failed(error).with_help(advice)
}

/// Returns parameters without the device and the instruction set: the environment names them.
pub(super) fn without_device(parameters: &impl Serialize) -> Value {
    let mut value = super::to_json(parameters);
    let object = value.as_object_mut().expect("parameters are an object");
    object.remove("device");
    object.remove("simd");
    value
}

/// Returns what the bytes depend on besides parameters and inputs.
pub(super) fn environment(device: DeviceName, pinned: Option<Simd>) -> BTreeMap<String, String> {
    // A device that cannot be opened is refused when the pipeline is checked.
    named(open(device, pinned).map_or_else(|_| device.to_string(), |compute| compute.to_string()))
}

fn named(device: String) -> BTreeMap<String, String> {
    BTreeMap::from([("device".to_owned(), device)])
}

/// Returns the environments that others may have come to by themselves: none where somebody has chosen the instruction set, or
/// a GPU, of which others may have any.
pub(super) fn environments(device: DeviceName, pinned: Option<Simd>) -> Vec<BTreeMap<String, String>> {
    let all = if pinned.is_none() && device == DeviceName::Flex { &Simd::ALL[..] } else { &[] };
    all.iter().map(|simd| named(format!("{device}/{simd}"))).collect()
}

/// Checks that a device can be opened.
pub(super) fn check(device: DeviceName, pinned: Option<Simd>) -> Result<(), ParameterError> {
    let name = if pinned.is_some() { "simd" } else { "device" };
    match open(device, pinned) {
        Ok(_) => Ok(()),
        Err(StageError::Failed { message, help, .. }) => {
            Err(ParameterError { path: vec![name.to_owned()], message, help })
        }
        Err(error) => Err(super::refused(name, error.to_string())),
    }
}
