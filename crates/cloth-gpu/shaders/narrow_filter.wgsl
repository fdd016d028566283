// Drops the candidates that certainly stay apart; what is left is decided in double precision elsewhere.
//   in   candidates[k]  k < min(room, status[STATUS_VERTEX_TRIANGLE or STATUS_EDGE_EDGE])
//        corners[f]     of triangles (xyz), or ends of edges (EDGES)
//        positions      as in triangle_bounds; of r nothing is asked: params.thickness, params.is_thin
//   out  left[p]        p < status[STATUS_LEFT] (with EDGES the word after): unordered; what does not fit is counted and left out
//
// Two questions, as in cloth-collision's ccd/filter.rs. Does one fixed direction separate the features during the whole
// step? The directions are those of Gilbert's algorithm for the point nearest to the origin in the hull of the differences
// at both ends. And, where only touching counts: are the four points never coplanar, that is, have the Bernstein
// coefficients of their determinant all one sign?
//
// Bounds. ε = ROUNDING bounds the relative error of + − × / (either neighbour of the exact result; fused is no worse).
// A device position is off by at most 2⁻²⁵ along each axis; P = POSITION_ERROR = 2⁻²³ is used instead, so that what is
// rejected stays farther apart than the thickness by more than 2⁻²⁴ in units of the scene. The code in double precision is
// sure of a pair once it is apart by about 1e-14 of the pair's size (ccd/mod.rs), so it rejects whatever is rejected here.
//   Direction n, differences d, D = max |d|: d carries ε D per coordinate, n·d 3ε|n|₁D more (first order), its two
//   positions 2P|n|₁; |n| carries 10ε with the square root, the sums and products of the bound itself less than 4ε:
//       n·d > thickness |n| (1 + 16ε) + |n|₁ (2P + 8εD) + 1e-17
//   at both ends means apart in between too. 1e-17 is more than all that flushing to zero can cost.
//   Determinant det(x, y, z), X = max |x| at both ends, likewise Y, Z: the entries of x are off by η = 2P + εX. With X' = X + η the
//   entries cost 6 (X'Y'Z' − XYZ) ≤ 6 (ηX Y'Z' + X' ηY Z' + X'Y' ηZ). Evaluation, with M = X'Y'Z': a determinant 28εM (cross
//   product 4εYZ per entry, times 3X; products 6, sums 10), an inner coefficient (36 + 12 + 20 + 28 + 18)/3 + 12 = 50εM:
//       |b| > 6.001 (ηX Y'Z' + X' ηY Z' + X'Y' ηZ) + 64εM
//   The difference to 56εM covers higher orders and is far above what the determinant in double precision is off by.
// Includes: layout.   Twin: src/twin/narrow_filter.rs
// Source: E. G. Gilbert, "An Iterative Procedure for Computing the Minimum of a Quadratic Form on a Convex Set", 1966.
@group(0) @binding(0) var<uniform> params: SceneParams;
@group(0) @binding(1) var<storage, read> candidates: array<vec2<u32>>;
//#if EDGES
@group(0) @binding(2) var<storage, read> corners: array<vec2<u32>>;
//#end
//#if !EDGES
@group(0) @binding(2) var<storage, read> corners: array<vec4<u32>>;
//#end
@group(0) @binding(3) var<storage, read> positions: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> left: array<vec2<u32>>;
@group(0) @binding(5) var<storage, read_write> status: array<atomic<u32>>;

//#if EDGES
const COUNT = 8u;
const COUNTED = STATUS_EDGE_EDGE;
const LEFT = STATUS_LEFT + 1u;
//#end
//#if !EDGES
const COUNT = 6u;
const COUNTED = STATUS_VERTEX_TRIANGLE;
const LEFT = STATUS_LEFT;
//#end

var<workgroup> sh_count: atomic<u32>;
var<workgroup> sh_base: u32;

fn largest(x: vec3<f32>) -> f32 {
    return max(max(abs(x.x), abs(x.y)), abs(x.z));
}

// Whether a direction is found along which all differences lie beyond the thickness.
fn separated(d: ptr<function, array<vec3<f32>, COUNT>>) -> bool {
    var extent = 0.0;
    var n = vec3<f32>();
    for (var k = 0u; k < COUNT; k++) {
        extent = max(extent, largest((*d)[k]));
        n += (*d)[k];
    }
    n /= f32(COUNT);
    for (var step = 0u; step < FILTER_STEPS; step++) {
        var corner = (*d)[0];
        var lowest = dot(n, corner);
        for (var k = 1u; k < COUNT; k++) {
            let along = dot(n, (*d)[k]);
            if along < lowest {
                lowest = along;
                corner = (*d)[k];
            }
        }
        let sizes = abs(n.x) + abs(n.y) + abs(n.z);
        let squared = dot(n, n);
        let needed = params.thickness * sqrt(squared) * (1.0 + 16.0 * ROUNDING)
            + sizes * (2.0 * POSITION_ERROR + 8.0 * ROUNDING * extent)
            + 1e-17;
        if lowest > needed { return true; }
        // Nearest point to the origin on the segment from n to the corner.
        let back = n - corner;
        let length = dot(back, back);
        if length <= 1e-30 { return false; }
        n -= back * clamp((squared - lowest) / length, 0.0, 1.0);
    }
    return false;
}

// Whether the Bernstein coefficients of det(x, y, z), each from [0] to [1], are certainly all of one sign.
fn rootless(x: array<vec3<f32>, 2>, y: array<vec3<f32>, 2>, z: array<vec3<f32>, 2>) -> bool {
    let first = cross(y[0], z[0]);
    let second = cross(y[1], z[1]);
    let mixed = cross(y[0], z[1]) + cross(y[1], z[0]);
    let b = vec4<f32>(
        dot(x[0], first),
        (dot(x[0], mixed) + dot(x[1], first)) * (1.0 / 3.0),
        (dot(x[1], mixed) + dot(x[0], second)) * (1.0 / 3.0),
        dot(x[1], second),
    );
    let sizes = vec3<f32>(
        max(largest(x[0]), largest(x[1])),
        max(largest(y[0]), largest(y[1])),
        max(largest(z[0]), largest(z[1])),
    );
    let off = 2.0 * POSITION_ERROR + ROUNDING * sizes;
    let s = sizes + off;
    let error = 6.001 * (off.x * s.y * s.z + s.x * off.y * s.z + s.x * s.y * off.z) + 64.0 * ROUNDING * s.x * s.y * s.z;
    return all(b > vec4<f32>(error)) || all(b < vec4<f32>(-error));
}

fn at(vertex: u32, end: u32) -> vec3<f32> {
    return positions[vertex + end * params.second].xyz;
}

fn is_apart(pair: vec2<u32>) -> bool {
    var d: array<vec3<f32>, COUNT>;
//#if EDGES
    let a = corners[pair.x];
    let b = corners[pair.y];
    var u: array<vec3<f32>, 2>;
    var v: array<vec3<f32>, 2>;
    for (var end = 0u; end < 2u; end++) {
        let p = array<vec3<f32>, 4>(at(a.x, end), at(a.y, end), at(b.x, end), at(b.y, end));
        d[4u * end] = p[0] - p[2];
        d[4u * end + 1u] = p[0] - p[3];
        d[4u * end + 2u] = p[1] - p[2];
        d[4u * end + 3u] = p[1] - p[3];
        u[end] = p[1] - p[0];
        v[end] = p[3] - p[2];
    }
    if params.is_thin != 0u && rootless(array<vec3<f32>, 2>(d[0], d[4]), u, v) { return true; }
//#end
//#if !EDGES
    let others = corners[pair.y];
    for (var end = 0u; end < 2u; end++) {
        let p = at(pair.x, end);
        d[3u * end] = at(others.x, end) - p;
        d[3u * end + 1u] = at(others.y, end) - p;
        d[3u * end + 2u] = at(others.z, end) - p;
    }
    if params.is_thin != 0u {
        let x = array<vec3<f32>, 2>(d[0], d[3]);
        let y = array<vec3<f32>, 2>(d[1], d[4]);
        let z = array<vec3<f32>, 2>(d[2], d[5]);
        if rootless(x, y, z) { return true; }
    }
//#end
    return separated(&d);
}

@compute @workgroup_size(WORKGROUP)
fn narrow_filter(
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let k = group_index(group, groups) * WORKGROUP + index;
    let n = min(atomicLoad(&status[COUNTED]), arrayLength(&candidates));
    if index == 0u { atomicStore(&sh_count, 0u); }
    workgroupBarrier();
    var pair = vec2<u32>();
    var is_left = false;
    var place = 0u;
    if k < n {
        pair = candidates[k];
        is_left = !is_apart(pair);
        if is_left { place = atomicAdd(&sh_count, 1u); }
    }
    workgroupBarrier();
    if index == 0u { sh_base = atomicAdd(&status[LEFT], atomicLoad(&sh_count)); }
    workgroupBarrier();
    place += sh_base;
    if is_left && place < arrayLength(&left) { left[place] = pair; }
}
