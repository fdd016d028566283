// The cells that each triangle is registered in.
//   in   spheres[t]  t < n, grid[0]
//   out  homes[t]    number of the cell that holds the sphere's centre
//        controls[t] see control.wgsl
//        counts[t]   how many cells: 1 to 8; 0 for n ≤ t < params.most
// Includes: layout.   Twin: src/twin/cells.rs
@group(0) @binding(0) var<uniform> params: LengthParams;
@group(0) @binding(1) var<storage, read> lengths: array<u32>;
@group(0) @binding(2) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> grids: array<Grid>;
@group(0) @binding(4) var<storage, read_write> homes: array<u32>;
@group(0) @binding(5) var<storage, read_write> controls: array<u32>;
@group(0) @binding(6) var<storage, read_write> counts: array<u32>;

// Does not decrease along any axis.
fn cell_of(grid: Grid, x: vec3<f32>) -> vec3<u32> {
    let place = floor((x - grid.low) * grid.inverse);
    return vec3<u32>(clamp(place, vec3<f32>(), vec3<f32>(grid.cells - 1u)));
}

@compute @workgroup_size(WORKGROUP)
fn cells_count(
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let t = group_index(group, groups) * WORKGROUP + index;
    if t >= params.most { return; }
    if t >= lengths[params.word] {
        counts[t] = 0u;
        return;
    }
    let grid = grids[0];
    let centre = spheres[t].xyz;
    let reach = REACH * spheres[t].w + PLANE_SLACK;
    let home = cell_of(grid, centre);
    let first = cell_of(grid, centre - reach);
    let last = cell_of(grid, centre + reach);
    let next = vec3<u32>(last > home);
    let reaches = next | vec3<u32>(first < home);
    let plane = grid.low + vec3<f32>(home + next) * grid.size;
    let gap = (centre - plane) * (centre - plane);

    let own_type = (home.x & 1u) | ((home.y & 1u) << 1u) | ((home.z & 1u) << 2u);
    var types = 0u;
    for (var other = 0u; other < 8u; other++) {
        let moved = (vec3<u32>(other) >> vec3<u32>(0u, 1u, 2u)) & vec3<u32>(1u);
        let distance = dot(gap, vec3<f32>(moved));
        if all((moved & reaches) == moved) && distance <= reach * reach { types |= 1u << (own_type ^ other); }
    }
    homes[t] = home.x + grid.cells.x * (home.y + grid.cells.y * home.z);
    controls[t] = own_type | (types << 3u) | (next.x << 11u) | (next.y << 12u) | (next.z << 13u);
    counts[t] = countOneBits(types);
}
