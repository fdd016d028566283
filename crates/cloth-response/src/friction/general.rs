//! The kernel of a scene with laws beyond Coulomb: stiction, Stribeck, viscous.
//!
//! A contact sticks if the tangential impulse that ends all sliding is at most μ_s λ. Else it slides, and its tangential
//! impulse is dt F_k(s) against the sliding (7.9, with the effective mass m, with the area A of the contact, and with μ_s in
//! the branch test: the speed-dependent coefficient would let a resting contact go at a slope that depends on dt).
//!
//! The sliding speed s is the one at the end of the step, solved for: with u the speed that the contact would have without
//! its own friction, s + dt F_k(s)/m = u. The step is then as implicit in friction as it is in the rest, of first order in dt,
//! and friction never turns the motion round, whatever the viscosity. The curve has infinite slope at s = 0 for δ_S < 1 and
//! a minimum near it: of two solutions the faster is taken (the other one is unstable), and if there is none the contact
//! stops; then u ≤ μ_s λ/m, so that it sticks by the rule too.
//!
//! Two things are found before a contact may slide, where others act on the same vertices: whether they hold it together
//! (each under μ_s λ: a convex problem as with Coulomb; a contact let go too soon would not be caught again, since it slides on
//! under less), and which contacts share a vertex's area. So the sweeps settle first with all that has not let go under μ_s λ;
//! then those that still slide let go, for the rest of the step. A contact alone on its vertices is decided at once.
//!
//! Friction that weakens with the speed is no convex problem: after [`LIVE_SWEEPS`] sweeps each contact keeps the coefficients
//! of the speed that it has then, and what is left to the sweeps is Coulomb with a linear drag, which settles.

use super::kernel::Kernel;
use crate::impulse::Contact;
use crate::motion::{Motion, bytes_of};
use crate::{FrictionLaw, FrictionRule, Vec3};
use cloth_collision::CollisionMesh;

/// Sweeps of one pass in which coefficients follow the speed.
const LIVE_SWEEPS: usize = 12;
/// Relative error of the sliding speed at which Newton's iteration ends, about the square of the change times the curvature.
const NEWTON_ERROR: f64 = 1e-6;
/// Cap on Newton's iterations; two or three are usual.
const NEWTON_STEPS: usize = 40;
/// What is more than μ_s λ by no more than this fraction holds still: rounding.
const THRESHOLD_ROUNDING: f64 = 1e-9;
/// A change of a contact's area by more than this fraction is looked at again.
const AREA_CHANGE: f64 = 1e-9;

/// A law as the sweeps want it.
#[derive(Debug, Clone, Copy)]
struct Entry {
    mu_c: f64,
    mu_s: f64,
    /// 1/v_S [s/m]; 0: without the Stribeck term.
    inv_v_s: f64,
    delta_s: f64,
    f_v: f64,
    delta_v: f64,
}

impl Entry {
    fn of(law: &FrictionLaw) -> Self {
        let (mu_c, mu_s) = (law.kinetic_coefficient(), law.static_coefficient());
        let plain = Self { mu_c, mu_s, inv_v_s: 0.0, delta_s: 1.0, f_v: 0.0, delta_v: 1.0 };
        match *law {
            FrictionLaw::Coulomb { .. } | FrictionLaw::CoulombStiction { .. } => plain,
            FrictionLaw::Stribeck { v_s, delta_s, .. } => Self { inv_v_s: 1.0 / v_s, delta_s, ..plain },
            FrictionLaw::Viscous { v_s, delta_s, f_v, delta_v, .. } => {
                Self { inv_v_s: 1.0 / v_s, delta_s, f_v, delta_v, ..plain }
            }
        }
    }

    /// e^(−(s/v_S)^δ_S), and its derivative times s.
    fn stribeck(&self, s: f64) -> (f64, f64) {
        if self.inv_v_s == 0.0 {
            return (0.0, 0.0);
        }
        let x = (s * self.inv_v_s).powf(self.delta_s);
        let share = (-x).exp();
        (share, -self.delta_s * x * share)
    }

    /// s^δ_v.
    fn power(&self, s: f64) -> f64 {
        if self.delta_v == 1.0 { s } else { s.powf(self.delta_v) }
    }
}

/// Friction of one contact.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sliding {
    law: u32,
    /// Has let go in this step.
    broken: bool,
    /// No other contact acts on its vertices.
    alone: bool,
    /// Area of contact [m²].
    area: f64,
    /// Sliding speed at the last look [m/s]; 0: none yet.
    speed: f64,
    /// Coefficient at that speed.
    mu: f64,
    /// dt F_v A s^(δ_v − 1) at that speed [kg].
    drag: f64,
}

/// Laws of all kinds.
#[derive(Debug, Default)]
pub(crate) struct General {
    laws: Vec<Entry>,
    viscous: bool,
    dt: f64,
    frozen: bool,
    /// Area of each vertex of cloth [m²], 0 for colliders; empty without viscous friction.
    areas: Vec<f64>,
    /// Contacts on each vertex.
    degree: Vec<u32>,
    /// Σ |w| over the loaded contacts of each vertex.
    load: Vec<f64>,
}

impl General {
    pub(crate) fn new(laws: &[FrictionLaw]) -> Self {
        // The last entry is that of contacts without friction.
        let none = FrictionLaw::Coulomb { mu_c: 0.0 };
        let viscous = laws.iter().any(FrictionLaw::is_viscous);
        Self { laws: laws.iter().chain([&none]).map(Entry::of).collect(), viscous, ..Self::default() }
    }

    /// Takes the vertices' areas from the positions `x`, if a law needs them.
    pub(crate) fn set_areas(&mut self, mesh: &CollisionMesh, x: &[Vec3]) {
        if !self.viscous {
            return;
        }
        self.areas.clear();
        self.areas.resize(mesh.vertex_count, 0.0);
        for triangle in &mesh.triangles {
            if mesh.bodies[mesh.vertex_body[triangle[0] as usize] as usize].dynamic {
                let [a, b, c] = triangle.map(|v| x[v as usize]);
                let third = (b - a).cross(&(c - a)).norm() / 6.0;
                for &v in triangle {
                    self.areas[v as usize] += third;
                }
            }
        }
    }

    /// Whether areas are wanted and not known yet.
    pub(crate) fn wants_areas(&self) -> bool {
        self.viscous && self.areas.is_empty()
    }

    /// Before the first sweep of a step.
    pub(crate) fn start(&mut self, dt: f64) {
        self.dt = dt;
    }

    /// The speed s > 0 at which s + (λ μ(s) + A f_v dt s^δ_v)/m = u, the largest; 0 if there is none.
    fn speed(&self, state: &mut Sliding, lambda: f64, mass: f64, u: f64) -> f64 {
        if self.frozen && state.speed > 0.0 {
            return ((u - state.mu * lambda / mass) / (1.0 + state.drag / mass)).max(0.0);
        }
        let law = &self.laws[state.law as usize];
        let excess = lambda * (law.mu_s - law.mu_c) / mass;
        let viscous = law.f_v * self.dt * state.area / mass;
        // No solution is above this one.
        let most = u - lambda * law.mu_c / mass;
        if most <= 0.0 {
            return 0.0;
        }
        let mut s = if state.speed > 0.0 { state.speed.min(most) } else { most };
        let mut restarted = s == most;
        let (mut share, mut slope, mut power, mut at);
        let mut steps = 0;
        loop {
            (share, slope) = law.stribeck(s);
            power = law.power(s);
            at = s;
            steps += 1;
            let off = s + excess * share + viscous * power - most;
            let rate = 1.0 + (excess * slope + viscous * law.delta_v * power) / s;
            let next = s - off / rate;
            if rate <= 0.0 || next <= 0.0 {
                // Beyond the minimum: from above that means that there is no solution.
                if restarted {
                    return 0.0;
                }
                (s, restarted) = (most, true);
                continue;
            }
            let next = next.min(most);
            let change = (next - s) / s;
            let small = change * change * (rate - 1.0).abs() <= NEWTON_ERROR * rate.min(1.0);
            s = next;
            if small || steps == NEWTON_STEPS {
                break;
            }
        }
        state.speed = s;
        // From the last evaluation, along the tangent.
        state.mu = law.mu_c + (law.mu_s - law.mu_c) * (share + slope * (s / at - 1.0));
        state.drag = law.f_v * self.dt * state.area * power / at;
        s
    }
}

/// Area of a contact whose vertices are loaded with `load` [m²]: each side counts its vertices' areas by weight, a vertex that
/// several contacts load gives each its share, and of two sides of cloth the harmonic mean counts: at a border the side with
/// the larger cells counts too much.
fn contact_area(areas: &[f64], contact: &Contact<Sliding>, load: impl Fn(usize) -> f64) -> f64 {
    let (mut sides, mut cloth) = ([0.0; 2], [false; 2]);
    for k in 0..4 {
        let v = contact.vertices[k] as usize;
        let (weight, area) = (contact.weights[k], areas[v]);
        let side = usize::from(weight < 0.0);
        sides[side] += weight.abs() * area / load(v).max(1.0);
        cloth[side] |= weight != 0.0 && area > 0.0;
    }
    match cloth {
        [true, true] => 2.0 * sides[0] * sides[1] / (sides[0] + sides[1]),
        _ => sides[0] + sides[1],
    }
}

impl Kernel for General {
    type State = Sliding;

    fn state(&self, rule: &FrictionRule, mesh: &CollisionMesh, first: u32, second: u32) -> Sliding {
        Sliding { law: rule.index_of(mesh, first, second) as u32, ..self.frictionless() }
    }

    fn frictionless(&self) -> Sliding {
        let law = (self.laws.len() - 1) as u32;
        Sliding { law, broken: false, alone: false, area: 0.0, speed: 0.0, mu: 0.0, drag: 0.0 }
    }

    #[inline]
    fn acts(&self, state: &Sliding) -> bool {
        let law = &self.laws[state.law as usize];
        law.mu_s > 0.0 || law.f_v > 0.0
    }

    #[inline]
    fn at_rest(&self, state: &Sliding) -> f64 {
        self.laws[state.law as usize].mu_s
    }

    #[inline]
    fn bound(&self, state: &mut Sliding, stop: Vec3, lambda: f64, mass: f64) -> Vec3 {
        let (needed, threshold) = (stop.norm(), self.laws[state.law as usize].mu_s * lambda);
        if !state.broken {
            if needed <= threshold {
                return stop;
            }
            if !state.alone {
                return stop * (threshold / needed);
            }
            state.broken = true;
        }
        let u = needed / mass;
        let s = self.speed(state, lambda, mass, u);
        if s > 0.0 { stop * (1.0 - s / u) } else { stop }
    }

    fn begin(&mut self, contacts: &mut [Contact<Sliding>], vertex_count: usize) {
        self.degree.clear();
        self.degree.resize(vertex_count, 0);
        let (degree, areas) = (&mut self.degree, &self.areas);
        // A pinned vertex moves nothing, but has an area to share.
        let counts = |contact: &Contact<Sliding>, k: usize| {
            let shares = contact.weights[k] != 0.0
                && areas.get(contact.vertices[k] as usize).is_some_and(|area| *area > 0.0);
            contact.moves(k) || shares
        };
        let each = |contact: &Contact<Sliding>, f: &mut dyn FnMut(usize)| {
            (0..4).filter(|&k| counts(contact, k)).for_each(|k| f(contact.vertices[k] as usize));
        };
        for contact in &*contacts {
            each(contact, &mut |v| degree[v] += 1);
        }
        for contact in contacts {
            let mut alone = true;
            each(contact, &mut |v| alone &= degree[v] == 1);
            contact.friction.alone = alone;
            if alone && self.viscous {
                contact.friction.area = contact_area(areas, contact, |_| 1.0);
            }
        }
    }

    #[inline]
    fn before_sweep(&mut self, sweep: usize) {
        self.frozen = sweep >= LIVE_SWEEPS;
    }

    const REVIEWS: bool = true;

    #[inline]
    fn alone(&self, state: &Sliding) -> bool {
        state.alone
    }

    fn review(
        &mut self,
        contacts: &mut [Contact<Sliding>],
        motion: &Motion<'_>,
        tolerance: f64,
        mut again: impl FnMut(usize),
    ) {
        if self.viscous {
            let mut load = std::mem::take(&mut self.load);
            load.clear();
            load.resize(self.areas.len(), 0.0);
            for contact in contacts
                .iter()
                .filter(|c| !c.friction.alone && c.normal.dot(&c.impulse) > 0.0 && self.acts(&c.friction))
            {
                for k in 0..4 {
                    load[contact.vertices[k] as usize] += contact.weights[k].abs();
                }
            }
            self.load = load;
        }
        for (i, contact) in contacts.iter_mut().enumerate() {
            let lambda = contact.normal.dot(&contact.impulse);
            if contact.friction.alone || lambda <= 0.0 || !self.acts(&contact.friction) {
                continue;
            }
            let mut changed = false;
            if !contact.friction.broken {
                let u = contact.relative(motion.buffers.kept());
                let sliding = u - contact.normal * contact.normal.dot(&u);
                let stop = contact.impulse - contact.normal * lambda - sliding * contact.mass;
                let threshold = self.laws[contact.friction.law as usize].mu_s * lambda;
                let needed = stop.norm();
                changed = sliding.norm() > tolerance && needed > threshold * (1.0 + THRESHOLD_ROUNDING);
                contact.friction.broken = changed;
            }
            if self.viscous {
                let area = contact_area(&self.areas, contact, |v| self.load[v]);
                changed |=
                    contact.friction.broken && (area - contact.friction.area).abs() > AREA_CHANGE * area;
                contact.friction.area = area;
            }
            if changed {
                again(i);
            }
        }
    }

    fn bytes(&self) -> usize {
        bytes_of(&self.laws) + bytes_of(&self.areas) + bytes_of(&self.degree) + bytes_of(&self.load)
    }
}
