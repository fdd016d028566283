//! One wrapper per stage: it records the stage's kernels into a submission.

pub mod bounds;
pub mod cells;
pub mod compact;
pub mod features;
pub mod narrow_filter;
pub mod octree;
pub mod pairs;
pub mod scan;
pub mod sort;
pub mod subdivision;
