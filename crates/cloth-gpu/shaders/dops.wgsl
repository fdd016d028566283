// 18-DOPs that move: beside the three axes of a box, slabs across the six diagonals x ± y, x ± z, y ± z, at both ends of the step
// (thesis 3.3.1). The axes are those of boxes.wgsl, with which they make up the 18 planes.
// Floating point: a sum of two coordinates within [−1, 1] is off by ROUNDING · 2, the difference of two sums by ROUNDING · 4 more; each of
// the four coordinates by POSITION_ERROR. A diagonal is √2 long. So slabs farther apart than
//     √2 thickness + 4 POSITION_ERROR + 8 ROUNDING
// mean that the features stay apart, and that more than 2⁻²² of it is left (see narrow_filter.wgsl).

struct Dop {
    // Over x + y, x + z, y + z at t0, then over x − y, x − z, y − z at t0; the same at t1.
    low: array<vec3<f32>, 4>,
    high: array<vec3<f32>, 4>,
}

fn vertex_dop(p: vec3<f32>, q: vec3<f32>) -> Dop {
    let d = array<vec3<f32>, 4>(p.xxy + p.yzz, p.xxy - p.yzz, q.xxy + q.yzz, q.xxy - q.yzz);
    return Dop(d, d);
}

fn dop_hull(a: ptr<function, Dop>, b: ptr<function, Dop>) -> Dop {
    var out: Dop;
    for (var k = 0u; k < 4u; k++) {
        out.low[k] = min((*a).low[k], (*b).low[k]);
        out.high[k] = max((*a).high[k], (*b).high[k]);
    }
    return out;
}

// Whether what is in them may come as close as the thickness at some time of the step.
fn dops_may_touch(a: ptr<function, Dop>, b: ptr<function, Dop>, thickness: f32) -> bool {
    let slack = 1.41422 * thickness + 4.0 * POSITION_ERROR + 8.0 * ROUNDING;
    var apart = false;
    for (var k = 0u; k < 2u; k++) {
        let above = ((*a).low[k] - (*b).high[k] > vec3<f32>(slack)) & ((*a).low[k + 2u] - (*b).high[k + 2u] > vec3<f32>(slack));
        let beneath = ((*b).low[k] - (*a).high[k] > vec3<f32>(slack)) & ((*b).low[k + 2u] - (*a).high[k + 2u] > vec3<f32>(slack));
        apart = apart || any(above | beneath);
    }
    return !apart;
}
