// How many tests each registration begins: a triangle at home meets all that follow it in its cell, where those at home
// come first. So every pair of a cell in which one is at home comes up once.
//   in   entries[r] r < n, sorted by key
//   out  counts[r]  r < n
// Includes: layout.   Twin: src/twin/pairs.rs
@group(0) @binding(0) var<uniform> params: LengthParams;
@group(0) @binding(1) var<storage, read> lengths: array<u32>;
@group(0) @binding(2) var<storage, read> entries: array<Entry>;
@group(0) @binding(3) var<storage, read_write> counts: array<u32>;

@compute @workgroup_size(WORKGROUP)
fn pairs_count(
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let r = group_index(group, groups) * WORKGROUP + index;
    let n = min(params.most, lengths[params.word]);
    if r >= n { return; }
    let key = entries[r].key;
    if (key & 1u) != 0u {
        counts[r] = 0u;
        return;
    }
    // The cell ends after r and not after far: far doubles its distance until it is past the cell.
    var in_cell = r;
    var distance = 1u;
    while distance < n - r && entries[r + distance].key <= key + 1u {
        in_cell = r + distance;
        distance = min(2u * distance, n);
    }
    var past = min(distance, n - r) + r;
    while past - in_cell > 1u {
        let middle = in_cell + (past - in_cell) / 2u;
        if entries[middle].key <= key + 1u { in_cell = middle; } else { past = middle; }
    }
    counts[r] = in_cell - r;
}
