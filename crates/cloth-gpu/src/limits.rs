//! Sizes that kernels, wrappers and twins share: written here once, injected into every kernel as its prelude.

/// Invocations per workgroup, of every kernel.
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
/// Triangle pairs that one invocation tests.
pub const PAIR_ITEMS: u32 = 4;
/// Triangle pairs that one workgroup tests.
pub const PAIR_BLOCK: u32 = WORKGROUP * PAIR_ITEMS;
/// Registrations whose pair counts a workgroup keeps at hand while it looks for the pairs of its invocations.
pub const SEARCH_WINDOW: u32 = 1024;

/// The constants as WGSL.
pub fn shader_prelude() -> String {
    [
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
    ]
    .map(|(name, value)| format!("const {name} = {value}u;\n"))
    .concat()
}
