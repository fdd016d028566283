//! What a state says of the bodies of its scene, and what is other in another scene.

use super::bytes::checksum;
use crate::bodies::Bodies;
use crate::scene::MeshSource;
use crate::{Assets, Scene, Vec3};
use serde_json::Value;

/// Keys of a scene that are no matter of the motion.
const OUTWARD: [&str; 3] = ["name", "duration", "output"];

/// A body as a state names it.
pub(super) struct Named {
    pub(super) name: String,
    pub(super) vertices: usize,
    /// Of its triangles.
    pub(super) topology: u64,
    /// Of the vertices and UV of a mesh, or of all frames of an animation; 0 where the scene's own keys say all.
    pub(super) shape: u64,
    /// The key of a body's table that its vertices come from.
    pub(super) source: &'static str,
}

/// Cloths and colliders of a scene.
pub(super) fn named(scene: &Scene, assets: &Assets, bodies: &Bodies) -> [Vec<Named>; 2] {
    let words = |triangles: &[[u32; 3]]| -> Vec<u8> {
        triangles.iter().flatten().flat_map(|v| v.to_le_bytes()).collect()
    };
    let cloth = (scene.cloth.iter().zip(&bodies.cloth)).map(|(source, body)| {
        let uv = body.mesh.uv.iter().flatten().flatten().flatten().flat_map(|n| n.to_le_bytes());
        Named {
            name: source.name.clone(),
            vertices: body.x.len(),
            topology: checksum(&words(&body.mesh.triangles)),
            shape: checksum(&points(&body.mesh.vertices).chain(uv).collect::<Vec<u8>>()),
            source: "mesh",
        }
    });
    let colliders = (scene.collider.iter().zip(&bodies.colliders)).map(|(source, body)| {
        let shape = || match (&source.sequence, &source.mesh) {
            (Some(sequence), _) => assets
                .sequences
                .get(&sequence.asset_name())
                .map_or(0, |asset| checksum_of_frames(&asset.frames)),
            (None, Some(MeshSource::File(file))) => checksum_of_mesh(assets, &file.file),
            (None, Some(MeshSource::Asset(asset))) => checksum_of_mesh(assets, &asset.asset),
            _ => 0,
        };
        Named {
            name: source.name.clone(),
            vertices: body.motion.vertex_count(),
            topology: checksum(&words(&body.triangles)),
            shape: *body.shape.get_or_init(shape),
            source: if source.sequence.is_some() { "sequence" } else { "mesh" },
        }
    });
    [cloth.collect(), colliders.collect()]
}

fn points(list: &[Vec3]) -> impl Iterator<Item = u8> {
    list.iter().flatten().flat_map(|n| n.to_le_bytes())
}

fn checksum_of_mesh(assets: &Assets, name: &str) -> u64 {
    assets.meshes.get(name).map_or(0, |mesh| checksum(&points(&mesh.vertices).collect::<Vec<u8>>()))
}

/// Of the checksums of the frames: the bytes of one at a time.
fn checksum_of_frames(frames: &[Vec<Vec3>]) -> u64 {
    let each = frames.iter().map(|frame| checksum(&points(frame).collect::<Vec<u8>>()));
    checksum(&each.flat_map(u64::to_le_bytes).collect::<Vec<u8>>())
}

/// Whether `listed` is `key` or what holds it or is part of it: one edit is listed once.
pub(super) fn covers(listed: &str, key: &str) -> bool {
    let below = |long: &str, short: &str| {
        long.strip_prefix(short).is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
    };
    below(listed, key) || below(key, listed)
}

/// Keys below `key` that are other.
pub(super) fn differences(key: &str, was: &Value, is: &Value, list: &mut Vec<String>) {
    if was == is {
        return;
    }
    match (was, is) {
        (Value::Object(was), Value::Object(is)) => {
            let names: std::collections::BTreeSet<&String> = was.keys().chain(is.keys()).collect();
            for name in names {
                if key.is_empty() && OUTWARD.contains(&name.as_str()) {
                    continue;
                }
                let below = if key.is_empty() { name.clone() } else { format!("{key}.{name}") };
                differences(
                    &below,
                    was.get(name).unwrap_or(&Value::Null),
                    is.get(name).unwrap_or(&Value::Null),
                    list,
                );
            }
        }
        (Value::Array(was), Value::Array(is)) if was.len() == is.len() && is.iter().any(Value::is_object) => {
            for (i, (was, is)) in was.iter().zip(is).enumerate() {
                differences(&format!("{key}[{i}]"), was, is, list);
            }
        }
        _ => list.push(key.into()),
    }
}
