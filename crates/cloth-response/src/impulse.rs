//! One contact: its effective mass, its normal law, and the impulse that fulfils the law.
//!
//! A contact joins two points by weights: relative velocity u = Σ w_k v_k, from the second point to the first. An
//! impulse p \[N s\] on the first point, −p on the second, changes v_k by w_k p/m_k and u by p/m with the effective
//! mass m = 1/Σ w_k²/m_k (3.39, 3.40 with the true masses; a prescribed vertex has 1/m_k = 0). It sums to zero
//! over the vertices since Σ w_k = 0: momentum is kept.
//!
//! Angular momentum over a step, Σ m x × v̄ about its start (or its end: the same for straight motions), changes by
//! r × p with r = Σ w_k x_k the vector between the two points at the start. It is kept where p lies along r: points that
//! meet head on. What is left otherwise is the couple of friction across the gap, at most |r| |p_t|, and the turn of the
//! normal between start and contact where the points slide as they near.
//!
//! Normal law, with λ = n·p the impulse so far and v_n = n·u (n from the second point to the first):
//!
//! - inelastic: v_n ≥ `least` and λ ≥ 0, one of them with equality;
//! - elastic on top of it: where v_n < `cap`, λ is at least `spring` (3.36: `spring` = dt k_r d, `cap` = 0.1 d/dt).
//!
//! λ as a function of v_n is a monotone staircase, so relaxing contact after contact minimises a convex function:
//! the sweeps converge whatever the number of contacts on a vertex. λ never falls below 0: nothing attracts.

use crate::Vec3;
use crate::friction::kernel::Kernel;
use cloth_collision::Stencil;

/// Lower bounds of the normal impulse, see the head of this file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct NormalLaw {
    /// Least normal velocity [m/s].
    pub(crate) least: f64,
    /// Elastic impulse [N s], ≥ 0.
    pub(crate) spring: f64,
    /// Normal velocity above which the elastic impulse does not act [m/s].
    pub(crate) cap: f64,
}

impl NormalLaw {
    /// The normal impulse that the law asks for where it is λ at the velocity `v_n`.
    fn impulse(&self, lambda: f64, v_n: f64, mass: f64) -> f64 {
        let stop = lambda + mass * (self.least - v_n);
        let push = self.spring.min(lambda + mass * (self.cap - v_n));
        stop.max(push).max(0.0)
    }
}

/// A contact with its accumulated impulse; `S`: what it knows about its friction.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Contact<S> {
    pub(crate) vertices: [u32; 4],
    pub(crate) weights: [f64; 4],
    /// w_k/m_k [1/kg].
    share: [f64; 4],
    pub(crate) normal: Vec3,
    /// Effective mass [kg].
    pub(crate) mass: f64,
    pub(crate) law: NormalLaw,
    pub(crate) friction: S,
    /// On the first point [N s].
    pub(crate) impulse: Vec3,
}

impl<S: Copy> Contact<S> {
    /// The contact of a stencil, without impulse. `None` if all its vertices are prescribed.
    pub(crate) fn new(stencil: &Stencil, inv_mass: &[f64], law: NormalLaw, friction: S) -> Option<Self> {
        let mut share = [0.0; 4];
        let mut inverse = 0.0;
        for k in 0..4 {
            share[k] = stencil.weights[k] * inv_mass[stencil.vertices[k] as usize];
            inverse += stencil.weights[k] * share[k];
        }
        (inverse > 0.0).then(|| Self {
            vertices: stencil.vertices,
            weights: stencil.weights,
            share,
            normal: stencil.normal,
            mass: 1.0 / inverse,
            law,
            friction,
            impulse: Vec3::zeros(),
        })
    }

    /// Velocity of the first point relative to the second [m/s].
    pub(crate) fn relative(&self, velocity: &[Vec3]) -> Vec3 {
        (0..4).map(|k| velocity[self.vertices[k] as usize] * self.weights[k]).sum()
    }

    /// The change of the impulse that fulfils the law and that of friction now, and the change of the relative
    /// velocity that it makes [m/s].
    pub(crate) fn correction<K: Kernel<State = S>>(&mut self, kernel: &K, velocity: &[Vec3]) -> (Vec3, f64) {
        let u = self.relative(velocity);
        let (v_n, lambda) = (self.normal.dot(&u), self.normal.dot(&self.impulse));
        let normal_impulse = self.law.impulse(lambda, v_n, self.mass);
        let mut change = self.normal * (normal_impulse - lambda);
        let tangential = self.impulse - self.normal * lambda;
        if kernel.acts(&self.friction) && (normal_impulse > 0.0 || lambda > 0.0) {
            let wanted = tangential - (u - self.normal * v_n) * self.mass;
            change += kernel.bound(&mut self.friction, wanted, normal_impulse, self.mass) - tangential;
        }
        (change, change.norm() / self.mass)
    }

    /// Applies a change of the impulse; `moved` hears of each vertex whose velocity changes.
    #[inline]
    pub(crate) fn apply(&mut self, change: Vec3, velocity: &mut [Vec3], mut moved: impl FnMut(usize)) {
        self.impulse += change;
        for k in 0..4 {
            if self.share[k] != 0.0 {
                let v = self.vertices[k] as usize;
                velocity[v] += change * self.share[k];
                moved(v);
            }
        }
    }

    /// The vertices between which the contact acts, where it has fewer than four (the closest points lie on a side or
    /// corner): several pairs of features that share it give the same contact.
    pub(crate) fn shared_feature(&self) -> Option<[u32; 4]> {
        let mut key = self.vertices;
        let mut fewer = false;
        for k in 0..4 {
            if self.weights[k] == 0.0 {
                key[k] = u32::MAX;
                fewer = true;
            }
        }
        key.sort_unstable();
        fewer.then_some(key)
    }

    /// Whether the impulse moves this one of the four vertices.
    pub(crate) fn moves(&self, k: usize) -> bool {
        self.share[k] != 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::friction::kernel::Coulomb;
    use cloth_collision::StencilKind;

    /// Rounding of a handful of operations on numbers of size 1.
    const ROUNDING: f64 = 1e-14;

    fn vertex_triangle() -> Stencil {
        Stencil {
            kind: StencilKind::VertexTriangle,
            vertices: [0, 1, 2, 3],
            weights: [1.0, -0.2, -0.3, -0.5],
            normal: Vec3::y(),
            distance: 0.001,
        }
    }

    fn edge_edge() -> Stencil {
        Stencil { kind: StencilKind::EdgeEdge, weights: [0.75, 0.25, -0.5, -0.5], ..vertex_triangle() }
    }

    const INELASTIC: NormalLaw = NormalLaw { least: 0.0, spring: 0.0, cap: 0.0 };

    fn solve(
        stencil: &Stencil,
        inv_mass: [f64; 4],
        law: NormalLaw,
        mu: f64,
        velocity: &mut [Vec3],
    ) -> Contact<f64> {
        let mut contact = Contact::new(stencil, &inv_mass, law, mu).expect("a free vertex");
        let (change, _) = contact.correction(&Coulomb::default(), velocity);
        contact.apply(change, velocity, |_| ());
        contact
    }

    /// Stop a head-on pair exactly: I = m_eff v_n, for both stencils, and conserve momentum.
    #[test]
    fn head_on_pairs_stop() {
        for stencil in [vertex_triangle(), edge_edge()] {
            let inv_mass = [1.0, 2.0, 0.5, 4.0];
            let mut v = [Vec3::new(0.0, -3.0, 0.0), Vec3::y(), Vec3::y(), Vec3::y()];
            let before: Vec3 = (0..4).map(|k| v[k] / inv_mass[k]).sum();
            let contact = solve(&stencil, inv_mass, INELASTIC, 0.0, &mut v);
            assert!(contact.relative(&v).norm() < ROUNDING);
            let after: Vec3 = (0..4).map(|k| v[k] / inv_mass[k]).sum();
            assert!((after - before).norm() < 10.0 * ROUNDING);
        }
        // By hand: 1/m = 1 + 0.04·2 + 0.09·0.5 + 0.25·4 = 2.125; closing speed 4; λ = 4/2.125.
        let mut v = [Vec3::new(0.0, -3.0, 0.0), Vec3::y(), Vec3::y(), Vec3::y()];
        let contact = solve(&vertex_triangle(), [1.0, 2.0, 0.5, 4.0], INELASTIC, 0.0, &mut v);
        assert!((contact.impulse.y - 4.0 / 2.125).abs() < ROUNDING);
        assert!((v[0].y - (-3.0 + 4.0 / 2.125)).abs() < ROUNDING);
    }

    /// Two equal points: the printed I_c = m v_n/2 (3.39, 3.40).
    #[test]
    fn equal_masses_give_the_printed_impulse() {
        let stencil = Stencil { weights: [1.0, -1.0, 0.0, 0.0], ..vertex_triangle() };
        let mut v = [Vec3::y() * -2.0, Vec3::zeros(), Vec3::zeros(), Vec3::zeros()];
        let contact = solve(&stencil, [1.0; 4], INELASTIC, 0.0, &mut v);
        assert!((contact.impulse.y - 1.0).abs() < ROUNDING);
        assert!((v[0].y + 1.0).abs() < ROUNDING && (v[1].y + 1.0).abs() < ROUNDING);
    }

    /// Leave separating pairs alone: a contact never attracts, with or without the elastic part.
    #[test]
    fn nothing_attracts() {
        for spring in [0.0, 1.0] {
            let law = NormalLaw { least: 0.0, spring, cap: 0.01 };
            let mut v = [Vec3::y() * 0.5, Vec3::zeros(), Vec3::zeros(), Vec3::zeros()];
            let contact = solve(&vertex_triangle(), [1.0; 4], law, 0.5, &mut v);
            assert_eq!(contact.impulse, Vec3::zeros());
            assert_eq!(v[0], Vec3::y() * 0.5);
        }
    }

    /// The elastic part ends at the cap (notes: v_n = −0.05, d = 1e-3, dt = 0.01 gives +0.01, not +0.07), or at
    /// the spring's impulse where that is less.
    #[test]
    fn repulsion_ends_at_the_cap() {
        let (d, dt) = (1e-3, 0.01);
        let law = NormalLaw { least: 0.0, spring: f64::INFINITY, cap: 0.1 * d / dt };
        let mut v = [Vec3::y() * -0.05, Vec3::zeros(), Vec3::zeros(), Vec3::zeros()];
        let contact = solve(&vertex_triangle(), [1.0; 4], law, 0.0, &mut v);
        assert!((contact.relative(&v).y - 0.01).abs() < ROUNDING);

        // 1/m = 1.38: a spring of 0.04/1.38 changes v_n by 0.04, less than stopping it needs.
        let law = NormalLaw { least: 0.0, spring: 0.04 / 1.38, cap: 0.1 * d / dt };
        let mut v = [Vec3::y() * -0.05, Vec3::zeros(), Vec3::zeros(), Vec3::zeros()];
        let contact = solve(&vertex_triangle(), [1.0; 4], law, 0.0, &mut v);
        assert!(contact.relative(&v).y.abs() < ROUNDING, "the inelastic part still stops it");

        let mut v = [Vec3::y() * -0.035, Vec3::zeros(), Vec3::zeros(), Vec3::zeros()];
        let contact = solve(&vertex_triangle(), [1.0; 4], law, 0.0, &mut v);
        assert!((contact.relative(&v).y - 0.005).abs() < ROUNDING);
    }

    /// A prescribed vertex keeps its velocity; four of them make no contact.
    #[test]
    fn prescribed_vertices_do_not_move() {
        let mut v = [Vec3::y() * -1.0, Vec3::zeros(), Vec3::zeros(), Vec3::zeros()];
        let contact = solve(&vertex_triangle(), [1.0, 0.0, 0.0, 0.0], INELASTIC, 0.0, &mut v);
        assert!(contact.relative(&v).norm() < ROUNDING);
        assert_eq!(&v[1..], &[Vec3::zeros(); 3]);
        assert!(Contact::new(&vertex_triangle(), &[0.0; 4], INELASTIC, 0.0_f64).is_none());
    }

    /// One relaxation fulfils the contact's own law: the second changes nothing.
    #[test]
    fn relaxation_is_idempotent() {
        let law = NormalLaw { least: 0.0, spring: 0.1, cap: 0.01 };
        for mu in [0.0, 0.1, 10.0] {
            let mut v = [Vec3::new(0.7, -0.4, 0.2), Vec3::x(), Vec3::zeros(), Vec3::zeros()];
            let mut contact = solve(&vertex_triangle(), [1.0, 2.0, 3.0, 0.0], law, mu, &mut v);
            assert!(contact.correction(&Coulomb::default(), &v).1 < ROUNDING);
        }
    }
}
