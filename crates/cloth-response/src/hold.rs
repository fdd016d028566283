//! The fail-safe: the motion of what still collides is held back.
//!
//! First to half of the way to its first contact; then fully: a held vertex stays at `x_t0`, or, where something
//! prescribed moves into it, rides on that. Held vertices stay held for this step, and those that they collide with
//! are held too, so the set grows until nothing collides: at the worst all cloth stands still, which was free of
//! intersections at the start. Only cloth caught between different prescribed motions has no way out.

use crate::collisions::{Detection, Hit, look_again, unresolved};
use crate::frames::{Frame, Frames, STILL};
use crate::motion::Motion;
use crate::{ResponseError, ResponseInfo};
use cloth_collision::CollisionMesh;

/// Not held.
const FREE: Frame = Frame::MAX;
/// The fraction of the way to the first contact that is left at first.
const WAY_LEFT: f64 = 0.5;
/// Held passes after which the neighbours of what is held are held with it: few passes, more stiffness.
const PASSES_ALONE: usize = 6;
/// Cap on held passes.
const MAX_PASSES: usize = 100;

/// Holds back what collides until nothing does.
///
/// # Errors
/// [`ResponseError::Unresolved`] with the pairs that cannot be held apart; those of the detection.
pub(crate) fn hold_back(
    detection: &mut Detection<'_>,
    motion: &mut Motion<'_>,
    frames: &mut Frames,
    thickness: f64,
    hits: &mut Vec<Hit>,
    info: &mut ResponseInfo,
    mut judge: impl FnMut(&mut Vec<Hit>),
) -> Result<(), ResponseError> {
    let mut held = vec![FREE; motion.x_t0.len()];
    let mut slowed = slow_down(motion, hits);
    for pass in 0..MAX_PASSES {
        info.passes += 1;
        look_again(detection, motion, 0.0, hits)?;
        judge(hits);
        if hits.is_empty() {
            slowed.extend((0..held.len() as u32).filter(|&v| held[v as usize] != FREE));
            slowed.sort_unstable();
            slowed.dedup();
            info.held_vertices = slowed.len();
            return Ok(());
        }
        let mut newly = Vec::new();
        for hit in hits.iter() {
            hold_pair(hit, detection.mesh, motion, frames, thickness, &mut held, &mut newly);
        }
        if pass >= PASSES_ALONE {
            hold_neighbours(detection.mesh, motion, &mut held, &mut newly);
        }
        let mut moved = false;
        for &v in &newly {
            let end = frames.map(held[v as usize]).apply(&motion.x_t0[v as usize]);
            moved |= motion.set_end(v, end);
        }
        if newly.is_empty() || (!moved && pass >= PASSES_ALONE) {
            break;
        }
    }
    Err(unresolved(hits))
}

/// Shortens the motion of the free vertices of colliding pairs; returns them, sorted.
fn slow_down(motion: &mut Motion<'_>, hits: &[Hit]) -> Vec<u32> {
    let mut fractions: Vec<(u32, f64)> = hits
        .iter()
        .flat_map(|hit| hit.vertices.map(|v| (v, WAY_LEFT * hit.time)))
        .filter(|&(v, _)| !motion.prescribed(v))
        .collect();
    fractions.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    fractions.dedup_by_key(|f| f.0);
    for &(v, fraction) in &fractions {
        motion.shorten(v, fraction);
    }
    fractions.into_iter().map(|f| f.0).collect()
}

/// Holds the free vertices of a pair in the frame of what moves into them, else where they were.
fn hold_pair(
    hit: &Hit,
    mesh: &CollisionMesh,
    motion: &Motion<'_>,
    frames: &mut Frames,
    thickness: f64,
    held: &mut [Frame],
    newly: &mut Vec<u32>,
) {
    let prescribed: Vec<u32> = hit.vertices.into_iter().filter(|&v| motion.prescribed(v)).collect();
    let mut target = STILL;
    let mut seen: Vec<Frame> = prescribed.iter().map(|&v| frames.of(v, mesh, motion, thickness)).collect();
    seen.sort_unstable();
    seen.dedup();
    if seen.len() > 1 {
        seen = vec![frames.of_patch(&prescribed, motion)];
    }
    seen.extend(hit.vertices.iter().map(|&v| held[v as usize]).filter(|&f| f != FREE));
    for frame in seen {
        if frame != STILL && target == STILL {
            target = frame;
        }
    }
    for &v in hit.vertices.iter().filter(|&&v| !motion.prescribed(v)) {
        let now = &mut held[v as usize];
        if *now == FREE || (*now == STILL && target != STILL) {
            *now = target;
            newly.push(v);
        }
    }
}

/// Holds the free vertices that share a triangle with a newly held one.
fn hold_neighbours(mesh: &CollisionMesh, motion: &Motion<'_>, held: &mut [Frame], newly: &mut Vec<u32>) {
    let mut is_new = vec![false; held.len()];
    for &v in newly.iter() {
        is_new[v as usize] = true;
    }
    for triangle in &mesh.triangles {
        let Some(&source) = triangle.iter().find(|&&v| is_new[v as usize]) else { continue };
        for &v in triangle {
            if held[v as usize] == FREE && !motion.prescribed(v) {
                held[v as usize] = held[source as usize];
                newly.push(v);
            }
        }
    }
}
