//! Which device and which instruction set does the work.
//!
//! The processor does it with kernels of ours. On every other device burn's own operations do, so that they agree with it but for
//! rounding: `ndarray` is a second witness, `wgpu` and `cuda` are GPUs. burn chooses its operations there by shape and not, as
//! it could, by the times they take, so a GPU gives the same bits again, and another GPU or driver may give others.

use std::fmt;
use std::str::FromStr;
#[cfg(any(feature = "wgpu", feature = "cuda"))]
use std::sync::OnceLock;

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
    /// A GPU, through Vulkan, Metal or DirectX (a build with `--features wgpu`).
    Wgpu,
    /// A GPU of NVIDIA, through CUDA (a build with `--features cuda`).
    Cuda,
}

impl DeviceName {
    /// Every device, also those that this build does not have.
    pub const ALL: [Self; 4] = [Self::Flex, Self::Ndarray, Self::Wgpu, Self::Cuda];

    /// Tells whether it is a GPU.
    #[must_use]
    pub const fn is_gpu(self) -> bool {
        matches!(self, Self::Wgpu | Self::Cuda)
    }

    /// Returns the name that settings and recipes have for it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Flex => "flex",
            Self::Ndarray => "ndarray",
            Self::Wgpu => "wgpu",
            Self::Cuda => "cuda",
        }
    }
}

impl fmt::Display for DeviceName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// An instruction set that the kernels are written for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
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
    opened: Opened,
    kernels: Option<Simd>,
}

/// A device that is open, and if it is a GPU what tells it from others.
#[derive(Debug, Clone)]
struct Opened {
    device: Device,
    gpu: Option<String>,
}

impl From<Device> for Opened {
    fn from(device: Device) -> Self {
        Self { device, gpu: None }
    }
}

impl Compute {
    /// Opens a device; on `flex` our kernels run with the instruction set `simd`, by default the best there is.
    ///
    /// # Errors
    /// [`UnetError`] if this build has no such device, this machine no GPU for it or this processor no such instruction set.
    pub fn new(name: DeviceName, simd: Option<Simd>) -> Result<Self, UnetError> {
        let simd = simd.unwrap_or_else(Simd::best);
        if !simd.is_available() {
            return Err(UnetError::MissingSimd(simd.name()));
        }
        let kernels = (name == DeviceName::Flex).then_some(simd);
        Ok(Self { name, opened: open(name)?, kernels })
    }

    /// Opens a device without our kernels: every operation is one of burn's.
    ///
    /// # Errors
    /// [`UnetError`] if this build has no such device or this machine no GPU for it.
    pub fn plain(name: DeviceName) -> Result<Self, UnetError> {
        Ok(Self { name, opened: open(name)?, kernels: None })
    }

    /// Returns the device, without automatic differentiation.
    #[must_use]
    pub const fn device(&self) -> &Device {
        &self.opened.device
    }

    /// Returns the instruction set of our kernels, or `None` where burn's own operations do all.
    #[must_use]
    pub const fn kernels(&self) -> Option<Simd> {
        self.kernels
    }
}

/// Writes what the bits of a result depend on, as in `flex/avx512`, with the GPU's name: it belongs into recipes.
impl fmt::Display for Compute {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.name)?;
        if let Some(gpu) = &self.opened.gpu {
            write!(f, "/{gpu}")?;
        }
        self.kernels.map_or(Ok(()), |simd| write!(f, "/{simd}"))
    }
}

fn open(name: DeviceName) -> Result<Opened, UnetError> {
    match name {
        DeviceName::Flex => Ok(Device::flex().into()),
        #[cfg(feature = "ndarray")]
        DeviceName::Ndarray => {
            #[expect(deprecated, reason = "kept to hold the first device against")]
            let device = Device::ndarray();
            Ok(device.into())
        }
        #[cfg(feature = "wgpu")]
        DeviceName::Wgpu => {
            // burn opens it once, for as long as the process lives, and refuses to do so again.
            static GPU: OnceLock<Result<Opened, UnetError>> = OnceLock::new();
            GPU.get_or_init(open_wgpu).clone()
        }
        #[cfg(feature = "cuda")]
        DeviceName::Cuda => {
            static GPU: OnceLock<Result<Opened, UnetError>> = OnceLock::new();
            GPU.get_or_init(open_cuda).clone()
        }
        #[cfg(not(all(feature = "ndarray", feature = "wgpu", feature = "cuda")))]
        name => Err(UnetError::MissingDevice(name.name())),
    }
}

/// Opens the GPU that wgpu prefers: a fast one, and where there is none a driver that computes on the processor.
#[cfg(feature = "wgpu")]
fn open_wgpu() -> Result<Opened, UnetError> {
    use burn::tensor::wgpu::WgpuInitError;

    let opened = Device::wgpu_options().init_with_setup().map_err(|error| {
        let reason = match error {
            WgpuInitError::AdapterUnavailable { message, .. } => message,
            error => error.to_string(),
        };
        UnetError::MissingGpu { device: DeviceName::Wgpu.name(), reason }
    });
    let (device, setup) = opened?;
    // The driver compiles what the GPU runs.
    let adapter = setup.adapter.get_info();
    let parts = [&adapter.backend.to_string(), &adapter.name, &adapter.driver_info];
    let named: Vec<&str> = parts.into_iter().map(|part| part.trim()).filter(|part| !part.is_empty()).collect();
    Ok(Opened { device, gpu: Some(named.join("/")) })
}

/// Opens the first GPU that NVIDIA's driver names.
#[cfg(feature = "cuda")]
fn open_cuda() -> Result<Opened, UnetError> {
    use burn::tensor::DeviceType;

    // Opening one would panic where there is none.
    if Device::enumerate(DeviceType::Cuda).is_empty() {
        let reason = "there is no driver of NVIDIA, or it names none".to_owned();
        return Err(UnetError::MissingGpu { device: DeviceName::Cuda.name(), reason });
    }
    let device = Device::cuda(0);
    let gpu = device.identity().map(|identity| identity.name);
    Ok(Opened { device, gpu })
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
        let named = |gpu: &str| Compute {
            name: DeviceName::Wgpu,
            opened: Opened { gpu: Some(gpu.to_owned()), ..Device::flex().into() },
            kernels: None,
        };
        assert_eq!(named("vulkan/A/1.0").to_string(), "wgpu/vulkan/A/1.0");
    }

    #[test]
    fn a_device_that_was_not_built_is_named() {
        let here = [
            (DeviceName::Ndarray, cfg!(feature = "ndarray")),
            (DeviceName::Wgpu, cfg!(feature = "wgpu")),
            (DeviceName::Cuda, cfg!(feature = "cuda")),
        ];
        for (name, _) in here.into_iter().filter(|(_, built)| !built) {
            assert_eq!(Compute::new(name, None).err(), Some(UnetError::MissingDevice(name.name())));
        }
    }
}
