//! Sizes that kernels, wrappers and twins share: written here once, injected into every kernel as its prelude.

/// Invocations per workgroup, of every kernel but `octree_pages`.
pub const WORKGROUP: u32 = 256;
/// Elements that one invocation scans.
pub const SCAN_ITEMS: u32 = 8;
/// Elements that one workgroup scans.
pub const SCAN_BLOCK: u32 = WORKGROUP * SCAN_ITEMS;
/// Keys that one invocation sorts.
pub const SORT_ITEMS: u32 = 4;
/// Keys that one workgroup sorts.
pub const SORT_BLOCK: u32 = WORKGROUP * SORT_ITEMS;
/// Bits of a digit of the radix sort.
pub const DIGIT_BITS: u32 = 4;
/// Values of a digit.
pub const RADIX: u32 = 1 << DIGIT_BITS;
/// Triangle pairs that one invocation tests: at most 32, one bit each.
pub const PAIR_ITEMS: u32 = 8;
/// Triangle pairs that one workgroup tests.
pub const PAIR_BLOCK: u32 = WORKGROUP * PAIR_ITEMS;
/// Registrations whose pair counts a workgroup keeps at hand while it looks for the pairs of its invocations.
pub const SEARCH_WINDOW: u32 = 1024;

/// Words of the status that kernels write and the host reads.
pub mod status {
    /// Bits of the largest radius (a non-negative `f32`: the order of its bits is its own).
    pub const RADIUS: u32 = 0;
    /// Bits that the cell keys have.
    pub const KEY_BITS: u32 = 1;
    /// Registrations there are, though there may be room for fewer.
    pub const REGISTRATIONS: u32 = 2;
    /// Triangle pairs to test, low word; the high word follows.
    pub const PAIRS: u32 = 3;
    /// Triangle pairs whose boxes overlap, in this part of the tests.
    pub const TRIANGLE_PAIRS: u32 = 5;
    /// Vertex-triangle candidates, in this part of the tests.
    pub const VERTEX_TRIANGLE: u32 = 6;
    /// Edge-edge candidates, in this part of the tests.
    pub const EDGE_EDGE: u32 = 7;
    /// 1: some triangle would come to more than [`super::MAX_PART_BITS`] allows.
    pub const TOO_FINE: u32 = 8;
    /// Vertex-triangle candidates that the filter leaves, in this part of the tests; the edge-edge ones follow.
    pub const LEFT: u32 = 9;
    /// Words.
    pub const LENGTH: u32 = 11;
}

/// A sphere is registered in the cells that it touches once its radius is multiplied by this: a little more than √2. Of two
/// spheres that overlap then at least one touches the cell of the other's centre (see `stages/cells.rs`).
pub const REACH: f32 = 1.4143;
/// What the rounding of cell planes and distances can add up to, with room: lengths are in units in which the scene lies within
/// [−1, 1], and a plane's place is off by less than 2⁻¹⁹.
pub const PLANE_SLACK: f32 = 1.0 / (1 << 17) as f32;
/// A cell's size in radii of the largest sphere: 1.5 times its diameter.
pub const CELL_RADII: f32 = 3.0;
/// Smallest cell.
pub const MIN_CELL: f32 = 1.0 / (1 << 11) as f32;
/// Most cells: their numbers and one bit more fit into a key.
pub const MAX_CELLS: f32 = (1u32 << 30) as f32;

/// Bound of what one operation in single precision is off by, relative to its result: WGSL gives either neighbour of the exact
/// result.
pub const ROUNDING: f32 = 1.0 / (1 << 23) as f32;
/// What a position on the device may be off by along each axis, with room. In units in which the scene lies within [−1, 1],
/// rounding costs at most 2⁻²⁵; the rest, more than 2⁻²⁴, is kept as a distance by which everything that is rejected stays
/// apart (see `shaders/narrow_filter.wgsl`).
pub const POSITION_ERROR: f32 = 1.0 / (1 << 23) as f32;
/// Directions that the filter of the narrow phase tries.
pub const FILTER_STEPS: u32 = 8;

/// Logarithm of the parts that one triangle may come to: 4^l · 2^m with 2 l + m at most this.
pub const MAX_PART_BITS: u32 = 18;
/// What the rounding of a part's corners can add up to, with room: sums of six products of numbers within [−1, 1].
pub const PART_SLACK: f32 = 1.0 / (1 << 19) as f32;

/// Levels of the small trees below the pages of an octree.
pub const PAGE_LEVELS: u32 = 3;
/// Invocations that build the tree below a page: as many as the finest level has lines.
pub const PAGE_WORKGROUP: u32 = 64;
/// Finest level that an octree may have: places along an axis take ten bits.
pub const MAX_LEVELS: u32 = 10;
/// Words of what an octree counts: registrations per level, then leaves.
pub const TALLY_LENGTH: u32 = MAX_LEVELS + 2;

/// The constants as WGSL.
pub fn shader_prelude() -> String {
    let floats = [
        ("REACH", REACH),
        ("PLANE_SLACK", PLANE_SLACK),
        ("CELL_RADII", CELL_RADII),
        ("MIN_CELL", MIN_CELL),
        ("MAX_CELLS", MAX_CELLS),
        ("PART_SLACK", PART_SLACK),
        ("ROUNDING", ROUNDING),
        ("POSITION_ERROR", POSITION_ERROR),
    ]
    .map(|(name, value)| format!("const {name} = {value:?}f;\n"));
    let words = [
        ("WORKGROUP", WORKGROUP),
        ("SCAN_ITEMS", SCAN_ITEMS),
        ("SCAN_BLOCK", SCAN_BLOCK),
        ("SORT_ITEMS", SORT_ITEMS),
        ("SORT_BLOCK", SORT_BLOCK),
        ("DIGIT_BITS", DIGIT_BITS),
        ("RADIX", RADIX),
        ("PAIR_ITEMS", PAIR_ITEMS),
        ("PAIR_BLOCK", PAIR_BLOCK),
        ("SEARCH_WINDOW", SEARCH_WINDOW),
        ("MAX_PART_BITS", MAX_PART_BITS),
        ("PAGE_WORKGROUP", PAGE_WORKGROUP),
        ("FILTER_STEPS", FILTER_STEPS),
        ("TALLY_LENGTH", TALLY_LENGTH),
        ("TALLY_LEAVES", TALLY_LENGTH - 1),
        ("STATUS_TOO_FINE", status::TOO_FINE),
        ("STATUS_RADIUS", status::RADIUS),
        ("STATUS_KEY_BITS", status::KEY_BITS),
        ("STATUS_REGISTRATIONS", status::REGISTRATIONS),
        ("STATUS_PAIRS", status::PAIRS),
        ("STATUS_TRIANGLE_PAIRS", status::TRIANGLE_PAIRS),
        ("STATUS_VERTEX_TRIANGLE", status::VERTEX_TRIANGLE),
        ("STATUS_EDGE_EDGE", status::EDGE_EDGE),
        ("STATUS_LEFT", status::LEFT),
    ]
    .map(|(name, value)| format!("const {name} = {value}u;\n"));
    words.concat() + &floats.concat()
}
