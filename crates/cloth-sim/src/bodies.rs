//! From the scene and its assets to checked meshes in place.

use crate::motion::Motion;
use crate::regions::{self, Part};
use crate::scene::{Cloth, Collider, DiagonalPattern, Generator, MeshSource, RestSource};
use crate::scene::{LENGTH, VELOCITY};
use crate::seams::{self, Seams};
use crate::{Assets, Scene, SceneError, Vec3};
use cloth_collision::{DetectError, shapes};
use cloth_core::mesh::{MeshError, RestShape, Topology, TriMesh, generators};
use cloth_core::{InPlane, Material, Stitch};
use cloth_response::LimitedEdge;
use std::ops::Range;
use std::sync::OnceLock;

/// What a body is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BodyKind {
    /// Moves by forces.
    Cloth,
    /// Moves as prescribed.
    Collider,
}

/// A body of the simulation, as output needs it.
#[derive(Debug, Clone, PartialEq)]
pub struct BodyInfo {
    /// Its name in the scene.
    pub name: String,
    /// Cloth or collider.
    pub kind: BodyKind,
    /// Its vertices in the global array (cloth first, so that a cloth's range also indexes `positions()`).
    pub vertices: Range<usize>,
    /// Its triangles, with indices into its own vertices.
    pub triangles: Vec<[u32; 3]>,
    /// Material coordinates per triangle corner [m], if the mesh has them.
    pub uv: Option<Vec<[[f64; 2]; 3]>>,
    /// By the number of each of the scene's regions that has any: its triangles, ascending, in no other region.
    pub regions: Vec<(usize, Vec<u32>)>,
}

/// A piece of cloth, ready to be built.
pub(crate) struct ClothBody {
    pub(crate) mesh: TriMesh,
    pub(crate) topology: Topology,
    pub(crate) rest: RestShape,
    pub(crate) material: Material,
    /// Its triangles by material; empty where all are of `material`.
    pub(crate) parts: Vec<Part>,
    /// Its seams, over its own vertices.
    pub(crate) seams: Seams,
    pub(crate) first_vertex: usize,
    /// Start positions [m] and velocities [m/s], before pins.
    pub(crate) x: Vec<Vec3>,
    pub(crate) v: Vec<Vec3>,
}

/// A collider: triangles and how its vertices move.
pub(crate) struct ColliderBody {
    pub(crate) triangles: Vec<[u32; 3]>,
    pub(crate) uv: Option<Vec<[[f64; 2]; 3]>>,
    pub(crate) first_vertex: usize,
    pub(crate) motion: Motion,
    /// Checksum of its mesh or frames, once a state has asked for it.
    pub(crate) shape: OnceLock<u64>,
}

impl ClothBody {
    /// Rest length of each edge \[m\], of the topology's order; the mean of its triangles' sides where UV panels differ.
    fn edge_lengths(&self) -> Vec<f64> {
        let mut sums = vec![(0.0, 0.0); self.topology.edges.len()];
        for (edges, sides) in self.topology.triangle_edges.iter().zip(&self.rest.side_lengths) {
            for (&edge, side) in edges.iter().zip(sides) {
                let (sum, count) = &mut sums[edge as usize];
                *sum += side;
                *count += 1.0;
            }
        }
        sums.into_iter().map(|(sum, count)| sum / count).collect()
    }

    /// Half of the cloth's sides are at most so long at rest [m].
    pub(crate) fn median_edge(&self) -> f64 {
        let mut lengths: Vec<f64> = self.rest.side_lengths.iter().flatten().copied().collect();
        let middle = lengths.len() / 2;
        *lengths.select_nth_unstable_by(middle, f64::total_cmp).1
    }
}

/// All bodies of a scene, cloth first.
pub(crate) struct Bodies {
    pub(crate) cloth: Vec<ClothBody>,
    pub(crate) colliders: Vec<ColliderBody>,
    pub(crate) cloth_vertices: usize,
    pub(crate) vertices: usize,
}

impl Bodies {
    /// Loads, checks and places the meshes of a checked scene.
    pub(crate) fn new(scene: &Scene, assets: &Assets) -> Result<Self, SceneError> {
        let mut next = 0;
        let mut cloth = Vec::with_capacity(scene.cloth.len());
        for (i, source) in scene.cloth.iter().enumerate() {
            let body = cloth_body(scene, assets, source, &format!("cloth[{i}]"), next)?;
            next += body.x.len();
            cloth.push(body);
        }
        let cloth_vertices = next;
        check_thickness(scene, &cloth)?;
        let mut colliders = Vec::with_capacity(scene.collider.len());
        for (i, source) in scene.collider.iter().enumerate() {
            let body = collider_body(scene, assets, source, &format!("collider[{i}]"), next)?;
            next += body.motion.vertex_count();
            colliders.push(body);
        }
        Ok(Self { cloth, colliders, cloth_vertices, vertices: next })
    }

    /// All stitches, over the global vertices.
    pub(crate) fn stitches(&self) -> Vec<Stitch> {
        let of = |body: &ClothBody| {
            let first = body.first_vertex as u32;
            body.seams
                .stitches
                .iter()
                .map(move |s| Stitch { vertices: s.vertices.map(|v| v + first), ..*s })
                .collect::<Vec<_>>()
        };
        self.cloth.iter().flat_map(of).collect()
    }

    /// Vertices that are as one to contact, over the global vertices.
    pub(crate) fn joined(&self) -> Vec<[u32; 2]> {
        let of = |body: &ClothBody| {
            let first = body.first_vertex as u32;
            body.seams.joined.iter().map(|pair| pair.map(|v| v + first)).collect::<Vec<_>>()
        };
        self.cloth.iter().flat_map(of).collect()
    }

    /// The edges whose strain the scene limits, but for those between two of the `pinned` vertices (sorted), whose length
    /// is prescribed.
    pub(crate) fn limited_edges(&self, scene: &Scene, pinned: &[u32]) -> Vec<LimitedEdge> {
        let is_pinned = |v: u32| pinned.binary_search(&v).is_ok();
        let mut limited = Vec::new();
        for (body, source) in self.cloth.iter().zip(&scene.cloth) {
            let Some(limit) = source.strain_limit.map(|l| l.limit()) else { continue };
            let lengths = body.edge_lengths();
            for (edge, rest_length) in body.topology.edges.iter().zip(lengths) {
                let vertices = edge.map(|v| v + body.first_vertex as u32);
                if !vertices.iter().all(|&v| is_pinned(v)) {
                    limited.push(LimitedEdge { vertices, rest_length, limit });
                }
            }
        }
        limited
    }

    pub(crate) fn infos(&self, scene: &Scene) -> Vec<BodyInfo> {
        let cloth = self.cloth.iter().zip(&scene.cloth).map(|(body, source)| BodyInfo {
            name: source.name.clone(),
            kind: BodyKind::Cloth,
            vertices: body.first_vertex..body.first_vertex + body.x.len(),
            triangles: body.mesh.triangles.clone(),
            uv: body.mesh.uv.clone(),
            regions: body.parts.iter().filter_map(|p| Some((p.region?, p.triangles.clone()))).collect(),
        });
        let colliders = self.colliders.iter().zip(&scene.collider).map(|(body, source)| BodyInfo {
            name: source.name.clone(),
            kind: BodyKind::Collider,
            vertices: body.first_vertex..body.first_vertex + body.motion.vertex_count(),
            triangles: body.triangles.clone(),
            uv: body.uv.clone(),
            regions: Vec::new(),
        });
        cloth.chain(colliders).collect()
    }
}

/// Refuses a thickness that is no less than the size of a piece of cloth.
fn check_thickness(scene: &Scene, cloth: &[ClothBody]) -> Result<(), SceneError> {
    let Some(contact) = &scene.contact else { return Ok(()) };
    for (body, source) in cloth.iter().zip(&scene.cloth) {
        let (lo, hi) = body.mesh.bounds().unwrap_or_default();
        let size = (hi - lo).norm();
        if contact.thickness >= size {
            let expected = format!("less than the size of \"{}\", {size:.3e} m", source.name);
            return Err(scene.error("contact.thickness", expected, format!("{}", contact.thickness)));
        }
    }
    Ok(())
}

fn cloth_body(
    scene: &Scene,
    assets: &Assets,
    source: &Cloth,
    key: &str,
    first_vertex: usize,
) -> Result<ClothBody, SceneError> {
    let mesh_key = format!("{key}.mesh");
    let mesh = load(scene, assets, &source.mesh, &mesh_key)?;
    let defect = |error: MeshError| mesh_error(scene, &mesh_key, &source.name, &error);
    scene.check_points(&mesh_key, &mesh.vertices, LENGTH, "m", vertex_of(&source.name))?;
    mesh.check().map_err(defect)?;
    let topology = Topology::new(mesh.vertices.len(), &mesh.triangles);
    let material = scene.resolve_material(&source.material, &format!("{key}.material"))?;
    let pose = crate::motion::pose(source.position, source.rotation.as_ref());
    let x: Vec<Vec3> = mesh.vertices.iter().map(|p| pose.transform_point(&(*p).into()).coords).collect();
    let parts = regions::parts(scene, assets, source, material, &mesh, &x, key)?;
    let materials: Vec<Material> =
        if parts.is_empty() { vec![material] } else { parts.iter().map(|p| p.material).collect() };
    if materials.iter().any(|m| !matches!(m.bending, cloth_core::Bending::None)) {
        topology.require_manifold().map_err(defect)?;
    }
    let rest = match (source.rest, &mesh.uv) {
        (RestSource::Mesh, _) => {
            check_warp(scene, source, &mesh, &materials, key)?;
            RestShape::from_positions(&mesh, Vec3::from(source.warp))
        }
        (RestSource::Uv, Some(uv)) => RestShape::from_uv(uv),
        (RestSource::Uv, None) => {
            let expected = format!("a mesh with UV (\"{}\" takes its rest shape from it)", source.name);
            return Err(scene.error(&format!("{key}.rest"), expected, "a mesh without"));
        }
    }
    .map_err(defect)?;
    let seams = seams::build(scene, source, &materials, &mesh, (&topology, &rest), &x, key)?;
    let mut v = vec![Vec3::from(source.velocity); x.len()];
    if let Some(name) = &source.velocities {
        let key = format!("{key}.velocities");
        let list = assets
            .velocities
            .get(name)
            .ok_or_else(|| missing(scene, &key, name, "start velocities", assets.velocities.keys()))?;
        if list.len() != v.len() {
            let expected = format!("one velocity per vertex ({})", v.len());
            return Err(scene.error(&key, expected, list.len().to_string()));
        }
        if let Some(i) = list.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
            return Err(scene.error(&key, "finite velocities [m/s]", format!("{:?} at vertex {i}", list[i])));
        }
        scene.check_points(&key, list, VELOCITY, "m/s", vertex_of(&source.name))?;
        for (own, more) in v.iter_mut().zip(list) {
            *own += more;
        }
    }
    Ok(ClothBody { mesh, topology, rest, material, parts, seams, first_vertex, x, v })
}

/// Refuses a warp that most of a cloth has along its normal: projected into the cloth it gives no direction.
///
/// Single triangles of a closed body may have it so; they take a direction of their own.
fn check_warp(
    scene: &Scene,
    source: &Cloth,
    mesh: &TriMesh,
    materials: &[Material],
    key: &str,
) -> Result<(), SceneError> {
    /// Sine of the least angle between warp and normal that gives a direction.
    const LEAST_SINE: f64 = 1e-6;
    if !materials.iter().any(|m| matches!(m.in_plane, InPlane::BaraffWitkin { .. })) {
        return Ok(());
    }
    let warp = Vec3::from(source.warp).normalize();
    let (mut whole, mut without, mut count) = (0.0, 0.0, 0);
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|v| mesh.vertices[v as usize]);
        let cross = (b - a).cross(&(c - a));
        let area = cross.norm();
        whole += area;
        if cross.cross(&warp).norm() <= LEAST_SINE * area {
            without += area;
            count += 1;
        }
    }
    if without <= 0.5 * whole {
        return Ok(());
    }
    let expected = format!("a direction that is not along the normal of \"{}\"", source.name);
    let got = format!("{:?}, along that of {count} of {} triangles", source.warp, mesh.triangles.len());
    Err(scene.error(&format!("{key}.warp"), expected, got))
}

fn collider_body(
    scene: &Scene,
    assets: &Assets,
    source: &Collider,
    key: &str,
    first_vertex: usize,
) -> Result<ColliderBody, SceneError> {
    if let Some(sequence) = &source.sequence {
        let name = sequence.asset_name();
        let key = format!("{key}.sequence");
        let asset = assets
            .sequences
            .get(&name)
            .ok_or_else(|| missing(scene, &key, &name, "animated mesh", assets.sequences.keys()))?;
        let Some(first) = asset.frames.first() else {
            return Err(scene.error(&key, format!("frames (\"{}\")", source.name), "none"));
        };
        for (f, frame) in asset.frames.iter().enumerate() {
            if frame.len() != first.len() {
                let expected = format!("{} vertices in every frame (\"{}\")", first.len(), source.name);
                return Err(scene.error(&key, expected, format!("{} in frame {f}", frame.len())));
            }
            if let Some(i) = frame.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
                let expected = format!("finite coordinates (\"{}\")", source.name);
                return Err(scene.error(&key, expected, format!("{:?} at frame {f}, vertex {i}", frame[i])));
            }
            let item = |i| format!("frame {f}, vertex {i} (\"{}\")", source.name);
            scene.check_points(&key, frame, LENGTH, "m", item)?;
        }
        let mesh = TriMesh { vertices: first.clone(), triangles: asset.triangles.clone(), uv: None };
        mesh.check().map_err(|error| mesh_error(scene, &key, &source.name, &error))?;
        let Some(fps) = sequence.fps.or(asset.fps) else {
            let expected = "frames per second > 0, which this file does not say";
            return Err(scene.error(&format!("{key}.fps"), expected, "nothing"));
        };
        let motion = Motion::sequence(asset, fps, sequence, source);
        return Ok(ColliderBody {
            triangles: mesh.triangles,
            uv: None,
            first_vertex,
            motion,
            shape: OnceLock::new(),
        });
    }
    let mesh = if let Some(shape) = &source.shape {
        let (shape, tolerance) = shape.parts();
        shapes::tessellate(&shape, tolerance).map_err(|error| match error {
            DetectError::Parameter { parameter, expected, got } => {
                scene.error(&format!("{key}.shape.{parameter}"), expected, format!("{got}"))
            }
            other => scene.error(&format!("{key}.shape"), "a shape", other.to_string()),
        })?
    } else {
        let mesh_key = format!("{key}.mesh");
        let Some(mesh) = &source.mesh else {
            return Err(scene.error(key, "exactly one of shape, mesh, sequence", "none"));
        };
        let mesh = load(scene, assets, mesh, &mesh_key)?;
        scene.check_points(&mesh_key, &mesh.vertices, LENGTH, "m", vertex_of(&source.name))?;
        mesh.check().map_err(|error| mesh_error(scene, &mesh_key, &source.name, &error))?;
        mesh
    };
    let motion = Motion::rigid(&mesh.vertices, source);
    Ok(ColliderBody { triangles: mesh.triangles, uv: mesh.uv, first_vertex, motion, shape: OnceLock::new() })
}

/// Names a vertex of a body.
fn vertex_of(name: &str) -> impl Fn(usize) -> String {
    move |i| format!("vertex {i} of \"{name}\"")
}

fn load(scene: &Scene, assets: &Assets, source: &MeshSource, key: &str) -> Result<TriMesh, SceneError> {
    let (name, key) = match source {
        MeshSource::Generated(generator) => {
            return generate(generator).map_err(|error| match error {
                MeshError::Parameter { parameter, expected, got } => {
                    scene.error(&format!("{key}.{parameter}"), expected, format!("{got}"))
                }
                other => scene.error(key, "a mesh", other.to_string()),
            });
        }
        MeshSource::File(file) => (&file.file, format!("{key}.file")),
        MeshSource::Asset(asset) => (&asset.asset, format!("{key}.asset")),
    };
    assets.meshes.get(name).cloned().ok_or_else(|| missing(scene, &key, name, "mesh", assets.meshes.keys()))
}

fn missing<'a>(
    scene: &Scene,
    key: &str,
    name: &str,
    what: &str,
    known: impl Iterator<Item = &'a String>,
) -> SceneError {
    let known: Vec<&str> = known.map(String::as_str).collect();
    let expected = if known.is_empty() {
        format!("a loaded {what} (none was given)")
    } else {
        format!("a loaded {what}, one of {known:?}")
    };
    scene.error(key, expected, format!("\"{name}\"")).with_nearest(name, known.into_iter())
}

/// A mesh's defect under the name of its body.
fn mesh_error(scene: &Scene, key: &str, name: &str, error: &MeshError) -> SceneError {
    let text = error.to_string();
    // MeshError's text is "array: expected …, got or named element".
    let (expected, got) = match text.split_once(": expected ").map(|(_, rest)| rest.split_once(", ")) {
        Some(Some((expected, got))) => (expected, got.strip_prefix("got ").unwrap_or(got)),
        _ => ("a sound mesh", text.as_str()),
    };
    scene.error(key, format!("{expected} (\"{name}\")"), got)
}

pub(crate) fn generate(generator: &Generator) -> Result<TriMesh, MeshError> {
    match *generator {
        Generator::Grid { width, height, nx, ny, diagonals } => {
            let diagonals = match diagonals {
                DiagonalPattern::Alternating => generators::Diagonals::Alternating,
                DiagonalPattern::OneWay => generators::Diagonals::OneWay,
                DiagonalPattern::Crossed => generators::Diagonals::Crossed,
            };
            generators::grid_with(width, height, nx, ny, diagonals)
        }
        Generator::Disc { radius, rings } => generators::disc(radius, rings),
        Generator::Ribbon { length, width, nx, ny, twist } => {
            generators::ribbon(length, width, nx, ny, twist)
        }
        Generator::Cylinder { radius, height, segments, rows, caps } => {
            generators::cylinder(radius, height, segments, rows, caps)
        }
        Generator::Sphere { radius, subdivisions } => generators::sphere(radius, subdivisions),
        Generator::Capsule { radius, half_height, segments, rings } => {
            generators::capsule(radius, half_height, segments, rings)
        }
        Generator::Cone { radius, height, segments } => generators::cone(radius, height, segments),
        Generator::Box { size, cells } => generators::cuboid(size, cells),
    }
}
