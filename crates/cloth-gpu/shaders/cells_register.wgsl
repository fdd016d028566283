// Writes the registrations of each triangle.
//   in   homes[t], controls[t]  t < n
//        offsets[t]             exclusive scan of the counts; grid[0]
//   out  keys[r], registered[r] r < offsets[n]: 2 · cell, plus 1 where it is not the triangle's home; the triangle.
//                               What does not fit is left out: the host compares offsets[n] with the room there is.
// Includes: layout, control.   Twin: src/twin/cells.rs
@group(0) @binding(0) var<uniform> params: LengthParams;
@group(0) @binding(1) var<storage, read> lengths: array<u32>;
@group(0) @binding(2) var<storage, read> homes: array<u32>;
@group(0) @binding(3) var<storage, read> controls: array<u32>;
@group(0) @binding(4) var<storage, read> offsets: array<u32>;
@group(0) @binding(5) var<storage, read> grids: array<Grid>;
@group(0) @binding(6) var<storage, read_write> keys: array<u32>;
@group(0) @binding(7) var<storage, read_write> registered: array<u32>;

@compute @workgroup_size(WORKGROUP)
fn cells_register(
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let t = group_index(group, groups) * WORKGROUP + index;
    if t >= min(params.most, lengths[params.word]) { return; }
    let cells = grids[0].cells;
    let strides = vec3<u32>(1u, cells.x, cells.x * cells.y);
    let control = controls[t];
    let own_type = home_type(control);
    var place = offsets[t];
    for (var cell_type = 0u; cell_type < 8u; cell_type++) {
        if meets_type(control, cell_type) {
            let moved = (vec3<u32>(own_type ^ cell_type) >> vec3<u32>(0u, 1u, 2u)) & vec3<u32>(1u);
            let next = (vec3<u32>(control) >> vec3<u32>(11u, 12u, 13u)) & vec3<u32>(1u);
            // Forward where next is 1, else back; words wrap.
            let step = moved * strides * (2u * next - 1u);
            if place < arrayLength(&keys) && place < arrayLength(&registered) {
                keys[place] = 2u * (homes[t] + step.x + step.y + step.z) + u32(cell_type != own_type);
                registered[place] = t;
            }
            place++;
        }
    }
}
