//! Sub-surfaces of low curvature that cannot meet themselves: not traversed against themselves in a session's first frame.
//!
//! A block's normals lie in a cone of half-angle φ about an axis; cones are merged up the tree to at most 70°. If, seen along the
//! axis, the contour is simple ([`super::contour`]), no two of the block's triangles cover a point twice: a point is
//! covered as often as the loops wind around it, since all triangles are seen from the same side. So the block is a flat mesh
//! as seen, and features without a common vertex are no nearer to each other than a vertex is to the opposite side of
//! one of its triangles (at least h cos φ, with h the least height of the triangles), or than a vertex of the contour is to another
//! side of it. Where both exceed twice the largest radius and the thickness, no pair of the block could be registered.
//! That keeps the triangles' orientation, too, wherever in their balls the vertices are: the cone bounds the normals over the
//! whole session, without a search in time. A vertex beyond its ball dangles, and what lies above it is traversed.
//!
//! Sources: \[volino1994\], \[provot1997\].

use super::contour::Contours;
use super::distance::Row;
use crate::bounds::LANES;
use crate::bvh::build::Tree;
use crate::bvh::refit::Boxes;
use crate::{CollisionMesh, Vec3};
use cloth_mesh::NONE;
use rayon::prelude::*;

/// Largest half-angle of a merged cone \[rad\].
const MOST_ANGLE: f64 = 70.0 * std::f64::consts::PI / 180.0;
/// More than the rounding of an angle \[rad\].
const ANGLE_ERROR: f64 = 1e-6;
/// Leaves per task.
const CHUNK: usize = 256;

/// Of the triangles below a block.
#[derive(Debug, Clone, Copy)]
struct Cone {
    axis: Vec3,
    /// Half-angle \[rad\].
    angle: f64,
    /// Least height of a triangle \[m\].
    height: f64,
    /// Largest radius of a vertex' ball \[m\].
    radius: f64,
}

impl Cone {
    /// The axis is the mean of those of the parts.
    fn around(axes: impl Iterator<Item = Vec3>, most: impl Fn(&Vec3) -> f64) -> Option<(Vec3, f64)> {
        let sum: Vec3 = axes.sum();
        let length = sum.norm();
        if !(length > 1e-3) {
            return None;
        }
        let axis = sum / length;
        let angle = most(&axis) + ANGLE_ERROR;
        (angle <= MOST_ANGLE).then_some((axis, angle))
    }

    /// What the heights must exceed.
    fn clearance(&self, thickness: f64) -> f64 {
        (2.0 * self.radius + thickness) * (1.0 + 1e-9)
    }

    fn is_clear(&self, thickness: f64) -> bool {
        self.height * self.angle.cos() > self.clearance(thickness)
    }
}

/// Where the vertices are: each within its ball.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Whereabouts<'a> {
    /// Middles relative to some origin [m].
    pub(crate) middles: &'a [Row],
    /// Radii [m].
    pub(crate) radii: &'a [f32],
    /// How near two features are to be to meet [m].
    pub(crate) thickness: f64,
}

fn point(row: &Row) -> Vec3 {
    Vec3::new(f64::from(row[0]), f64::from(row[1]), f64::from(row[2]))
}

fn leaf_cone(ids: &[u32], mesh: &CollisionMesh, within: &Whereabouts<'_>) -> Option<Cone> {
    let (mut normals, mut count) = ([Vec3::zeros(); LANES], 0);
    let (mut squared_height, mut radius) = (f64::INFINITY, 0.0f32);
    for &t in ids.iter().filter(|&&t| t != NONE) {
        let corners = mesh.triangles[t as usize];
        let [a, b, c] = corners.map(|v| point(&within.middles[v as usize]));
        let n = (b - a).cross(&(c - a));
        let squared_area = n.norm_squared();
        let longest = (b - a).norm_squared().max((c - b).norm_squared()).max((a - c).norm_squared());
        for v in corners {
            radius = radius.max(within.radii[v as usize]);
        }
        squared_height = squared_height.min(squared_area / longest);
        normals[count] = n / squared_area.sqrt();
        count += 1;
        let needed = 2.0 * f64::from(radius) + within.thickness;
        // Not a number where the triangle is a point.
        if !(squared_height > needed * needed) {
            return None;
        }
    }
    let normals = &normals[..count];
    let least = |axis: &Vec3| normals.iter().map(|n| axis.dot(n)).fold(1.0, f64::min);
    let (axis, angle) = Cone::around(normals.iter().copied(), |axis| least(axis).max(-1.0).acos())?;
    Some(Cone { axis, angle, height: squared_height.sqrt(), radius: f64::from(radius) })
}

/// Blocks, and triangles below them, that are marked.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Found {
    pub(crate) surfaces: u64,
    pub(crate) triangles: u64,
}

/// Marks the largest blocks above the leaves that cannot meet themselves while their vertices stay in their balls. `is_simple`
/// answers for loops, axis, positions and clearance.
pub(crate) fn mark(
    boxes: &mut Boxes<1>,
    tree: &Tree,
    mesh: &CollisionMesh,
    within: &Whereabouts<'_>,
    contours: &Contours,
    is_simple: impl Fn(&[Vec<u32>], &Vec3, &(dyn Fn(u32) -> Vec3 + Sync), f64) -> bool + Sync,
    pool: &rayon::ThreadPool,
) -> Found {
    let leaves = tree.triangle_ids.par_iter().with_min_len(CHUNK);
    let meets_itself = |body: u32| mesh.bodies_meet(body, body);
    let body_of = |ids: &[u32]| mesh.vertex_body[mesh.triangles[ids[0] as usize][0] as usize];
    let cone =
        |ids: &[u32; LANES]| meets_itself(body_of(ids)).then(|| leaf_cone(ids, mesh, within)).flatten();
    let mut cones: Vec<Option<Cone>> = pool.install(|| leaves.map(cone).collect());
    for inner in &tree.inner {
        let children = &cones[inner.first as usize..(inner.first + inner.count) as usize];
        cones.push(merged(children, within.thickness));
    }
    // Level by level from above: all of a level at once.
    let position = |v: u32| point(&within.middles[v as usize]);
    let mut found = Found::default();
    let mut level: Vec<u32> = tree.roots.iter().filter(|r| meets_itself(r.body)).map(|r| r.block).collect();
    loop {
        level.retain(|&block| tree.inner(block).is_some());
        if level.is_empty() {
            return found;
        }
        let is_flat = |&block: &u32| {
            let loops = contours.of_inner(block as usize - tree.leaves.len());
            cones[block as usize].as_ref().is_some_and(|cone| {
                !loops.is_empty() && is_simple(loops, &cone.axis, &position, cone.clearance(within.thickness))
            })
        };
        let flat: Vec<bool> = pool.install(|| level.par_iter().map(is_flat).collect());
        let mut below = vec![];
        for (&block, is_flat) in level.iter().zip(flat) {
            if is_flat {
                boxes.lanes[block as usize].is_flat = true;
                found.surfaces += 1;
                found.triangles += triangles_below(tree, block);
            } else if let Some(inner) = tree.inner(block) {
                below.extend(inner.first..inner.first + inner.count);
            }
        }
        level = below;
    }
}

fn merged(children: &[Option<Cone>], thickness: f64) -> Option<Cone> {
    let (mut height, mut radius) = (f64::INFINITY, 0.0f64);
    for child in children {
        let child = child.as_ref()?;
        height = height.min(child.height);
        radius = radius.max(child.radius);
    }
    let children = || children.iter().flatten();
    let (axis, angle) = Cone::around(children().map(|child| child.axis), |axis| {
        children().map(|c| axis.dot(&c.axis).clamp(-1.0, 1.0).acos() + c.angle).fold(0.0, f64::max)
    })?;
    let cone = Cone { axis, angle, height, radius };
    cone.is_clear(thickness).then_some(cone)
}

fn triangles_below(tree: &Tree, block: u32) -> u64 {
    match tree.inner(block) {
        Some(inner) => {
            (inner.first..inner.first + inner.count).map(|child| triangles_below(tree, child)).sum()
        }
        None => u64::from(tree.leaves[block as usize].count),
    }
}

#[cfg(test)]
mod tests {
    use super::super::contour;
    use super::super::dangling::ball_box;
    use super::super::room::{Room, Weights};
    use super::*;
    use crate::{BruteForce, Bvh, Detector, Mode, Query};

    fn pool() -> rayon::ThreadPool {
        rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap()
    }

    /// A ribbon around the vertical axis, by so much more than a full turn: flat to look at from above, its ends pass through each
    /// other where they overlap.
    fn spiral(turn: f64) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        const ALONG: usize = 120;
        const ACROSS: usize = 9;
        let mut x = vec![];
        for i in 0..ALONG {
            let angle = turn * i as f64 / (ALONG - 1) as f64;
            let height = 0.05 * (angle - 0.5 * turn).abs();
            for j in 0..ACROSS {
                let radius = 0.6 + 0.4 * j as f64 / (ACROSS - 1) as f64;
                x.push(Vec3::new(radius * angle.cos(), height, radius * angle.sin()));
            }
        }
        let mut triangles = vec![];
        for i in 0..ALONG as u32 - 1 {
            for j in 0..ACROSS as u32 - 1 {
                let a = i * ACROSS as u32 + j;
                let (b, c, d) = (a + 1, a + ACROSS as u32, a + ACROSS as u32 + 1);
                triangles.extend([[a, b, c], [b, d, c]]);
            }
        }
        (x, triangles)
    }

    /// What is found with the contour test and without, and how many contacts there are.
    fn found(x: &[Vec3], triangles: &[[u32; 3]]) -> (Found, Found, usize) {
        let mesh = CollisionMesh::single(x.len(), triangles).unwrap();
        let pool = pool();
        let query = Query { x_t0: x, x_t1: x, thickness: 0.0, mode: Mode::Continuous, active: None };
        let tree = Bvh::new(&mesh, x).unwrap().tree;
        let samples = super::super::samples::Samples::new(&mesh);
        let room =
            Room::new(&mesh, &samples, &query, Weights { alpha: 0.0, beta: 0.0, gamma: 0.0 }, &pool).unwrap();
        let contours = Contours::new(&tree, &mesh);
        let marked = |tested: bool| {
            let mut boxes = Boxes::<1>::default();
            let of_vertex = |v: usize| ball_box(&room.middles[v], room.radii[v], room.thickness);
            boxes.refit(&tree, &mesh, of_vertex, None, &pool);
            let is_simple =
                |loops: &[Vec<u32>], axis: &Vec3, at: &(dyn Fn(u32) -> Vec3 + Sync), clear: f64| {
                    !tested || contour::is_simple(loops, axis, at, clear)
                };
            mark(&mut boxes, &tree, &mesh, &room.whereabouts(), &contours, is_simple, &pool)
        };
        let contacts = BruteForce.detect(&mesh, &query, &pool).unwrap();
        (marked(true), marked(false), contacts.vertex_triangle.len() + contacts.edge_edge.len())
    }

    #[test]
    fn without_its_contour_a_surface_that_meets_itself_seems_flat() {
        let (x, triangles) = spiral(2.0 * std::f64::consts::PI + 0.7);
        let (tested, untested, contacts) = found(&x, &triangles);
        assert!(contacts > 0);
        let all = Found { surfaces: 1, triangles: triangles.len() as u64 };
        assert_eq!(untested, all, "the planted fault: all contacts would be lost");
        assert!(tested.surfaces > 1 && tested.triangles < all.triangles, "{tested:?}");
    }

    #[test]
    fn a_ribbon_that_does_not_close_is_one_flat_surface() {
        let (x, triangles) = spiral(6.0);
        let (tested, _, contacts) = found(&x, &triangles);
        assert_eq!((tested.surfaces, tested.triangles, contacts), (1, triangles.len() as u64, 0));
    }

    #[test]
    fn a_cylinder_is_several_flat_surfaces_and_opposite_windings_are_none() {
        let (x, mut triangles) = spiral(6.0);
        let bent: Vec<Vec3> =
            x.iter().map(|p| Vec3::new((6.0 * p.x).sin(), (6.0 * p.x).cos(), 6.0 * p.z)).collect();
        let (tested, untested, _) = found(&bent, &triangles);
        assert!(tested.surfaces > 1 && untested.surfaces > 1, "{tested:?}");
        for t in triangles.iter_mut().step_by(2) {
            t.swap(0, 1);
        }
        assert_eq!(found(&x, &triangles).0, Found::default());
    }
}
