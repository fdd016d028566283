//! A device or a reason to skip, and seeded numbers, shared by the tests.
#![allow(dead_code, reason = "each test binary uses its part")]
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]
#![allow(clippy::print_stderr, reason = "a skipped test says so")]

use cloth_gpu::{Gpu, GpuError, GpuOptions};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

/// A device that no other test of this binary uses meanwhile.
pub(crate) struct Device {
    pub(crate) gpu: Arc<Gpu>,
    _turn: MutexGuard<'static, ()>,
}

/// A device; without any adapter None, with the reason on the standard error stream. With `CLOTHSIM_REQUIRE_GPU=1` a
/// missing adapter is a failure.
pub(crate) fn device(options: GpuOptions) -> Option<Device> {
    let turn = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    match Gpu::new(options) {
        Ok(gpu) => Some(Device { gpu, _turn: turn }),
        Err(reason @ GpuError::NoAdapter { .. })
            if std::env::var("CLOTHSIM_REQUIRE_GPU").is_ok_and(|v| v == "1") =>
        {
            panic!("CLOTHSIM_REQUIRE_GPU=1, but {reason}")
        }
        Err(reason @ GpuError::NoAdapter { .. }) => {
            eprintln!("skipped: {reason}");
            None
        }
        Err(reason) => panic!("{reason}"),
    }
}

/// With subgroup operations, without, and with every dispatch folded to two dimensions.
pub(crate) fn variants() -> [GpuOptions; 3] {
    let plain = GpuOptions::default();
    [
        plain,
        GpuOptions { subgroups: false, ..plain },
        GpuOptions { max_workgroups_per_dimension: Some(24), ..plain },
    ]
}

/// SplitMix64.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    /// Uniform in [0, 1).
    pub(crate) fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }
    pub(crate) fn within(&mut self, half: f64) -> f64 {
        (2.0 * self.unit() - 1.0) * half
    }
    pub(crate) fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }
}
