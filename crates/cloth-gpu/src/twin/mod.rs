//! CPU twins: one plain function per kernel, same inputs, same outputs, meant to be compared with the shader.

pub mod compact;
pub mod scan;
pub mod sort;
