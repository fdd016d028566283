//! Compiled kernels: source text in, pipeline out.

use crate::context::{Gpu, ready};
use crate::error::GpuError;
use crate::limits::shader_prelude;
use std::num::NonZeroU64;
use std::sync::Arc;

/// Bytes that the parameters of any kernel fit into.
pub(crate) const MAX_PARAMS: u64 = 64;

/// One kernel's text: its file, what it includes, and the switches of its `//#if` lines.
#[derive(Debug, Clone)]
pub struct Source {
    /// Name of the entry point and of the file.
    pub name: &'static str,
    /// Texts ahead of the kernel's own, in order.
    pub includes: Vec<&'static str>,
    /// The kernel's own text.
    pub text: &'static str,
    /// Switches that are on.
    pub switches: Vec<&'static str>,
}

impl Source {
    /// A kernel with the shared structs as its only include.
    pub fn new(name: &'static str, text: &'static str) -> Self {
        Self { name, includes: vec![include_str!("../shaders/layout.wgsl")], text, switches: vec![] }
    }

    /// Puts a text ahead of the kernel's own.
    #[must_use]
    pub fn include(mut self, text: &'static str) -> Self {
        self.includes.push(text);
        self
    }

    /// Turns a switch on.
    #[must_use]
    pub fn switch(mut self, name: &'static str, on: bool) -> Self {
        if on {
            self.switches.push(name);
        }
        self
    }

    /// The whole WGSL text. Between `//#if NAME` and `//#end` lines stay only if the switch is on, or off for
    /// `//#if !NAME`.
    pub fn wgsl(&self) -> String {
        let mut out = shader_prelude();
        let mut keep = true;
        for line in self.includes.iter().chain([&self.text]).flat_map(|text| text.lines()) {
            if let Some(name) = line.trim().strip_prefix("//#if ") {
                keep = match name.strip_prefix('!') {
                    Some(name) => !self.switches.contains(&name),
                    None => self.switches.contains(&name),
                };
            } else if line.trim() == "//#end" {
                keep = true;
            } else if keep {
                out.push_str(line);
                out.push('\n');
            }
        }
        out
    }

    fn key(&self) -> String {
        format!("{} {}", self.name, self.switches.join(" "))
    }

    /// The compiled kernel, from the device's cache if it is there.
    pub(crate) fn kernel(&self, gpu: &Gpu) -> Result<Arc<Kernel>, GpuError> {
        gpu.kernel(&self.key(), || Kernel::compile(gpu, self))
    }
}

/// A compiled kernel. Binding 0 holds its parameters, the bindings after it arrays.
#[derive(Debug)]
pub(crate) struct Kernel {
    pub(crate) name: &'static str,
    pub(crate) pipeline: wgpu::ComputePipeline,
    pub(crate) bindings: wgpu::BindGroupLayout,
    pub(crate) arrays: usize,
}

impl Kernel {
    fn compile(gpu: &Gpu, source: &Source) -> Result<Self, GpuError> {
        let wgsl = source.wgsl();
        let access = array_access(&wgsl);
        let scope = gpu.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let entry = |binding: usize, ty, has_dynamic_offset, min_binding_size| wgpu::BindGroupLayoutEntry {
            binding: binding as u32,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset, min_binding_size },
            count: None,
        };
        let mut entries = vec![entry(0, wgpu::BufferBindingType::Uniform, true, NonZeroU64::new(MAX_PARAMS))];
        for (k, &read_only) in access.iter().enumerate() {
            entries.push(entry(k + 1, wgpu::BufferBindingType::Storage { read_only }, false, None));
        }
        let bindings = gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(source.name),
            entries: &entries,
        });
        let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(source.name),
            bind_group_layouts: &[Some(&bindings)],
            immediate_size: 0,
        });
        let descriptor = wgpu::ShaderModuleDescriptor {
            label: Some(source.name),
            source: wgpu::ShaderSource::Wgsl(wgsl.into()),
        };
        let module = if gpu.options.shader_checks {
            gpu.device.create_shader_module(descriptor)
        } else {
            // SAFETY: every loop of the kernels has a bound that its own counter reaches, and every index is compared
            // with the length of its array or comes from a table that the host has checked.
            unsafe {
                gpu.device.create_shader_module_trusted(descriptor, wgpu::ShaderRuntimeChecks::unchecked())
            }
        };
        let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(source.name),
            layout: Some(&layout),
            module: &module,
            entry_point: Some(source.name),
            compilation_options: wgpu::PipelineCompilationOptions {
                // Every kernel writes its workgroup memory before it reads it.
                zero_initialize_workgroup_memory: false,
                ..Default::default()
            },
            cache: None,
        });
        match ready(scope.pop()) {
            Some(None) => Ok(Self { name: source.name, pipeline, bindings, arrays: access.len() }),
            Some(Some(error)) => {
                Err(GpuError::Shader { kernel: source.name.to_owned(), message: error.to_string() })
            }
            None => {
                Err(GpuError::Shader { kernel: source.name.to_owned(), message: "no verdict".to_owned() })
            }
        }
    }
}

/// Whether each array of the text is read only, in the order of the bindings, which is that of the lines.
fn array_access(wgsl: &str) -> Vec<bool> {
    wgsl.lines()
        .filter(|line| line.starts_with("@group(0)") && line.contains("var<storage"))
        .map(|line| !line.contains("read_write"))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn switches_keep_and_drop_lines() {
        let source = Source {
            name: "x",
            includes: vec![],
            text: "a\n//#if ON\nb\n//#end\n//#if !ON\nc\n//#end\nd",
            switches: vec![],
        };
        let tail = |s: &Source| s.wgsl().lines().rev().take(3).map(str::to_owned).collect::<Vec<_>>();
        assert_eq!(tail(&source), ["d", "c", "a"]);
        assert_eq!(tail(&source.switch("ON", true)), ["d", "b", "a"]);
    }

    #[test]
    fn access_is_read_from_the_text() {
        let text = "@group(0) @binding(0) var<uniform> p: P;\n@group(0) @binding(1) var<storage, read> a: A;\n\
            @group(0) @binding(2) var<storage, read_write> b: A;";
        assert_eq!(array_access(text), [true, false]);
    }
}
