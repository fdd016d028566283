// Boxes that move. A position is (x, y, z, r): the vertex lies within r of it along each axis, half the thickness included.
// Floating point: + and − give one of the two neighbours of the exact result, so one step outward holds it; |r| is far above
// the smallest normal number, so flushing to zero does no harm.

struct Box {
    low_0: vec3<f32>,
    high_0: vec3<f32>,
    low_1: vec3<f32>,
    high_1: vec3<f32>,
}

fn below(x: f32) -> f32 {
    let bits = bitcast<u32>(x);
    if x == 0.0 { return -1.1754944e-38; }
    return bitcast<f32>(select(bits + 1u, bits - 1u, x > 0.0));
}

fn all_below(x: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(below(x.x), below(x.y), below(x.z));
}

fn vertex_box(p: vec4<f32>, q: vec4<f32>) -> Box {
    return Box(
        all_below(p.xyz - p.w),
        -all_below(-p.xyz - p.w),
        all_below(q.xyz - q.w),
        -all_below(-q.xyz - q.w),
    );
}

fn hull(a: Box, b: Box) -> Box {
    return Box(
        min(a.low_0, b.low_0),
        max(a.high_0, b.high_0),
        min(a.low_1, b.low_1),
        max(a.high_1, b.high_1),
    );
}

// Whether the boxes may touch at some time of the step: they are apart if along one axis the same one lies above the other
// at both ends.
fn may_touch(a: Box, b: Box) -> bool {
    let above = (a.low_0 > b.high_0) & (a.low_1 > b.high_1);
    let beneath = (a.high_0 < b.low_0) & (a.high_1 < b.low_1);
    return !any(above | beneath);
}
