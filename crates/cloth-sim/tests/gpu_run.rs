//! Whole simulations with continuous detection on a GPU: the CPU's bits, and what happens when the GPU fails.
#![cfg(feature = "gpu")]
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]
#![allow(clippy::print_stderr, reason = "a skipped test says so")]
#![allow(clippy::result_large_err, reason = "an error ends the test: its size costs nothing")]

mod common;

use cloth_sim::device::{Device, DeviceError, GPU_METHODS, SharedGpu};
use cloth_sim::gpu::GpuOptions;
use cloth_sim::{Assets, SimError, Simulation, SimulationOptions};
use common::{bits, drape, scene};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

const STEPS: usize = 24;
/// The step during which the GPU is lost.
const LOST: usize = 6;

static SHARED: SharedGpu = SharedGpu::new(true);
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

/// The shared GPU, used by no other test meanwhile; None, with the reason on the standard error stream, where there is none. With
/// `CLOTHSIM_REQUIRE_GPU=1` that is a failure.
fn gpu() -> Option<MutexGuard<'static, ()>> {
    let turn = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    match build("auto", Device::Gpu, &SHARED) {
        Err(SimError::Device(DeviceError::Unavailable { reason })) => {
            let required = std::env::var("CLOTHSIM_REQUIRE_GPU").is_ok_and(|v| v == "1");
            assert!(!required, "CLOTHSIM_REQUIRE_GPU=1, but {reason}");
            eprintln!("skipped: {reason}");
            None
        }
        Err(error) => panic!("{error}"),
        Ok(_) => Some(turn),
    }
}

/// A tablecloth thrown at a ball, 5 cm in a step: hundreds of collisions within the steps of these tests.
fn build(detector: &str, device: Device, gpu: &'static SharedGpu) -> Result<Simulation, SimError> {
    build_with("thickness = 0.002", detector, device, gpu)
}

fn build_with(
    thickness: &str,
    detector: &str,
    device: Device,
    gpu: &'static SharedGpu,
) -> Result<Simulation, SimError> {
    let text = drape(11)
        .replace("thickness = 0.005", thickness)
        .replace("[contact]", &format!("[contact]\ndetector = \"{detector}\""))
        .replace("[[collider]]", "velocity = [0.0, -10.0, 0.0]\n[[collider]]");
    let options = SimulationOptions { threads: Some(2), device, gpu, ..SimulationOptions::default() };
    Simulation::new(&scene(&text), Assets::default(), options)
}

fn run(mut sim: Simulation) -> Simulation {
    while (sim.step_count() as usize) < STEPS {
        sim.step().unwrap();
        assert_eq!(sim.intersections().unwrap(), Vec::<[u32; 2]>::new());
    }
    sim
}

fn on_cpu() -> Simulation {
    run(build("bvh", Device::Cpu, &SHARED).unwrap())
}

fn detection(sim: &Simulation) -> (String, String) {
    let detection = sim.report().detection.clone().unwrap();
    (detection.detector, detection.device)
}

#[test]
fn every_method_gives_the_bits_of_the_cpu() {
    let Some(_turn) = gpu() else { return };
    let expected = on_cpu();
    let contacts = expected.report().steps.iter().filter_map(|s| s.contact.as_ref());
    let [mut collisions, mut again] = [0; 2];
    for contact in contacts {
        collisions += contact.collisions;
        again += contact.passes - 1;
    }
    assert!(collisions > 50 && again > 5, "{collisions} collisions, {again} further passes");
    for method in GPU_METHODS {
        let sim = run(build(method, Device::Gpu, &SHARED).unwrap());
        assert_eq!(bits(&sim), bits(&expected), "{method}");
        let found = sim.report().detection.clone().unwrap();
        assert_eq!(found.detector, method);
        assert_eq!(found.device, SHARED.gpu().unwrap().description());
        assert!(found.device_bytes > 0);
        assert_eq!(sim.report().fallbacks, []);
    }
    // Planted fault: contacts found a thousandth of a millimetre off, and the comparison sees it.
    let off = run(build_with("thickness = 0.002001", "bvh", Device::Cpu, &SHARED).unwrap());
    assert_ne!(bits(&off), bits(&expected));
}

#[test]
fn a_gpu_that_is_lost_in_mid_run_is_done_without_under_auto() {
    let Some(_turn) = gpu() else { return };
    let mut sim = build("grid", Device::Auto, &SHARED).unwrap();
    let device = detection(&sim).1;
    assert_ne!(device, "cpu");
    for _ in 1..LOST {
        sim.step().unwrap();
    }
    assert!(SHARED.lose());
    let sim = run(sim);
    assert_eq!(bits(&sim), bits(&on_cpu()));
    let [fallback] = &sim.report().fallbacks[..] else { panic!("{:?}", sim.report().fallbacks) };
    assert_eq!((fallback.step, fallback.detector.as_str()), (LOST as u64, "grid"));
    assert_eq!((fallback.time, &fallback.device), (sim.report().steps[LOST - 2].time, &device));
    assert!(fallback.reason.contains("lost"), "{fallback}");
    assert_eq!(detection(&sim), ("bvh".to_owned(), "cpu".to_owned()));
    assert_eq!(sim.report().steps[LOST - 1].substeps, 1, "the same step, not smaller ones");

    // The note stays through a checkpoint, and the run goes on where it is resumed.
    let options = SimulationOptions { device: Device::Gpu, gpu: &SHARED, ..SimulationOptions::default() };
    let resumed = Simulation::resume_on(&sim.checkpoint(), options).unwrap();
    assert_eq!(resumed.report().fallbacks, sim.report().fallbacks);
    assert_eq!(detection(&resumed), ("grid".to_owned(), device));
}

#[test]
fn a_gpu_that_is_lost_in_mid_run_is_an_error_that_leaves_no_trace_where_it_was_asked_for() {
    let Some(_turn) = gpu() else { return };
    let mut sim = build("auto", Device::Gpu, &SHARED).unwrap();
    assert_eq!(detection(&sim).0, "virtual-subdivision");
    for _ in 1..LOST {
        sim.step().unwrap();
    }
    let before = (bits(&sim), sim.contact_forces(), sim.report().steps.len());
    assert!(SHARED.lose());
    let error = sim.step().unwrap_err();
    let SimError::Device(DeviceError::Failed { device, reason }) = &error else { panic!("{error}") };
    assert_eq!(*device, detection(&sim).1);
    assert!(reason.contains("lost") && error.to_string().contains("device \"auto\""), "{error}");
    assert!(before == (bits(&sim), sim.contact_forces(), sim.report().steps.len()));
    // The next step opens it anew.
    assert_eq!(bits(&run(sim)), bits(&on_cpu()));
}

#[test]
fn a_checkpoint_goes_on_on_another_device_to_the_same_bits() {
    let Some(_turn) = gpu() else { return };
    let expected = bits(&on_cpu());
    let mut devices = [Device::Gpu, Device::Cpu];
    for _ in 0..2 {
        let mut sim = build("auto", devices[0], &SHARED).unwrap();
        for _ in 0..LOST {
            sim.step().unwrap();
        }
        let options = SimulationOptions { device: devices[1], gpu: &SHARED, ..SimulationOptions::default() };
        let resumed = Simulation::resume_on(&sim.checkpoint(), options).unwrap();
        assert_ne!(detection(&sim).1, detection(&resumed).1);
        assert_eq!(bits(&run(resumed)), expected);
        devices.reverse();
    }
}

/// A GPU of its own, opened with other options.
fn gpu_with(options: GpuOptions) -> &'static SharedGpu {
    Box::leak(Box::new(SharedGpu::with_options(true, options)))
}

#[test]
fn a_gpu_that_hangs_is_given_up_after_the_timeout() {
    let Some(_turn) = gpu() else { return };
    let hangs = || gpu_with(GpuOptions { timeout: Duration::from_nanos(1), ..GpuOptions::default() });
    let mut sim = build("grid", Device::Gpu, hangs()).unwrap();
    let error = sim.step().unwrap_err().to_string();
    assert!(error.contains("no answer within"), "{error}");
    assert_eq!(sim.step_count(), 0);

    let sim = run(build("grid", Device::Auto, hangs()).unwrap());
    assert_eq!(bits(&sim), bits(&on_cpu()));
    assert_eq!(sim.report().fallbacks[0].step, 1);
    assert!(sim.report().fallbacks[0].reason.contains("no answer within"));
}

#[test]
fn a_gpu_whose_arrays_are_too_small_is_refused_or_done_without() {
    let Some(_turn) = gpu() else { return };
    // Not even one triangle fits, so that chunks are no way out.
    let small = || gpu_with(GpuOptions { max_binding_bytes: Some(16), ..GpuOptions::default() });
    let error = build("grid", Device::Gpu, small()).and_then(|mut sim| sim.step()).unwrap_err();
    assert!(matches!(error, SimError::Device(DeviceError::Failed { .. })), "{error}");
    assert!(error.to_string().contains("the device binds 16"), "{error}");

    let sim = run(build("grid", Device::Auto, small()).unwrap());
    assert_eq!(bits(&sim), bits(&on_cpu()));
    let [fallback] = &sim.report().fallbacks[..] else { panic!("{:?}", sim.report().fallbacks) };
    assert!(fallback.step <= 1 && fallback.reason.contains("the device binds 16"), "{fallback}");
}

/// Among the CPU's and the GPU's methods the measured one changes, and the bits do not; a GPU that is lost is no candidate any more.
#[test]
fn auto_measures_methods_of_both_devices() {
    let Some(_turn) = gpu() else { return };
    let mut sim = build("auto", Device::Auto, &SHARED).unwrap();
    let mut expected = build("bvh", Device::Cpu, &SHARED).unwrap();
    let why = sim.plan().detection.clone().unwrap().why;
    assert!(why.contains("measured against \"octree\", \"bvh\", \"session\""), "{why}");
    while sim.report().choices.is_empty() && sim.step_count() < 120 {
        sim.step().unwrap();
        expected.step().unwrap();
        assert_eq!(bits(&sim), bits(&expected));
    }
    let choice = &sim.report().choices[0];
    let mut measured: Vec<&str> = choice.seconds_per_step.iter().map(|(name, _)| name.as_str()).collect();
    measured.sort_unstable();
    assert_eq!(measured, ["bvh", "octree", "session", "virtual-subdivision"]);
    assert_eq!(detection(&sim), (choice.detector.clone(), choice.device.clone()));
    let least = choice.seconds_per_step.iter().map(|(_, s)| *s).fold(f64::INFINITY, f64::min);
    let own = choice.seconds_per_step.iter().find(|(name, _)| *name == choice.detector).unwrap().1;
    assert!(own <= least / 0.9, "{choice:?}");

    // A software adapter that the device asks for by its name is alone.
    if SHARED.gpu().is_some_and(|gpu| gpu.is_software()) {
        let alone = build("auto", Device::Gpu, &SHARED).unwrap();
        assert_eq!(alone.plan().detection.clone().unwrap().why, "device \"gpu\"");
    }

    // Lost while it is measured.
    let mut sim = build("auto", Device::Auto, &SHARED).unwrap();
    for _ in 0..10 {
        sim.step().unwrap();
    }
    let lost = SHARED.lose();
    let sim = run(sim);
    assert!(lost && bits(&sim) == bits(&on_cpu()));
    assert_eq!((detection(&sim).1.as_str(), sim.report().fallbacks.len()), ("cpu", 1));
}

#[test]
fn devices_and_detectors_that_do_not_go_together_are_refused() {
    for (detector, device) in [("grid", Device::Cpu), ("bvh", Device::Gpu), ("brute", Device::Gpu)] {
        let error = build(detector, device, &SHARED).err().unwrap();
        let SimError::InvalidScene(error) = error else { panic!("{error}") };
        assert_eq!((error.key.as_str(), error.line), ("contact.detector", Some(6)), "{error}");
        assert!(error.expected.contains(&format!("runs on device \"{}\"", device.name())), "{error}");
    }
    let detection =
        |detector, device| build(detector, device, &SHARED).unwrap().report().detection.clone().unwrap();
    let auto = detection("auto", Device::Cpu);
    let why = "device \"cpu\"; measured against \"session\" where detection takes 5 % of a step and 0.25 ms";
    assert_eq!((auto.detector.as_str(), auto.why.as_str()), ("bvh", why));
    let named = detection("brute", Device::Auto);
    assert_eq!((named.detector.as_str(), named.why.as_str()), ("brute", "contact.detector = \"brute\""));
}

#[test]
fn software_adapters_are_never_chosen_by_auto() {
    static HARDWARE: SharedGpu = SharedGpu::new(false);
    let _turn = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    for (detector, notes) in [("auto", 0), ("grid", 1)] {
        let sim = build(detector, Device::Auto, &HARDWARE).unwrap();
        let found = sim.report().detection.clone().unwrap();
        if let Some(gpu) = HARDWARE.gpu() {
            assert!(!gpu.is_software());
            assert_eq!(found.device, gpu.description());
            continue;
        }
        assert_eq!((found.detector.as_str(), found.device.as_str()), ("bvh", "cpu"));
        assert!(found.why.starts_with("device \"auto\", and no GPU: "), "{}", found.why);
        // What was asked for by name and is not there is said, what was not asked for is not.
        assert_eq!((sim.report().fallbacks.len(), sim.plan().warnings.len()), (notes, notes));
    }
}
