//! What contact does: repulsion, impulses, friction, impact zones.
