//! Who detects in a simulation: chosen once, and again only when a GPU fails.

use super::{CPU_DEFAULT, Device, DeviceError, GPU_DEFAULT, GpuDetector, Method, SharedGpu, wrong_device};
use crate::Vec3;
use crate::collision::{CollisionMesh, Detector, detector};
use crate::report::{Detection, Fallback};

/// The continuous detection of one simulation.
pub(crate) struct Continuous {
    kind: Kind,
    device: Device,
    /// Who it is, for plan and report.
    pub(crate) detection: Detection,
    /// That the GPU that was asked for cannot be had; its step and time are the simulation's to fill in.
    pub(crate) lack: Option<Fallback>,
}

enum Kind {
    /// The hierarchy that the response has for proximities.
    Tree,
    Cpu(Box<dyn Detector>),
    Gpu(Box<GpuDetector>),
}

impl Continuous {
    /// By the name in the scene, `"auto"` among them, and the device.
    ///
    /// # Errors
    /// [`DeviceError::Unknown`], [`DeviceError::WrongDevice`]; with [`Device::Gpu`] [`DeviceError::Unavailable`] and
    /// [`DeviceError::Failed`].
    pub(crate) fn choose(
        name: &str,
        device: Device,
        shared: &'static SharedGpu,
        mesh: &CollisionMesh,
        x: &[Vec3],
    ) -> Result<Self, DeviceError> {
        let by_name = format!("contact.detector = \"{name}\"");
        let by_device = format!("device \"{}\"", device.name());
        let (method, why) = match (name.parse()?, device) {
            (Method::Cpu(name), Device::Cpu | Device::Auto) => {
                return Self::on_cpu(name, device, &by_name, mesh, x);
            }
            (Method::Cpu(name), Device::Gpu) => return Err(wrong_device(name, "gpu")),
            (Method::Gpu(name), Device::Cpu) => return Err(wrong_device(name, "cpu")),
            (Method::Auto, Device::Cpu) => return Self::on_cpu(CPU_DEFAULT, device, &by_device, mesh, x),
            (Method::Auto, Device::Gpu) => (GPU_DEFAULT, by_device.clone()),
            (Method::Auto, Device::Auto) => (GPU_DEFAULT, format!("{by_device}, and there is a GPU")),
            (Method::Gpu(name), Device::Gpu | Device::Auto) => (name, by_name.clone()),
        };
        let (is_asked_for, adapter, reason) = match GpuDetector::new(shared, mesh, method, device) {
            Ok((gpu, description)) => {
                let (detector, device_bytes) = (method.to_owned(), gpu.bytes());
                let detection = Detection { detector, device: description, why, device_bytes };
                return Ok(Self { kind: Kind::Gpu(Box::new(gpu)), device, detection, lack: None });
            }
            Err(DeviceError::Unavailable { reason }) if device == Device::Auto => {
                (name == method, "no GPU".to_owned(), reason)
            }
            Err(DeviceError::Failed { device: adapter, reason }) if device == Device::Auto => {
                (true, adapter, reason)
            }
            Err(error) => return Err(error),
        };
        let why = format!("{by_device}, and {adapter}: {reason}");
        let mut chosen = Self::on_cpu(CPU_DEFAULT, device, &why, mesh, x)?;
        chosen.lack = is_asked_for.then(|| Fallback {
            step: 0,
            time: 0.0,
            detector: method.to_owned(),
            device: adapter,
            reason,
        });
        Ok(chosen)
    }

    /// The hierarchy, where nothing is to be chosen.
    pub(crate) fn tree(why: &str) -> Self {
        let detection = Detection::on_cpu(CPU_DEFAULT, why);
        Self { kind: Kind::Tree, device: Device::Cpu, detection, lack: None }
    }

    fn on_cpu(
        name: &'static str,
        device: Device,
        why: &str,
        mesh: &CollisionMesh,
        x: &[Vec3],
    ) -> Result<Self, DeviceError> {
        let kind = if name == CPU_DEFAULT { Kind::Tree } else { Kind::Cpu(detector(name, mesh, x)?) };
        Ok(Self { kind, device, detection: Detection::on_cpu(name, why), lack: None })
    }

    /// The detector, if it is not the hierarchy that the response has anyway.
    pub(crate) fn other(&mut self) -> Option<&mut dyn Detector> {
        match &mut self.kind {
            Kind::Tree => None,
            Kind::Cpu(detector) => Some(detector.as_mut()),
            Kind::Gpu(detector) => Some(detector.as_mut()),
        }
    }

    /// Memory on the device, as far as it was needed so far \[B\].
    pub(crate) fn device_bytes(&self) -> u64 {
        match &self.kind {
            Kind::Gpu(detector) => detector.bytes(),
            _ => 0,
        }
    }

    /// Goes on without the GPU that gave no answer in the step of that number, which began at `time` \[s\].
    ///
    /// # Errors
    /// [`DeviceError::Failed`] unless the device was [`Device::Auto`].
    pub(crate) fn fall_back(&mut self, step: u64, time: f64, reason: &str) -> Result<Fallback, DeviceError> {
        let Detection { detector, device, .. } = self.detection.clone();
        let reason = reason.to_owned();
        if self.device != Device::Auto {
            return Err(DeviceError::Failed { device, reason });
        }
        let fallback = Fallback { step, time, detector, device, reason };
        let why = format!("since step {step}, as {} gave no answer: {}", fallback.device, fallback.reason);
        (self.kind, self.detection) = (Kind::Tree, Detection::on_cpu(CPU_DEFAULT, &why));
        Ok(fallback)
    }
}
