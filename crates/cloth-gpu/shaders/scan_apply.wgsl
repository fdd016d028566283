// Exclusive scan of each block of SCAN_BLOCK elements, on top of what comes before the block: the second half of a
// reduce-then-scan.
//   in   input[i]   i < n          as in scan_reduce
//        bases[b]   b < blocks     sum of all blocks before b; unused where params.extra is 0
//   out  output[i]  i ≤ n          sum of input before i; the last one is the total
// Includes: layout, sum, workgroup_scan.   Twin: src/twin/scan.rs
@group(0) @binding(0) var<uniform> params: LengthParams;
@group(0) @binding(1) var<storage, read> lengths: array<u32>;
//#if FIRST
@group(0) @binding(2) var<storage, read> input: array<u32>;
fn load(i: u32) -> Sum { return widen(input[i]); }
//#end
//#if !FIRST
@group(0) @binding(2) var<storage, read> input: array<Sum>;
fn load(i: u32) -> Sum { return input[i]; }
//#end
@group(0) @binding(3) var<storage, read> bases: array<Sum>;
@group(0) @binding(4) var<storage, read_write> output: array<Sum>;

@compute @workgroup_size(WORKGROUP)
fn scan_apply(
    me: Lane,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let block = group_index(group, groups);
    let elements = min(params.most, lengths[params.word]);
    let n = (elements + (1u << params.shift) - 1u) >> params.shift;
    let first = block * SCAN_BLOCK + me.index * SCAN_ITEMS;
    var own: array<Sum, SCAN_ITEMS>;
    var sum = Sum();
    for (var k = 0u; k < SCAN_ITEMS; k++) {
        own[k] = Sum();
        if first + k < n { own[k] = load(first + k); }
        sum = add(sum, own[k]);
    }
    var before = scan_workgroup(sum, me).before;
    if params.extra != 0u { before = add(before, bases[min(block, arrayLength(&bases) - 1u)]); }
    for (var k = 0u; k < SCAN_ITEMS; k++) {
        let i = first + k;
        if i <= n && i < arrayLength(&output) { output[i] = before; }
        before = add(before, own[k]);
        // The element after the last one belongs to the next block where the last one ends a block.
        if i + 1u == n && (i + 1u) % SCAN_BLOCK == 0u && n < arrayLength(&output) { output[n] = before; }
    }
}
