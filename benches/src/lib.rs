//! Bench bodies by stage and by scene.

pub mod incline;
pub mod sequences;
