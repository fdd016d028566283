//! Who detects in a simulation: chosen once, and again when a GPU fails; `"auto"` goes on measuring.

use super::auto::Auto;
use super::{CPU_DEFAULT, Device, DeviceError, GPU_DEFAULT, GpuDetector, Method, SharedGpu, wrong_device};
use crate::Vec3;
use crate::collision::{CollisionMesh, Detector, detector};
use crate::report::{Chosen, Detection, Fallback};

/// The continuous detection of one simulation.
pub(crate) struct Continuous {
    seat: Seat,
    device: Device,
    /// With `"auto"`, where there is a choice.
    auto: Option<Box<Auto>>,
    /// Who it is, for plan and report.
    pub(crate) detection: Detection,
    /// That the GPU that was asked for cannot be had; its step and time are the simulation's to fill in.
    pub(crate) lack: Option<Fallback>,
}

/// A method at work, and where it runs.
pub(super) struct Seat {
    pub(super) kind: Kind,
    /// `"cpu"`, or the GPU with its driver.
    pub(super) device: String,
}

pub(super) enum Kind {
    /// The hierarchy that the response has for proximities.
    Tree,
    Cpu(Box<dyn Detector>),
    Gpu(Box<GpuDetector>),
}

impl Kind {
    /// Memory beside the hierarchy that is there anyway \[B\].
    pub(super) fn bytes(&self) -> usize {
        match self {
            Self::Cpu(detector) => detector.host_bytes(),
            _ => 0,
        }
    }

    /// Memory on the device, as far as it was needed so far \[B\].
    pub(super) fn device_bytes(&self) -> u64 {
        match self {
            Self::Gpu(detector) => detector.bytes(),
            _ => 0,
        }
    }
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
        let is_auto = name == "auto";
        let by_name = format!("contact.detector = \"{name}\"");
        let by_device = format!("device \"{}\"", device.name());
        let (method, why) = match (name.parse()?, device) {
            (Method::Cpu(name), Device::Cpu | Device::Auto) => {
                return Self::on_cpu(name, device, &by_name, mesh, x);
            }
            (Method::Cpu(name), Device::Gpu) => return Err(wrong_device(name, "gpu")),
            (Method::Gpu(name), Device::Cpu) => return Err(wrong_device(name, "cpu")),
            (Method::Auto, Device::Cpu) => {
                let chosen = Self::on_cpu(CPU_DEFAULT, device, &by_device, mesh, x)?;
                return Ok(chosen.measured(CPU_DEFAULT, shared, false));
            }
            (Method::Auto, Device::Gpu) => (GPU_DEFAULT, by_device.clone()),
            (Method::Auto, Device::Auto) => (GPU_DEFAULT, format!("{by_device}, and there is a GPU")),
            (Method::Gpu(name), Device::Gpu | Device::Auto) => (name, by_name.clone()),
        };
        let (is_asked_for, adapter, reason) = match GpuDetector::new(shared, mesh, method, device) {
            Ok((gpu, description)) => {
                let (detector, device_bytes) = (method.to_owned(), gpu.bytes());
                let seat = Seat { kind: Kind::Gpu(Box::new(gpu)), device: description.clone() };
                let detection = Detection { detector, device: description, why, device_bytes };
                let chosen = Self { seat, device, auto: None, detection, lack: None };
                // A software adapter was asked for by name of the device; it is no candidate among others.
                let has_choice = is_auto && (device == Device::Auto || shared.is_hardware());
                return Ok(if has_choice { chosen.measured(method, shared, true) } else { chosen });
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
        if is_auto {
            chosen = chosen.measured(CPU_DEFAULT, shared, false);
        }
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
        let seat = Seat { kind: Kind::Tree, device: "cpu".to_owned() };
        Self { seat, device: Device::Cpu, auto: None, detection, lack: None }
    }

    /// Number of methods that are kept beside the one at work.
    #[cfg(test)]
    pub(crate) fn waiting(&self) -> usize {
        self.auto.as_ref().map_or(0, |auto| auto.waiting())
    }

    /// Lets methods take so many seconds, whatever they do.
    #[cfg(test)]
    pub(crate) fn plant(&mut self, seconds: fn(&str) -> f64) {
        if let Some(auto) = &mut self.auto {
            auto.planted = Some(seconds);
        }
    }

    /// With other methods to be measured against the one at work.
    fn measured(mut self, first: &'static str, shared: &'static SharedGpu, on_gpu: bool) -> Self {
        let auto = Auto::new(first, self.device, shared, on_gpu);
        self.detection.why.push_str(&auto.outlook());
        self.auto = Some(Box::new(auto));
        self
    }

    /// After an accepted step number `step` to `time` \[s\], in which the continuous detection took so many seconds, and all so
    /// many: the method that was chosen, if one was.
    pub(crate) fn observe(
        &mut self,
        seconds: [f64; 2],
        mesh: &CollisionMesh,
        x: &[Vec3],
        step: u64,
        time: f64,
    ) -> Option<Chosen> {
        let chosen = self.auto.as_mut()?.observe(&mut self.seat, seconds, mesh, x)?;
        let chosen = Chosen { step, time, ..chosen };
        self.detection.detector.clone_from(&chosen.detector);
        self.detection.device.clone_from(&chosen.device);
        self.detection.why.clone_from(&chosen.why);
        Some(chosen)
    }

    fn on_cpu(
        name: &'static str,
        device: Device,
        why: &str,
        mesh: &CollisionMesh,
        x: &[Vec3],
    ) -> Result<Self, DeviceError> {
        let kind = if name == CPU_DEFAULT { Kind::Tree } else { Kind::Cpu(detector(name, mesh, x)?) };
        let seat = Seat { kind, device: "cpu".to_owned() };
        Ok(Self { seat, device, auto: None, detection: Detection::on_cpu(name, why), lack: None })
    }

    /// The detector, if it is not the hierarchy that the response has anyway.
    pub(crate) fn other(&mut self) -> Option<&mut dyn Detector> {
        match &mut self.seat.kind {
            Kind::Tree => None,
            Kind::Cpu(detector) => Some(detector.as_mut()),
            Kind::Gpu(detector) => Some(detector.as_mut()),
        }
    }

    /// Memory beside the hierarchy that is there anyway, of all that are built \[B\].
    pub(crate) fn bytes(&self) -> usize {
        self.seat.kind.bytes() + self.auto.as_ref().map_or(0, |auto| auto.waiting_bytes().0)
    }

    /// Memory on the device, as far as it was needed so far \[B\].
    pub(crate) fn device_bytes(&self) -> u64 {
        self.seat.kind.device_bytes() + self.auto.as_ref().map_or(0, |auto| auto.waiting_bytes().1)
    }

    /// Goes on without the GPU that gave no answer in the step of that number, which began at `time` \[s\].
    ///
    /// # Errors
    /// [`DeviceError::Failed`] unless the device was [`Device::Auto`].
    pub(crate) fn fall_back(&mut self, step: u64, time: f64, reason: &str) -> Result<Fallback, DeviceError> {
        let Kind::Gpu(at_work) = &self.seat.kind else {
            return Err(DeviceError::Failed { device: self.seat.device.clone(), reason: reason.to_owned() });
        };
        let (detector, device) = (at_work.name().to_owned(), self.seat.device.clone());
        let reason = reason.to_owned();
        if self.device != Device::Auto {
            return Err(DeviceError::Failed { device, reason });
        }
        let fallback = Fallback { step, time, detector, device, reason };
        let why = format!("since step {step}, as {} gave no answer: {}", fallback.device, fallback.reason);
        self.seat = Seat { kind: Kind::Tree, device: "cpu".to_owned() };
        self.detection = Detection::on_cpu(CPU_DEFAULT, &why);
        if let Some(auto) = &mut self.auto {
            auto.lose_gpu();
        }
        Ok(fallback)
    }
}
