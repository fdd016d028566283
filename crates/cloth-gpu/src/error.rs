//! Why the device gives no answer.

use cloth_collision::DetectError;

/// A failure of the device, of its limits or of a query, with what was needed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GpuError {
    /// No adapter of the wanted kind: install a Vulkan, Metal or DX12 driver (Mesa's software Vulkan adapter will do).
    #[error("gpu: expected an adapter ({wanted}), found {found}")]
    NoAdapter {
        /// The kind that was asked for.
        wanted: &'static str,
        /// The adapters there are.
        found: String,
    },
    /// The adapter gives no device.
    #[error("gpu: adapter \"{adapter}\" gives no device: {reason}")]
    NoDevice {
        /// Name of the adapter.
        adapter: String,
        /// What the driver says.
        reason: String,
    },
    /// The device allows less than every kernel needs.
    #[error("gpu: expected {what} ≥ {needed}, the device allows {available}")]
    Limit {
        /// Name of the limit.
        what: &'static str,
        /// What the kernels need.
        needed: u64,
        /// What the device allows.
        available: u64,
    },
    /// A kernel was refused: a defect of this crate or of the driver.
    #[error("gpu: kernel {kernel}: {message}")]
    Shader {
        /// Name of the kernel.
        kernel: String,
        /// The diagnostics.
        message: String,
    },
    /// An array is longer than one binding of the device holds.
    #[error("gpu: {what}: needs {needed} bytes, the device binds {limit}")]
    TooLarge {
        /// Name of the array.
        what: String,
        /// Its size [B].
        needed: u64,
        /// Largest binding [B].
        limit: u64,
    },
    /// A dispatch has more workgroups than the device takes, folded to two dimensions.
    #[error("gpu: kernel {kernel}: {needed} workgroups, the device takes {limit}")]
    TooManyWorkgroups {
        /// Name of the kernel.
        kernel: &'static str,
        /// Workgroups.
        needed: u64,
        /// The most there may be.
        limit: u64,
    },
    /// The device has no memory left.
    #[error("gpu: {what}: no memory for {bytes} bytes")]
    OutOfMemory {
        /// Name of the array.
        what: String,
        /// Its size [B].
        bytes: u64,
    },
    /// The device did not finish in time: it hangs, or the wait in [`crate::GpuOptions::timeout`] is too short.
    #[error("gpu: no answer within {seconds} s")]
    Timeout {
        /// The wait [s].
        seconds: f64,
    },
    /// The device was lost (driver reset, removal): build a new [`crate::Gpu`].
    #[error("gpu: device lost: {reason}")]
    Lost {
        /// What the driver says.
        reason: String,
    },
    /// The device refused a command: a defect of this crate or of the driver.
    #[error("gpu: {message}")]
    Device {
        /// What it says.
        message: String,
    },
    /// The query was refused before it reached the device.
    #[error(transparent)]
    Query(#[from] DetectError),
}
