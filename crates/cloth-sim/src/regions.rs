//! Which triangles of a cloth are of which material.

use crate::scene::{Cloth, MeshSource};
use crate::{Assets, Scene, SceneError, Vec3};
use cloth_core::Material;
use cloth_core::mesh::TriMesh;

/// Triangles of one material.
pub(crate) struct Part {
    /// Number of the region in the scene; none for what is left to the cloth's own material.
    pub(crate) region: Option<usize>,
    pub(crate) material: Material,
    /// Ascending.
    pub(crate) triangles: Vec<u32>,
}

/// The parts of a cloth: none where it is all of one material; else the cloth's own material first (unless nothing is left to
/// it), then each region's. `x`: start positions \[m\].
pub(crate) fn parts(
    scene: &Scene,
    assets: &Assets,
    source: &Cloth,
    own: Material,
    mesh: &TriMesh,
    x: &[Vec3],
    key: &str,
) -> Result<Vec<Part>, SceneError> {
    if source.regions.is_empty() {
        return Ok(Vec::new());
    }
    let mut part_of = vec![0_usize; mesh.triangles.len()];
    let mut parts = vec![Part { region: None, material: own, triangles: Vec::new() }];
    for (i, region) in source.regions.iter().enumerate() {
        let key = format!("{key}.regions[{i}]");
        let material = scene.resolve_material(&region.material, &format!("{key}.material"))?;
        parts.push(Part { region: Some(i), material, triangles: Vec::new() });
        let corners_all = |inside: &dyn Fn(u32) -> bool| -> Vec<u32> {
            let all = |t: &u32| mesh.triangles[*t as usize].iter().all(|&v| inside(v));
            (0..mesh.triangles.len() as u32).filter(all).collect()
        };
        let (name, triangles) = if let Some(group) = &region.group {
            ("group", group_of(scene, assets, source, group, &format!("{key}.group"))?)
        } else if let Some(list) = &region.triangles {
            ("triangles", list.clone())
        } else if let Some(list) = &region.vertices {
            check_indices(scene, source, list, x.len(), "vertex", &format!("{key}.vertices"))?;
            let mut inside = vec![false; x.len()];
            for &v in list {
                inside[v as usize] = true;
            }
            ("vertices", corners_all(&|v| inside[v as usize]))
        } else {
            let Some(region) = region.region else { continue };
            let (lo, hi) = (Vec3::from(region.min), Vec3::from(region.max));
            let inside = |v: u32| (0..3).all(|a| (lo[a]..=hi[a]).contains(&x[v as usize][a]));
            ("box", corners_all(&inside))
        };
        if triangles.is_empty() {
            let expected = format!("at least one triangle of \"{}\"", source.name);
            return Err(scene.error(&format!("{key}.{name}"), expected, "none"));
        }
        check_indices(scene, source, &triangles, mesh.triangles.len(), "triangle", &format!("{key}.{name}"))?;
        for t in triangles {
            part_of[t as usize] = i + 1;
        }
    }
    for (t, &part) in part_of.iter().enumerate() {
        parts[part].triangles.push(t as u32);
    }
    parts.retain(|part| !part.triangles.is_empty());
    Ok(parts)
}

fn group_of(
    scene: &Scene,
    assets: &Assets,
    source: &Cloth,
    group: &str,
    key: &str,
) -> Result<Vec<u32>, SceneError> {
    let name = match &source.mesh {
        MeshSource::File(file) => Some(&file.file),
        MeshSource::Asset(asset) => Some(&asset.asset),
        MeshSource::Generated(_) => None,
    };
    let groups = name.and_then(|name| assets.groups.get(name));
    let Some(groups) = groups.filter(|groups| !groups.is_empty()) else {
        let expected = format!("a mesh with groups of faces (\"{}\")", source.name);
        return Err(scene.error(key, expected, format!("a mesh without, and the group \"{group}\"")));
    };
    groups.get(group).cloned().ok_or_else(|| {
        let known: Vec<&str> = groups.keys().map(String::as_str).collect();
        scene
            .error(key, format!("one of the mesh's groups {known:?}"), format!("\"{group}\""))
            .with_nearest(group, known.into_iter())
    })
}

/// Refuses indices that a cloth does not have.
pub(crate) fn check_indices(
    scene: &Scene,
    source: &Cloth,
    list: &[u32],
    count: usize,
    what: &str,
    key: &str,
) -> Result<(), SceneError> {
    match list.iter().position(|&i| i as usize >= count) {
        Some(i) => {
            let expected = format!("a {what} of \"{}\", 0 to {}", source.name, count.saturating_sub(1));
            Err(scene.error(&format!("{key}[{i}]"), expected, list[i].to_string()))
        }
        None => Ok(()),
    }
}
