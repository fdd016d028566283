// The registrations: each triangle in every leaf that its range meets, once.
//   in   ranges[t], offsets[t]  as in octree_assign
//        leaves[p], types[3 p]
//        firsts[v]              registrations before visit v, (low, high) (WRITE)
//   out  counts[v]              registrations of visit v; 0 from the last visit up to params.room (no WRITE)
//        keys[r]                2 · number of the leaf's lowest cell of the base level (WRITE)
//        registered[r]          triangle | levels above the base << 28 (WRITE). What does not fit is left out.
// Includes: layout, octree, octree_find.   Twin: src/twin/octree.rs
@group(0) @binding(0) var<uniform> params: OctreeParams;
@group(0) @binding(1) var<storage, read> ranges: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read> offsets: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read> leaves: array<u32>;
@group(0) @binding(4) var<storage, read> types: array<u32>;
//#if !WRITE
@group(0) @binding(5) var<storage, read_write> counts: array<u32>;
//#end
//#if WRITE
@group(0) @binding(5) var<storage, read> firsts: array<vec2<u32>>;
@group(0) @binding(6) var<storage, read_write> keys: array<u32>;
@group(0) @binding(7) var<storage, read_write> registered: array<u32>;
//#end

var<private> written: u32;

fn register_in(number: u32, triangle: u32, low: vec3<u32>, up: u32) {
//#if WRITE
    let slot = firsts[number].x + written;
    if firsts[number].y == 0u && slot < arrayLength(&keys) && slot < arrayLength(&registered) {
        keys[slot] = 2u * cell_number(params.base, low);
        registered[slot] = triangle | (up << 28u);
    }
//#end
    written++;
}

fn is_divided(page: u32, node: u32) -> bool {
    return ((types[3u * page + node / 32u] >> (node % 32u)) & 1u) != 0u;
}

// The leaves below a page that lie in the range.
fn register_below(number: u32, visit: Visit, page: u32) {
    let depth = params.base - params.page;
    let corner = visit.place << vec3<u32>(depth);
    let low = max(visit.low, corner) - corner;
    let high = min(visit.high - corner, vec3<u32>((1u << depth) - 1u));
    // Cells in the order of their Morton numbers; a leaf is passed over whole.
    let cells = 1u << (3u * depth);
    for (var cell = 0u; cell < cells;) {
        var below = 0u;
        var node = 0u;
        var place = vec3<u32>();
        var up = depth;
        var is_met = true;
        while is_met && below < depth && is_divided(page, node) {
            below++;
            up = depth - below;
            let child = cell >> (3u * up);
            place = 2u * place + ((vec3<u32>(child) >> vec3<u32>(0u, 1u, 2u)) & vec3<u32>(1u));
            node = ((1u << (3u * below)) - 1u) / 7u + cell_number(below, place);
            is_met = all(place >= low >> vec3<u32>(up)) && all(place <= high >> vec3<u32>(up));
        }
        if is_met { register_in(number, visit.triangle, corner + (place << vec3<u32>(up)), up); }
        cell += 1u << (3u * up);
    }
}

@compute @workgroup_size(WORKGROUP)
fn octree_register(
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let number = group_index(group, groups) * WORKGROUP + index;
    written = 0u;
    if is_visit(number) {
        let visit = find_visit(number);
        let page = cell_number(params.page, visit.place);
        let level = leaves[page];
        if level == params.page {
            register_below(number, visit, page);
        } else if is_first_in(visit, level) {
            let up = params.base - level;
            let corner = (visit.place >> vec3<u32>(params.page - level)) << vec3<u32>(up);
            register_in(number, visit.triangle, corner, up);
        }
    }
//#if !WRITE
    if number < params.room { counts[number] = written; }
//#end
}
