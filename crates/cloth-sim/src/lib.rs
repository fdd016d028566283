//! Scene, effect plan, step loop, reports, checkpoints and frames.
