// Cells for virtual subdivision: 3 λ times the average radius (Eq. 5.1), and what the parts' radii may be. One invocation.
//   in   sums[n]   sum of the radii in units of 2^-20, (low, high); params.triangles = n > 0
//        params.coarseness  λ, times two for each time that the parts were too many
//        params.least       what no subdivision gets a radius below
//   out  grid[0], status[STATUS_KEY_BITS]
// Includes: layout.   Twin: src/twin/subdivision.rs
@group(0) @binding(0) var<uniform> params: SubdivisionParams;
@group(0) @binding(1) var<storage, read> sums: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read_write> status: array<atomic<u32>>;
@group(0) @binding(3) var<storage, read_write> grid: array<Grid>;

@compute @workgroup_size(1)
fn subdivision_setup() {
    let sum = sums[params.triangles];
    let average = (f32(sum.y) * 4294967296.0 + f32(sum.x)) / f32(params.triangles) / 1048576.0;
    let extent = params.high - params.low;
    // Twice what no part gets below leaves half of a part's radius to the triangle and its motion.
    var size = max(CELL_RADII * max(params.coarseness * average, 2.0 * params.least), MIN_CELL);
    var cells = max(ceil(extent / size), vec3<f32>(1.0));
    for (var k = 0u; k < 64u && cells.x * cells.y * cells.z > MAX_CELLS; k++) {
        size *= 1.25;
        cells = max(ceil(extent / size), vec3<f32>(1.0));
    }
    grid[0] = Grid(params.low, size, vec3<u32>(cells), 1.0 / size);
    let keys = 2u * u32(cells.x) * u32(cells.y) * u32(cells.z);
    atomicStore(&status[STATUS_KEY_BITS], 32u - countLeadingZeros(keys - 1u));
}
