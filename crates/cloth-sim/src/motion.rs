//! Prescribed motion: rigid keyframes and animated vertices.

use crate::scene::{Collider, Keyframe, Rotation, SequenceSource};
use crate::{Sequence, Vec3};
use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion};

pub(crate) type Pose = Isometry3<f64>;

/// Two axes are the same line if the sine of their angle is at most this: what rounding makes of a direction.
const SAME_AXIS_SINE: f64 = 1e-12;

/// The pose that a position and a rotation make.
pub(crate) fn pose(position: [f64; 3], rotation: Option<&Rotation>) -> Pose {
    Pose::from_parts(Translation3::from(position), rotation.map_or_else(UnitQuaternion::identity, quaternion))
}

fn quaternion(rotation: &Rotation) -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&Unit::new_normalize(Vec3::from(rotation.axis)), rotation.angle)
}

/// How the vertices of a collider move.
pub(crate) enum Motion {
    /// A mesh carried by a pose.
    Rigid { local: Vec<Vec3>, path: Path },
    /// Vertices per frame, linear in between.
    Sequence { frames: Vec<Vec<Vec3>>, fps: f64, start: f64 },
}

/// A pose over time.
pub(crate) struct Path {
    rest: Pose,
    frames: Vec<PathFrame>,
}

struct PathFrame {
    time: f64,
    position: Vec3,
    rotation: Option<Rotation>,
}

impl Path {
    /// The path through `keyframes`; what they leave out is taken from `position` and `rotation`.
    pub(crate) fn new(keyframes: &[Keyframe], position: [f64; 3], rotation: Option<Rotation>) -> Self {
        let frames = keyframes
            .iter()
            .map(|k| PathFrame {
                time: k.time,
                position: k.position.unwrap_or(position).into(),
                rotation: k.rotation.or(rotation),
            })
            .collect();
        Self { rest: pose(position, rotation.as_ref()), frames }
    }

    /// Whether the pose changes at all.
    pub(crate) fn moves(&self) -> bool {
        self.frames.len() > 1
    }

    /// The pose at `time` [s]: linear in position, linear in the angle where the axis stays the same, else along the
    /// shortest arc; held before the first and after the last keyframe.
    pub(crate) fn at(&self, time: f64) -> Pose {
        let Some(last) = self.frames.last() else { return self.rest };
        let next = self.frames.partition_point(|f| f.time <= time);
        if next == 0 {
            return self.frames[0].pose();
        }
        if next == self.frames.len() {
            return last.pose();
        }
        let (a, b) = (&self.frames[next - 1], &self.frames[next]);
        let s = (time - a.time) / (b.time - a.time);
        let position = a.position + (b.position - a.position) * s;
        Pose::from_parts(Translation3::from(position), between(a.rotation.as_ref(), b.rotation.as_ref(), s))
    }
}

impl PathFrame {
    fn pose(&self) -> Pose {
        pose(self.position.into(), self.rotation.as_ref())
    }
}

fn between(a: Option<&Rotation>, b: Option<&Rotation>, s: f64) -> UnitQuaternion<f64> {
    let none = Rotation { axis: [0.0, 1.0, 0.0], angle: 0.0 };
    let (mut a, mut b) = (*a.unwrap_or(&none), *b.unwrap_or(&none));
    // No rotation has any axis.
    if a.angle == 0.0 {
        a.axis = b.axis;
    }
    if b.angle == 0.0 {
        b.axis = a.axis;
    }
    let (axis_a, axis_b) = (Vec3::from(a.axis).normalize(), Vec3::from(b.axis).normalize());
    if axis_a.cross(&axis_b).norm() <= SAME_AXIS_SINE {
        let end = if axis_a.dot(&axis_b) < 0.0 { -b.angle } else { b.angle };
        return UnitQuaternion::from_axis_angle(&Unit::new_unchecked(axis_a), a.angle + (end - a.angle) * s);
    }
    let (qa, qb) = (quaternion(&a), quaternion(&b));
    // Exactly half a turn apart there is no shortest arc: then the nearer end.
    qa.try_slerp(&qb, s, f64::EPSILON).unwrap_or(if s < 0.5 { qa } else { qb })
}

impl Motion {
    pub(crate) fn rigid(vertices: &[Vec3], source: &Collider) -> Self {
        Self::Rigid {
            local: vertices.to_vec(),
            path: Path::new(&source.keyframes, source.position, source.rotation),
        }
    }

    /// The frames, placed by the collider's position and rotation.
    pub(crate) fn sequence(asset: &Sequence, fps: f64, source: &SequenceSource, collider: &Collider) -> Self {
        let pose = pose(collider.position, collider.rotation.as_ref());
        let place =
            |frame: &Vec<Vec3>| frame.iter().map(|p| pose.transform_point(&(*p).into()).coords).collect();
        Self::Sequence { frames: asset.frames.iter().map(place).collect(), fps, start: source.start }
    }

    pub(crate) fn vertex_count(&self) -> usize {
        match self {
            Self::Rigid { local, .. } => local.len(),
            Self::Sequence { frames, .. } => frames[0].len(),
        }
    }

    /// Whether vertices move at any time.
    pub(crate) fn moves(&self) -> bool {
        match self {
            Self::Rigid { path, .. } => path.moves(),
            Self::Sequence { frames, .. } => frames.len() > 1,
        }
    }

    /// Writes the positions at `time` [s].
    pub(crate) fn write(&self, time: f64, out: &mut [Vec3]) {
        match self {
            Self::Rigid { local, path } => {
                let pose = path.at(time);
                for (p, local) in out.iter_mut().zip(local) {
                    *p = pose.transform_point(&(*local).into()).coords;
                }
            }
            Self::Sequence { frames, fps, start } => {
                let at = ((time - start) * fps).clamp(0.0, (frames.len() - 1) as f64);
                let first = (at.floor() as usize).min(frames.len() - 1);
                let second = (first + 1).min(frames.len() - 1);
                let s = at - first as f64;
                for ((p, a), b) in out.iter_mut().zip(&frames[first]).zip(&frames[second]) {
                    *p = if s == 0.0 { *a } else { a + (b - a) * s };
                }
            }
        }
    }

    /// Memory [B].
    pub(crate) fn bytes(&self) -> usize {
        let points = match self {
            Self::Rigid { local, .. } => local.len(),
            Self::Sequence { frames, .. } => frames.iter().map(Vec::len).sum(),
        };
        points * size_of::<Vec3>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI, TAU};

    /// Rounding of a few rotations.
    const ROUNDING: f64 = 1e-14;

    fn frame(time: f64, axis: [f64; 3], angle: f64) -> Keyframe {
        Keyframe { time, position: None, rotation: Some(Rotation { axis, angle }) }
    }

    fn turned(path: &Path, time: f64) -> Vec3 {
        path.at(time) * Vec3::x()
    }

    #[test]
    fn angles_about_one_axis_are_linear_beyond_a_turn() {
        let path = Path::new(
            &[frame(1.0, [0.0, 2.0, 0.0], 0.0), frame(3.0, [0.0, 1.0, 0.0], 2.0 * TAU)],
            [0.0; 3],
            None,
        );
        // A quarter of the way: half a turn of two.
        assert!((turned(&path, 1.25) - Vec3::new(0.0, 0.0, -1.0)).norm() < ROUNDING);
        assert!((turned(&path, 1.5) + Vec3::x()).norm() < ROUNDING);
        assert!((turned(&path, 0.0) - Vec3::x()).norm() < ROUNDING, "held before");
        assert!((turned(&path, 9.0) - Vec3::x()).norm() < 1e-13, "held after");
    }

    #[test]
    fn opposite_axes_are_one_line() {
        let path = Path::new(
            &[frame(0.0, [0.0, 1.0, 0.0], FRAC_PI_2), frame(1.0, [0.0, -1.0, 0.0], FRAC_PI_2)],
            [0.0; 3],
            None,
        );
        assert!((turned(&path, 0.5) - Vec3::x()).norm() < ROUNDING);
    }

    #[test]
    fn different_axes_take_the_shortest_arc() {
        let path = Path::new(
            &[frame(0.0, [0.0, 1.0, 0.0], FRAC_PI_2), frame(1.0, [1.0, 0.0, 0.0], FRAC_PI_2)],
            [0.0; 3],
            None,
        );
        let half = path.at(0.5).rotation;
        let (a, b) = (path.at(0.0).rotation, path.at(1.0).rotation);
        assert!((half.angle_to(&a) - half.angle_to(&b)).abs() < ROUNDING);
        assert!((half.angle_to(&a) - 0.5 * a.angle_to(&b)).abs() < ROUNDING);
        assert!(a.angle_to(&b) < PI);
    }

    #[test]
    fn positions_are_linear_and_default_to_the_bodys() {
        let frames = [
            Keyframe { time: 0.0, position: Some([0.0, 0.0, 0.0]), rotation: None },
            Keyframe { time: 2.0, position: None, rotation: None },
        ];
        let path = Path::new(&frames, [4.0, 0.0, 0.0], None);
        assert!((path.at(0.5).translation.vector - Vec3::new(1.0, 0.0, 0.0)).norm() < ROUNDING);
    }

    #[test]
    fn sequences_are_linear_between_frames() {
        let motion = Motion::Sequence {
            frames: vec![vec![Vec3::zeros()], vec![Vec3::x()], vec![Vec3::y()]],
            fps: 10.0,
            start: 1.0,
        };
        let at = |time| {
            let mut out = [Vec3::zeros()];
            motion.write(time, &mut out);
            out[0]
        };
        assert_eq!(at(0.0), Vec3::zeros());
        assert!((at(1.05) - Vec3::x() * 0.5).norm() < 1e-14);
        assert!((at(1.15) - (Vec3::x() + Vec3::y()) * 0.5).norm() < 1e-14);
        assert_eq!(at(5.0), Vec3::y());
    }
}
