// Total of each block of SCAN_BLOCK elements: the first half of a reduce-then-scan.
//   in   input[i]  i < n         words at the first level, sums of the level below at the others
//   out  sums[b]   b < ⌈n / SCAN_BLOCK⌉
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
@group(0) @binding(3) var<storage, read_write> sums: array<Sum>;

@compute @workgroup_size(WORKGROUP)
fn scan_reduce(
    me: Lane,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let block = group_index(group, groups);
    let elements = min(params.most, lengths[params.word]);
    let n = (elements + (1u << params.shift) - 1u) >> params.shift;
    var sum = Sum();
    for (var k = 0u; k < SCAN_ITEMS; k++) {
        let i = block * SCAN_BLOCK + k * WORKGROUP + me.index;
        if i < n { sum = add(sum, load(i)); }
    }
    let total = scan_workgroup(sum, me).total;
    if me.index == 0u && block < arrayLength(&sums) { sums[block] = total; }
}
