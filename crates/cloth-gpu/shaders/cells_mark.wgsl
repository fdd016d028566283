// Which registrations are kept: of the parts of one triangle in one cell one, and one at home if there is any. A guest is
// looked up among those at home in its cell, which are sorted by triangle: parts are in the order of their triangles, and the sort
// keeps the order of equal keys.
//   in   keys, registered [r]  r < n; roots[k]
//   out  marks[r]              1: kept; 0 also for n ≤ r < params.most
// Includes: layout.   Twin: src/twin/subdivision.rs
@group(0) @binding(0) var<uniform> params: LengthParams;
@group(0) @binding(1) var<storage, read> lengths: array<u32>;
@group(0) @binding(2) var<storage, read> keys: array<u32>;
@group(0) @binding(3) var<storage, read> registered: array<u32>;
@group(0) @binding(4) var<storage, read> roots: array<u32>;
@group(0) @binding(5) var<storage, read_write> marks: array<u32>;

@compute @workgroup_size(WORKGROUP)
fn cells_mark(
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let r = group_index(group, groups) * WORKGROUP + index;
    if r >= params.most { return; }
    if r >= lengths[params.word] {
        marks[r] = 0u;
        return;
    }
    let key = keys[r];
    let root = roots[registered[r]];
    var is_kept = r == 0u || keys[r - 1u] != key || roots[registered[r - 1u]] != root;
    if is_kept && (key & 1u) != 0u {
        // First registration with (key, root) not below (key − 1, root).
        var low = 0u;
        var high = r;
        while low < high {
            let middle = low + (high - low) / 2u;
            let other = keys[middle];
            if other < key - 1u || (other == key - 1u && roots[registered[middle]] < root) {
                low = middle + 1u;
            } else {
                high = middle;
            }
        }
        is_kept = low == r || keys[low] != key - 1u || roots[registered[low]] != root;
    }
    marks[r] = u32(is_kept);
}
