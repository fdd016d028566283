//! The passes over a range of hinges, one kernel per law and way of keeping its memory.

use super::{
    BLOCK, Hinges,
    places::{Places, PlacesMut},
};
use crate::{
    bending::BendingLaw,
    forces::{
        Block, Linear, Outer, Survey,
        dihedral::{Angle, dihedral_angle},
    },
    mesh::Vec3,
};
use std::ops::Range;

impl<L: BendingLaw> Hinges<L> {
    /// Elastic angle and curvature of each hinge of a range.
    pub(super) fn look(
        &self,
        range: Range<usize>,
        x: &[Vec3],
        places: &mut impl Places<L>,
        Survey { elastic, work }: Survey<&mut [f64]>,
    ) {
        for ((k, element), (elastic, work)) in range.enumerate().zip(elastic.iter_mut().zip(work)) {
            let (rest, place) = (&self.rest[element], places.get(k));
            let angle = dihedral_angle(&self.corners_of(element, x));
            *work = Self::curvature(rest, place.as_ref(), angle);
            *elastic = rest.height * self.elastic(place.as_ref(), *work);
        }
    }

    /// Adds the energy of a range to `sum` [J].
    pub(super) fn add_bending(
        &self,
        range: Range<usize>,
        x: &[Vec3],
        places: &mut impl Places<L>,
        survey: Survey<&[f64]>,
        sum: &mut f64,
    ) {
        for (k, element) in range.enumerate() {
            let (rest, place) = (&self.rest[element], places.get(k));
            let curvature = if self.coupled.is_some() {
                // Half of each product: its other hinge has the other half.
                let torque = self.neighbour_torque(element, survey.elastic);
                *sum += 0.5 * survey.elastic[element] * torque;
                survey.work[k]
            } else {
                let angle = dihedral_angle(&self.corners_of(element, x));
                Self::curvature(rest, place.as_ref(), angle)
            };
            *sum += rest.edge * rest.height * self.answer(place.as_ref(), curvature, 0.0).energy;
        }
    }

    /// Corner forces of a range [N].
    pub(super) fn push(
        &self,
        range: Range<usize>,
        x: &[Vec3],
        v: &[Vec3],
        places: &mut impl Places<L>,
        survey: Survey<&[f64]>,
        out: &mut [Vec3],
    ) {
        for ((k, element), f) in range.enumerate().zip(out.chunks_exact_mut(4)) {
            let (rest, place) = (&self.rest[element], places.get(k));
            let corners = self.corners_of(element, x);
            let (curvature, gradient, neighbours) = if self.coupled.is_some() {
                let neighbours = self.neighbour_torque(element, survey.elastic);
                (survey.work[k], rest.gradient(&corners), neighbours)
            } else {
                let Angle { value, gradient } = rest.angle(&corners);
                (Self::curvature(rest, place.as_ref(), value), gradient, 0.0)
            };
            let moment = self.answer(place.as_ref(), curvature, 0.0).moment;
            let mut torque = rest.edge * moment + neighbours;
            if self.damping > 0.0 {
                let rate: f64 = (0..4).map(|c| gradient[c].dot(&v[self.vertices[element][c] as usize])).sum();
                torque += rest.edge * self.damping / rest.height * rate;
            }
            for c in 0..4 {
                f[c] = gradient[c] * -torque;
            }
        }
    }

    /// Exact corner forces and blocks of a range; of coupled hinges elastic angles and curvatures instead.
    pub(super) fn blocks(
        &self,
        range: Range<usize>,
        x: &[Vec3],
        v: &[Vec3],
        linear: &Linear,
        places: &mut impl PlacesMut<L>,
        Survey { elastic, work }: Survey<&mut [f64]>,
        forces: &mut [Vec3],
        blocks: &mut [Block],
    ) {
        let elements = range.enumerate().zip(forces.chunks_exact_mut(4).zip(blocks.chunks_exact_mut(6)));
        for ((k, element), (f, blocks)) in elements {
            let rest = &self.rest[element];
            let value = dihedral_angle(&self.corners_of(element, x));
            let (place, curvature) = self.arrive(rest, places, k, value, linear.accept);
            if self.coupled.is_some() {
                elastic[k] = rest.height * self.elastic(place.as_ref(), curvature);
                work[k] = curvature;
            } else {
                self.exact_blocks(element, x, v, linear, (place, curvature, 0.0), f, blocks);
            }
        }
    }

    /// The second pass of [`Self::blocks`] over coupled hinges.
    pub(super) fn couple_blocks(
        &self,
        range: Range<usize>,
        x: &[Vec3],
        v: &[Vec3],
        linear: &Linear,
        places: &mut impl Places<L>,
        survey: Survey<&[f64]>,
        forces: &mut [Vec3],
        blocks: &mut [Block],
    ) {
        let elements = range.zip(survey.work).zip(forces.chunks_exact_mut(4));
        for (k, (((element, curvature), f), blocks)) in elements.zip(blocks.chunks_exact_mut(6)).enumerate() {
            let at = (places.get(k), *curvature, self.neighbour_torque(element, survey.elastic));
            self.exact_blocks(element, x, v, linear, at, f, blocks);
        }
    }

    /// Moves the places of a range on to `x`.
    pub(super) fn advance(&self, range: Range<usize>, x: &[Vec3], places: &mut impl PlacesMut<L>) {
        for (k, element) in range.enumerate() {
            let angle = dihedral_angle(&self.corners_of(element, x));
            self.arrive(&self.rest[element], places, k, angle, true);
        }
    }

    /// Couplings and corner forces of the elements from `first` on; of coupled ones elastic angles and torques instead of
    /// forces.
    #[inline]
    pub(super) fn outer<const COUPLED: bool>(
        &self,
        first: usize,
        x: &[Vec3],
        v: &[Vec3],
        linear: &Linear,
        places: &mut impl PlacesMut<L>,
        Survey { elastic, work }: Survey<&mut [f64]>,
        forces: &mut [Vec3],
        outer: &mut [Outer],
    ) {
        let blocks = forces.chunks_mut(4 * BLOCK).zip(outer.chunks_mut(BLOCK));
        for (block, (forces, outer)) in blocks.enumerate() {
            // Angles first, laws after: the laws of several hinges then run side by side.
            let (mut angles, mut rates) = ([0.0; BLOCK], [0.0; BLOCK]);
            for (k, outer) in outer.iter_mut().enumerate() {
                let element = first + block * BLOCK + k;
                let Angle { value, gradient } = self.rest[element].angle(&self.corners_of(element, x));
                let [v0, v1, v2, v3] = self.corners_of(element, v);
                // Σ g_a = 0, so the rate needs differences only.
                rates[k] =
                    gradient[1].dot(&(v1 - v0)) + gradient[2].dot(&(v2 - v0)) + gradient[3].dot(&(v3 - v0));
                angles[k] = value;
                outer.gradient = gradient.map(Into::into);
            }
            for (k, (f, outer)) in forces.chunks_exact_mut(4).zip(outer).enumerate() {
                let at = block * BLOCK + k;
                let rest = &self.rest[first + at];
                let (place, curvature) = self.arrive(rest, places, at, angles[k], linear.accept);
                let answer = self.answer(place.as_ref(), curvature, rates[k]);
                let per_angle = rest.edge / rest.height;
                // A negative slope has no place in a positive semi-definite block.
                let mut stiffness = per_angle * answer.slope.max(0.0);
                if COUPLED {
                    stiffness += self.bound(first + at, linear.iterates);
                }
                let damping = per_angle * self.damping;
                let torque = rest.edge * answer.moment + (damping + linear.ahead * stiffness) * rates[k];
                if COUPLED {
                    elastic[at] = rest.height * self.elastic(place.as_ref(), curvature);
                    work[at] = torque;
                } else {
                    for (f, gradient) in f.iter_mut().zip(&outer.gradient) {
                        *f = Vec3::from(*gradient) * -torque;
                    }
                }
                outer.scale = linear.stiffness * stiffness + linear.damping * damping;
            }
        }
    }
}
