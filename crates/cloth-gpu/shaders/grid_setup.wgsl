// Size and number of the cells, from the largest radius: one invocation.
//   in   status[STATUS_RADIUS]
//   out  grid[0], status[STATUS_KEY_BITS]
// Includes: layout.   Twin: src/twin/cells.rs
@group(0) @binding(0) var<uniform> params: SceneParams;
@group(0) @binding(1) var<storage, read_write> status: array<atomic<u32>>;
@group(0) @binding(2) var<storage, read_write> grid: array<Grid>;

@compute @workgroup_size(1)
fn grid_setup() {
    let radius = bitcast<f32>(atomicLoad(&status[STATUS_RADIUS]));
    let extent = params.high - params.low;
    // Twice the reach stays below the size, so a sphere touches two cells along an axis at most.
    var size = max(max(CELL_RADII * radius, 2.02 * (REACH * radius + 2.0 * PLANE_SLACK)), MIN_CELL);
    var cells = max(ceil(extent / size), vec3<f32>(1.0));
    for (var k = 0u; k < 64u && cells.x * cells.y * cells.z > MAX_CELLS; k++) {
        size *= 1.25;
        cells = max(ceil(extent / size), vec3<f32>(1.0));
    }
    grid[0] = Grid(params.low, size, vec3<u32>(cells), 1.0 / size);
    let keys = 2u * u32(cells.x) * u32(cells.y) * u32(cells.z);
    atomicStore(&status[STATUS_KEY_BITS], 32u - countLeadingZeros(keys - 1u));
}
