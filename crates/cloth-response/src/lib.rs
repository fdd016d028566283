//! What contact does: repulsion, impulses, friction, impact zones.
//!
//! One entry point, [`Responder::respond`]: an intersection-free state `x_t0` and the unconstrained end of the step
//! go in, an accepted motion without known collision comes out, or an error and unchanged arrays.

pub use cloth_collision as collision;

mod error;
mod info;
mod params;

pub use error::ResponseError;
pub use info::ResponseInfo;
pub use params::{FrictionRule, ResponseParams};
