//! Rigid impact zones: what impulses did not separate moves as one body for this step.
//!
//! The vertices of colliding pairs are joined into zones (union–find); a zone that collides with a vertex or another
//! zone takes it in. A free zone keeps its momentum and angular momentum. A zone that touches something prescribed
//! rides on it: it takes the collider's rigid motion over the step, so that neither can meet the other. The motion of
//! a zone is one affine map at every instant: nothing collides inside it.

use crate::collisions::{Detection, Hit, look_again};
use crate::frames::Frames;
use crate::motion::{Motion, bytes_of};
use crate::rigid_motion::RigidMap;
use crate::{ResponseInfo, ResponseParams, Vec3};
use cloth_collision::DetectError;
use cloth_collision::mesh::NONE;

/// Union–find over the vertices that are in a zone.
#[derive(Default)]
pub(crate) struct Zones {
    /// Parent of each vertex, or [`NONE`]: in no zone.
    parent: Vec<u32>,
    /// Vertices in a zone and what they kept of their average velocity when they joined [m/s].
    members: Vec<(u32, Vec3)>,
    /// (vertex of a zone, prescribed vertex that it collides with).
    ties: Vec<(u32, u32)>,
}

/// One zone.
#[derive(Debug, PartialEq)]
struct Zone {
    /// (vertex, velocity when it joined), sorted.
    members: Vec<(u32, Vec3)>,
    /// Prescribed vertices that it collides with, sorted.
    ties: Vec<u32>,
}

impl Zones {
    /// Memory [B].
    pub(crate) fn bytes(&self) -> usize {
        bytes_of(&self.parent) + bytes_of(&self.members) + bytes_of(&self.ties)
    }

    fn clear(&mut self, vertex_count: usize) {
        self.parent.clear();
        self.parent.resize(vertex_count, NONE);
        self.members.clear();
        self.ties.clear();
    }

    fn root(&mut self, vertex: u32) -> u32 {
        let mut v = vertex;
        while self.parent[v as usize] != v {
            let up = self.parent[self.parent[v as usize] as usize];
            self.parent[v as usize] = up;
            v = up;
        }
        v
    }

    /// Joins the free vertices of a pair; returns whether a zone grew.
    fn join(&mut self, vertices: &[u32; 4], motion: &Motion<'_>) -> bool {
        let mut first = NONE;
        let mut grew = false;
        for &v in vertices.iter().filter(|&&v| !motion.prescribed(v)) {
            if self.parent[v as usize] == NONE {
                self.parent[v as usize] = v;
                self.members.push((v, motion.buffers.kept()[v as usize]));
                grew = true;
            }
            if first == NONE {
                first = v;
                continue;
            }
            let (a, b) = (self.root(first), self.root(v));
            if a != b {
                self.parent[a.max(b) as usize] = a.min(b);
                grew = true;
            }
        }
        if first != NONE {
            for &v in vertices.iter().filter(|&&v| motion.prescribed(v)) {
                let root = self.root(first);
                let known =
                    (0..self.ties.len()).any(|i| self.ties[i].1 == v && self.root(self.ties[i].0) == root);
                if !known {
                    self.ties.push((first, v));
                    grew = true;
                }
            }
        }
        grew
    }

    /// The zones, sorted by their lowest vertex.
    fn collect(&mut self) -> Vec<Zone> {
        self.members.sort_unstable_by_key(|m| m.0);
        let mut zones: Vec<Zone> = Vec::new();
        let mut index = std::collections::HashMap::new();
        for i in 0..self.members.len() {
            let root = self.root(self.members[i].0);
            let zone = *index.entry(root).or_insert_with(|| {
                zones.push(Zone { members: Vec::new(), ties: Vec::new() });
                zones.len() - 1
            });
            zones[zone].members.push(self.members[i]);
        }
        for i in 0..self.ties.len() {
            let (vertex, prescribed) = self.ties[i];
            let root = self.root(vertex);
            if let Some(&zone) = index.get(&root) {
                zones[zone].ties.push(prescribed);
            }
        }
        for zone in &mut zones {
            zone.ties.sort_unstable();
            zone.ties.dedup();
        }
        zones
    }
}

impl Zone {
    fn map(&self, detection: &Detection<'_>, motion: &Motion<'_>, frames: &mut Frames, h: f64) -> RigidMap {
        if self.ties.is_empty() {
            let points = self
                .members
                .iter()
                .map(|&(v, velocity)| (1.0 / motion.inv_mass[v as usize], motion.x_t0[v as usize], velocity));
            return RigidMap::of_free(points, motion.dt);
        }
        let mut ridden: Vec<_> = self.ties.iter().map(|&v| frames.of(v, detection.mesh, motion, h)).collect();
        ridden.dedup();
        // A deforming collider, or several: the nearest rigid motion, judged by the detection.
        let frame = if let [frame] = ridden[..] { frame } else { frames.of_patch(&self.ties, motion) };
        *frames.map(frame)
    }
}

/// Lets zones grow until nothing collides, the cap is reached, or no zone can grow. `hits` holds what collides
/// before and after.
///
/// # Errors
/// Those of the detection.
pub(crate) fn move_zones(
    zones: &mut Zones,
    detection: &mut Detection<'_>,
    motion: &mut Motion<'_>,
    frames: &mut Frames,
    params: &ResponseParams,
    hits: &mut Vec<Hit>,
    info: &mut ResponseInfo,
    mut judge: impl FnMut(&mut Vec<Hit>),
) -> Result<(), DetectError> {
    zones.clear(motion.x_t0.len());
    for _ in 0..params.max_zone_passes {
        let mut grew = false;
        for hit in hits.iter() {
            grew |= zones.join(&hit.vertices, motion);
        }
        if !grew {
            break;
        }
        let list = zones.collect();
        (info.zones, info.zone_vertices) = (list.len(), zones.members.len());
        for zone in &list {
            let map = zone.map(detection, motion, frames, params.thickness);
            for &(v, _) in &zone.members {
                motion.set_end(v, map.apply(&motion.x_t0[v as usize]));
            }
        }
        info.passes += 1;
        look_again(detection, motion, 0.0, hits)?;
        judge(hits);
        if hits.is_empty() {
            break;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::MotionBuffers;

    /// Pairs that share a free vertex are one zone; a shared prescribed vertex does not join.
    #[test]
    fn zones_merge_through_free_vertices() {
        let mut buffers = MotionBuffers::default();
        let inv_mass = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0];
        let x = vec![Vec3::zeros(); 8];
        let motion = Motion::new(&mut buffers, &inv_mass, &x, &x, 0.1);
        let mut zones = Zones::default();
        zones.clear(8);
        assert!(zones.join(&[0, 1, 6, 7], &motion));
        assert!(zones.join(&[4, 5, 6, 7], &motion));
        assert!(!zones.join(&[1, 0, 7, 6], &motion), "nothing new");
        let members = |zones: &mut Zones| -> Vec<Vec<u32>> {
            zones.collect().iter().map(|z| z.members.iter().map(|m| m.0).collect()).collect()
        };
        assert_eq!(members(&mut zones), [vec![0, 1], vec![4, 5]]);
        assert_eq!(zones.collect()[1].ties, [6, 7]);
        assert!(zones.join(&[1, 2, 3, 4], &motion));
        assert_eq!(members(&mut zones), [vec![0, 1, 2, 3, 4, 5]]);
    }
}
