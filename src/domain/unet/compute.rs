//! Which device and which instruction set does the work.

use std::fmt;
use std::str::FromStr;

use burn::tensor::Device;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::UnetError;

/// A device that burn runs on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum DeviceName {
    /// The processor, through burn-flex and kernels of our own.
    #[default]
    Flex,
    /// The processor, through burn-ndarray: slow, to hold the first against (a build with `--features ndarray`).
    Ndarray,
}

impl DeviceName {
    /// Returns the name that settings and recipes have for it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Flex => "flex",
            Self::Ndarray => "ndarray",
        }
    }
}

impl fmt::Display for DeviceName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// An instruction set that the kernels are written for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Simd {
    /// 16 numbers at once, x86-64 with AVX-512.
    Avx512,
    /// 8 numbers at once, x86-64 with AVX2 and FMA.
    Avx2,
    /// Plain Rust, without fused multiplication and addition: the same bits on every machine.
    Portable,
}

impl Simd {
    /// Every instruction set, the fastest first.
    pub const ALL: [Self; 3] = [Self::Avx512, Self::Avx2, Self::Portable];

    /// Tells whether this processor has it.
    #[must_use]
    pub fn is_available(self) -> bool {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => is_x86_feature_detected!("avx512f") && Self::Avx2.is_available(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma"),
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx512 | Self::Avx2 => false,
            Self::Portable => true,
        }
    }

    /// Returns the fastest that this processor has.
    #[must_use]
    pub fn best() -> Self {
        Self::ALL.into_iter().find(|simd| simd.is_available()).expect("plain Rust runs everywhere")
    }

    /// Returns the name that settings and recipes have for it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Avx512 => "avx512",
            Self::Avx2 => "avx2",
            Self::Portable => "portable",
        }
    }
}

impl fmt::Display for Simd {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Simd {
    type Err = UnetError;
    fn from_str(name: &str) -> Result<Self, UnetError> {
        Self::ALL.into_iter().find(|simd| simd.name() == name).ok_or_else(|| UnetError::UnknownSimd(name.to_owned()))
    }
}

/// What computes: a device, and our kernels or burn's own operations on it.
#[derive(Debug, Clone)]
pub struct Compute {
    name: DeviceName,
    device: Device,
    kernels: Option<Simd>,
}

impl Compute {
    /// Opens a device; on `flex` our kernels run with the instruction set `simd`, by default the best there is.
    ///
    /// # Errors
    /// [`UnetError`] if this build has no such device or this processor no such instruction set.
    pub fn new(name: DeviceName, simd: Option<Simd>) -> Result<Self, UnetError> {
        let simd = simd.unwrap_or_else(Simd::best);
        if !simd.is_available() {
            return Err(UnetError::MissingSimd(simd.name()));
        }
        let kernels = (name == DeviceName::Flex).then_some(simd);
        Ok(Self { name, device: open(name)?, kernels })
    }

    /// Opens a device without our kernels: every operation is one of burn's.
    ///
    /// # Errors
    /// [`UnetError::MissingDevice`] if this build has no such device.
    pub fn plain(name: DeviceName) -> Result<Self, UnetError> {
        Ok(Self { name, device: open(name)?, kernels: None })
    }

    /// Returns the device, without automatic differentiation.
    #[must_use]
    pub const fn device(&self) -> &Device {
        &self.device
    }

    /// Returns the instruction set of our kernels, or `None` where burn's own operations do all.
    #[must_use]
    pub const fn kernels(&self) -> Option<Simd> {
        self.kernels
    }
}

/// Writes what the bits of a result depend on, as in `flex/avx512`: it belongs into recipes.
impl fmt::Display for Compute {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.name)?;
        self.kernels.map_or(Ok(()), |simd| write!(f, "/{simd}"))
    }
}

fn open(name: DeviceName) -> Result<Device, UnetError> {
    match name {
        DeviceName::Flex => Ok(Device::flex()),
        #[cfg(feature = "ndarray")]
        DeviceName::Ndarray => {
            #[expect(deprecated, reason = "kept to hold the first device against")]
            let device = Device::ndarray();
            Ok(device)
        }
        #[cfg(not(feature = "ndarray"))]
        DeviceName::Ndarray => Err(UnetError::MissingDevice(name.name())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instruction_sets_go_by_their_names() {
        for simd in Simd::ALL {
            assert_eq!(simd.to_string().parse(), Ok(simd));
        }
        assert_eq!("sse9".parse::<Simd>(), Err(UnetError::UnknownSimd("sse9".to_owned())));
        assert!(Simd::best().is_available());
    }

    #[test]
    fn a_recipe_can_tell_devices_apart() {
        let own = Compute::new(DeviceName::Flex, Some(Simd::Portable)).expect("everywhere");
        assert_eq!(own.to_string(), "flex/portable");
        assert_eq!(Compute::plain(DeviceName::Flex).expect("everywhere").to_string(), "flex");
    }
}
