//! Bench bodies by stage and by scene.
