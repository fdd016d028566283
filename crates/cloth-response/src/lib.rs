//! What contact does: repulsion, impulses, friction, impact zones; and strain limits, which are met together with it.
//!
//! One entry point, [`Responder::respond`]: an intersection-free state `x_t0` and the unconstrained end of the step
//! go in, an accepted motion without known collision comes out, or an error and unchanged arrays.

pub use cloth_collision as collision;

mod collisions;
mod error;
mod frames;
mod friction;
mod gaps;
mod hold;
mod impulse;
mod info;
mod landing;
mod motion;
mod params;
mod repulsion;
mod respond;
mod resting;
mod rigid_motion;
mod sides;
mod stages;
mod strain;
mod sweeps;
mod zones;

pub use error::ResponseError;
pub use friction::law::FrictionLaw;
pub use friction::rule::FrictionRule;
pub use info::ResponseInfo;
pub use params::ResponseParams;
pub use respond::Responder;
pub use resting::Resting;
pub use sides::{Side, Sides};
pub use strain::{LimitedEdge, StrainLimit};

/// A point [m], velocity [m/s] or impulse [N s] in space.
pub type Vec3 = cloth_collision::Vec3;
