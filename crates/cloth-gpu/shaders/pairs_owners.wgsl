// Where the tests of a portion change the registration that begins them: summed up, the number of each test's (Fan et al. 2011, cited in
// thesis 5.3.4).
//   in   sums[r]   r ≤ n   tests before registration r, as (low, high)
//        marks[k]          0
//   out  marks[k]  k > 0   registrations r with sums[r] = start + k, those without tests too
//        marks[0]          the registration that begins test start
// Includes: layout.   Twin: src/twin/pairs.rs
@group(0) @binding(0) var<uniform> params: PairParams;
@group(0) @binding(1) var<storage, read> lengths: array<u32>;
@group(0) @binding(2) var<storage, read> sums: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read_write> marks: array<atomic<u32>>;

fn is_at_most(a: vec2<u32>, b: vec2<u32>) -> bool {
    return a.y < b.y || (a.y == b.y && a.x <= b.x);
}

@compute @workgroup_size(WORKGROUP)
fn pairs_owners(
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let r = group_index(group, groups) * WORKGROUP + index;
    let n = min(params.most, lengths[params.word]);
    if r >= n { return; }
    let start = vec2<u32>(params.start_low, params.start_high);
    if is_at_most(sums[r], start) {
        if !is_at_most(sums[r + 1u], start) { atomicAdd(&marks[0], r); }
        return;
    }
    // The difference, which wraps where it has more than 32 bits.
    let k = sums[r].x - start.x;
    let borrow = select(0u, 1u, sums[r].x < start.x);
    if sums[r].y - start.y - borrow == 0u && k < params.count { atomicAdd(&marks[k], 1u); }
}
