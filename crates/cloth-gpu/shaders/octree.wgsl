// What the kernels of the octree share. Level l has 2^l cells along each axis. Levels 0 to params.page are held as dense trees, the
// finest of them first: its cells are the pages; the levels below a page, params.base − params.page of them and at most
// PAGE_LEVELS, are a small tree of its own (octree_pages.wgsl).

fn unpack(place: u32) -> vec3<u32> {
    return (vec3<u32>(place) >> vec3<u32>(0u, 10u, 20u)) & vec3<u32>(1023u);
}

fn pack(place: vec3<u32>) -> u32 {
    return place.x | (place.y << 10u) | (place.z << 20u);
}

// Number of a cell among those of its level.
fn cell_number(level: u32, place: vec3<u32>) -> u32 {
    return place.x | (place.y << level) | (place.z << (2u * level));
}

fn cell_place(level: u32, cell: u32) -> vec3<u32> {
    return (vec3<u32>(cell) >> vec3<u32>(0u, level, 2u * level)) & vec3<u32>((1u << level) - 1u);
}

// Where a level begins in the dense trees: after all finer ones.
fn level_start(page: u32, level: u32) -> u32 {
    return ((8u << (3u * page)) - (8u << (3u * level))) / 7u;
}

// n (n − 1) / 2 as (low, high).
fn tests_of(n: u32) -> vec2<u32> {
    if n < 2u { return vec2<u32>(); }
    let is_even = (n & 1u) == 0u;
    let a = select(n, n / 2u, is_even);
    let b = select((n - 1u) / 2u, n - 1u, is_even);
    let low = (a & 0xffffu) * (b & 0xffffu);
    let first = (a >> 16u) * (b & 0xffffu) + (low >> 16u);
    let second = (a & 0xffffu) * (b >> 16u) + (first & 0xffffu);
    return vec2<u32>((low & 0xffffu) | (second << 16u), (a >> 16u) * (b >> 16u) + (first >> 16u) + (second >> 16u));
}

fn plus(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    let low = a.x + b.x;
    return vec2<u32>(low, a.y + b.y + select(0u, 1u, low < a.x));
}

fn is_less(a: vec2<u32>, b: vec2<u32>) -> bool {
    return a.y < b.y || (a.y == b.y && a.x < b.x);
}
