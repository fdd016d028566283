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
//! The elastic part moves the points apart and gives them no velocity: what it adds to the normal impulses, the *push*, counts in
//! the motion over this step and not in what is kept of it. (3.36 keeps it: a tenth of the overlap per step is a velocity of
//! 0.1 d/dt, and cloth that starts within the thickness leaves the faster the smaller the step is, with energy from nowhere.)
//!
//! Friction of what is kept knows the inelastic part alone: a push brakes nothing that slides. A push has friction of its own, under
//! the push alone and with the coefficient at rest, against what pushes slide. Without it, pushes that cannot all have their way, as
//! those of cloth between two walls with less room than it wants, move it aside wherever their normals are not quite opposite, a
//! little in every step, and friction of what is kept holds it there: a ratchet that stretches cloth without end.
//!
//! λ as a function of v_n is a monotone staircase, so relaxing contact after contact minimises a convex function:
//! the sweeps converge whatever the number of contacts on a vertex. λ never falls below 0: nothing attracts.

use crate::Vec3;
use crate::friction::into_cone;
use crate::friction::kernel::Kernel;
use cloth_collision::Stencil;

/// Lower bounds of the normal impulse, see the head of this file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct NormalLaw {
    /// Least normal velocity [m/s].
    pub(crate) least: f64,
    /// Elastic impulse [N s], ≥ 0.
    pub(crate) spring: f64,
    /// Whether the elastic impulse comes on top of what the inelastic part carries.
    pub(crate) on_top: bool,
    /// Whether the elastic impulse has friction.
    pub(crate) rubs: bool,
    /// Normal velocity above which the elastic impulse does not act [m/s].
    pub(crate) cap: f64,
}

impl NormalLaw {
    /// Without an elastic impulse.
    pub(crate) const fn inelastic(least: f64) -> Self {
        Self { least, spring: 0.0, on_top: false, rubs: false, cap: f64::NEG_INFINITY }
    }

    /// The normal impulse that the law asks for where it is λ at the velocity `v_n`, without its elastic part.
    fn stop(&self, lambda: f64, v_n: f64, mass: f64) -> f64 {
        (lambda + mass * (self.least - v_n)).max(0.0)
    }

    /// Most that the elastic part brings a normal impulse to, of which the inelastic part is `carried` [N s].
    fn elastic(&self, carried: f64) -> f64 {
        if self.on_top { carried + self.spring } else { self.spring }
    }

    /// The whole of it.
    fn impulse(&self, lambda: f64, v_n: f64, mass: f64, carried: f64) -> f64 {
        let push = self.elastic(carried).min(lambda + mass * (self.cap - v_n));
        self.stop(lambda, v_n, mass).max(push)
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
    /// On the first point, without the push [N s].
    pub(crate) impulse: Vec3,
    /// What the push adds to its normal part [N s].
    pub(crate) push: f64,
    /// Friction of the push [N s].
    rub: Vec3,
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
            push: 0.0,
            rub: Vec3::zeros(),
        })
    }

    /// Velocity of the first point relative to the second [m/s].
    pub(crate) fn relative(&self, velocity: &[Vec3]) -> Vec3 {
        (0..4).map(|k| velocity[self.vertices[k] as usize] * self.weights[k]).sum()
    }

    /// The change of the impulse that fulfils the law without its elastic part, and that of friction, in what is kept of the
    /// motion, and the change of the relative velocity that it makes [m/s].
    pub(crate) fn correction<K: Kernel<State = S>>(&mut self, kernel: &K, velocity: &[Vec3]) -> (Vec3, f64) {
        let u = self.relative(velocity);
        let (v_n, lambda) = (self.normal.dot(&u), self.normal.dot(&self.impulse));
        let normal_impulse = self.law.stop(lambda, v_n, self.mass);
        let mut change = self.normal * (normal_impulse - lambda);
        let tangential = self.impulse - self.normal * lambda;
        if kernel.acts(&self.friction) && (normal_impulse > 0.0 || lambda > 0.0) {
            let wanted = tangential - (u - self.normal * v_n) * self.mass;
            change += kernel.bound(&mut self.friction, wanted, normal_impulse, self.mass) - tangential;
        }
        (change, change.norm() / self.mass)
    }

    /// The change of the push that fulfils the whole law in the motion `velocity`, and that of friction against what pushes alone
    /// slide (`kept`: the motion without them), and the change of the relative velocity that it makes [m/s].
    pub(crate) fn push_correction<K: Kernel<State = S>>(
        &self,
        kernel: &K,
        velocity: &[Vec3],
        kept: &[Vec3],
    ) -> (Vec3, f64) {
        let u = self.relative(velocity);
        let (v_n, carried) = (self.normal.dot(&u), self.normal.dot(&self.impulse));
        let lambda = carried + self.push;
        let by = self.law.impulse(lambda, v_n, self.mass, carried) - lambda;
        if !self.law.rubs {
            return (self.normal * by, by.abs() / self.mass);
        }
        let most = kernel.at_rest(&self.friction) * (self.push + by).max(0.0);
        let slip = u - self.relative(kept);
        let wanted = self.rub - (slip - self.normal * self.normal.dot(&slip)) * self.mass;
        let change = self.normal * by + (into_cone(wanted, most) - self.rub);
        (change, change.norm() / self.mass)
    }

    /// Whether the whole law asks for more than the impulse gives, by more than `tolerance` [m/s].
    pub(crate) fn wants_push(&self, velocity: &[Vec3], tolerance: f64) -> bool {
        let carried = self.normal.dot(&self.impulse);
        let lambda = carried + self.push;
        let v_n = self.normal.dot(&self.relative(velocity));
        self.law.elastic(carried) > lambda && self.law.cap > v_n + tolerance
    }

    /// Books a change of the impulse, or of the push; `change` hears of each vertex and the change of its velocity.
    #[inline]
    pub(crate) fn apply(&mut self, by: Vec3, push: bool, mut change: impl FnMut(usize, Vec3)) {
        if push {
            let along = self.normal.dot(&by);
            self.push += along;
            if self.law.rubs {
                self.rub += by - self.normal * along;
            }
        } else {
            self.impulse += by;
        }
        for k in 0..4 {
            if self.share[k] != 0.0 {
                change(self.vertices[k] as usize, by * self.share[k]);
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

    const INELASTIC: NormalLaw = NormalLaw::inelastic(0.0);

    fn solve(
        stencil: &Stencil,
        inv_mass: [f64; 4],
        law: NormalLaw,
        mu: f64,
        velocity: &mut [Vec3],
    ) -> Contact<f64> {
        let mut contact = Contact::new(stencil, &inv_mass, law, mu).expect("a free vertex");
        let (change, _) = contact.correction(&Coulomb::default(), velocity);
        contact.apply(change, false, |v, by| velocity[v] += by);
        let (change, _) = contact.push_correction(&Coulomb::default(), velocity, velocity);
        contact.apply(change, true, |v, by| velocity[v] += by);
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
            let law = NormalLaw { spring, cap: 0.01, ..INELASTIC };
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
        let law = NormalLaw { spring: f64::INFINITY, cap: 0.1 * d / dt, ..INELASTIC };
        let mut v = [Vec3::y() * -0.05, Vec3::zeros(), Vec3::zeros(), Vec3::zeros()];
        let contact = solve(&vertex_triangle(), [1.0; 4], law, 0.0, &mut v);
        assert!((contact.relative(&v).y - 0.01).abs() < ROUNDING);

        // 1/m = 1.38: a spring of 0.04/1.38 changes v_n by 0.04, less than stopping it needs.
        let law = NormalLaw { spring: 0.04 / 1.38, cap: 0.1 * d / dt, ..INELASTIC };
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

    /// One relaxation fulfils the contact's own law: the second changes nothing. What the push moves is not kept, and carries no
    /// friction.
    #[test]
    fn relaxation_is_idempotent() {
        let law = NormalLaw { spring: 2.0, cap: 0.01, ..INELASTIC };
        for mu in [0.0, 0.1, 10.0] {
            let mut kept = [Vec3::new(0.7, -0.4, 0.2), Vec3::x(), Vec3::zeros(), Vec3::zeros()];
            let mut contact = Contact::new(&vertex_triangle(), &[1.0, 2.0, 3.0, 0.0], law, mu).expect("free");
            let (change, _) = contact.correction(&Coulomb::default(), &kept);
            contact.apply(change, false, |v, by| kept[v] += by);
            let inelastic = contact.impulse;
            assert!(contact.relative(&kept).y.abs() < ROUNDING && contact.wants_push(&kept, 1e-6));
            let mut moved = kept;
            let (change, _) = contact.push_correction(&Coulomb::default(), &moved, &kept);
            contact.apply(change, true, |v, by| moved[v] += by);
            assert!((contact.relative(&moved).y - 0.01).abs() < ROUNDING && contact.push > 0.0);
            assert!(!contact.wants_push(&moved, 1e-6));
            assert_eq!(contact.impulse, inelastic);
            assert!(contact.correction(&Coulomb::default(), &kept).1 < ROUNDING);
            assert!(contact.push_correction(&Coulomb::default(), &moved, &kept).1 < ROUNDING);
            let slip = |v: &[Vec3]| contact.relative(v) - contact.normal * contact.relative(v).y;
            assert!((slip(&moved) - slip(&kept)).norm() < ROUNDING);
        }
    }
}
