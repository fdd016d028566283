//! The motions of what is prescribed: colliders and pinned cloth.

use crate::Vec3;
use crate::motion::{Motion, bytes_of};
use crate::rigid_motion::RigidMap;
use cloth_collision::CollisionMesh;
use cloth_collision::mesh::NONE;

/// Index of a frame: [`Frames::map`] says where it goes.
pub(crate) type Frame = u32;
/// The frame of what stands still.
pub(crate) const STILL: Frame = 0;

/// A body counts as rigid if no vertex deviates from its rigid map by more than this fraction of the thickness; what
/// rides on the map is checked against the true motion by the detection.
const RIGID_DEVIATION: f64 = 1e-6;
/// Bodies that turn by more than this in one step are not ridden on [rad].
const MAX_RIDDEN_TURN: f64 = 2.5;

#[derive(Debug, Clone, Copy, PartialEq)]
enum BodyMotion {
    Unknown,
    Rigid(Frame),
    Deforming,
}

/// The frames of one step, found as they are asked for.
#[derive(Default)]
pub(crate) struct Frames {
    maps: Vec<RigidMap>,
    bodies: Vec<BodyMotion>,
}

impl Frames {
    pub(crate) fn clear(&mut self, body_count: usize) {
        self.maps.clear();
        self.maps.push(RigidMap::still());
        self.bodies.clear();
        self.bodies.resize(body_count, BodyMotion::Unknown);
    }

    /// Memory [B].
    pub(crate) fn bytes(&self) -> usize {
        bytes_of(&self.maps) + bytes_of(&self.bodies)
    }

    pub(crate) fn map(&self, frame: Frame) -> &RigidMap {
        &self.maps[frame as usize]
    }

    /// The frame of a prescribed vertex: its body's (for pins, that of the body's pins together) where that moves
    /// rigidly, else the translation of the vertex alone.
    pub(crate) fn of(
        &mut self,
        vertex: u32,
        mesh: &CollisionMesh,
        motion: &Motion<'_>,
        thickness: f64,
    ) -> Frame {
        let i = vertex as usize;
        let (x, y) = (motion.x_t0[i], motion.buffers.end[i]);
        let held_by = mesh.attached_to[i];
        let candidates = [held_by, mesh.vertex_body[i]];
        for body in candidates.into_iter().filter(|&b| b != NONE) {
            if self.bodies[body as usize] == BodyMotion::Unknown {
                self.bodies[body as usize] = self.body_motion(body, mesh, motion, thickness);
            }
            if let BodyMotion::Rigid(frame) = self.bodies[body as usize]
                && (self.map(frame).apply(&x) - y).norm() <= RIGID_DEVIATION * thickness
            {
                return frame;
            }
        }
        let shift = RigidMap { from: x, to: y, ..RigidMap::still() };
        self.insert(shift, &x, RIGID_DEVIATION * thickness)
    }

    /// The frame of several prescribed vertices of a deforming body: their nearest rigid motion.
    pub(crate) fn of_patch(&mut self, vertices: &[u32], motion: &Motion<'_>) -> Frame {
        let (map, _) = RigidMap::fit(
            vertices.iter().map(|&v| (motion.x_t0[v as usize], motion.buffers.end[v as usize])),
        );
        self.maps.push(map);
        (self.maps.len() - 1) as Frame
    }

    fn body_motion(
        &mut self,
        body: u32,
        mesh: &CollisionMesh,
        motion: &Motion<'_>,
        thickness: f64,
    ) -> BodyMotion {
        let members = (0..mesh.vertex_count)
            .filter(|&i| mesh.vertex_body[i] == body && motion.inv_mass[i] == 0.0)
            .map(|i| (motion.x_t0[i], motion.buffers.end[i]));
        if members.clone().all(|(x, y)| x == y) {
            return BodyMotion::Rigid(STILL);
        }
        let (map, deviation) = RigidMap::fit(members.clone());
        if deviation > RIGID_DEVIATION * thickness || map.angle() > MAX_RIDDEN_TURN {
            return BodyMotion::Deforming;
        }
        let sample = members.clone().next().map_or(Vec3::zeros(), |(x, _)| x);
        BodyMotion::Rigid(self.insert(map, &sample, RIGID_DEVIATION * thickness))
    }

    /// The frame of a map; maps with the same turn that agree at `sample` share one.
    fn insert(&mut self, map: RigidMap, sample: &Vec3, tolerance: f64) -> Frame {
        let same =
            |m: &RigidMap| m.turn == map.turn && (m.apply(sample) - map.apply(sample)).norm() <= tolerance;
        if let Some(frame) = self.maps.iter().position(same) {
            return frame as Frame;
        }
        self.maps.push(map);
        (self.maps.len() - 1) as Frame
    }
}
