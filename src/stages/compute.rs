//! The device and the instruction set that `train` and `annotate` compute with.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::Value;

use crate::domain::unet::{Compute, DeviceName, Simd, UnetError};
use crate::pipeline::stage::{ParameterError, StageError};

/// The environment variable that chooses the instruction set, so that two machines can be made to agree.
pub const SIMD_VARIABLE: &str = "TRODDEN_SIMD";

/// Opens a device with the instruction set that [`SIMD_VARIABLE`] names, by default the best there is.
///
/// # Errors
/// [`StageError::Failed`] if this build has no such device, this machine no GPU for it or this processor no such instruction
/// set.
pub fn open(device: DeviceName) -> Result<Compute, StageError> {
    let simd: Option<Simd> = match std::env::var(SIMD_VARIABLE) {
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
        _ => format!("set {SIMD_VARIABLE} to `avx512`, `avx2` or `portable`, or unset it"),
    };
    StageError::failed(error).with_help(advice)
}

/// Returns parameters without the device: the environment names it, with the instruction set.
pub(super) fn without_device(parameters: &impl Serialize) -> Value {
    let mut value = super::to_json(parameters);
    value.as_object_mut().expect("parameters are an object").remove("device");
    value
}

/// Returns what the bytes depend on besides parameters and inputs.
pub(super) fn environment(device: DeviceName) -> BTreeMap<String, String> {
    // A device that cannot be opened is refused when the pipeline is checked.
    let name = open(device).map_or_else(|_| device.to_string(), |compute| compute.to_string());
    BTreeMap::from([("device".to_owned(), name)])
}

/// Checks that a device can be opened.
pub(super) fn check(device: DeviceName) -> Result<(), ParameterError> {
    match open(device) {
        Ok(_) => Ok(()),
        Err(StageError::Failed { message, help, .. }) => {
            Err(ParameterError { path: vec!["device".to_owned()], message, help })
        }
        Err(error) => Err(super::refused("device", error.to_string())),
    }
}
