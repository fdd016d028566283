//! One hinge against differences, closed forms and its own memory.

use super::super::testing::{
    Model, Random, check_blocks, check_derivatives, check_momentum, check_rigid_motion, check_velocity_terms,
    energy, forces,
};
use super::*;
use crate::bending::{Curve, Hysteresis, Linear, Plastic};

/// B [N m].
const RIGIDITY: f64 = 2.0;
/// D of the damped hinge [N m s].
const DAMPING: f64 = 0.6;

/// A hinge on the x axis with flaps of the given heights, the second folded by θ about the edge.
fn folded(theta: f64, heights: [f64; 2]) -> [Vec3; 4] {
    let (s, c) = theta.sin_cos();
    [
        Vec3::zeros(),
        Vec3::x(),
        Vec3::new(0.3, heights[0], 0.0),
        Vec3::new(0.6, -heights[1] * c, -heights[1] * s),
    ]
}

fn bent<L: BendingLaw + 'static>(law: L, damping: f64, heights: [f64; 2], rest_angle: f64) -> Model {
    let rest = Rest::new(1.0, heights.map(|h| 0.5 * h), rest_angle);
    Model::new(Hinges::new(law, damping, vec![[0, 1, 2, 3]], vec![rest]).unwrap())
}

fn hinge(damping: f64, heights: [f64; 2], rest_angle: f64) -> Model {
    bent(Linear::new(RIGIDITY).unwrap(), damping, heights, rest_angle)
}

#[test]
fn angle_is_signed_and_right_past_90_degrees() {
    for degrees in [-179.0, -120.0, -90.0, -30.0, -1e-6, 0.0, 1e-6, 45.0, 90.0, 91.0, 150.0, 179.999_f64] {
        let theta = degrees.to_radians();
        let got = dihedral_angle(&folded(theta, [1.0, 0.7]));
        assert!((got - theta).abs() < 1e-12, "{degrees}: {got}");
    }
    let flat = dihedral_angle(&folded(std::f64::consts::PI, [1.0, 0.7])).abs();
    assert!((flat - std::f64::consts::PI).abs() < 1e-12);
}

#[test]
fn derivatives_and_invariance() {
    let mut random = Random::new(3);
    let cases = [
        ("near flat", 0.01, [1.0, 0.8]),
        ("bent", 0.9, [1.0, 0.8]),
        ("past 90 degrees", 1.9, [0.7, 0.8]),
        ("past 90 degrees the other way", -2.2, [0.7, 1.1]),
        ("nearly folded flat", 3.1, [1.0, 0.8]),
        ("nearly degenerate", 0.8, [0.05, 0.9]),
    ];
    for (what, theta, heights) in cases {
        for _ in 0..3 {
            let noise = 0.02 * f64::min(heights[0], heights[1]);
            let x = folded(theta, heights).map(|x| x + random.vector() * noise);
            let v = random.vectors(4, 1.0);
            check_derivatives(&hinge(0.0, heights, 0.2), &x, what);
            check_velocity_terms(&hinge(DAMPING, heights, 0.2), &x, &v, what);
            check_momentum(&hinge(DAMPING, heights, 0.2), &x, &v, what);
            check_rigid_motion(&hinge(DAMPING, heights, 0.2), &x, what);
        }
    }
}

#[test]
fn rest_has_no_energy_and_no_force() {
    for theta in [0.0, 0.7, -2.5] {
        let x = folded(theta, [1.0, 0.7]);
        let model = hinge(0.0, [1.0, 0.7], dihedral_angle(&x));
        assert_eq!(energy(&model, &x), 0.0);
        assert!(forces(&model, &x, &[Vec3::zeros(); 4]).iter().all(|f| *f == Vec3::zeros()));
    }
}

#[test]
fn value_by_hand() {
    // |e| = 1, heights 1 and 0.6, h̄ = 0.8, θ = 0.4, B = 2: K = 0.5, M = 1, energy |e| B θ²/(2 h̄) = 0.2.
    // Torque |e| M = 1 on each flap: force torque/height = 1 on vertex 2 along its normal (0, 0, 1).
    let x = folded(0.4, [1.0, 0.6]);
    let model = hinge(0.0, [1.0, 0.6], 0.0);
    assert!((energy(&model, &x) - 0.2).abs() < 1e-14);
    let f = forces(&model, &x, &[Vec3::zeros(); 4]);
    assert!((f[2] - Vec3::z()).norm() < 1e-13, "{:?}", f[2]);
    assert!((f[3].norm() - 1.0 / 0.6).abs() < 1e-13);
    // The moment restores: the force on the folded flap turns it back.
    let closing = Vec3::new(0.0, 0.4_f64.sin(), -(0.4_f64.cos()));
    assert!(f[3].dot(&closing) < 0.0);
}

#[test]
fn collapsed_hinges_stay_finite_and_bad_ones_are_named() {
    let model = hinge(DAMPING, [1.0, 1.0], 0.0);
    for x in [[Vec3::zeros(); 4], [Vec3::zeros(), Vec3::x(), Vec3::x() * 0.4, Vec3::x() * 0.2]] {
        let f = forces(&model, &x, &[Vec3::zeros(), Vec3::x(), Vec3::y(), Vec3::z()]);
        assert!(f.iter().all(|f| f.iter().all(|c| c.is_finite())), "{f:?}");
    }
    let rest = vec![Rest::new(1.0, [1.0, 1.0], 0.0), Rest::new(1.0, [0.0, 0.0], 0.0)];
    let error =
        Hinges::new(Linear::new(RIGIDITY).unwrap(), 0.0, vec![[0, 1, 2, 3], [4, 5, 6, 7]], rest).err();
    assert!(
        matches!(error, Some(CoreError::Degenerate { element: 1, ref vertices, .. }) if vertices == &[4, 5, 6, 7])
    );
}

/// Laws of every kind, the ones with memory in the middle of a path.
fn laws_on_the_way(heights: [f64; 2], start: &[Vec3]) -> Vec<(&'static str, Model)> {
    let curve = Curve::new(3.0, 1.0, -2.0).unwrap();
    let mut laws = vec![
        ("nonlinear", bent(curve, 0.0, heights, 0.2)),
        ("plastic", bent(Plastic::new(2.0, 0.3, 0.5).unwrap(), 0.0, heights, 0.2)),
        ("hysteresis", bent(Hysteresis::new(curve, 0.2, 0.1).unwrap(), 0.0, heights, 0.2)),
        ("hysteresis, damped", bent(Hysteresis::new(curve, 0.2, 0.1).unwrap(), DAMPING, heights, 0.2)),
    ];
    for (_, model) in &mut laws {
        for theta in [1.4, -0.3, 0.9, 0.5] {
            model.accept(&folded(theta, heights));
        }
        model.accept(start);
    }
    laws
}

#[test]
fn blocks_and_momentum_of_laws_with_memory() {
    let mut random = Random::new(9);
    let heights = [1.0, 0.8];
    for theta in [0.3, 0.7, 1.5, -2.0, 3.0] {
        for (what, model) in laws_on_the_way(heights, &folded(0.45, heights)) {
            let x = folded(theta, heights).map(|x| x + random.vector() * 0.02);
            let v = random.vectors(4, 1.0);
            check_blocks(&model, &x, what);
            check_momentum(&model, &x, &v, what);
            check_rigid_motion(&model, &x, what);
        }
    }
}

#[test]
fn memory_moves_on_by_accepting_only_and_can_be_put_back() {
    let heights = [1.0, 0.8];
    let (start, bent) = (folded(0.45, heights), folded(1.2, heights));
    for (what, mut model) in laws_on_the_way(heights, &start) {
        let (memory, rest) = (model.memory.clone(), [Vec3::zeros(); 4]);
        let before = forces(&model, &start, &rest);
        forces(&model, &bent, &rest);
        assert_eq!(model.memory, memory, "{what}");
        model.accept(&bent);
        assert_eq!(model.memory == memory, memory.is_empty(), "{what}");
        assert_eq!(forces(&model, &start, &rest) == before, what == "nonlinear", "{what}");
        model.memory.clone_from(&memory);
        assert_eq!(forces(&model, &start, &rest), before, "{what}");
    }
}

#[test]
fn a_hinge_that_folds_through_goes_on_past_pi() {
    use std::f64::consts::PI;
    let heights = [1.0, 1.0];
    let law = Hysteresis::new(Curve::new(3.0, 1.0, -2.0).unwrap(), 0.0, 0.0).unwrap();
    let mut model = bent(law, 0.0, heights, 0.0);
    let mut last = 0.0;
    for step in 0..=160 {
        let x = folded(0.04 * f64::from(step), heights);
        model.accept(&x);
        let now = energy(&model, &x);
        assert!(now > last || step == 0, "{step}: {last} {now}");
        last = now;
    }
    // θ = 6.4 > 2π.
    assert!(last > 0.5 * (2.0 * PI).powi(2), "{last}");
    let f = forces(&model, &folded(PI, heights), &[Vec3::zeros(); 4]);
    assert!(f.iter().flatten().all(|c| c.is_finite()));
}

#[test]
fn memory_costs_48_bytes_where_it_is_and_none_elsewhere() {
    let bytes = |model: &Model| model.law.info().bytes;
    let curve = Curve::new(3.0, 1.0, -2.0).unwrap();
    let linear = bytes(&hinge(0.0, [1.0; 2], 0.0));
    assert_eq!(bytes(&bent(curve, 0.0, [1.0; 2], 0.0)), linear);
    let hysteresis = Hysteresis::new(curve, 0.5, 0.5).unwrap();
    assert_eq!(bytes(&bent(hysteresis, 0.0, [1.0; 2], 0.0)), linear + 48);
}

/// A path of one hinge: every motion turns it to a random angle within `reach` [rad].
fn wander(random: &mut Random, reach: f64, steps: usize) -> Vec<f64> {
    (0..steps).map(|_| reach * random.value()).collect()
}

#[test]
fn plastic_history_that_starts_at_the_limit_changes_no_bit() {
    let heights = [1.0, 0.8];
    let law = Plastic::new(2.0, 0.4, 0.5).unwrap();
    // h̄ = 0.9: the limit is an angle of 0.36.
    let rest = || vec![Rest::new(1.0, heights.map(|h| 0.5 * h), 0.2)];
    let hinges = || Hinges::new(law, 0.3, vec![[0, 1, 2, 3]], rest()).unwrap();
    let (mut whole, mut lean) = (Model::new(hinges()), Model::lean(hinges(), 0.01));
    let mut random = Random::new(12);
    let v = random.vectors(4, 1.0);
    let path = [wander(&mut random, 0.3, 40), wander(&mut random, 1.5, 40), wander(&mut random, 0.3, 40)];
    for (part, angles) in path.iter().enumerate() {
        for angle in angles {
            let x = folded(0.2 + angle, heights);
            for trial in [0.1, 0.9] {
                let x = folded(0.2 + angle + trial, heights);
                assert_eq!(forces(&whole, &x, &v), forces(&lean, &x, &v));
            }
            whole.accept(&x);
            lean.accept(&x);
            assert_eq!(forces(&whole, &x, &v), forces(&lean, &x, &v));
            assert_eq!(energy(&whole, &x).to_bits(), energy(&lean, &x).to_bits());
            assert_eq!(whole.law.hinge_states(&x, &whole.memory), lean.law.hinge_states(&x, &lean.memory));
        }
        let kept = lean.memory.needed().unwrap().0;
        assert_eq!(kept, usize::from(part > 0), "history starts with the flow, and stays");
    }
    // Planted: one that forgets where it flowed is seen.
    lean.memory = lean.law.unused();
    let x = folded(0.2, heights);
    assert_ne!(forces(&whole, &x, &v), forces(&lean, &x, &v));
}

#[test]
fn hysteresis_without_history_is_within_its_bound_on_any_path() {
    let heights = [1.0, 1.0];
    let curve = Curve::new(3.0, 1.0, -2.0).unwrap();
    let law = Hysteresis::new(curve, 0.3, 0.1).unwrap();
    let hinges = || Hinges::new(law, 0.0, vec![[0, 1, 2, 3]], vec![Rest::new(1.0, [0.5, 0.5], 0.0)]).unwrap();
    let moment = |model: &Model, x: &[Vec3]| model.law.hinge_states(x, &model.memory)[0].moment;
    let mut random = Random::new(4);
    for neglected in [0.02, 0.2] {
        // Not on the end itself, where rounding decides.
        let range = 2.0 * neglected / (2.0 - neglected) * curve.k0() * (1.0 - 1e-9);
        let mut worst = [0.0_f64; 2];
        for round in 0..60 {
            let (mut whole, mut lean) = (Model::new(hinges()), Model::lean(hinges(), neglected));
            // Small turns about a place, whole ways from end to end, and all between.
            let (middle, reach) = (range * random.value(), range * random.value().abs());
            let inside = (0..200).map(|_| (middle + reach * random.value()).clamp(-range, range));
            let ends = (0..6).map(|k| if k % 2 == 0 { range } else { -range });
            let mut path: Vec<f64> = if round == 0 { ends.collect() } else { inside.collect() };
            let within = path.len();
            path.push(2.0 * curve.k0());
            path.extend((0..60).map(|_| 3.0 * curve.k0() * random.value()));
            for (k, curvature) in path.iter().enumerate() {
                let x = folded(*curvature, heights);
                whole.accept(&x);
                lean.accept(&x);
                let error = (moment(&whole, &x) - moment(&lean, &x)).abs() / curve.m0();
                let part = usize::from(k >= within);
                worst[part] = worst[part].max(error);
                assert_eq!(lean.memory.needed().unwrap().0 > 0, k >= within, "{curvature}");
            }
        }
        // Rounding of moments of order one.
        assert!(worst[0] <= neglected + 1e-12, "{worst:?}");
        assert!(worst[1] <= neglected + 1e-12, "the error does not grow once history is kept: {worst:?}");
        assert!(worst[0] > 0.5 * neglected, "a bound that is half as large is not kept: {worst:?}");
    }
}

#[test]
fn a_hinge_without_history_has_the_energy_of_its_force() {
    let law = Hysteresis::new(Curve::new(3.0, 1.0, -2.0).unwrap(), 0.3, 0.1).unwrap();
    let hinges =
        || Hinges::new(law, DAMPING, vec![[0, 1, 2, 3]], vec![Rest::new(1.0, [0.5, 0.4], 0.1)]).unwrap();
    let mut random = Random::new(6);
    for theta in [0.11, 0.13, 0.08] {
        let x = folded(theta, [1.0, 0.8]).map(|x| x + random.vector() * 1e-3);
        let lean = Model::lean(hinges(), 0.2);
        check_derivatives(&lean, &x, "lean");
        check_velocity_terms(&lean, &x, &random.vectors(4, 1.0), "lean");
    }
    assert_eq!(Model::lean(hinges(), 0.2).law.info().bytes + 48, Model::new(hinges()).law.info().bytes);
}
