//! CPU twins: one plain function per kernel, same inputs, same outputs, meant to be compared with the shader; and the method
//! made of them.

pub mod bounds;
pub mod cells;
pub mod compact;
pub mod dops;
pub mod features;
pub mod grid;
pub mod narrow_filter;
pub mod octree;
pub mod pairs;
pub mod scan;
pub mod sort;
pub mod subdivision;
