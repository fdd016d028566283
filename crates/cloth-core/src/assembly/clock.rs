//! Wall-clock seconds of each force.

use std::time::Instant;

/// Seconds that each force took: corner forces, couplings and energies of its elements.
///
/// Read around a whole parallel region, so that what it costs does not grow with the number of elements.
#[derive(Debug, Clone, Default)]
pub(crate) struct ForceClock {
    /// Per model, in the system's order.
    pub(crate) models: Vec<f64>,
    pub(crate) gravity: f64,
    pub(crate) air_damping: f64,
}

impl ForceClock {
    pub(crate) fn new(models: usize) -> Self {
        Self { models: vec![0.0; models], ..Self::default() }
    }

    pub(crate) fn reset(&mut self) {
        self.models.fill(0.0);
        (self.gravity, self.air_damping) = (0.0, 0.0);
    }
}

/// Adds the seconds that `work` takes.
pub(crate) fn timed<T>(seconds: &mut f64, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = work();
    *seconds += start.elapsed().as_secs_f64();
    result
}
