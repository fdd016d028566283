// How far each triangle is subdivided: l times into four (Loop: midpoints of the sides), m times its time into two.
//   Every part of a triangle so divided lies, during its part of the time, within
//       ρ / 2^l + d / 2^(m+1) + least
//   of the mean of its corners at the middle of that time; ρ: largest distance of a corner from the centroid at both ends, d: largest
//   displacement of a corner, least: thickness and rounding. The larger term is halved until this is at most the limit.
//   in   triangles, positions, spheres [t]  t < n; grid[0]
//   out  plans[t]   l | m << 8
//        counts[t]  4^l · 2^m
//        status[STATUS_TOO_FINE]  1 where MAX_PARTS would be passed: the cells have to be larger
// Includes: layout.   Twin: src/twin/subdivision.rs
@group(0) @binding(0) var<uniform> params: SubdivisionParams;
@group(0) @binding(1) var<storage, read> triangles: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> positions: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> grids: array<Grid>;
@group(0) @binding(5) var<storage, read_write> plans: array<u32>;
@group(0) @binding(6) var<storage, read_write> counts: array<u32>;
@group(0) @binding(7) var<storage, read_write> status: array<atomic<u32>>;

@compute @workgroup_size(WORKGROUP)
fn subdivision_plan(
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let t = group_index(group, groups) * WORKGROUP + index;
    if t >= params.triangles { return; }
    let size = grids[0].size;
    // As large as a part may be and still touch two cells along an axis at most, and no more than a third of the cell.
    let limit = min(size / CELL_RADII, (size / 2.02 - 2.0 * PLANE_SLACK) / REACH);
    var in_space = 0u;
    var in_time = 0u;
    if spheres[t].w > limit {
        let corners = triangles[t].xyz;
        let p = array<vec3<f32>, 3>(positions[corners.x].xyz, positions[corners.y].xyz, positions[corners.z].xyz);
        let q = array<vec3<f32>, 3>(
            positions[params.second + corners.x].xyz,
            positions[params.second + corners.y].xyz,
            positions[params.second + corners.z].xyz,
        );
        let centre_0 = (p[0] + p[1] + p[2]) / 3.0;
        let centre_1 = (q[0] + q[1] + q[2]) / 3.0;
        var extent = 0.0;
        var motion = 0.0;
        for (var k = 0u; k < 3u; k++) {
            extent = max(extent, max(length(p[k] - centre_0), length(q[k] - centre_1)));
            motion = max(motion, 0.5 * length(q[k] - p[k]));
        }
        let rest = 0.999 * limit - params.least;
        while extent + motion > rest && 2u * in_space + in_time < MAX_PART_BITS {
            if extent > motion {
                extent *= 0.5;
                in_space++;
            } else {
                motion *= 0.5;
                in_time++;
            }
        }
        if extent + motion > rest || 2u * in_space + in_time > MAX_PART_BITS {
            atomicStore(&status[STATUS_TOO_FINE], 1u);
            in_space = 0u;
            in_time = 0u;
        }
    }
    plans[t] = in_space | (in_time << 8u);
    counts[t] = 1u << (2u * in_space + in_time);
}
