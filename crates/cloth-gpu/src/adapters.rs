//! The adapters of this machine: which there are, what they allow, which one is taken.

use crate::context::ready;
use crate::error::GpuError;
use crate::limits::WORKGROUP;

/// Which adapters will do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum AdapterChoice {
    /// A GPU if there is one (discrete before integrated before virtual), else a software adapter.
    #[default]
    Any,
    /// GPUs only.
    Hardware,
    /// Software adapters only.
    Software,
}

/// One adapter with the limits that decide what it can do.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Adapter {
    /// Adapter, driver and back end, as [`crate::Gpu::description`] has them.
    pub description: String,
    /// `"discrete"`, `"integrated"`, `"virtual"`, `"other"` or `"software"`.
    pub kind: &'static str,
    /// Largest array \[B\]: larger ones are taken in portions or refused.
    pub max_binding_bytes: u64,
    /// Memory that the invocations of a workgroup share \[B\].
    pub workgroup_bytes: u32,
    /// Workgroups per dimension of a dispatch.
    pub max_workgroups: u32,
    /// It has subgroup operations.
    pub has_subgroups: bool,
    /// It measures the seconds of stages.
    pub has_timestamps: bool,
    /// Why it cannot be used, if it cannot.
    pub problem: Option<String>,
}

impl Adapter {
    /// Whether it is a processor that plays a GPU.
    pub fn is_software(&self) -> bool {
        self.kind == KINDS[4].1
    }

    fn new(adapter: &wgpu::Adapter) -> Self {
        let (info, limits, features) = (adapter.get_info(), adapter.limits(), adapter.features());
        Self {
            description: description(&info),
            kind: KINDS[rank_of(&info) as usize].1,
            max_binding_bytes: limits.max_storage_buffer_binding_size.min(limits.max_buffer_size),
            workgroup_bytes: limits.max_compute_workgroup_storage_size,
            max_workgroups: limits.max_compute_workgroups_per_dimension,
            has_subgroups: features.contains(wgpu::Features::SUBGROUP),
            has_timestamps: features.contains(wgpu::Features::TIMESTAMP_QUERY),
            problem: check_limits(&limits).err().map(|error| error.to_string()),
        }
    }
}

/// All adapters, in the order in which they are taken. Loads the drivers of all of them.
pub fn adapters() -> Vec<Adapter> {
    enumerate().iter().map(Adapter::new).collect()
}

/// The best adapter of the wanted kind.
pub(crate) fn best(choice: AdapterChoice) -> Result<wgpu::Adapter, GpuError> {
    let all = enumerate();
    let found = all.iter().map(|a| a.get_info().name).collect::<Vec<_>>().join(", ");
    all.into_iter().find(|a| is_wanted(a, choice)).ok_or(GpuError::NoAdapter {
        wanted: match choice {
            AdapterChoice::Any => "any",
            AdapterChoice::Hardware => "a GPU",
            AdapterChoice::Software => "a software adapter",
        },
        found: if found.is_empty() { "none".to_owned() } else { found },
    })
}

/// Adapter, driver and back end.
pub(crate) fn description(info: &wgpu::AdapterInfo) -> String {
    let wgpu::AdapterInfo { name, driver, driver_info, backend, .. } = info;
    format!("{name} ({driver} {driver_info}, {backend})")
}

/// What every kernel takes for granted.
pub(crate) fn check_limits(limits: &wgpu::Limits) -> Result<(), GpuError> {
    let needs = [
        ("max_compute_invocations_per_workgroup", WORKGROUP, limits.max_compute_invocations_per_workgroup),
        ("max_compute_workgroup_size_x", WORKGROUP, limits.max_compute_workgroup_size_x),
        ("max_compute_workgroup_storage_size", 16_384, limits.max_compute_workgroup_storage_size),
        ("max_storage_buffers_per_shader_stage", 8, limits.max_storage_buffers_per_shader_stage),
        ("max_compute_workgroups_per_dimension", 65_535, limits.max_compute_workgroups_per_dimension),
    ];
    for (what, needed, available) in needs {
        if available < needed {
            return Err(GpuError::Limit { what, needed: needed.into(), available: available.into() });
        }
    }
    Ok(())
}

/// The kinds, best first.
const KINDS: [(wgpu::DeviceType, &str); 5] = [
    (wgpu::DeviceType::DiscreteGpu, "discrete"),
    (wgpu::DeviceType::IntegratedGpu, "integrated"),
    (wgpu::DeviceType::VirtualGpu, "virtual"),
    (wgpu::DeviceType::Other, "other"),
    (wgpu::DeviceType::Cpu, "software"),
];

fn rank_of(info: &wgpu::AdapterInfo) -> u32 {
    KINDS.iter().position(|(kind, _)| *kind == info.device_type).unwrap_or(3) as u32
}

fn is_wanted(adapter: &wgpu::Adapter, choice: AdapterChoice) -> bool {
    let is_software = adapter.get_info().device_type == wgpu::DeviceType::Cpu;
    match choice {
        AdapterChoice::Any => true,
        AdapterChoice::Hardware => !is_software,
        AdapterChoice::Software => is_software,
    }
}

/// All adapters, best first.
fn enumerate() -> Vec<wgpu::Adapter> {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12;
    let backends = descriptor.backends;
    let instance = wgpu::Instance::new(descriptor);
    let mut adapters = ready(instance.enumerate_adapters(backends)).unwrap_or_default();
    adapters.sort_by_key(|adapter| rank_of(&adapter.get_info()));
    adapters
}
