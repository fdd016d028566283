// Whether the pair is tested in this leaf. The token of a pair is the cell of the base level at the larger of both lower ends, along each
// axis (after Fan et al. 2011). If the ranges of A and B meet, it lies in both, hence in one leaf, and both are
// registered there. Ranges of boxes that meet do meet (octree_ranges.wgsl), so such a pair is tested, and once.
fn holds_token(a: Entry, b: Entry) -> bool {
    let up = vec3<u32>(a.level & 255u);
    let base = a.level >> 8u;
    let shift = vec3<u32>(0u, base, 2u * base);
    let mask = vec3<u32>((1u << base) - 1u);
    let token = max((vec3<u32>(a.control) >> shift) & mask, (vec3<u32>(b.control) >> shift) & mask);
    let corner = (vec3<u32>(a.key / 2u) >> shift) & mask;
    return all(token >> up == corner >> up);
}
