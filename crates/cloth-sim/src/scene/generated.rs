//! How many vertices a generator makes, before it makes them: a scene of a few lines can ask for more than any machine has.

use super::{Generator, MeshSource, Scene, SceneError};

/// Vertices that the generators of a scene may make together.
const MOST: usize = 1 << 22;

impl Generator {
    /// Number of vertices of the mesh; the largest number where it is beyond that, or where there is no such mesh.
    pub(crate) fn vertex_count(&self) -> usize {
        let product = |factors: &[usize]| factors.iter().fold(1, |all: usize, &one| all.saturating_mul(one));
        match *self {
            Self::Grid { nx, ny, diagonals: super::DiagonalPattern::Crossed, .. } => {
                product(&[nx, ny]).saturating_add(product(&[nx.saturating_sub(1), ny.saturating_sub(1)]))
            }
            Self::Grid { nx, ny, .. } | Self::Ribbon { nx, ny, .. } => product(&[nx, ny]),
            Self::Disc { rings, .. } => product(&[3, rings, rings.saturating_add(1)]).saturating_add(1),
            Self::Cylinder { segments, rows, caps, .. } => {
                product(&[segments, rows.saturating_add(1)]).saturating_add(2 * usize::from(caps))
            }
            Self::Sphere { subdivisions, .. } => {
                product(&[10, 4_usize.checked_pow(subdivisions).unwrap_or(usize::MAX)]).saturating_add(2)
            }
            Self::Capsule { segments, rings, .. } => product(&[2, rings, segments]).saturating_add(2),
            Self::Cone { segments, .. } => segments.saturating_add(2),
            Self::Box { cells, .. } => {
                let inside = product(&cells.map(|n| n.saturating_sub(1)));
                product(&cells.map(|n| n.saturating_add(1))).saturating_sub(inside)
            }
        }
    }
}

impl Scene {
    /// Vertices that generators make for the cloth.
    pub(crate) fn generated_cloth(&self) -> usize {
        self.cloth.iter().fold(0, |sum: usize, cloth| sum.saturating_add(count(&cloth.mesh)))
    }

    /// Refuses meshes of absurd size.
    pub(super) fn check_generated(&self) -> Result<(), SceneError> {
        let cloths = self.cloth.iter().enumerate().map(|(i, c)| (format!("cloth[{i}].mesh"), Some(&c.mesh)));
        let colliders = self.collider.iter().enumerate();
        let colliders = colliders.map(|(i, c)| (format!("collider[{i}].mesh"), c.mesh.as_ref()));
        let mut sum = 0_usize;
        for (key, mesh) in cloths.chain(colliders) {
            sum = sum.saturating_add(mesh.map_or(0, count));
            if sum > MOST {
                let expected = format!("at most {MOST} vertices in all generated meshes together");
                return Err(self.error(
                    &key,
                    expected,
                    if sum == usize::MAX { "more".into() } else { sum.to_string() },
                ));
            }
        }
        Ok(())
    }
}

fn count(mesh: &MeshSource) -> usize {
    match mesh {
        MeshSource::Generated(generator) => generator.vertex_count(),
        _ => 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::generate;
    use crate::scene::DiagonalPattern;

    #[test]
    fn counts_are_those_of_the_meshes() {
        let grid = |diagonals| Generator::Grid { width: 1.0, height: 2.0, nx: 4, ny: 3, diagonals };
        let cylinder = |caps| Generator::Cylinder { radius: 1.0, height: 1.0, segments: 5, rows: 3, caps };
        for generator in [
            grid(DiagonalPattern::Alternating),
            grid(DiagonalPattern::OneWay),
            grid(DiagonalPattern::Crossed),
            Generator::Disc { radius: 1.0, rings: 1 },
            Generator::Disc { radius: 1.0, rings: 4 },
            Generator::Ribbon { length: 1.0, width: 0.1, nx: 7, ny: 2, twist: 1.0 },
            cylinder(false),
            cylinder(true),
            Generator::Sphere { radius: 1.0, subdivisions: 0 },
            Generator::Sphere { radius: 1.0, subdivisions: 3 },
            Generator::Capsule { radius: 1.0, half_height: 1.0, segments: 6, rings: 3 },
            Generator::Cone { radius: 1.0, height: 1.0, segments: 9 },
            Generator::Box { size: [1.0, 2.0, 3.0], cells: [1, 1, 1] },
            Generator::Box { size: [1.0, 2.0, 3.0], cells: [2, 3, 4] },
        ] {
            let made = generate(&generator).map(|mesh| mesh.vertices.len());
            assert_eq!(made, Ok(generator.vertex_count()), "{generator:?}");
        }
    }

    #[test]
    fn counts_do_not_overflow() {
        let huge =
            Generator::Capsule { radius: 1.0, half_height: 1.0, segments: usize::MAX, rings: usize::MAX };
        assert_eq!(huge.vertex_count(), usize::MAX);
        assert_eq!(Generator::Sphere { radius: 1.0, subdivisions: u32::MAX }.vertex_count(), usize::MAX);
        let none =
            Generator::Grid { width: 1.0, height: 1.0, nx: 0, ny: 0, diagonals: DiagonalPattern::Crossed };
        assert_eq!(none.vertex_count(), 0);
    }
}
