// The triangle pairs of the cells: one test per invocation and turn, whatever cell it comes from (thesis 5.3.4). The workgroup
// finds the registrations of its first and last test by binary search in the sums, keeps the sums between at hand, and
// each invocation finds its own registration in those. Spheres come first; the few pairs that pass are shared out anew over
// the invocations for the rest. With OWNERS the registrations come from pairs_owners.wgsl and nothing is searched.
//   in   sums[r]        r ≤ n   tests before registration r, as (low, high)
//        entries[r]             by cell; bounds[t]
//        owners[k]      k ≥ 1   registration that begins test k − 1 of this portion (OWNERS)
//   out  pairs[p]       p < status[STATUS_TRIANGLE_PAIRS]: unordered; what does not fit is counted and left out
//        status         also: registrations and tests there are
// Includes: layout, boxes, control or octree_token (TOKEN).   Twin: src/twin/pairs.rs
@group(0) @binding(0) var<uniform> params: PairParams;
@group(0) @binding(1) var<storage, read> lengths: array<u32>;
@group(0) @binding(2) var<storage, read> sums: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read> entries: array<Entry>;
@group(0) @binding(4) var<storage, read> bounds: array<Bounds>;
@group(0) @binding(5) var<storage, read_write> pairs: array<vec2<u32>>;
@group(0) @binding(6) var<storage, read_write> status: array<atomic<u32>>;
//#if OWNERS
@group(0) @binding(7) var<storage, read> owners: array<u32>;
//#end

//#if !OWNERS
// Registrations of the workgroup's first and last test.
var<workgroup> sh_ends: array<u32, 2>;
// Tests before each registration from the first to the last, counted from the workgroup's first test.
var<workgroup> sh_window: array<u32, SEARCH_WINDOW>;
//#end
// Tests that passed the first look.
var<workgroup> sh_near: array<u32, PAIR_BLOCK>;
var<workgroup> sh_near_count: atomic<u32>;
var<workgroup> sh_count: atomic<u32>;
var<workgroup> sh_base: u32;

// The tests of the workgroup, and the registrations that they begin with.
struct Share {
    begin: vec2<u32>,
    // Tests of this portion that belong to earlier workgroups.
    offset: u32,
    size: u32,
    first: u32,
    last: u32,
    // Tests of the first registration that belong to earlier workgroups.
    skipped: u32,
}

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

//#if OWNERS
// The registrations of a test: who begins it, and the partner.
fn locate(share: Share, test: u32) -> vec2<u32> {
    let r = owners[share.offset + test + 1u];
    return vec2<u32>(r, r + 1u + (share.begin.x + test - sums[r].x));
}
//#end

//#if !OWNERS
// The registrations of a test: who begins it, and the partner.
fn locate(share: Share, test: u32) -> vec2<u32> {
    if share.last - share.first < SEARCH_WINDOW {
        var low = 0u;
        var high = share.last - share.first + 1u;
        while high - low > 1u {
            let middle = low + (high - low) / 2u;
            if sh_window[middle] <= test { low = middle; } else { high = middle; }
        }
        let r = share.first + low;
        return vec2<u32>(r, r + 1u + test + select(0u - sh_window[low], share.skipped, low == 0u));
    }
    let r = find(plus(share.begin, test), share.first, share.last + 1u);
    return vec2<u32>(r, r + 1u + (share.begin.x + test - sums[r].x));
}
//#end

fn bodies_meet(a: u32, b: u32) -> bool {
    if (a >> 2u) == (b >> 2u) { return (a & 1u) != 0u; }
    return ((a | b) & 2u) != 0u;
}

// The factor covers the rounding of both sides.
fn spheres_touch(pair: vec2<u32>) -> bool {
    let between = entries[pair.x].centre - entries[pair.y].centre;
    let reach = entries[pair.x].radius + entries[pair.y].radius;
    return dot(between, between) <= reach * reach * 1.00001;
}

//#if TOKEN
// Many pairs share several leaves: those that are tested elsewhere go before the boxes are asked for.
fn is_near(pair: vec2<u32>) -> bool {
    return spheres_touch(pair) && holds_token(entries[pair.x], entries[pair.y]);
}

fn is_here(pair: vec2<u32>) -> bool {
    return true;
}
//#end
//#if !TOKEN
fn is_near(pair: vec2<u32>) -> bool {
    return spheres_touch(pair);
}

// Whether the pair is tested in this cell and not in the home of the second.
fn is_here(pair: vec2<u32>) -> bool {
    return (entries[pair.y].key & 1u) == 0u
        || !is_left_to_other_cell(entries[pair.x].control, entries[pair.y].control);
}
//#end

fn boxes_touch(a: u32, b: u32) -> bool {
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
//#if !OWNERS
    if index < 2u && size > 0u {
        sh_ends[index] = find(plus(begin, index * (size - 1u)), 0u, n);
    }
//#end
    if index == 0u {
        atomicStore(&sh_near_count, 0u);
        atomicStore(&sh_count, 0u);
    }
    workgroupBarrier();
    var share = Share(begin, offset, size, 0u, 0u, 0u);
//#if !OWNERS
    if size > 0u {
        share.first = sh_ends[0];
        share.last = sh_ends[1];
        share.skipped = begin.x - sums[share.first].x;
        if share.last - share.first < SEARCH_WINDOW {
            for (var k = index + 1u; k <= share.last - share.first; k += WORKGROUP) {
                sh_window[k] = sums[share.first + k].x - begin.x;
            }
            if index == 0u { sh_window[0] = 0u; }
        }
    }
    workgroupBarrier();
//#end

    // Bit per turn.
    var near = 0u;
    for (var turn = 0u; turn < PAIR_ITEMS; turn++) {
        let test = turn * WORKGROUP + index;
        if test < size && is_near(locate(share, test)) { near |= 1u << turn; }
    }
    var slot = atomicAdd(&sh_near_count, countOneBits(near));
    for (; near != 0u; near &= near - 1u) {
        sh_near[slot] = firstTrailingBit(near) * WORKGROUP + index;
        slot++;
    }
    workgroupBarrier();
    let near_count = atomicLoad(&sh_near_count);
    var hits = 0u;
    for (var turn = 0u; turn * WORKGROUP < near_count; turn++) {
        let k = turn * WORKGROUP + index;
        if k < near_count {
            let pair = locate(share, sh_near[k]);
            if is_here(pair) && boxes_touch(entries[pair.x].triangle, entries[pair.y].triangle) { hits |= 1u << turn; }
        }
    }
    var place = atomicAdd(&sh_count, countOneBits(hits));
    workgroupBarrier();
    if index == 0u { sh_base = atomicAdd(&status[STATUS_TRIANGLE_PAIRS], atomicLoad(&sh_count)); }
    workgroupBarrier();
    place += sh_base;
    for (; hits != 0u; hits &= hits - 1u) {
        let pair = locate(share, sh_near[firstTrailingBit(hits) * WORKGROUP + index]);
        if place < arrayLength(&pairs) {
            pairs[place] = vec2<u32>(entries[pair.x].triangle, entries[pair.y].triangle);
        }
        place++;
    }
}
