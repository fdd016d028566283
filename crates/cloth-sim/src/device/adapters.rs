//! The adapters of this machine, and which of them each device takes.

use super::{Adapter, Device};

/// All adapters, best first; loads the drivers of all of them.
///
/// # Errors
/// Why none can be listed.
pub fn adapters() -> Result<Vec<Adapter>, String> {
    let found = crate::gpu::adapters();
    let first_hardware = found.iter().position(|adapter| !adapter.is_software());
    let adapters = found.into_iter().enumerate().map(|(k, adapter)| Adapter {
        devices: [(Device::Gpu, Some(0)), (Device::Auto, first_hardware)]
            .into_iter()
            .filter(|(_, first)| *first == Some(k) && adapter.problem.is_none())
            .map(|(device, _)| device.name())
            .collect(),
        kind: adapter.kind,
        max_binding_bytes: adapter.max_binding_bytes,
        workgroup_bytes: adapter.workgroup_bytes,
        max_workgroups: adapter.max_workgroups,
        subgroups: adapter.has_subgroups,
        timestamps: adapter.has_timestamps,
        problem: adapter.problem,
        name: adapter.description,
    });
    Ok(adapters.collect())
}
