// The triangle pairs of the cells: one test per invocation and turn, whatever cell it comes from (thesis 5.3.4). The workgroup
// finds the registrations of its first and last test by binary search in the sums, keeps the sums between at hand, and
// each invocation finds its own registration in those.
//   in   sums[r]        r ≤ n   tests before registration r, as (low, high)
//        keys, registered [r]   sorted; controls[t], bounds[t]
//   out  pairs[p]       p < status[STATUS_TRIANGLE_PAIRS]: unordered; what does not fit is counted and left out
//        status         also: registrations and tests there are
// Includes: layout, boxes, control.   Twin: src/twin/pairs.rs
@group(0) @binding(0) var<uniform> params: PairParams;
@group(0) @binding(1) var<storage, read> lengths: array<u32>;
@group(0) @binding(2) var<storage, read> sums: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read> keys: array<u32>;
@group(0) @binding(4) var<storage, read> registered: array<u32>;
@group(0) @binding(5) var<storage, read> controls: array<u32>;
@group(0) @binding(6) var<storage, read> bounds: array<Bounds>;
@group(0) @binding(7) var<storage, read_write> pairs: array<vec2<u32>>;
@group(0) @binding(8) var<storage, read_write> status: array<atomic<u32>>;

// Registrations of the workgroup's first and last test.
var<workgroup> sh_ends: array<u32, 2>;
// Tests before each registration from the first to the last, counted from the workgroup's first test.
var<workgroup> sh_window: array<u32, SEARCH_WINDOW>;
var<workgroup> sh_count: atomic<u32>;
var<workgroup> sh_base: u32;

fn is_at_most(a: vec2<u32>, b: vec2<u32>) -> bool {
    return a.y < b.y || (a.y == b.y && a.x <= b.x);
}

fn plus(a: vec2<u32>, b: u32) -> vec2<u32> {
    let low = a.x + b;
    return vec2<u32>(low, a.y + select(0u, 1u, low < b));
}

// The last registration in [first, past) before which there are at most so many tests; the first one is such.
fn find(test: vec2<u32>, first: u32, past: u32) -> u32 {
    var low = first;
    var high = past;
    while high - low > 1u {
        let middle = low + (high - low) / 2u;
        if is_at_most(sums[middle], test) { low = middle; } else { high = middle; }
    }
    return low;
}

fn bodies_meet(a: u32, b: u32) -> bool {
    if (a >> 2u) == (b >> 2u) { return (a & 1u) != 0u; }
    return ((a | b) & 2u) != 0u;
}

fn passes(a: u32, b: u32, is_guest: bool) -> bool {
    if is_guest && is_left_to_other_cell(controls[a], controls[b]) { return false; }
    let first = bounds[a];
    let second = bounds[b];
    if (first.is_active | second.is_active) == 0u || !bodies_meet(first.body, second.body) { return false; }
    return may_touch(
        Box(first.low_0, first.high_0, first.low_1, first.high_1),
        Box(second.low_0, second.high_0, second.low_1, second.high_1),
    );
}

@compute @workgroup_size(WORKGROUP)
fn pairs_test(
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let block = group_index(group, groups);
    let n = min(params.most, lengths[params.word]);
    let total = sums[n];
    if block == 0u && index == 0u {
        atomicStore(&status[STATUS_REGISTRATIONS], lengths[params.word]);
        atomicStore(&status[STATUS_PAIRS], total.x);
        atomicStore(&status[STATUS_PAIRS + 1u], total.y);
    }
    // Tests of this workgroup: those below the count, and below the total.
    let offset = min(block * PAIR_BLOCK, params.count);
    let begin = plus(vec2<u32>(params.start_low, params.start_high), offset);
    var size = min(PAIR_BLOCK, params.count - offset);
    if is_at_most(total, begin) {
        size = 0u;
    } else if is_at_most(total, plus(begin, size)) {
        size = total.x - begin.x;
    }
    if index < 2u && size > 0u {
        sh_ends[index] = find(plus(begin, index * (size - 1u)), 0u, n);
    }
    if index == 0u { atomicStore(&sh_count, 0u); }
    workgroupBarrier();
    var first = 0u;
    var last = 0u;
    if size > 0u {
        first = sh_ends[0];
        last = sh_ends[1];
    }
    let is_near = last - first < SEARCH_WINDOW;
    if is_near && size > 0u {
        for (var k = index; k <= last - first; k += WORKGROUP) {
            // Only the first one's tests may begin before the workgroup's.
            sh_window[k] = select(sums[first + k].x - begin.x, 0u, k == 0u);
        }
    }
    workgroupBarrier();

    var found: array<vec2<u32>, PAIR_ITEMS>;
    var hits = 0u;
    for (var turn = 0u; turn < PAIR_ITEMS; turn++) {
        let test = turn * WORKGROUP + index;
        if test < size {
            var r = first;
            if is_near {
                var low = 0u;
                var high = last - first + 1u;
                while high - low > 1u {
                    let middle = low + (high - low) / 2u;
                    if sh_window[middle] <= test { low = middle; } else { high = middle; }
                }
                r = first + low;
            } else {
                r = find(plus(begin, test), first, last + 1u);
            }
            let partner = r + 1u + (begin.x + test - sums[r].x);
            let a = registered[r];
            let b = registered[partner];
            if passes(a, b, (keys[partner] & 1u) != 0u) {
                found[hits] = vec2<u32>(a, b);
                hits++;
            }
        }
    }
    var place = 0u;
    if hits > 0u { place = atomicAdd(&sh_count, hits); }
    workgroupBarrier();
    if index == 0u { sh_base = atomicAdd(&status[STATUS_TRIANGLE_PAIRS], atomicLoad(&sh_count)); }
    workgroupBarrier();
    place += sh_base;
    for (var k = 0u; k < hits; k++) {
        if place + k < arrayLength(&pairs) { pairs[place + k] = found[k]; }
    }
}
