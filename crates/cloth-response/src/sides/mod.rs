//! Which side of each other the features of near pairs are on, remembered from step to step.
//!
//! A pair's side is the sign of n · (first − second) with the triangle's normal n, or the cross product of
//! the two edges ([`cloth_collision::side`]). It is known from when the pair comes near, straight above the
//! triangle or with edges that cross, until it is no longer near, and decides the contact's normal
//!
//! - where the distance is rounding and has no direction: the plane's normal, to the remembered side;
//! - where a pair went through, which only one can that touched at the start and was exempt: to the side
//!   where it was, with a negative gap, so that repulsion brings it back.
//!
//! A pair that was not exempt has been seen not to touch all the way: where its position says another side,
//! it went round a border (or two edges turned past parallel), and the side is that of the position.
//!
//! A pair that is met touching, with nothing remembered, takes the side of the first of these that says one:
//! what is remembered of the vertex with triangles beside; the cloth around the vertex; its motion (it came
//! from where it does not go); else the later body lies above, along the plane's normal that points to the
//! positive side of the axis nearest to it.
//!
//! Source: Wong 2010, section 1, after Selle et al. 2009, "Robust high-resolution cloth using parallelism,
//! history-based collisions, and accurate friction": which pairs are followed and why; the rules above are
//! this project's.

mod touching;

use crate::ResponseError;
use crate::motion::{Motion, bytes_of};
use cloth_collision::{CollisionMesh, Stencil, StencilKind, plane, side};
use touching::{first_side, votes};

/// The side of one near pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Side {
    /// (v, a, b, c) or (a0, a1, b0, b1).
    pub vertices: [u32; 4],
    /// Which kind of pair.
    pub kind: StencilKind,
    /// Whether the first feature is where the normal points.
    pub positive: bool,
    /// Whether it has been seen not to pass to the other side; not so after a step in which the pair was
    /// exempt.
    pub certain: bool,
}

impl Side {
    fn key(&self) -> (StencilKind, [u32; 4]) {
        (self.kind, self.vertices)
    }

    /// 1 or −1, as [`cloth_collision::side`].
    pub fn sign(&self) -> i8 {
        if self.positive { 1 } else { -1 }
    }
}

/// The sides of all near pairs, sorted by kind and vertices.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sides {
    list: Vec<Side>,
    /// Pairs that are where they should not be, sorted; of the step at hand alone.
    through: Vec<(StencilKind, [u32; 4])>,
}

impl Sides {
    /// The sides as a checkpoint has them.
    ///
    /// # Errors
    /// [`ResponseError::Side`] for a pair that `mesh` cannot have, or that is not after the one before.
    pub fn new(list: Vec<Side>, mesh: &CollisionMesh) -> Result<Self, ResponseError> {
        for (k, side) in list.iter().enumerate() {
            let [a, b, c, d] = side.vertices;
            let features = side.vertices.iter().all(|v| (*v as usize) < mesh.vertex_count)
                && match side.kind {
                    StencilKind::VertexTriangle => {
                        mesh.triangle_of([b, c, d]).is_some() && ![b, c, d].contains(&a)
                    }
                    StencilKind::EdgeEdge => {
                        [[a, b], [c, d]].iter().all(|e| mesh.edges.binary_search(e).is_ok())
                    }
                };
            if !features {
                return Err(ResponseError::Side { pair: k, expected: "vertices of a pair of the mesh" });
            }
            if k > 0 && list[k - 1].key() >= side.key() {
                return Err(ResponseError::Side { pair: k, expected: "a pair after the one before" });
            }
        }
        Ok(Self { list, through: Vec::new() })
    }

    /// All of them.
    pub fn pairs(&self) -> &[Side] {
        &self.list
    }

    /// What is remembered of a pair.
    pub fn get(&self, kind: StencilKind, vertices: [u32; 4]) -> Option<&Side> {
        self.list.binary_search_by_key(&(kind, vertices), Side::key).ok().map(|k| &self.list[k])
    }

    /// Whether the pair is on the other side of where it should be.
    pub(crate) fn is_through(&self, kind: StencilKind, vertices: [u32; 4]) -> bool {
        !self.through.is_empty() && self.through.binary_search(&(kind, vertices)).is_ok()
    }

    /// Memory \[B\].
    pub(crate) fn bytes(&self) -> usize {
        bytes_of(&self.list) + bytes_of(&self.through)
    }

    /// Takes the sides of the pairs `near` from `past` and from where they are, and turns their normals to
    /// these sides.
    ///
    /// `near`: as [`cloth_collision::Bvh::proximity`] sorts it, at the start of `motion`. A pair that went
    /// through gets its gap as a negative distance. Returns the number of pairs whose normal the side
    /// decided, not the distance.
    pub(crate) fn renew(
        &mut self,
        past: &Self,
        near: &mut [Stencil],
        mesh: &CollisionMesh,
        motion: &Motion<'_>,
    ) -> usize {
        self.list.clear();
        self.through.clear();
        let mut decided = 0;
        let mut rest = &past.list[..];
        let lead = |kind: StencilKind, vertices: &[u32; 4]| (kind, vertices[0]);
        for stencil in near {
            // Both lists ascend by kind and first vertex.
            let own = lead(stencil.kind, &stencil.vertices);
            let skip = rest.iter().take_while(|s| lead(s.kind, &s.vertices) < own).count();
            rest = &rest[skip..];
            let group = rest.iter().take_while(|s| lead(s.kind, &s.vertices) == own);
            let known = group.clone().find(|s| s.vertices == stencil.vertices);
            self.take(stencil, known, past, mesh, motion, &mut decided);
        }
        self.list.sort_unstable_by_key(Side::key);
        self.list.dedup_by_key(|s| s.key());
        self.through.sort_unstable();
        decided
    }

    fn take(
        &mut self,
        stencil: &mut Stencil,
        known: Option<&Side>,
        past: &Self,
        mesh: &CollisionMesh,
        motion: &Motion<'_>,
        decided: &mut usize,
    ) {
        let Stencil { kind, vertices, .. } = *stencil;
        let p = vertices.map(|v| motion.x_t0[v as usize]);
        let here = side(kind, &p);
        let is_inside = stencil.weights.iter().all(|w| *w != 0.0);
        let has_direction = stencil.has_direction(&p);
        let of_plane = plane(kind, &p);
        let sign = match known {
            Some(known) if here == 0 || !is_inside || !known.certain => known.sign(),
            _ if is_inside && of_plane.is_some() => here,
            _ => 0,
        };
        if has_direction {
            let is_through = is_inside && sign * here < 0;
            if is_through {
                stencil.normal = -stencil.normal;
                stencil.distance = -stencil.distance;
                *decided += 1;
                self.through.push((kind, vertices));
            }
            if sign != 0 {
                let certain = known.is_none_or(|k| k.certain || here == sign);
                self.list.push(Side { vertices, kind, positive: sign > 0, certain });
            }
            return;
        }
        *decided += 1;
        let Some(normal) = of_plane else {
            // No plane, no side: as where nothing is remembered.
            if first_side(stencil, stencil.normal, past, mesh, motion) < 0 {
                stencil.normal = -stencil.normal;
            }
            return;
        };
        let sign = match sign {
            0 => match votes(stencil, normal, past, motion.x_t0) {
                0 if here != 0 => here,
                0 => first_side(stencil, normal, past, mesh, motion),
                vote => vote,
            },
            sign => sign,
        };
        stencil.normal = normal * f64::from(sign);
        if is_inside && sign * here < 0 {
            self.through.push((kind, vertices));
        }
        let certain = known.is_none_or(|k| k.certain || here == sign);
        self.list.push(Side { vertices, kind, positive: sign > 0, certain });
    }

    /// Ends the step at hand; exempt pairs may have passed in it.
    pub(crate) fn end_step(&mut self, is_exempt: impl Fn(StencilKind, [u32; 4]) -> bool) {
        self.through.clear();
        for side in &mut self.list {
            side.certain &= !is_exempt(side.kind, side.vertices);
        }
    }
}

#[cfg(test)]
mod tests;
