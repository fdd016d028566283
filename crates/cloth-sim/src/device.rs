//! Detection by name of the method and of the device: the methods of `cloth-collision` on the CPU, those of `cloth-gpu` on a GPU.

use crate::collision::mesh::Vec3;
use crate::collision::{self, CollisionMesh, Contacts, DetectError, Query};
use crate::scene::nearest;

mod continuous;
mod tuning;
pub(crate) use continuous::Continuous;
pub use tuning::Tuning;

#[cfg(feature = "gpu")]
mod adapters;
#[cfg(feature = "gpu")]
mod gpu_detector;
#[cfg(feature = "gpu")]
mod hardware;
#[cfg(feature = "gpu")]
mod methods;
#[cfg(feature = "gpu")]
mod shared;
#[cfg(feature = "gpu")]
pub use adapters::adapters;
#[cfg(feature = "gpu")]
pub(crate) use gpu_detector::GpuDetector;
#[cfg(feature = "gpu")]
pub use shared::SharedGpu;

#[cfg(not(feature = "gpu"))]
mod absent;
#[cfg(not(feature = "gpu"))]
pub(crate) use absent::GpuDetector;
#[cfg(not(feature = "gpu"))]
pub use absent::{SharedGpu, adapters};

/// Methods that run on the CPU; [`crate::collision::detector`] builds them.
pub const CPU_METHODS: [&str; 3] = ["brute", "bvh", "session"];
/// Methods that run on a GPU.
pub const GPU_METHODS: [&str; 4] = ["grid", "virtual-subdivision", "octree-single", "octree"];
/// The method of `"auto"` on the CPU, and of a GPU's method where there is no GPU.
const CPU_DEFAULT: &str = "bvh";
/// The method of `"auto"` on a GPU.
const GPU_DEFAULT: &str = "virtual-subdivision";
const DEVICES: [&str; 3] = ["cpu", "gpu", "auto"];

/// Where to detect.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Device {
    /// The CPU.
    Cpu,
    /// A GPU, be it a software adapter.
    Gpu,
    /// A GPU that is no software adapter, for `"auto"` and for methods that run on one; else the CPU.
    #[default]
    Auto,
}

impl Device {
    /// The name that [`str::parse`] takes.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
            Self::Gpu => "gpu",
            Self::Auto => "auto",
        }
    }
}

impl std::str::FromStr for Device {
    type Err = DeviceError;

    fn from_str(name: &str) -> Result<Self, DeviceError> {
        match name {
            "cpu" => Ok(Self::Cpu),
            "gpu" => Ok(Self::Gpu),
            "auto" => Ok(Self::Auto),
            _ => Err(unknown("device", name, &DEVICES)),
        }
    }
}

/// An adapter, what it allows, and which devices take it.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Adapter {
    /// Adapter, driver and back end.
    pub name: String,
    /// `"discrete"`, `"integrated"`, `"virtual"`, `"other"` or `"software"`.
    pub kind: &'static str,
    /// Largest array \[B\].
    pub max_binding_bytes: u64,
    /// Memory that the invocations of a workgroup share \[B\].
    pub workgroup_bytes: u32,
    /// Workgroups per dimension of a dispatch.
    pub max_workgroups: u32,
    /// It has subgroup operations.
    pub subgroups: bool,
    /// It measures the seconds of stages.
    pub timestamps: bool,
    /// Why it cannot be used, if it cannot.
    pub problem: Option<String>,
    /// The devices that take it: `"gpu"`, `"auto"`, both or none.
    pub devices: Vec<&'static str>,
}

/// The contacts, who found them, and why not somebody else.
#[derive(Debug)]
pub struct Detected {
    /// The contacts, the same for every method on every device; of a GPU, the counts hold the `bytes` of the method on the device.
    pub contacts: Contacts,
    /// Name of the method.
    pub method: &'static str,
    /// `"cpu"`, or the adapter with its driver.
    pub device: String,
    /// Why the CPU, where a GPU would have been taken.
    pub reason: Option<Reason>,
}

/// Why [`Device::Auto`] took the CPU.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Reason {
    /// There is no GPU: nothing is wrong.
    NoGpu(String),
    /// There is one, and it failed at this call.
    Failed(String),
}

/// Why there are no contacts.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DeviceError {
    /// No method or device has this name.
    #[error("{parameter}: expected {expected}, got \"{got}\"{}", did_you_mean(nearest.as_deref()))]
    Unknown {
        /// `"method"` or `"device"`.
        parameter: &'static str,
        /// The names that exist.
        expected: String,
        /// The name that came.
        got: String,
        /// The name that is near to it.
        nearest: Option<String>,
    },
    /// The method does not run there.
    #[error("method: expected {expected}, got \"{method}\"")]
    WrongDevice {
        /// Name of the method.
        method: &'static str,
        /// Which methods run where.
        expected: String,
    },
    /// The method has no such parameter.
    #[error("{parameter}: expected nothing, as {}, got a value for \"{method}\"", only(owners))]
    OtherMethod {
        /// The parameter.
        parameter: &'static str,
        /// The methods that have it.
        owners: &'static [&'static str],
        /// The method that was asked for.
        method: String,
    },
    /// There is no GPU, or none that opens.
    #[error(
        "device: expected a GPU (a Vulkan, Metal or DX12 adapter; a software adapter will do): {reason}; `clothsim doctor` lists \
         adapters, and the devices \"cpu\" and \"auto\" do without"
    )]
    Unavailable {
        /// What was found instead.
        reason: String,
    },
    /// The GPU gave no answer.
    #[error("device: {device}: {reason}; device \"cpu\" does without it, device \"auto\" when it fails")]
    Failed {
        /// The adapter with its driver.
        device: String,
        /// What it says.
        reason: String,
    },
    /// The query is refused.
    #[error(transparent)]
    Query(#[from] DetectError),
}

fn did_you_mean(nearest: Option<&str>) -> String {
    nearest.map(|name| format!(" (did you mean \"{name}\"?)")).unwrap_or_default()
}

fn quoted(names: &[&str]) -> String {
    names.iter().map(|name| format!("\"{name}\"")).collect::<Vec<_>>().join(", ")
}

/// Which methods alone have a parameter.
pub fn only(owners: &[&str]) -> String {
    let (methods, have) = if owners.len() == 1 { ("method", "has") } else { ("methods", "have") };
    format!("only the {methods} {} {have} it", quoted(owners))
}

fn unknown(parameter: &'static str, got: &str, known: &[&'static str]) -> DeviceError {
    DeviceError::Unknown {
        parameter,
        expected: format!("one of {}", quoted(known)),
        got: got.to_owned(),
        nearest: nearest(got, known.iter().copied()),
    }
}

/// Names of the methods, those of the CPU first, `"auto"` last.
pub(crate) fn method_names() -> Vec<&'static str> {
    CPU_METHODS.into_iter().chain(GPU_METHODS).chain(["auto"]).collect()
}

/// A method by its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Method {
    Auto,
    Cpu(&'static str),
    Gpu(&'static str),
}

impl std::str::FromStr for Method {
    type Err = DeviceError;

    fn from_str(name: &str) -> Result<Self, DeviceError> {
        let find = |names: &[&'static str]| names.iter().copied().find(|&n| n == name);
        if name == "auto" {
            return Ok(Self::Auto);
        }
        if let Some(name) = find(&CPU_METHODS) {
            return Ok(Self::Cpu(name));
        }
        find(&GPU_METHODS).map(Self::Gpu).ok_or_else(|| unknown("method", name, &method_names()))
    }
}

fn wrong_device(method: &'static str, device: &str) -> DeviceError {
    let expected = format!(
        "one that runs on device \"{device}\" ({} run on \"cpu\", {} on \"gpu\")",
        quoted(&CPU_METHODS),
        quoted(&GPU_METHODS)
    );
    DeviceError::WrongDevice { method, expected }
}

/// Detects with one of [`CPU_METHODS`] or [`GPU_METHODS`], or `"auto"`, on the device.
///
/// The GPU is opened at the first call that wants it and kept; one call at a time computes on it. After a failure the next call
/// opens it anew. The last two topologies stay on it, so that calls for the same mesh do not write it again.
///
/// # Errors
/// [`DeviceError`]; with [`Device::Auto`], a GPU that is missing or fails is none: the CPU answers.
pub fn detect(
    mesh: &CollisionMesh,
    query: &Query<'_>,
    method: &str,
    tuning: &Tuning,
    device: Device,
    pool: &rayon::ThreadPool,
) -> Result<Detected, DeviceError> {
    let kind = method.parse()?;
    tuning.check(method)?;
    let on_cpu = match (kind, device) {
        (Method::Cpu(name), Device::Cpu | Device::Auto) => Some(name),
        (Method::Auto, Device::Cpu) => Some(CPU_DEFAULT),
        (Method::Cpu(name), Device::Gpu) => return Err(wrong_device(name, "gpu")),
        (Method::Gpu(name), Device::Cpu) => return Err(wrong_device(name, "cpu")),
        (Method::Gpu(_) | Method::Auto, Device::Gpu | Device::Auto) => None,
    };
    query.check(mesh)?;
    if let Some(name) = on_cpu {
        return detect_on_cpu(mesh, query, name, None, pool);
    }
    let name = GPU_METHODS.into_iter().find(|&n| n == method).unwrap_or(GPU_DEFAULT);
    SharedGpu::of_process().detect(mesh, query, name, tuning, device, pool)
}

fn detect_on_cpu(
    mesh: &CollisionMesh,
    query: &Query<'_>,
    method: &'static str,
    reason: Option<Reason>,
    pool: &rayon::ThreadPool,
) -> Result<Detected, DeviceError> {
    let x: &[Vec3] = query.x_t0;
    let contacts = collision::detector_in(method, mesh, x, pool)?.detect(mesh, query, pool)?;
    Ok(Detected { contacts, method, device: "cpu".to_owned(), reason })
}
