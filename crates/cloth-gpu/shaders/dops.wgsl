// 18-DOPs that move: beside the three axes of a box, slabs across the six diagonals x ± y, x ± z, y ± z at both ends of the step
// (thesis 3.3.1), as two more boxes: one over the sums, one over the differences. With the axes they make up the 18 planes.
// Floating point: a sum of two coordinates within [−1, 1] is off by 2 ROUNDING, its coordinates by POSITION_ERROR each, and moving it
// outward by the margin costs ROUNDING (2 + margin) more. A diagonal is √2 long: half the thickness is √½ of it along the diagonal.
//     margin = 0.7072 thickness + 2 POSITION_ERROR + 8 ROUNDING
// on either side is more than that by 2⁻²³, so what has disjoint slabs stays apart by more than the thickness and 2⁻²³
// (see narrow_filter.wgsl). √½ < 0.7072 (1 − 4 ROUNDING).
// Includes: boxes.   Twin: src/twin/dops.rs

struct Dop {
    sums: Box,
    differences: Box,
}

fn slab(p: vec3<f32>, q: vec3<f32>, margin: f32) -> Box {
    return Box(p - margin, p + margin, q - margin, q + margin);
}

fn vertex_dop(p: vec3<f32>, q: vec3<f32>, thickness: f32) -> Dop {
    let margin = 0.7072 * thickness + 2.0 * POSITION_ERROR + 8.0 * ROUNDING;
    return Dop(slab(p.xxy + p.yzz, q.xxy + q.yzz, margin), slab(p.xxy - p.yzz, q.xxy - q.yzz, margin));
}

fn dop_hull(a: Dop, b: Dop) -> Dop {
    return Dop(hull(a.sums, b.sums), hull(a.differences, b.differences));
}

// Whether what is in them may come as close as the thickness at some time of the step.
fn dops_may_touch(a: Dop, b: Dop) -> bool {
    return may_touch(a.sums, b.sums) && may_touch(a.differences, b.differences);
}
