// Moves each key and its value to its place by one digit, keeping the order of equal digits.
//   in   offsets[d · blocks + b]            keys with a smaller digit, or with this one in an earlier block
//        keys, high, values [i]  i < n      high only for 64-bit keys
//   out  keys_out, high_out, values_out [i] i < n
// A block is first sorted in workgroup memory, so that what goes to one digit's place is written in one run.
// Counters of sixteen digits are packed in two vectors of 16-bit halves: a block has fewer than 2^16 keys.
// Includes: layout, sum, workgroup_scan.   Twin: src/twin/sort.rs
@group(0) @binding(0) var<uniform> params: LengthParams;
@group(0) @binding(1) var<storage, read> lengths: array<u32>;
@group(0) @binding(2) var<storage, read> offsets: array<u32>;
@group(0) @binding(3) var<storage, read> keys: array<u32>;
@group(0) @binding(4) var<storage, read> values: array<u32>;
@group(0) @binding(5) var<storage, read_write> keys_out: array<u32>;
@group(0) @binding(6) var<storage, read_write> values_out: array<u32>;
//#if HIGH
@group(0) @binding(7) var<storage, read> high: array<u32>;
@group(0) @binding(8) var<storage, read_write> high_out: array<u32>;
var<workgroup> sh_high: array<u32, SORT_BLOCK>;
//#end

var<workgroup> sh_keys: array<u32, SORT_BLOCK>;
var<workgroup> sh_values: array<u32, SORT_BLOCK>;
// First place of each digit in the sorted block.
var<workgroup> sh_start: array<u32, RADIX>;
// What to add to a place in the sorted block to get the place among all keys.
var<workgroup> sh_move: array<u32, RADIX>;

fn digit_of(word: u32) -> u32 {
    return (word >> (params.shift & 31u)) & (RADIX - 1u);
}

fn one_of(digit: u32) -> vec4<u32> {
    let one = 1u << (16u * (digit & 1u));
    return select(vec4<u32>(), vec4<u32>(one), vec4<u32>((digit >> 1u) & 3u) == vec4<u32>(0u, 1u, 2u, 3u));
}

fn counter(low: vec4<u32>, high_digits: vec4<u32>, digit: u32) -> u32 {
    let half = select(low, high_digits, digit >= 8u);
    return (half[(digit >> 1u) & 3u] >> (16u * (digit & 1u))) & 0xffffu;
}

@compute @workgroup_size(WORKGROUP)
fn radix_scatter(
    me: Lane,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let block = group_index(group, groups);
    let n = min(params.most, lengths[params.word]);
    let begin = block * SORT_BLOCK;
    let size = min(max(n, begin) - begin, SORT_BLOCK);
    let first = me.index * SORT_ITEMS;

    var key: array<u32, SORT_ITEMS>;
    var digit: array<u32, SORT_ITEMS>;
    var low = vec4<u32>();
    var upper = vec4<u32>();
    for (var k = 0u; k < SORT_ITEMS; k++) {
        if first + k < size {
            let i = begin + first + k;
            key[k] = keys[i];
            var word = key[k];
//#if HIGH
            if params.shift >= 32u { word = high[i]; }
//#end
            digit[k] = digit_of(word);
            if digit[k] < 8u { low += one_of(digit[k]); } else { upper += one_of(digit[k]); }
        }
    }
    let low_scan = scan_workgroup(low, me);
    let upper_scan = scan_workgroup(upper, me);
    if me.index < RADIX {
        var start = 0u;
        for (var d = 0u; d < me.index; d++) { start += counter(low_scan.total, upper_scan.total, d); }
        sh_start[me.index] = start;
        if block < params.extra { sh_move[me.index] = offsets[me.index * params.extra + block] - start; }
    }
    workgroupBarrier();

    low = low_scan.before;
    upper = upper_scan.before;
    for (var k = 0u; k < SORT_ITEMS; k++) {
        if first + k < size {
            let d = digit[k];
            let place = sh_start[d] + counter(low, upper, d);
            if d < 8u { low += one_of(d); } else { upper += one_of(d); }
            sh_keys[place] = key[k];
            sh_values[place] = values[begin + first + k];
//#if HIGH
            sh_high[place] = high[begin + first + k];
//#end
        }
    }
    workgroupBarrier();

    for (var k = 0u; k < SORT_ITEMS; k++) {
        let place = k * WORKGROUP + me.index;
        if place < size {
            var word = sh_keys[place];
//#if HIGH
            if params.shift >= 32u { word = sh_high[place]; }
//#end
            let to = place + sh_move[digit_of(word)];
            keys_out[to] = sh_keys[place];
            values_out[to] = sh_values[place];
//#if HIGH
            high_out[to] = sh_high[place];
//#end
        }
    }
}
