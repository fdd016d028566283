//! In place of [`SharedGpu`] and what is built on it, in a build without GPU methods.

use super::{CPU_DEFAULT, Detected, Device, DeviceError, Reason, Tuning, detect_on_cpu};
use crate::collision::{CollisionMesh, Contacts, DetectError, Detector, Query};
use std::convert::Infallible;

const WHY: &str = "this build has no GPU methods (cargo feature \"gpu\")";

/// No GPU.
#[derive(Debug)]
pub struct SharedGpu;

static OF_PROCESS: SharedGpu = SharedGpu;

impl SharedGpu {
    /// The one of the process.
    pub fn of_process() -> &'static Self {
        &OF_PROCESS
    }

    /// Nothing changes.
    pub fn set_takes_software(&self, _takes: bool) {}

    /// None is open.
    pub fn is_hardware(&self) -> bool {
        false
    }

    /// None is open.
    pub fn lose(&self) -> bool {
        false
    }

    /// For [`Device::Auto`] the CPU's answer.
    ///
    /// # Errors
    /// [`DeviceError::Unavailable`] for other devices; what the query is refused for.
    pub fn detect(
        &self,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        method: &'static str,
        _tuning: &Tuning,
        device: Device,
        pool: &rayon::ThreadPool,
    ) -> Result<Detected, DeviceError> {
        if device != Device::Auto {
            return Err(unavailable());
        }
        let reason = Reason::NoGpu(format!("\"{method}\": {WHY}"));
        detect_on_cpu(mesh, query, CPU_DEFAULT, Some(reason), pool)
    }
}

fn unavailable() -> DeviceError {
    DeviceError::Unavailable { reason: WHY.to_owned() }
}

/// There is none.
#[derive(Debug)]
pub(crate) struct GpuDetector(Infallible);

impl GpuDetector {
    pub(crate) fn new(
        _shared: &'static SharedGpu,
        _mesh: &CollisionMesh,
        _method: &'static str,
        _device: Device,
    ) -> Result<(Self, String), DeviceError> {
        Err(unavailable())
    }

    pub(crate) fn bytes(&self) -> u64 {
        match self.0 {}
    }
}

impl Detector for GpuDetector {
    fn name(&self) -> &'static str {
        match self.0 {}
    }

    fn detect(
        &mut self,
        _mesh: &CollisionMesh,
        _query: &Query<'_>,
        _pool: &rayon::ThreadPool,
    ) -> Result<Contacts, DetectError> {
        match self.0 {}
    }
}

/// Why no adapter can be listed.
///
/// # Errors
/// Always.
pub fn adapters() -> Result<Vec<super::Adapter>, String> {
    Err(WHY.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collision::Mode;
    use crate::{Assets, Scene, SimError, Simulation, SimulationOptions, Vec3};

    const SCENE: &str = r#"
duration = 0.1
[contact]
detector = "grid"
[[cloth]]
name = "cloth"
mesh = { generator = "grid", width = 1.0, height = 1.0, nx = 4, ny = 4 }
material = "cotton"
"#;

    #[test]
    fn detection_says_what_the_build_lacks() {
        let x = [Vec3::zeros(), Vec3::x(), Vec3::y()];
        let mesh = CollisionMesh::single(3, &[[0, 1, 2]]).unwrap();
        let query = Query { x_t0: &x, x_t1: &x, thickness: 0.1, mode: Mode::Discrete, active: None };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let detect =
            |method, device| super::super::detect(&mesh, &query, method, &Tuning::default(), device, &pool);
        let error = detect("grid", Device::Gpu).unwrap_err().to_string();
        assert!(error.contains(WHY), "{error}");
        let found = detect("grid", Device::Auto).unwrap();
        assert_eq!((found.method, found.device.as_str()), ("bvh", "cpu"));
        assert!(matches!(found.reason, Some(Reason::NoGpu(why)) if why.contains(WHY)));
        assert!(detect("gird", Device::Auto).unwrap_err().to_string().contains("did you mean \"grid\""));
    }

    #[test]
    fn simulations_say_what_the_build_lacks() {
        let scene = Scene::parse_toml(SCENE, "test.toml").unwrap();
        let build = |device| {
            let options = SimulationOptions { threads: Some(1), device, ..SimulationOptions::default() };
            Simulation::new(&scene, Assets::default(), options)
        };
        let Err(SimError::Device(error)) = build(Device::Gpu) else { panic!("refused") };
        assert_eq!(error, unavailable());
        let sim = build(Device::Auto).unwrap();
        let detection = sim.report().detection.clone().unwrap();
        assert_eq!((detection.detector.as_str(), detection.device.as_str()), ("bvh", "cpu"));
        assert!(detection.why.contains(WHY), "{}", detection.why);
    }
}
