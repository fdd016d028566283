//! One wrapper per stage: it records the stage's kernels into a submission.

pub mod compact;
pub mod scan;
pub mod sort;
