// Control bits of a triangle. A cell's type is the parity of its place: bit k is that of axis k. Along each axis a triangle is
// registered in at most two neighbouring cells, so it meets each type once.
//   bits 0..2    type of the home cell, which holds the sphere's centre
//   bits 3..10   bit 3 + k: registered in its cell of type k
//   bits 11..13  per axis: its other cell is the next one (1) or the one before (0)

fn home_type(control: u32) -> u32 {
    return control & 7u;
}

fn meets_type(control: u32, cell_type: u32) -> bool {
    return ((control >> (3u + cell_type)) & 1u) != 0u;
}

// Of a triangle at home in this cell and one that is registered here from another home: whether the pair is left to that
// other cell. It is if both meet there too (the first is registered in the second's home: the same type, reached in the opposite
// direction along every axis in which the homes differ), and that cell's type is the lower one.
fn is_left_to_other_cell(home: u32, guest: u32) -> bool {
    let differ = home_type(home) ^ home_type(guest);
    let opposite = ((home ^ guest) >> 11u) & differ;
    return meets_type(home, home_type(guest)) && opposite == differ && home_type(guest) < home_type(home);
}
