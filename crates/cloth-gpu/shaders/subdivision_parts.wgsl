// The parts of the triangles and their spheres.
//   in   offsets[t]  t ≤ n  parts before triangle t, (low, high); plans[t]; triangles, positions, spheres
//   out  roots[k], parts[k]  k < parts there are room for: the triangle, and the sphere that holds the part, thickness included
//        during its part of the time
// Includes: layout.   Twin: src/twin/subdivision.rs
@group(0) @binding(0) var<uniform> params: SubdivisionParams;
@group(0) @binding(1) var<storage, read> triangles: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> positions: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> offsets: array<vec2<u32>>;
@group(0) @binding(5) var<storage, read> plans: array<u32>;
@group(0) @binding(6) var<storage, read_write> roots: array<u32>;
@group(0) @binding(7) var<storage, read_write> parts: array<vec4<f32>>;

@compute @workgroup_size(WORKGROUP)
fn subdivision_parts(
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let k = group_index(group, groups) * WORKGROUP + index;
    if k >= params.room || k >= offsets[params.triangles].x { return; }
    var t = 0u;
    var past = params.triangles;
    while past - t > 1u {
        let middle = t + (past - t) / 2u;
        if offsets[middle].x <= k { t = middle; } else { past = middle; }
    }
    roots[k] = t;
    let in_space = plans[t] & 0xffu;
    let in_time = plans[t] >> 8u;
    if in_space == 0u && in_time == 0u {
        parts[k] = spheres[t];
        return;
    }
    let number = k - offsets[t].x;
    // Corners in barycentric coordinates: multiples of 2^-l, so exact.
    var a = vec3<f32>(1.0, 0.0, 0.0);
    var b = vec3<f32>(0.0, 1.0, 0.0);
    var c = vec3<f32>(0.0, 0.0, 1.0);
    for (var level = 0u; level < in_space; level++) {
        let child = (number >> (in_time + 2u * level)) & 3u;
        let ab = 0.5 * (a + b);
        let bc = 0.5 * (b + c);
        let ca = 0.5 * (c + a);
        // 0, 1, 2: at that corner; 3: in the middle.
        if child == 0u {
            b = ab;
            c = ca;
        } else if child == 1u {
            a = ab;
            c = bc;
        } else if child == 2u {
            a = ca;
            b = bc;
        } else {
            a = ab;
            b = bc;
            c = ca;
        }
    }
    let interval = 1.0 / f32(1u << in_time);
    let start = f32(number & ((1u << in_time) - 1u)) * interval;
    let corners = triangles[t].xyz;
    var at: array<vec3<f32>, 6>;
    var reach = 0.0;
    for (var end = 0u; end < 2u; end++) {
        let time = start + f32(end) * interval;
        var x: array<vec3<f32>, 3>;
        for (var i = 0u; i < 3u; i++) {
            let p = positions[corners[i]];
            let q = positions[params.second + corners[i]];
            x[i] = (1.0 - time) * p.xyz + time * q.xyz;
            reach = max(reach, max(p.w, q.w));
        }
        at[3u * end] = a.x * x[0] + a.y * x[1] + a.z * x[2];
        at[3u * end + 1u] = b.x * x[0] + b.y * x[1] + b.z * x[2];
        at[3u * end + 2u] = c.x * x[0] + c.y * x[1] + c.z * x[2];
    }
    let centre = (at[0] + at[1] + at[2] + at[3] + at[4] + at[5]) / 6.0;
    var distance = 0.0;
    for (var i = 0u; i < 6u; i++) { distance = max(distance, length(at[i] - centre)); }
    parts[k] = vec4<f32>(centre, (distance + 1.7321 * reach + PART_SLACK) * 1.00001);
}
