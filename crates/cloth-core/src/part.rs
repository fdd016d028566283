//! One piece of cloth: which force models its material calls for.

use crate::{
    Bending, CoreError, HingeCoupling, InPlane, Material,
    bending::{BendingLaw, Linear},
    forces::{
        ForceModel,
        coupled::Plate,
        dihedral::{Rest, dihedral_angle},
        hinge::Hinges,
        spring::{Role, Springs},
        stretch_shear::{Stiffness, StretchShear},
    },
    mesh::{NONE, RestShape, Topology, TriMesh},
};

/// One piece of cloth, or the triangles of it that are of one material, and where its vertices lie in the global arrays.
///
/// Where a cloth has several materials, each is a part with the same mesh. An edge between two of them belongs to the part
/// that has its first triangle.
#[derive(Debug, Clone, Copy)]
pub struct ClothPart<'a> {
    /// Its mesh; rest angles of hinges are read from these positions.
    pub mesh: &'a TriMesh,
    /// Connectivity of the mesh.
    pub topology: &'a Topology,
    /// Undeformed geometry of its triangles.
    pub rest: &'a RestShape,
    /// What it is made of.
    pub material: &'a Material,
    /// Global index of its vertex 0.
    pub first_vertex: usize,
    /// The triangles that the part has, ascending; by default all of the mesh.
    pub triangles: Option<&'a [u32]>,
}

impl ClothPart<'_> {
    pub(crate) fn check(&self, cloth_vertex_count: usize) -> Result<(), CoreError> {
        self.material.check()?;
        let (vertices, triangles) = (self.mesh.vertices.len(), self.mesh.triangles.len());
        for (name, expected, got) in [
            ("topology.vertex_count", vertices, self.topology.vertex_count),
            ("topology.triangle_edges", triangles, self.topology.triangle_edges.len()),
            ("rest.area", triangles, self.rest.area.len()),
            ("rest.inverse", triangles, self.rest.inverse.len()),
            ("rest.side_lengths", triangles, self.rest.side_lengths.len()),
        ] {
            if expected != got {
                return Err(CoreError::Length { name, expected, got });
            }
        }
        if let Some(&t) = self.triangles.and_then(|own| own.iter().find(|t| **t as usize >= triangles)) {
            return Err(CoreError::Length { name: "triangles", expected: triangles, got: t as usize + 1 });
        }
        let got = self.first_vertex + vertices;
        if got > cloth_vertex_count {
            return Err(CoreError::Length { name: "cloth vertices", expected: cloth_vertex_count, got });
        }
        Ok(())
    }

    fn global<const N: usize>(&self, local: [u32; N]) -> [u32; N] {
        local.map(|v| v + self.first_vertex as u32)
    }

    /// The triangles that the part has.
    pub(crate) fn own_triangles(&self) -> impl Iterator<Item = usize> {
        let all = if self.triangles.is_none() { self.mesh.triangles.len() } else { 0 };
        (0..all).chain(self.triangles.into_iter().flatten().map(|&t| t as usize))
    }

    /// Whether the part has a triangle, and with it the edges of which this is the first.
    fn has(&self, triangle: u32) -> bool {
        self.triangles.is_none_or(|own| own.binary_search(&triangle).is_ok())
    }

    /// The edges that the part has, each with the places of its triangles.
    fn own_edges(&self) -> impl Iterator<Item = usize> {
        (0..self.topology.edges.len()).filter(|&e| self.has(self.topology.edge_triangles[e][0]))
    }

    pub(crate) fn global_triangles(&self) -> Vec<[u32; 3]> {
        self.own_triangles().map(|t| self.global(self.mesh.triangles[t])).collect()
    }

    pub(crate) fn build_in_plane(
        &self,
        triangles: &[[u32; 3]],
        models: &mut Vec<Box<dyn ForceModel>>,
    ) -> Result<(), CoreError> {
        match self.material.in_plane {
            InPlane::Spring { stiffness, damping } if stiffness > 0.0 || damping > 0.0 => {
                let all = self.edge_lengths();
                let vertices: Vec<_> =
                    self.own_edges().map(|e| self.global(self.topology.edges[e])).collect();
                let lengths = self.own_edges().map(|e| all[e]).collect();
                if !vertices.is_empty() {
                    models.push(Box::new(Springs::new(
                        Role::InPlane,
                        stiffness,
                        damping,
                        vertices,
                        lengths,
                    )?));
                }
            }
            InPlane::BaraffWitkin { warp, weft, shear, damping }
                if warp.max(weft).max(shear) > 0.0 && !triangles.is_empty() =>
            {
                let stiffness = Stiffness { warp, weft, shear, damping };
                let inverse: Vec<_> = self.own_triangles().map(|t| self.rest.inverse[t]).collect();
                let area: Vec<_> = self.own_triangles().map(|t| self.rest.area[t]).collect();
                models.push(Box::new(StretchShear::new(stiffness, triangles.to_vec(), &inverse, &area)?));
            }
            _ => {}
        }
        Ok(())
    }

    pub(crate) fn build_bending(&self, models: &mut Vec<Box<dyn ForceModel>>) -> Result<(), CoreError> {
        let bends = match self.material.bending {
            Bending::None => false,
            Bending::Spring { stiffness, damping } => stiffness > 0.0 || damping > 0.0,
            Bending::Hinge { rigidity, .. } => rigidity > 0.0,
            Bending::Nonlinear(_) | Bending::Plastic(_) | Bending::Hysteresis(_) => true,
        };
        if !bends {
            return Ok(());
        }
        self.topology.require_manifold()?;
        let hinges = self.own_hinges();
        if hinges.is_empty() {
            return Ok(());
        }
        let lengths = self.edge_lengths();
        let rest: Vec<Rest> = hinges
            .iter()
            .map(|hinge| {
                let x = [hinge.edge[0], hinge.edge[1], hinge.opposite[0], hinge.opposite[1]]
                    .map(|v| self.mesh.vertices[v as usize]);
                let areas = hinge.triangles.map(|t| self.rest.area[t as usize]);
                Rest::new(lengths[self.edge_of(hinge)], areas, dihedral_angle(&x))
            })
            .collect();
        match self.material.bending {
            Bending::None => {}
            Bending::Spring { stiffness, damping } => {
                let vertices = hinges.iter().map(|h| self.global(h.opposite)).collect();
                let lengths = hinges.iter().zip(&rest).map(|(h, r)| self.opposite_distance(h, r)).collect();
                models.push(Box::new(Springs::new(Role::Bending, stiffness, damping, vertices, lengths)?));
            }
            Bending::Hinge { rigidity, damping, .. } => {
                models.push(self.hinges(Linear::new(rigidity)?, damping * rigidity, rest)?);
            }
            Bending::Nonlinear(given) => {
                let law = given.curve()?;
                models.push(self.hinges(law, given.damping * law.b2(), rest)?);
            }
            Bending::Plastic(given) => {
                models.push(self.hinges(given.law()?, given.damping * given.rigidity, rest)?);
            }
            Bending::Hysteresis(given) => {
                let law = given.law()?;
                models.push(self.hinges(law, given.damping * law.curve().b2(), rest)?);
            }
        }
        Ok(())
    }

    /// The hinges of the part under a law with the damping D [N m s].
    fn hinges<L: BendingLaw + 'static>(
        &self,
        law: L,
        damping: f64,
        rest: Vec<Rest>,
    ) -> Result<Box<dyn ForceModel>, CoreError> {
        let corners = |h: &crate::mesh::Hinge| [h.edge[0], h.edge[1], h.opposite[0], h.opposite[1]];
        let vertices = self.own_hinges().into_iter().map(|h| self.global(corners(h))).collect();
        let hinges = Hinges::new(law, damping, vertices, rest)?;
        Ok(Box::new(match self.material.bending.hinges() {
            Some(HingeCoupling::Coupled) => hinges.coupled(&self.plates()),
            _ => hinges,
        }))
    }

    /// The hinges that the part has.
    fn own_hinges(&self) -> Vec<&crate::mesh::Hinge> {
        self.topology.hinges.iter().filter(|h| self.has(h.triangles[0])).collect()
    }

    /// The triangles with those of their hinges that the part has.
    fn plates(&self) -> Vec<Plate> {
        let mut hinge_of = vec![NONE; self.topology.edges.len()];
        for (k, hinge) in self.own_hinges().into_iter().enumerate() {
            hinge_of[self.edge_of(hinge)] = k as u32;
        }
        let lengths = self.rest.side_lengths.iter().zip(&self.rest.area);
        let plate = |(edges, (&lengths, &area)): (&[u32; 3], (&[f64; 3], &f64))| Plate {
            hinges: edges.map(|e| hinge_of[e as usize]),
            lengths,
            area,
        };
        self.topology.triangle_edges.iter().zip(lengths).map(plate).collect()
    }

    /// Rest length of each edge: the mean over the triangles that have it, whose panels may differ at a seam [m].
    fn edge_lengths(&self) -> Vec<f64> {
        let mut sums = vec![(0.0, 0u32); self.topology.edges.len()];
        for (edges, lengths) in self.topology.triangle_edges.iter().zip(&self.rest.side_lengths) {
            for (&edge, length) in edges.iter().zip(lengths) {
                let sum = &mut sums[edge as usize];
                sum.0 += length;
                sum.1 += 1;
            }
        }
        sums.iter().map(|&(sum, count)| sum / f64::from(count)).collect()
    }

    /// Edge of a hinge.
    fn edge_of(&self, hinge: &crate::mesh::Hinge) -> usize {
        let [a, b] = hinge.edge;
        let key = [a.min(b), a.max(b)];
        let edges = self.topology.triangle_edges[hinge.triangles[0] as usize];
        edges.into_iter().find(|&e| self.topology.edges[e as usize] == key).unwrap_or(edges[0]) as usize
    }

    /// Rest distance of a hinge's opposite vertices: its two rest triangles at its rest angle [m].
    fn opposite_distance(&self, hinge: &crate::mesh::Hinge, rest: &Rest) -> f64 {
        // Height over the edge and foot along it, from the side that starts at edge[0].
        let flap = |which: usize| {
            let t = hinge.triangles[which] as usize;
            let triangle = self.mesh.triangles[t];
            let lengths = self.rest.side_lengths[t];
            let height = 2.0 * self.rest.area[t] / rest.edge;
            let side = |from: u32| {
                let pair = [from, hinge.opposite[which]];
                (0..3)
                    .find(|&s| {
                        let ends = [triangle[s], triangle[(s + 1) % 3]];
                        ends == pair || ends == [pair[1], pair[0]]
                    })
                    .map_or(rest.edge, |s| lengths[s])
            };
            let (near, far) = (side(hinge.edge[0]), side(hinge.edge[1]));
            let foot = (near * near - far * far + rest.edge * rest.edge) / (2.0 * rest.edge);
            (foot, height)
        };
        let ((s0, h0), (s1, h1)) = (flap(0), flap(1));
        ((s0 - s1).powi(2) + h0 * h0 + h1 * h1 + 2.0 * h0 * h1 * rest.angle.cos()).sqrt()
    }
}
