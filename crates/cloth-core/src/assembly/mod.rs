//! The block matrix.

/// Symmetric matrix of 3×3 blocks.
pub struct BlockMatrix;

/// Which multiples of mass, damping and stiffness a matrix sums.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weights {
    /// Factor of M.
    pub mass: f64,
    /// Factor of −K_v.
    pub damping: f64,
    /// Factor of −K_x.
    pub stiffness: f64,
}
