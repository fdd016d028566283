// Boxes and spheres of the triangles over the whole step, and the largest radius.
//   in   triangles[t]          t < n     corners, and body << 2 | dynamic << 1 | self-colliding
//        positions[v]          at t0; those at t1 begin at params.second
//        active[v / 32]        bit per vertex; unused where all are active
//   out  bounds[t]             as above, held by the boxes of the corners
//        spheres[t]            centre and radius of a ball that holds the triangle, thickness included, during the step
//        status[STATUS_RADIUS] bits of the largest radius
// Includes: layout, boxes.   Twin: src/twin/bounds.rs
@group(0) @binding(0) var<uniform> params: SceneParams;
@group(0) @binding(1) var<storage, read> triangles: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> positions: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> active_bits: array<u32>;
@group(0) @binding(4) var<storage, read_write> bounds: array<Bounds>;
@group(0) @binding(5) var<storage, read_write> spheres: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read_write> status: array<atomic<u32>>;

var<workgroup> sh_radius: atomic<u32>;

@compute @workgroup_size(WORKGROUP)
fn triangle_bounds(
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let t = group_index(group, groups) * WORKGROUP + index;
    if index == 0u { atomicStore(&sh_radius, 0u); }
    workgroupBarrier();
    if t < params.triangles {
        let triangle = triangles[t];
        let corners = triangle.xyz;
        var is_active = params.all_active;
        for (var k = 0u; k < 3u && is_active == 0u; k++) {
            is_active = (active_bits[corners[k] / 32u] >> (corners[k] % 32u)) & 1u;
        }
        var b = vertex_box(positions[corners.x], positions[params.second + corners.x]);
        b = hull(b, vertex_box(positions[corners.y], positions[params.second + corners.y]));
        b = hull(b, vertex_box(positions[corners.z], positions[params.second + corners.z]));
        bounds[t] = Bounds(b.low_0, is_active, b.high_0, triangle.w, b.low_1, 0u, b.high_1, 0u);

        let centre = 0.5 * (min(b.low_0, b.low_1) + max(b.high_0, b.high_1));
        var distance = 0.0;
        var reach = 0.0;
        for (var k = 0u; k < 3u; k++) {
            let p = positions[corners[k]];
            let q = positions[params.second + corners[k]];
            distance = max(distance, max(length(p.xyz - centre), length(q.xyz - centre)));
            reach = max(reach, max(p.w, q.w));
        }
        // √3 of what each axis may be off; the factor covers the rounding of a few operations and of the square root.
        let radius = (distance + 1.7321 * reach) * 1.00001;
        spheres[t] = vec4<f32>(centre, radius);
        atomicMax(&sh_radius, bitcast<u32>(radius));
    }
    workgroupBarrier();
    if index == 0u { atomicMax(&status[STATUS_RADIUS], atomicLoad(&sh_radius)); }
}
