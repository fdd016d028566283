//! A batch, by any instructions, answers as one pair at a time, bit for bit.

use super::batch::Batch;
use super::edge_edge::EdgeEdgeMotion;
use super::filter::{Row, row};
use super::instructions::Instructions;
use super::march::{NEVER, march};
use super::motions::Motions;
use super::one;
use super::vertex_triangle::VertexTriangleMotion;
use crate::{StencilKind, Vec3};

type Pair = [Vec3; 8];

fn random() -> impl FnMut() -> u32 {
    let mut state = 0x2545_f491_4f6c_dd1d_u64;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 32) as u32
    }
}

/// Pairs in general position and in none: on a coarse grid they touch, lie in a plane, are parallel, have no size; some
/// do not move, some move as one. One scene per size: tiny, huge, far from the origin.
fn scenes() -> Vec<Vec<Pair>> {
    const SCALES: [f64; 6] = [1.0, 1e-3, 1e-155, 1e150, 1e-310, 1e308];
    let mut random = random();
    let mut scenes = vec![vec![]; 2 * SCALES.len()];
    scenes[0] = vec![[Vec3::zeros(); 8], [Vec3::new(0.1, 0.2, 0.3); 8]];
    for k in 0..6000 {
        let steps = [1, 2, 3, 8, 1000, u32::MAX][k % 6];
        let mut coordinate = || f64::from(random() % steps.saturating_add(1)) / f64::from(steps) - 0.5;
        let mut p: Pair = std::array::from_fn(|_| Vec3::new(coordinate(), coordinate(), coordinate()));
        if k % 7 == 0 {
            let step = p[4] - p[0];
            for j in 0..4 {
                p[j + 4] = p[j] + step;
            }
        }
        if k % 11 == 0 {
            // All but flat: times of contact that are hard to find.
            for v in &mut p {
                v.y *= 1e-9;
            }
        }
        let (scale, is_far) = (k / 6 % SCALES.len(), k % 13 == 0);
        let far = if is_far { Vec3::new(1e6, -3e5, 7.0) * SCALES[scale].min(1e290) } else { Vec3::zeros() };
        scenes[2 * scale + usize::from(is_far)].push(p.map(|v| v * SCALES[scale] + far));
    }
    scenes
}

fn in_a_batch(
    instructions: Instructions,
    kind: StencilKind,
    pairs: &[Pair],
    thickness: f64,
) -> Vec<Option<f64>> {
    let start: Vec<Vec3> = pairs.iter().flat_map(|p| p[..4].to_vec()).collect();
    let end: Vec<Vec3> = pairs.iter().flat_map(|p| p[4..].to_vec()).collect();
    let vertices: Vec<[u32; 4]> = (0..pairs.len() as u32).map(|k| [0, 1, 2, 3].map(|j| 4 * k + j)).collect();
    let mut batch = Batch::default();
    let left = batch.decide(instructions, kind, &Motions::new(&start, &end, thickness), &vertices[..]);
    let mut answers = vec![None; pairs.len()];
    for (pair, time) in batch.contacts() {
        answers[pair as usize] = Some(time);
    }
    assert!(answers.iter().flatten().filter(|&&time| time > 0.0).count() <= left);
    answers
}

/// The first pair with answers of other bits.
fn first_difference(a: &[Option<f64>], b: &[Option<f64>]) -> Option<usize> {
    assert_eq!(a.len(), b.len());
    (0..a.len()).find(|&k| a[k].map(f64::to_bits) != b[k].map(f64::to_bits))
}

#[test]
fn a_batch_answers_as_one_pair_at_a_time() {
    for kind in [StencilKind::VertexTriangle, StencilKind::EdgeEdge] {
        for thickness in [0.0, 1e-3, 0.1, 1e-160] {
            let (mut contacts, mut later, mut count) = (0, 0, 0);
            for pairs in scenes() {
                let single: Vec<_> = pairs.iter().map(|p| one(kind, p, thickness)).collect();
                for &instructions in Instructions::KNOWN.iter().filter(|i| i.are_there()) {
                    let batch = in_a_batch(instructions, kind, &pairs, thickness);
                    let difference = first_difference(&single, &batch);
                    assert_eq!(difference, None, "{instructions:?} {kind:?} {thickness}");
                }
                count += pairs.len();
                contacts += single.iter().flatten().count();
                later += single.iter().flatten().filter(|&&t| t > 0.0).count();
            }
            assert!(contacts > 500 && contacts < count - 500, "{kind:?} {thickness}: {contacts} contacts");
            assert!(later > 200, "{kind:?} {thickness}: {later} later contacts");
        }
    }
}

#[test]
fn groups_that_are_not_full_answer_the_same() {
    let pairs = &scenes()[0];
    let kind = StencilKind::EdgeEdge;
    for &instructions in Instructions::KNOWN.iter().filter(|i| i.are_there()) {
        for count in 0..36 {
            let pairs = &pairs[40..40 + count];
            let single: Vec<_> = pairs.iter().map(|p| one(kind, p, 0.1)).collect();
            assert_eq!(first_difference(&single, &in_a_batch(instructions, kind, pairs, 0.1)), None);
        }
    }
}

#[test]
fn a_difference_of_one_bit_is_seen() {
    let answers = in_a_batch(Instructions::Plain, StencilKind::EdgeEdge, &scenes()[0], 0.0);
    let k = answers.iter().position(|t| t.is_some_and(|t| t > 0.0)).expect("contacts");
    let mut changed = answers.clone();
    changed[k] = changed[k].map(f64::next_up);
    assert_eq!(first_difference(&answers, &changed), Some(k));
    changed[k] = None;
    assert_eq!(first_difference(&answers, &changed), Some(k));
}

/// The answers of the march, with the filter's word on them or without.
fn marched(kind: StencilKind, pairs: &[Pair], thickness: f64, filters: bool) -> Vec<Option<f64>> {
    let points: Vec<[Row; 8]> = pairs.iter().map(|p| p.each_ref().map(row)).collect();
    let rows = |pair: u32| points[pair as usize].each_ref();
    let mut list: Vec<u32> = (0..pairs.len() as u32).collect();
    let mut times = vec![NEVER; pairs.len()];
    let (list, all) = (&mut list[..], &mut times[..]);
    let left = match kind {
        StencilKind::VertexTriangle => {
            march::<f64, VertexTriangleMotion<f64>, 3>(rows, thickness, filters, list, all)
        }
        StencilKind::EdgeEdge => march::<f64, EdgeEdgeMotion<f64>, 4>(rows, thickness, filters, list, all),
    };
    let answers: Vec<_> = times.iter().map(|&t| (t != NEVER).then_some(t)).collect();
    assert!(answers.iter().flatten().count() <= left);
    answers
}

#[test]
fn the_march_answers_as_the_filter_before_it_would_and_not_so_without_it() {
    let mut overruled = 0;
    for kind in [StencilKind::VertexTriangle, StencilKind::EdgeEdge] {
        for thickness in [0.0, 1e-3] {
            for pairs in scenes() {
                let single: Vec<_> = pairs.iter().map(|p| one(kind, p, thickness)).collect();
                let filtered = marched(kind, &pairs, thickness, true);
                assert_eq!(first_difference(&single, &filtered), None, "{kind:?} {thickness}");
                let alone = marched(kind, &pairs, thickness, false);
                overruled += (0..pairs.len()).filter(|&k| single[k].is_none() && alone[k].is_some()).count();
            }
        }
    }
    // Pairs that all but touch: rare, and the same ones in every run.
    assert!(overruled > 0, "no answer of the march was overruled");
}
