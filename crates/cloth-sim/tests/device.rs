//! A GPU that fails between two calls.
#![cfg(feature = "gpu")]
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]
#![allow(clippy::print_stderr, reason = "a skipped test says so")]

use cloth_sim::collision::mesh::Vec3;
use cloth_sim::collision::{CollisionMesh, Mode, Query};
use cloth_sim::device::{Device, DeviceError, Reason, SharedGpu, Tuning};

#[test]
fn a_lost_gpu_is_an_error_or_a_stated_fall_back_and_is_opened_anew() {
    let shared = SharedGpu::new(true);
    let x: Vec<Vec3> =
        [[0., 0., 0.], [1., 0., 0.], [0., 0., 1.], [0.2, 0.1, 0.2], [1.2, 1., 0.2], [0.2, 1., 1.2]]
            .map(Vec3::from)
            .to_vec();
    let mesh = CollisionMesh::single(6, &[[0, 1, 2], [3, 4, 5]]).unwrap();
    let query = Query { x_t0: &x, x_t1: &x, thickness: 0.2, mode: Mode::Discrete, active: None };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let detect = |device| shared.detect(&mesh, &query, "grid", &Tuning::default(), device, &pool);

    let first = match detect(Device::Gpu) {
        Err(DeviceError::Unavailable { reason }) => {
            assert!(
                std::env::var("CLOTHSIM_REQUIRE_GPU").is_err(),
                "CLOTHSIM_REQUIRE_GPU is set, but {reason}"
            );
            eprintln!("skipped: {reason}");
            return;
        }
        answer => answer.unwrap(),
    };
    assert_eq!(first.contacts.vertex_triangle, [[3, 0]]);
    assert_eq!(first.reason, None);

    shared.gpu().unwrap().close();
    let lost = detect(Device::Gpu).unwrap_err();
    assert!(matches!(&lost, DeviceError::Failed { device, .. } if *device == first.device), "{lost}");
    assert_eq!(detect(Device::Auto).unwrap().device, first.device, "opened anew");

    shared.gpu().unwrap().close();
    let on_cpu = detect(Device::Auto).unwrap();
    assert_eq!((on_cpu.device.as_str(), on_cpu.method), ("cpu", "bvh"));
    assert!(matches!(on_cpu.reason, Some(Reason::Failed(_))), "{:?}", on_cpu.reason);
    assert_eq!(on_cpu.contacts.vertex_triangle, first.contacts.vertex_triangle);
    assert_eq!(detect(Device::Gpu).unwrap().device, first.device, "opened anew");
}
