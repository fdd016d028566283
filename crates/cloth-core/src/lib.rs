//! What moves cloth: material, forces, integrators, the linear solver.

pub use cloth_mesh as mesh;
