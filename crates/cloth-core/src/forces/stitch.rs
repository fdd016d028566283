//! Stitches of a seam: threads between two vertices that are drawn in over time and then hold them together.
//!
//! E = ½ k max(r − l(t), 0)²   [J],   r = |x_1 − x_0|,   l(t) = l_0 (1 − clamp((t − t_s)/T, 0, 1))
//!
//! l_0 the gap at the start [m], k the stiffness [N/m], t_s the time at which closing begins and T how long it takes [s].
//! A thread pulls and does not push; closed (l = 0) it is a spring of no length, E = ½ k |x_1 − x_0|², smooth at r = 0.
//! With u = (x_1 − x_0)/r, P = I − u uᵀ, force on corner 0: k (r − l) u, on corner 1 its negative;
//! ∂f_0/∂x_1 = k [u uᵀ + (1 − l/r) P] = k [(1 − β) u uᵀ + β I] with β = 1 − l/r in [0, 1]: never indefinite.

use std::ops::Range;

use super::{
    Block, CouplingKind, Couplings, ForceModel, Linear, Psd, Survey,
    memory::{Past, PastMut},
};
use crate::{EffectInfo, Energy, mesh::Vec3};

/// Two vertices that are sewn together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stitch {
    /// Global indices of the vertices.
    pub vertices: [u32; 2],
    /// Length of the thread before it is drawn in, l_0 [m].
    pub gap: f64,
    /// Stiffness k [N/m].
    pub stiffness: f64,
    /// Time at which closing begins, t_s [s].
    pub start: f64,
    /// How long closing takes, T [s]; 0: at once.
    pub duration: f64,
}

impl Stitch {
    /// Length of the thread at `time` [s], l(t) [m].
    pub fn length(&self, time: f64) -> f64 {
        let since = time - self.start;
        let drawn = if since >= self.duration { 1.0 } else { (since / self.duration).max(0.0) };
        self.gap * (1.0 - drawn)
    }
}

/// All stitches of a scene at one time.
pub(crate) struct Stitches {
    threads: Vec<Stitch>,
    vertices: Vec<u32>,
    /// l(t) of each [m].
    length: Vec<f64>,
}

impl Stitches {
    /// The stitches at time 0.
    pub(crate) fn new(stitches: Vec<Stitch>) -> Self {
        let vertices = stitches.iter().flat_map(|s| s.vertices).collect();
        let length = stitches.iter().map(|s| s.length(0.0)).collect();
        Self { threads: stitches, vertices, length }
    }

    /// x_1 − x_0 of a taut thread and β; none of a slack one.
    fn taut(&self, element: usize, x: &[Vec3]) -> Option<(Vec3, f64)> {
        let [a, b] = self.threads[element].vertices.map(|i| i as usize);
        let d = x[b] - x[a];
        let (r, l) = (d.norm(), self.length[element]);
        // l = 0: β is 1 also where there is no direction.
        if l == 0.0 {
            Some((d, 1.0))
        } else if r > l {
            Some((d, 1.0 - l / r))
        } else {
            None
        }
    }
}

impl ForceModel for Stitches {
    fn info(&self) -> EffectInfo {
        EffectInfo {
            name: "stitches",
            elements: self.threads.len(),
            bytes: size_of_val(self.threads.as_slice())
                + size_of_val(self.vertices.as_slice())
                + size_of_val(self.length.as_slice()),
        }
    }

    fn corners(&self) -> usize {
        2
    }

    fn vertices(&self) -> &[u32] {
        &self.vertices
    }

    fn coupling(&self, _psd: Psd) -> CouplingKind {
        CouplingKind::Blocks
    }

    fn dissipates(&self) -> bool {
        false
    }

    fn set_time(&mut self, time: f64) {
        for (length, stitch) in self.length.iter_mut().zip(&self.threads) {
            *length = stitch.length(time);
        }
    }

    fn add_energy(
        &self,
        range: Range<usize>,
        x: &[Vec3],
        _memory: Past<'_>,
        _survey: Survey<&[f64]>,
        energy: &mut Energy,
    ) {
        for element in range {
            if let Some((d, beta)) = self.taut(element, x) {
                energy.stretch += 0.5 * self.threads[element].stiffness * (beta * beta) * d.norm_squared();
            }
        }
    }

    fn forces(
        &self,
        range: Range<usize>,
        x: &[Vec3],
        _v: &[Vec3],
        _memory: Past<'_>,
        _survey: Survey<&[f64]>,
        out: &mut [Vec3],
    ) {
        for (element, f) in range.zip(out.chunks_exact_mut(2)) {
            // k (r − l) u = k β (x_1 − x_0)
            f[0] = self
                .taut(element, x)
                .map_or_else(Vec3::zeros, |(d, beta)| d * (self.threads[element].stiffness * beta));
            f[1] = -f[0];
        }
    }

    fn linearise(
        &self,
        range: Range<usize>,
        x: &[Vec3],
        v: &[Vec3],
        linear: &Linear,
        _memory: PastMut<'_>,
        _survey: Survey<&mut [f64]>,
        forces: &mut [Vec3],
        couplings: Couplings<'_>,
    ) {
        let Couplings::Blocks(blocks) = couplings else { unreachable!("stitches couple by blocks") };
        for ((element, f), block) in range.zip(forces.chunks_exact_mut(2)).zip(blocks) {
            let Some((d, beta)) = self.taut(element, x) else {
                f.fill(Vec3::zeros());
                *block = [0.0; 9];
                continue;
            };
            let Stitch { vertices: [a, b], stiffness, .. } = self.threads[element];
            let u = d.try_normalize(0.0).unwrap_or_default();
            let w = v[b as usize] - v[a as usize];
            // K_x v on corner 0: k [(1 − β)(w·u) u + β w].
            let ahead = (u * ((1.0 - beta) * w.dot(&u)) + w * beta) * (linear.ahead * stiffness);
            f[0] = d * (stiffness * beta) + ahead;
            f[1] = -f[0];
            *block = stitch_block(&u, linear.stiffness * stiffness, beta);
        }
    }
}

/// −k [(1 − β) u uᵀ + β I].
fn stitch_block(u: &Vec3, k: f64, beta: f64) -> Block {
    let mut block = [0.0; 9];
    for column in 0..3 {
        for row in 0..3 {
            block[3 * column + row] = -k * (1.0 - beta) * u[row] * u[column];
        }
        block[4 * column] -= k * beta;
    }
    block
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Model, Random, check_derivatives, check_momentum, energy, forces};
    use super::*;

    fn seam(gap: f64, time: f64) -> Stitches {
        let stitch = |vertices| Stitch { vertices, gap, stiffness: 30.0, start: 1.0, duration: 2.0 };
        let mut stitches = Stitches::new(vec![stitch([0, 1]), stitch([2, 1]), stitch([3, 0])]);
        stitches.set_time(time);
        stitches
    }

    #[test]
    fn derivatives_while_it_closes_and_when_it_is_closed() {
        let mut random = Random::new(3);
        for time in [0.0, 1.5, 2.9, 3.0, 9.0] {
            let x = random.vectors(4, 2.0);
            let model = Model::new(seam(0.4, time));
            check_derivatives(&model, &x, "stitches");
            check_momentum(&model, &x, &random.vectors(4, 1.0), "stitches");
        }
    }

    #[test]
    fn the_thread_is_drawn_in_and_does_not_push() {
        let stitch = Stitch { vertices: [0, 1], gap: 0.8, stiffness: 10.0, start: 1.0, duration: 2.0 };
        let lengths = [0.0, 1.0, 2.0, 3.0, 4.0].map(|t| stitch.length(t));
        assert_eq!(lengths, [0.8, 0.8, 0.4, 0.0, 0.0]);
        assert_eq!(Stitch { duration: 0.0, ..stitch }.length(1.0), 0.0);
        assert_eq!(Stitch { duration: 0.0, ..stitch }.length(0.5), 0.8);
        let x = [Vec3::zeros(), Vec3::x() * 0.3];
        let at = |time| {
            let mut stitches = Stitches::new(vec![stitch]);
            stitches.set_time(time);
            let model = Model::new(stitches);
            (energy(&model, &x), forces(&model, &x, &[Vec3::zeros(); 2])[0].x)
        };
        assert_eq!(at(2.0), (0.0, 0.0), "slack: 0.3 < 0.4");
        // Closed: E = ½·10·0.3², f = 10·0.3.
        let (e, f) = at(3.0);
        assert!((e - 0.45).abs() < 1e-15 && (f - 3.0).abs() < 1e-15);
    }

    #[test]
    fn vertices_that_have_met_are_finite() {
        let model = Model::new(seam(0.4, 5.0));
        let f = forces(&model, &[Vec3::zeros(); 4], &[Vec3::x(); 4]);
        assert!(f.iter().all(|f| *f == Vec3::zeros()));
    }
}
