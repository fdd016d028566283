// A triangle in a page, found by its number among all of them: triangles are in their order, the pages of each one by z, y, x.
// Wants bindings ranges, offsets and params; includes octree.

struct Visit {
    triangle: u32,
    // Cells of the base level, from low to high.
    low: vec3<u32>,
    high: vec3<u32>,
    // Of the page.
    place: vec3<u32>,
}

// Whether there is a visit of that number, and room for it.
fn is_visit(number: u32) -> bool {
    let total = offsets[params.triangles];
    return number < params.room && (total.y != 0u || number < total.x);
}

fn find_visit(number: u32) -> Visit {
    var t = 0u;
    var past = params.triangles;
    while past - t > 1u {
        let middle = t + (past - t) / 2u;
        if offsets[middle].y == 0u && offsets[middle].x <= number { t = middle; } else { past = middle; }
    }
    let low = unpack(ranges[t].x);
    let high = unpack(ranges[t].y);
    let depth = params.base - params.page;
    let first = low >> vec3<u32>(depth);
    let size = (high >> vec3<u32>(depth)) - first + 1u;
    let index = number - offsets[t].x;
    let place = first + vec3<u32>(index % size.x, index / size.x % size.y, index / size.x / size.y);
    return Visit(t, low, high, place);
}

// The token position (Fan et al. 2011): of the pages of a triangle in one coarser cell, the lowest stands for all.
fn is_first_in(visit: Visit, level: u32) -> bool {
    let depth = vec3<u32>(params.base - params.page);
    let up = vec3<u32>(params.page - level);
    return all(visit.place == max(visit.low >> depth, (visit.place >> up) << up));
}
