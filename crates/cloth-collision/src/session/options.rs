//! What a session is asked to do.

use crate::DetectError;

/// How pairs are found, from the plainest way to the whole pipeline. All give the same contacts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Variant {
    /// Every frame: tree update and traversal down to triangles; their assigned features are tested.
    NoDup,
    /// Every frame: as [`Variant::NoDup`], and every feature has a box of its own.
    RTri,
    /// Every frame: tree update and traversal; the distance heuristic filters what they find.
    NSwD,
    /// Tree update and traversal in a session's first frame only.
    #[default]
    SwD,
}

/// How many frames a session lasts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Frames {
    /// Always so many, 1 to [`MOST_FRAMES`]; with this α, or n_f − 1 (the method's αxfy with x = α, y = n_f).
    Fixed {
        /// n_f.
        frames: u32,
        /// α: the inflation covers so many steps of each vertex at its present speed.
        alpha: Option<f64>,
    },
    /// Adapted to the cost of detection, starting from `first` or, where the motion is large, from less; at most `most`.
    Adaptive {
        /// n_f of the first session at most.
        first: u32,
        /// Largest n_f.
        most: u32,
    },
}

/// What n_f is adapted to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Adapt {
    /// Counted tests, each kind with a fixed weight: runs repeat to the bit.
    #[default]
    Work,
    /// Measured time.
    Time,
}

/// Largest n_f.
pub const MOST_FRAMES: u32 = 1000;

/// Parameters of a [`crate::SkippingSession`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SessionOptions {
    /// How pairs are found.
    pub variant: Variant,
    /// n_f.
    pub frames: Frames,
    /// Share of the body's mean speed in the inflation, ≥ 0.
    pub beta: f64,
    /// Share of the mean edge length in the inflation, ≥ 0.
    pub gamma: f64,
    /// Adapted to what.
    pub adapt: Adapt,
    /// Whether self-collision leaves out sub-surfaces of low curvature that cannot meet themselves.
    pub low_curvature: bool,
}

impl Default for SessionOptions {
    /// The whole pipeline: adaptive, β = 0.2, γ = 0.1.
    fn default() -> Self {
        Self {
            variant: Variant::SwD,
            frames: Frames::Adaptive { first: 8, most: 64 },
            beta: 0.2,
            gamma: 0.1,
            adapt: Adapt::Work,
            low_curvature: true,
        }
    }
}

impl SessionOptions {
    /// Refuses what is out of range.
    ///
    /// # Errors
    /// [`DetectError::Parameter`] naming it.
    pub fn check(&self) -> Result<(), DetectError> {
        let refuse = |parameter, expected, got| Err(DetectError::Parameter { parameter, expected, got });
        let is_share = |x: f64| x >= 0.0 && x.is_finite();
        let counts = match self.frames {
            Frames::Fixed { frames, .. } => [frames, frames],
            Frames::Adaptive { first, most } => [first, most],
        };
        for frames in counts {
            if !(1..=MOST_FRAMES).contains(&frames) {
                return refuse("frames", "a whole number from 1 to 1000", f64::from(frames));
            }
        }
        if counts[0] > counts[1] {
            return refuse("frames", "a first number that is not above the largest", f64::from(counts[0]));
        }
        if let Frames::Fixed { alpha: Some(alpha), .. } = self.frames
            && !is_share(alpha)
        {
            return refuse("alpha", "a finite number ≥ 0", alpha);
        }
        for (name, value) in [("beta", self.beta), ("gamma", self.gamma)] {
            if !is_share(value) {
                return refuse(name, "a finite number ≥ 0", value);
            }
        }
        Ok(())
    }
}
