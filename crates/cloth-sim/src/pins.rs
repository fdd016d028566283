//! Cloth vertices whose motion is prescribed: held fixed, moved by keyframes, carried by a collider.

use crate::bodies::Bodies;
use crate::motion::{Motion, Path};
use crate::{Scene, SceneError, Vec3};
use cloth_collision::distance::vertex_triangle;
use std::collections::BTreeMap;

/// All pinned vertices of a scene, ascending, and what holds each.
pub(crate) struct PinSet {
    pub(crate) vertices: Vec<u32>,
    holds: Vec<Hold>,
    paths: Vec<Path>,
    /// (vertex, collider) of all vertices carried by a collider.
    pub(crate) attachments: Vec<(u32, usize)>,
}

enum Hold {
    /// A point in space [m].
    Fixed(Vec3),
    /// A path about a pivot, and the start relative to the pivot.
    Keyframed { path: usize, pivot: Vec3, offset: Vec3 },
    /// A rigid collider, and the start in its coordinates.
    Rigid { collider: usize, local: Vec3 },
    /// The nearest triangle of an animated collider (global vertices), the nearest point on it, and what is left in the
    /// triangle's own frame.
    Triangle { corners: [u32; 3], weights: [f64; 3], offset: Vec3 },
}

impl PinSet {
    /// Selects and anchors the pins of a checked scene; `x` holds the start of all vertices [m].
    pub(crate) fn new(scene: &Scene, bodies: &Bodies, x: &[Vec3]) -> Result<Self, SceneError> {
        let mut held: BTreeMap<u32, Hold> = BTreeMap::new();
        let mut paths = Vec::new();
        let mut attachments = Vec::new();
        for (c, (cloth, body)) in scene.cloth.iter().zip(&bodies.cloth).enumerate() {
            for (p, pin) in cloth.pins.iter().enumerate() {
                let key = format!("cloth[{c}].pins[{p}]");
                let local: Vec<u32> = match (&pin.vertices, &pin.region) {
                    (Some(list), _) => {
                        if let Some(i) = list.iter().position(|&v| v as usize >= body.x.len()) {
                            return Err(scene.error(
                                &format!("{key}.vertices[{i}]"),
                                format!("a vertex of \"{}\", 0 to {}", cloth.name, body.x.len() - 1),
                                list[i].to_string(),
                            ));
                        }
                        list.clone()
                    }
                    (None, Some(region)) => {
                        let (lo, hi) = (Vec3::from(region.min), Vec3::from(region.max));
                        let inside = |p: &Vec3| (0..3).all(|a| lo[a] <= p[a] && p[a] <= hi[a]);
                        (0..body.x.len() as u32).filter(|&v| inside(&body.x[v as usize])).collect()
                    }
                    (None, None) => Vec::new(),
                };
                if local.is_empty() {
                    let expected = format!("at least one start position of \"{}\" inside", cloth.name);
                    return Err(scene.error(&format!("{key}.box"), expected, "none"));
                }
                let start = |v: u32| body.x[v as usize];
                let pivot = pin.pivot.map_or_else(
                    || local.iter().map(|&v| start(v)).sum::<Vec3>() / local.len() as f64,
                    Vec3::from,
                );
                let collider = pin
                    .collider
                    .as_ref()
                    .and_then(|name| scene.collider.iter().position(|k| &k.name == name));
                if collider.is_none() && !pin.keyframes.is_empty() {
                    paths.push(Path::new(&pin.keyframes, [0.0; 3], None));
                }
                for (i, &v) in local.iter().enumerate() {
                    let hold = match collider {
                        Some(collider) => anchor(bodies, collider, start(v), x),
                        None if pin.keyframes.is_empty() => Hold::Fixed(start(v)),
                        None => Hold::Keyframed { path: paths.len() - 1, pivot, offset: start(v) - pivot },
                    };
                    let global = v + body.first_vertex as u32;
                    if held.insert(global, hold).is_some() {
                        let key = if pin.vertices.is_some() {
                            format!("{key}.vertices[{i}]")
                        } else {
                            format!("{key}.box")
                        };
                        let got = format!("vertex {v} of \"{}\" again", cloth.name);
                        return Err(scene.error(&key, "vertices that no other pin holds", got));
                    }
                    attachments.extend(collider.map(|k| (global, k)));
                }
            }
        }
        let (vertices, holds) = held.into_iter().unzip();
        Ok(Self { vertices, holds, paths, attachments })
    }

    /// Writes the positions at `time` [s]; `x` must hold the colliders at that time [m].
    pub(crate) fn write(&self, bodies: &Bodies, time: f64, x: &[Vec3], out: &mut [Vec3]) {
        let poses: Vec<_> = self.paths.iter().map(|p| p.at(time)).collect();
        let carried: Vec<_> = bodies
            .colliders
            .iter()
            .map(|c| match &c.motion {
                Motion::Rigid { path, .. } => Some(path.at(time)),
                Motion::Sequence { .. } => None,
            })
            .collect();
        for (target, hold) in out.iter_mut().zip(&self.holds) {
            *target = match hold {
                Hold::Fixed(p) => *p,
                Hold::Keyframed { path, pivot, offset } => {
                    pivot + poses[*path].transform_point(&(*offset).into()).coords
                }
                Hold::Rigid { collider, local } => {
                    carried[*collider].map_or(*local, |pose| pose.transform_point(&(*local).into()).coords)
                }
                Hold::Triangle { corners, weights, offset } => {
                    let p = corners.map(|v| x[v as usize]);
                    point(&p, weights) + frame(&p) * offset
                }
            };
        }
    }

    /// Memory [B].
    pub(crate) fn bytes(&self) -> usize {
        self.vertices.len() * (size_of::<u32>() + size_of::<Hold>())
    }
}

fn anchor(bodies: &Bodies, collider: usize, start: Vec3, x: &[Vec3]) -> Hold {
    let body = &bodies.colliders[collider];
    if let Motion::Rigid { path, .. } = &body.motion {
        return Hold::Rigid { collider, local: path.at(0.0).inverse_transform_point(&start.into()).coords };
    }
    let mut best: Option<(f64, [u32; 3], [f64; 3])> = None;
    for triangle in &body.triangles {
        let corners = triangle.map(|v| v + body.first_vertex as u32);
        let p = corners.map(|v| x[v as usize]);
        let weights = vertex_triangle::closest_point(&[start, p[0], p[1], p[2]]);
        let distance = (start - point(&p, &weights)).norm_squared();
        if best.is_none_or(|(least, ..)| distance < least) {
            best = Some((distance, corners, weights));
        }
    }
    match best {
        Some((_, corners, weights)) => {
            let p = corners.map(|v| x[v as usize]);
            let offset = frame(&p).transpose() * (start - point(&p, &weights));
            Hold::Triangle { corners, weights, offset }
        }
        None => Hold::Fixed(start),
    }
}

fn point(p: &[Vec3; 3], weights: &[f64; 3]) -> Vec3 {
    p[0] * weights[0] + p[1] * weights[1] + p[2] * weights[2]
}

/// The triangle's own axes as columns: along its first side, across it, and its normal. No axes (zero) without area.
fn frame(p: &[Vec3; 3]) -> nalgebra::Matrix3<f64> {
    let along = (p[1] - p[0]).try_normalize(0.0).unwrap_or_default();
    let normal = (p[1] - p[0]).cross(&(p[2] - p[0])).try_normalize(0.0).unwrap_or_default();
    nalgebra::Matrix3::from_columns(&[along, normal.cross(&along), normal])
}
