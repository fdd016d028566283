//! Strain limiting: edges of cloth that may not get longer or shorter than a given fraction of their rest length.

pub(crate) mod limiter;

use crate::ResponseError;

/// How far an edge may be strained.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StrainLimit {
    /// Largest stretch [-], > 0: l ≤ (1 + stretch) l₀.
    pub stretch: f64,
    /// Largest compression [-], in (0, 1): l ≥ (1 − compression) l₀; `None`: no bound.
    pub compression: Option<f64>,
}

impl StrainLimit {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`ResponseError::Parameter`] naming the first value out of range.
    pub fn check(&self) -> Result<(), ResponseError> {
        if !(self.stretch.is_finite() && self.stretch > 0.0) {
            return Err(ResponseError::Parameter {
                name: "stretch",
                expected: "a finite number > 0",
                got: self.stretch,
            });
        }
        match self.compression {
            Some(got) if !(got > 0.0 && got < 1.0) => Err(ResponseError::Parameter {
                name: "compression",
                expected: "a number between 0 and 1, both excluded",
                got,
            }),
            _ => Ok(()),
        }
    }
}

/// An edge of cloth with a limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LimitedEdge {
    /// Its two vertices.
    pub vertices: [u32; 2],
    /// Rest length l₀ [m], > 0.
    pub rest_length: f64,
    /// Its limit.
    pub limit: StrainLimit,
}

impl LimitedEdge {
    /// Checks the limit, the length, and that the vertices are two of `vertex_count`.
    ///
    /// # Errors
    /// [`ResponseError::Parameter`] naming the first value out of range.
    pub fn check(&self, vertex_count: usize) -> Result<(), ResponseError> {
        self.limit.check()?;
        let [a, b] = self.vertices;
        let refuse = |name, expected, got| Err(ResponseError::Parameter { name, expected, got });
        if !(self.rest_length.is_finite() && self.rest_length > 0.0) {
            return refuse("rest_length", "a finite length > 0 m", self.rest_length);
        }
        if a == b || a.max(b) as usize >= vertex_count {
            return refuse("vertices", "two different vertices of the mesh", f64::from(a.max(b)));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Name the value that is out of range; a limit of 0 is refused.
    #[test]
    fn ranges_are_checked() {
        let refused = |stretch, compression| match (StrainLimit { stretch, compression }).check() {
            Err(ResponseError::Parameter { name, got, .. }) => (name, got),
            other => panic!("{stretch} {compression:?}: {other:?}"),
        };
        assert_eq!(refused(0.0, None), ("stretch", 0.0));
        assert_eq!(refused(f64::INFINITY, None), ("stretch", f64::INFINITY));
        assert_eq!(refused(0.1, Some(0.0)), ("compression", 0.0));
        assert_eq!(refused(0.1, Some(1.0)), ("compression", 1.0));
        assert_eq!(StrainLimit { stretch: 0.1, compression: Some(0.1) }.check(), Ok(()));
    }
}
