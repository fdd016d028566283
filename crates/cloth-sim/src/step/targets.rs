//! Where colliders and pins are at the end of a step.

use crate::report::add_seconds;
use crate::{Simulation, StepReport, Vec3};
use std::time::Instant;

impl Simulation {
    /// Writes where colliders are at `t1`, and the mean velocity of their way there.
    pub(super) fn move_colliders(
        &self,
        t1: f64,
        dt: f64,
        x: &mut [Vec3],
        v: &mut [Vec3],
        report: &mut StepReport,
    ) {
        let clock = Instant::now();
        let mut any = false;
        for body in self.bodies.colliders.iter().filter(|body| body.motion.moves()) {
            let range = body.first_vertex..body.first_vertex + body.motion.vertex_count();
            body.motion.write(t1, &mut x[range.clone()]);
            for i in range {
                v[i] = (x[i] - self.state.x[i]) / dt;
            }
            any = true;
        }
        if any {
            add_seconds(&mut report.seconds, "moving colliders", clock.elapsed().as_secs_f64());
        }
    }

    /// Where pins are at `t1`, when colliders are as in `x`, and the mean velocity of their way there.
    pub(super) fn move_pins(
        &self,
        t1: f64,
        dt: f64,
        x: &[Vec3],
        report: &mut StepReport,
    ) -> (Vec<Vec3>, Vec<Vec3>) {
        if self.pins.vertices.is_empty() {
            return (Vec::new(), Vec::new());
        }
        let clock = Instant::now();
        let mut pin_x = vec![Vec3::zeros(); self.pins.vertices.len()];
        self.pins.write(&self.bodies, t1, x, &mut pin_x);
        let start = |i: u32| self.state.x[i as usize];
        let pin_v = self.pins.vertices.iter().zip(&pin_x).map(|(&i, p)| (p - start(i)) / dt).collect();
        add_seconds(&mut report.seconds, "pins", clock.elapsed().as_secs_f64());
        (pin_x, pin_v)
    }
}
