// Vertex-triangle and edge-edge candidates of the triangle pairs. Each vertex and edge is tested by the one triangle that owns it
// (R-triangles: Curtis et al. 2008), so a pair of features comes up once; features whose boxes stay apart are dropped, and with DOPS
// triangles and features whose 18-DOPs do.
//   in   pairs[p]         p < min(room, status[STATUS_TRIANGLE_PAIRS])
//        triangles[t]     corners; features[t]: edges 01, 12, 20, and the features it owns (bits 0..2 corners, 3..5 edges)
//        positions, active_bits: as in triangle_bounds
//   out  vertex_triangle, edge_edge: unordered; what does not fit is counted in the status and left out
// Includes: layout, boxes, dops (DOPS).   Twin: src/twin/features.rs
@group(0) @binding(0) var<uniform> params: SceneParams;
@group(0) @binding(1) var<storage, read> triangles: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> features: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read> positions: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> active_bits: array<u32>;
@group(0) @binding(5) var<storage, read> pairs: array<vec2<u32>>;
@group(0) @binding(6) var<storage, read_write> vertex_triangle: array<vec2<u32>>;
@group(0) @binding(7) var<storage, read_write> edge_edge: array<vec2<u32>>;
@group(0) @binding(8) var<storage, read_write> status: array<atomic<u32>>;

var<workgroup> sh_counts: array<atomic<u32>, 2>;
var<workgroup> sh_bases: array<u32, 2>;

fn is_active(vertex: u32) -> bool {
    return params.all_active != 0u || ((active_bits[vertex / 32u] >> (vertex % 32u)) & 1u) != 0u;
}

fn corner_box(vertex: u32) -> Box {
    return vertex_box(positions[vertex], positions[params.second + vertex]);
}

//#if DOPS
fn corner_dop(vertex: u32) -> Dop {
    return vertex_dop(positions[vertex].xyz, positions[params.second + vertex].xyz, params.thickness);
}

fn edge_dop(a: u32, b: u32) -> Dop {
    return dop_hull(corner_dop(a), corner_dop(b));
}

fn whole_dop(corners: vec3<u32>) -> Dop {
    return dop_hull(edge_dop(corners.x, corners.y), corner_dop(corners.z));
}
//#end

struct Side {
    corners: vec3<u32>,
    features: vec4<u32>,
    boxes: array<Box, 3>,
    // Bit per corner.
    is_active: u32,
}

fn side(t: u32) -> Side {
    let corners = triangles[t].xyz;
    return Side(
        corners,
        features[t],
        array<Box, 3>(corner_box(corners.x), corner_box(corners.y), corner_box(corners.z)),
        u32(is_active(corners.x)) | (u32(is_active(corners.y)) << 1u) | (u32(is_active(corners.z)) << 2u),
    );
}

// Bit per corner of a: owned by it, no corner of b, and near b.
fn vertices_near(a: ptr<function, Side>, b: ptr<function, Side>) -> u32 {
    let whole = hull(hull((*b).boxes[0], (*b).boxes[1]), (*b).boxes[2]);
    var near = 0u;
    for (var k = 0u; k < 3u; k++) {
        let is_owned = (((*a).features.w >> k) & 1u) != 0u;
        let is_live = (((*a).is_active >> k) & 1u) != 0u || (*b).is_active != 0u;
        if is_owned && is_live && all(vec3<u32>((*a).corners[k]) != (*b).corners) && may_touch((*a).boxes[k], whole) {
            near |= 1u << k;
        }
    }
    return near;
}

// Bit 3 i + j: edge i of a and edge j of b are owned, share no vertex, and are near.
fn edges_near(a: ptr<function, Side>, b: ptr<function, Side>) -> u32 {
    var near = 0u;
    for (var i = 0u; i < 3u; i++) {
        if (((*a).features.w >> (3u + i)) & 1u) == 0u { continue; }
        let i_end = (i + 1u) % 3u;
        let box_a = hull((*a).boxes[i], (*a).boxes[i_end]);
        let a_active = (((*a).is_active >> i) | ((*a).is_active >> i_end)) & 1u;
        for (var j = 0u; j < 3u; j++) {
            let j_end = (j + 1u) % 3u;
            let ends = vec2<u32>((*b).corners[j], (*b).corners[j_end]);
            let b_active = (((*b).is_active >> j) | ((*b).is_active >> j_end)) & 1u;
            let is_owned = (((*b).features.w >> (3u + j)) & 1u) != 0u && (a_active | b_active) != 0u;
            let is_apart = all(vec2<u32>((*a).corners[i]) != ends) && all(vec2<u32>((*a).corners[i_end]) != ends);
            if is_owned && is_apart && may_touch(box_a, hull((*b).boxes[j], (*b).boxes[j_end])) {
                near |= 1u << (3u * i + j);
            }
        }
    }
    return near;
}

//#if DOPS
// Which of the vertices and edges remain, bits as in feature_pairs. Few pairs come here: their boxes are the cheaper test.
fn dops_near(a: vec3<u32>, b: vec3<u32>, vertices: u32, edges: u32) -> vec2<u32> {
    let whole_a = whole_dop(a);
    let whole_b = whole_dop(b);
    if !dops_may_touch(whole_a, whole_b) { return vec2<u32>(); }
    var near = vec2<u32>();
    for (var bits = vertices; bits != 0u; bits &= bits - 1u) {
        let k = firstTrailingBit(bits);
        if k < 3u {
            if dops_may_touch(corner_dop(a[k]), whole_b) { near.x |= 1u << k; }
        } else if dops_may_touch(corner_dop(b[k - 3u]), whole_a) {
            near.x |= 1u << k;
        }
    }
    for (var bits = edges; bits != 0u; bits &= bits - 1u) {
        let k = firstTrailingBit(bits);
        let i = k / 3u;
        let j = k % 3u;
        let edge_a = edge_dop(a[i], a[(i + 1u) % 3u]);
        if dops_may_touch(edge_a, edge_dop(b[j], b[(j + 1u) % 3u])) { near.y |= 1u << k; }
    }
    return near;
}
//#end

@compute @workgroup_size(WORKGROUP)
fn feature_pairs(
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let p = group_index(group, groups) * WORKGROUP + index;
    let n = min(atomicLoad(&status[STATUS_TRIANGLE_PAIRS]), arrayLength(&pairs));
    if index < 2u { atomicStore(&sh_counts[index], 0u); }
    workgroupBarrier();
    var a: Side;
    var b: Side;
    var pair = vec2<u32>();
    // Bits 0..2: corners of a near b; 3..5: corners of b near a.
    var vertices = 0u;
    var edges = 0u;
    var place = vec2<u32>();
    if p < n {
        pair = pairs[p];
        a = side(pair.x);
        b = side(pair.y);
        vertices = vertices_near(&a, &b) | (vertices_near(&b, &a) << 3u);
        edges = edges_near(&a, &b);
//#if DOPS
        if (vertices | edges) != 0u {
            let near = dops_near(a.corners, b.corners, vertices, edges);
            vertices = near.x;
            edges = near.y;
        }
//#end
        if vertices != 0u { place.x = atomicAdd(&sh_counts[0], countOneBits(vertices)); }
        if edges != 0u { place.y = atomicAdd(&sh_counts[1], countOneBits(edges)); }
    }
    workgroupBarrier();
    if index == 0u {
        sh_bases[0] = atomicAdd(&status[STATUS_VERTEX_TRIANGLE], atomicLoad(&sh_counts[0]));
        sh_bases[1] = atomicAdd(&status[STATUS_EDGE_EDGE], atomicLoad(&sh_counts[1]));
    }
    workgroupBarrier();
    place += vec2<u32>(sh_bases[0], sh_bases[1]);
    for (var k = 0u; k < 6u; k++) {
        if ((vertices >> k) & 1u) != 0u {
            var found = vec2<u32>(a.corners[k % 3u], pair.y);
            if k >= 3u { found = vec2<u32>(b.corners[k % 3u], pair.x); }
            if place.x < arrayLength(&vertex_triangle) { vertex_triangle[place.x] = found; }
            place.x++;
        }
    }
    for (var k = 0u; k < 9u; k++) {
        if ((edges >> k) & 1u) != 0u {
            if place.y < arrayLength(&edge_edge) {
                edge_edge[place.y] = vec2<u32>(a.features[k / 3u], b.features[k % 3u]);
            }
            place.y++;
        }
    }
}
