//! What the hinges of one triangle owe each other: the part of a plate's bending energy that hinges alone leave out.
//!
//! A triangle T of area A with the elastic angles θ_i over its inner edges (length l_i, in-plane normal n_i) has the
//! curvature S = Σ θ_i l_i/(2 A) n_i ⊗ n_i and, as a plate without Poisson effect, the energy A B/2 |S|². Its squares are the
//! energies of the hinges by themselves; its products are
//!
//! E = Σ_{i<j} C_ij θ_i θ_j   [J],   C_ij = B s_i s_j l_i l_j cos²φ_ij/(4 A)   [J],
//!
//! φ_ij the angle between edges i and j. A hinge between unequal triangles stores s_i² ≤ 1 of the plate's square; s_i
//! scales its products by as much, so the sum of squares and products is never negative.
//!
//! Torque on hinge i: Σ_j C_ij θ_j, over at most four neighbours.
//!
//! The matrix takes products by a bound on its diagonal, which couples no vertices that a hinge does not couple. In units of
//! the plate's squares a triangle has the matrix R = cos²φ_ij with eigenvalues λ_1 ≤ λ_2 ≤ λ_3 in [0, 3]. A single step takes
//! R by λ_3: bending then never has less stiffness than it has, and a step never overshoots. Iterations take it by
//! (λ_1 + λ_3)/2 and not less than 1: at least half of R, so that each descends, and what is left of an error shrinks fastest.
//!
//! Source: Grinspun et al. 2006 for the curvature of a triangle from the angles over its edges.

use nalgebra::{Matrix3, SymmetricEigen};

use super::dihedral::Rest;
use crate::mesh::NONE;

/// The hinges of a triangle and its rest geometry.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Plate {
    /// Hinge on each side; [`NONE`] on the boundary.
    pub(crate) hinges: [u32; 3],
    /// Rest length of each side [m].
    pub(crate) lengths: [f64; 3],
    /// Rest area [m²].
    pub(crate) area: f64,
}

impl Plate {
    /// cos²φ of the angles between sides: 1 on the diagonal.
    fn cosines(&self) -> Matrix3<f64> {
        Matrix3::from_fn(|a, b| {
            if a == b {
                return 1.0;
            }
            let [la, lb, lc] = [a, b, 3 - a - b].map(|k| self.lengths[k]);
            let cosine = (la * la + lb * lb - lc * lc) / (2.0 * la * lb);
            (cosine * cosine).min(1.0)
        })
    }

    /// Least and greatest eigenvalue of cos²φ over its hinges; 1 without any.
    fn extremes(&self, cosines: &Matrix3<f64>) -> [f64; 2] {
        let has = |side: usize| self.hinges[side] != NONE;
        // A side that is no hinge stands alone with the eigenvalue 1, which lies between the others.
        let present =
            Matrix3::from_fn(|a, b| if a == b || (has(a) && has(b)) { cosines[(a, b)] } else { 0.0 });
        let values = SymmetricEigen::new(present).eigenvalues;
        [values.min(), values.max()]
    }

    /// What a plate of unit rigidity stores of the angle of a side: twice its energy over the angle's square.
    fn square(&self, side: usize) -> f64 {
        self.lengths[side] * self.lengths[side] / (4.0 * self.area)
    }

    /// Its sides that are hinges: (side, hinge).
    fn sides(&self) -> impl Iterator<Item = (usize, usize)> {
        (0..3).filter(|&k| self.hinges[k] != NONE).map(|k| (k, self.hinges[k] as usize))
    }
}

/// The products of all hinges of a part.
pub(crate) struct Coupled {
    /// The other hinges of the two triangles of each hinge; itself where there are fewer than four.
    neighbours: Vec<[u32; 4]>,
    /// C_ij with each of them [J]; 0 with itself.
    factors: Vec<[f64; 4]>,
    /// What the matrix takes for them, per hinge [J]: of a single step, and of an iteration.
    bounds: [Vec<f64>; 2],
}

impl Coupled {
    /// From the elastic rigidity B [N m] and the triangles; none where no two hinges have a product.
    pub(crate) fn new(rigidity: f64, rest: &[Rest], plates: &[Plate]) -> Option<Self> {
        let mut squares = vec![0.0; rest.len()];
        for plate in plates {
            for (side, hinge) in plate.sides() {
                squares[hinge] += plate.square(side);
            }
        }
        // s_i²
        let shares: Vec<f64> =
            rest.iter().zip(&squares).map(|(r, square)| r.edge / r.height / square).collect();
        let mut coupled = Self {
            neighbours: (0..rest.len() as u32).map(|h| [h; 4]).collect(),
            factors: vec![[0.0; 4]; rest.len()],
            bounds: [vec![0.0; rest.len()], vec![0.0; rest.len()]],
        };
        let mut found = vec![0; rest.len()];
        for plate in plates {
            let cosines = plate.cosines();
            let [least, greatest] = plate.extremes(&cosines);
            let bounds = [greatest - 1.0, (0.5 * (least + greatest) - 1.0).max(0.0)];
            for (a, i) in plate.sides() {
                for (sum, bound) in coupled.bounds.iter_mut().zip(bounds) {
                    sum[i] += rigidity * bound * shares[i] * plate.square(a);
                }
                for (b, j) in plate.sides().filter(|&(b, _)| b != a) {
                    let scale = (shares[i] * plate.square(a) * shares[j] * plate.square(b)).sqrt();
                    coupled.neighbours[i][found[i]] = j as u32;
                    coupled.factors[i][found[i]] = rigidity * cosines[(a, b)] * scale;
                    found[i] += 1;
                }
            }
        }
        coupled.factors.iter().flatten().any(|c| *c > 0.0).then_some(coupled)
    }

    /// Torque of its neighbours on a hinge [N m], given the elastic angles of all hinges.
    #[inline]
    pub(crate) fn torque(&self, hinge: usize, elastic: &[f64]) -> f64 {
        let (factors, neighbours) = (&self.factors[hinge], &self.neighbours[hinge]);
        let [a, b, c, d] = neighbours.map(|j| elastic[j as usize]);
        (factors[0] * a + factors[1] * b) + (factors[2] * c + factors[3] * d)
    }

    /// What the matrix takes for the products of each hinge [J], in a single step or in an iteration.
    #[inline]
    pub(crate) fn bounds(&self, iterates: bool) -> &[f64] {
        &self.bounds[usize::from(iterates)]
    }

    /// Memory, with the two numbers per hinge that an evaluation works with [B].
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.neighbours.as_slice())
            + size_of_val(self.factors.as_slice())
            + 4 * size_of_val(self.bounds[0].as_slice())
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::super::{
        Linear, Psd,
        hinge::Hinges,
        memory::Memory,
        testing::{
            Model, Random, check_force, check_momentum, check_rigid_motion, check_velocity_terms, energy,
            force_by_differences, forces, linearised,
        },
    };
    use super::*;
    use crate::{
        bending::{self, BendingLaw, Curve, Hysteresis, Plastic},
        mesh::{RestShape, Topology, TriMesh, Vec3, generators},
    };

    /// Relative rounding of eigenvalues of 3 × 3 matrices.
    const ROUNDING: f64 = 1e-12;
    /// Relative size of a fault that a comparison must see.
    const FAULT: f64 = 1e-3;
    /// Relative error of forces against differences of energies.
    const DIFFERENCES: f64 = 2e-6;
    const RIGIDITY: f64 = 2.0;

    /// A bent patch with edges, unequal triangles, and vertices inside.
    fn patch(seed: u64) -> TriMesh {
        let mut random = Random::new(seed);
        let mut mesh = generators::grid(3.0, 3.0, 4, 4).unwrap();
        mesh.uv = None;
        for x in &mut mesh.vertices {
            *x += random.vector() * 0.25;
        }
        mesh
    }

    fn rest_and_plates(mesh: &TriMesh) -> (Vec<[u32; 4]>, Vec<Rest>, Vec<Plate>) {
        let topology = Topology::new(mesh.vertices.len(), &mesh.triangles);
        let shape = RestShape::new(mesh, Vec3::x()).unwrap();
        let (mut corners, mut rest) = (Vec::new(), Vec::new());
        let mut hinge_of = vec![NONE; topology.edges.len()];
        for (k, hinge) in topology.hinges.iter().enumerate() {
            let [a, b] = hinge.edge;
            corners.push([a, b, hinge.opposite[0], hinge.opposite[1]]);
            let x = corners[k].map(|v| mesh.vertices[v as usize]);
            let areas = hinge.triangles.map(|t| shape.area[t as usize]);
            rest.push(Rest::new((x[1] - x[0]).norm(), areas, super::super::dihedral::dihedral_angle(&x)));
            let edge = topology.edges.iter().position(|e| *e == [a.min(b), a.max(b)]).unwrap();
            hinge_of[edge] = k as u32;
        }
        let plates = topology.triangle_edges.iter().enumerate().map(|(t, edges)| Plate {
            hinges: edges.map(|e| hinge_of[e as usize]),
            lengths: shape.side_lengths[t],
            area: shape.area[t],
        });
        (corners, rest, plates.collect())
    }

    fn model<L: BendingLaw + 'static>(law: L, damping: f64, mesh: &TriMesh, coupled: bool) -> Model {
        let (corners, rest, plates) = rest_and_plates(mesh);
        let hinges = Hinges::new(law, damping, corners, rest).unwrap();
        Model::new(if coupled { hinges.coupled(&plates) } else { hinges })
    }

    fn linear(mesh: &TriMesh, coupled: bool) -> Model {
        model(bending::Linear::new(RIGIDITY).unwrap(), 0.0, mesh, coupled)
    }

    /// The triangle of these side lengths, each side a hinge.
    fn triangle(lengths: [f64; 3]) -> Plate {
        let [a, b, c] = lengths;
        let s = 0.5 * (a + b + c);
        Plate { hinges: [0, 1, 2], lengths, area: (s * (s - a) * (s - b) * (s - c)).sqrt() }
    }

    /// Random triangles down to slivers of both kinds.
    fn triangles() -> Vec<Plate> {
        let mut random = Random::new(7);
        let mut list = Vec::new();
        for flat in [1.0, 1e-2, 1e-5] {
            for _ in 0..40 {
                let p = [0, 1, 2].map(|_| Vec3::new(random.value(), random.value() * flat, 0.0));
                let plate = triangle([(p[1] - p[0]).norm(), (p[2] - p[1]).norm(), (p[0] - p[2]).norm()]);
                if plate.area > 1e-3 * flat {
                    list.push(plate);
                }
            }
        }
        list.extend([triangle([1.0; 3]), triangle([1.0, 1.0, 2f64.sqrt()]), triangle([1.0, 1.0, 1e-4])]);
        list
    }

    /// Squares and products of the hinges, as matrices of ½ θᵀ (squares + products) θ.
    fn matrices(coupled: &Coupled, rest: &[Rest]) -> (DMatrix<f64>, DMatrix<f64>) {
        let n = rest.len();
        let column = |j: usize| {
            let unit: Vec<f64> = (0..n).map(|k| f64::from(u8::from(k == j))).collect();
            DVector::from_fn(n, |i, _| coupled.torque(i, &unit))
        };
        let squares = DVector::from_iterator(n, rest.iter().map(|r| RIGIDITY * r.edge / r.height));
        (DMatrix::from_diagonal(&squares), DMatrix::from_columns(&(0..n).map(column).collect::<Vec<_>>()))
    }

    /// Least eigenvalue of D^(−1/2) A D^(−1/2): of A in units of the squares D.
    fn least(a: &DMatrix<f64>, squares: &DMatrix<f64>) -> f64 {
        let n = a.nrows();
        let scaled = DMatrix::from_fn(n, n, |i, j| a[(i, j)] / (squares[(i, i)] * squares[(j, j)]).sqrt());
        SymmetricEigen::new(scaled).eigenvalues.min()
    }

    #[test]
    fn energy_is_that_of_a_plate_and_bounds_hold_on_any_triangle() {
        let mut random = Random::new(3);
        for plate in triangles() {
            // Neighbours of an area each of their own, or equal ones.
            for spread in [0.0, 3.0] {
                let rest = [0, 1, 2].map(|k| {
                    let other = plate.area * (1.0 + spread * (1.0 + random.value()));
                    Rest::new(plate.lengths[k], [plate.area, other], 0.0)
                });
                let coupled = Coupled::new(RIGIDITY, &rest, &[plate]).unwrap();
                let (squares, products) = matrices(&coupled, &rest);
                assert!((&products - products.transpose()).amax() <= ROUNDING * products.amax());
                // Slivers lose the digits of their angles.
                let rounding = 1e-6;
                assert!(least(&(&squares + &products), &squares) > -rounding, "{plate:?}");
                let single = DMatrix::from_diagonal(&DVector::from_column_slice(coupled.bounds(false)));
                assert!(least(&(&single - &products), &squares) > -rounding, "{plate:?}");
                assert!(
                    least(&(&single * (1.0 - 0.01) - &products), &squares) < -rounding,
                    "a bound that is too small must be seen: {plate:?}"
                );
                let iterate = DMatrix::from_diagonal(&DVector::from_column_slice(coupled.bounds(true)));
                let half = (&squares + iterate) * 2.0 - (&squares + &products);
                assert!(least(&half, &squares) > -rounding, "{plate:?}");
            }
        }
        // The plate itself: A B |S|² with S from the edges' normals.
        let p = [Vec3::zeros(), Vec3::new(1.3, 0.1, 0.0), Vec3::new(0.4, 0.8, 0.0)];
        let sides = [p[1] - p[0], p[2] - p[1], p[0] - p[2]];
        let plate = triangle(sides.map(|s| s.norm()));
        let rest = plate.lengths.map(|l| Rest::new(l, [plate.area, plate.area], 0.0));
        // Squares of hinges between equal triangles are the plate's of both; here each is in one.
        let coupled = Coupled::new(RIGIDITY, &rest, &[plate]).unwrap();
        let angles = [0.3, -0.2, 0.7];
        let mut curvature = nalgebra::Matrix2::<f64>::zeros();
        for (side, angle) in sides.iter().zip(angles) {
            let n = nalgebra::Vector2::new(side.y, -side.x) / side.norm();
            curvature += n * n.transpose() * (angle * side.norm() / (2.0 * plate.area));
        }
        let whole = plate.area * RIGIDITY * curvature.norm_squared();
        let (squares, products) = matrices(&coupled, &rest);
        let theta = DVector::from_column_slice(&angles);
        let got = 0.5 * theta.dot(&((squares + products) * &theta));
        assert!((got / whole - 1.0).abs() < 1e-12, "{got} {whole}");
    }

    #[test]
    fn forces_are_the_gradient_and_keep_momentum() {
        for seed in 1..4 {
            let mesh = patch(seed);
            let mut random = Random::new(seed + 20);
            let x: Vec<Vec3> = mesh.vertices.iter().map(|x| x + random.vector() * 0.2).collect();
            let v = random.vectors(x.len(), 1.0);
            let coupled = linear(&mesh, true);
            check_force(&coupled, &x, "coupled");
            check_momentum(&coupled, &x, &v, "coupled");
            check_rigid_motion(&coupled, &x, "coupled");
            let damped = model(bending::Linear::new(RIGIDITY).unwrap(), 0.6, &mesh, true);
            check_velocity_terms(&damped, &x, &v, "coupled, damped");
            check_momentum(&damped, &x, &v, "coupled, damped");
            let alone = energy(&linear(&mesh, false), &x);
            assert!((energy(&coupled, &x) / alone - 1.0).abs() > 0.01, "products must matter here");
            assert_eq!(energy(&coupled, &mesh.vertices), 0.0);
        }
    }

    /// The coupling of laws with a memory, on the way along a path.
    fn check_products<L: BendingLaw + Copy + 'static>(law: L, size: f64, what: &str) {
        let mesh = patch(5);
        let mut random = Random::new(31);
        let mut pair = [model(law, 0.0, &mesh, true), model(law, 0.0, &mesh, false)];
        for _ in 0..4 {
            let x: Vec<Vec3> = mesh.vertices.iter().map(|x| x + random.vector() * (3.0 * size)).collect();
            for model in &mut pair {
                model.accept(&x);
            }
        }
        assert_eq!(pair[0].memory, pair[1].memory, "{what}");
        let last = mesh.vertices.clone();
        for model in &mut pair {
            model.accept(&last);
        }
        let x: Vec<Vec3> = last.iter().map(|x| x + random.vector() * size).collect();
        check_momentum(&pair[0], &x, &random.vectors(x.len(), 1.0), what);
        check_rigid_motion(&pair[0], &x, what);
        let rest = vec![Vec3::zeros(); x.len()];
        let [with, without] = [0, 1].map(|k| forces(&pair[k], &x, &rest));
        let [e_with, e_without] = [0, 1].map(|k| force_by_differences(&pair[k], &x));
        let got = DVector::from_iterator(
            3 * x.len(),
            with.iter().zip(&without).flat_map(|(a, b)| (a - b).iter().copied().collect::<Vec<_>>()),
        );
        let expected = e_with - e_without;
        let error = |got: &DVector<f64>| (got - &expected).amax() / expected.amax();
        assert!(expected.amax() > 0.0 && error(&got) < 10.0 * DIFFERENCES, "{what}: {:e}", error(&got));
        assert!(error(&(&got * (1.0 + FAULT))) > 10.0 * DIFFERENCES, "{what}: a fault must be seen");
        let scale = Linear {
            damping: 0.0,
            stiffness: 1.0,
            ahead: 0.0,
            iterates: false,
            accept: false,
            psd: Psd::Projected,
        };
        for psd in [Psd::Raw, Psd::Projected] {
            let (f, matrix) = linearised(&pair[0], &x, &rest, &Linear { psd, ..scale });
            let difference = f.iter().zip(&with).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
            assert!(difference <= 1e-12 * with.iter().map(Vec3::norm).fold(0.0, f64::max), "{what}");
            if psd == Psd::Projected {
                assert!(SymmetricEigen::new(matrix.clone()).eigenvalues.min() > -1e-10 * matrix.amax());
            }
        }
    }

    #[test]
    fn laws_of_every_kind_couple_their_elastic_part() {
        let curve = Curve::new(3.0, 1.0, -2.0).unwrap();
        check_products(curve, 0.1, "nonlinear");
        check_products(Hysteresis::new(curve, 0.5, 0.1).unwrap(), 0.1, "hysteresis");
        // Small motions from the last state: no flow, in which the torque is not a gradient.
        check_products(Plastic::new(2.0, 0.6, 0.5).unwrap(), 0.002, "plastic");
    }

    #[test]
    fn hysteresis_without_a_loop_is_the_linear_law() {
        let mesh = patch(2);
        let mut random = Random::new(8);
        let loopless = Hysteresis::new(Curve::new(RIGIDITY, RIGIDITY, 0.0).unwrap(), 0.5, 0.5).unwrap();
        let (mut hysteresis, linear) = (model(loopless, 0.0, &mesh, true), linear(&mesh, true));
        let rest = vec![Vec3::zeros(); mesh.vertices.len()];
        for _ in 0..5 {
            let x: Vec<Vec3> = mesh.vertices.iter().map(|x| x + random.vector() * 0.2).collect();
            hysteresis.accept(&x);
            for (a, b) in forces(&hysteresis, &x, &rest).iter().zip(forces(&linear, &x, &rest)) {
                assert!((a - b).norm() <= 1e-12 * b.norm().max(1.0), "{a:?} {b:?}");
            }
        }
    }

    #[test]
    fn beyond_the_couplings_lies_the_exact_stiffness() {
        // At rest there are no torques, and the exact stiffness is that of the angles alone.
        let mesh = patch(6);
        let coupled = linear(&mesh, true);
        let x = &mesh.vertices;
        let n = x.len();
        let rest = vec![Vec3::zeros(); n];
        let projected = Linear {
            damping: 0.0,
            stiffness: 1.0,
            ahead: 0.0,
            iterates: false,
            accept: false,
            psd: Psd::Projected,
        };
        let (_, matrix) = linearised(&coupled, x, &rest, &projected);
        let models = std::slice::from_ref(&coupled.law);
        let (mut assembler, _) = crate::assembly::Assembler::new(n, models, Psd::Projected);
        let mut corners = crate::assembly::Corners::new(models);
        assembler.elements.linearise(models, &mut [Memory::default()], &mut corners, x, &rest, &projected);
        let d = Random::new(4).vectors(n, 1.0);
        let mut beyond = rest.clone();
        assembler.elements.add_beyond(models, &d, &mut beyond);
        let flat = |v: &[Vec3]| DVector::from_iterator(3 * n, v.iter().flat_map(|v| v.iter().copied()));
        let (bounded, got) = (&matrix * flat(&d), &matrix * flat(&d) + flat(&beyond));
        let step = 1e-6;
        let moved =
            |sign: f64| -> Vec<Vec3> { x.iter().zip(&d).map(|(x, d)| x + d * (sign * step)).collect() };
        let ends = [1.0, -1.0].map(|sign| flat(&forces(&coupled, &moved(sign), &rest)));
        let expected = (&ends[1] - &ends[0]) / (2.0 * step);
        assert!((&got - &expected).amax() < 1e-6 * expected.amax());
        assert!((&bounded - &expected).amax() > 1e-2 * expected.amax(), "the bound alone is not exact");
    }
}
