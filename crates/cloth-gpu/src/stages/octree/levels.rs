//! Which levels the next tree has (thesis 6.3.2).

/// Coarsest and finest level of a tree; the root is level 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Levels {
    /// Coarsest level that has leaves.
    pub top: u32,
    /// Finest level.
    pub base: u32,
}

/// When levels are added and dropped: shares of the registrations \[1\].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Thresholds {
    /// ε₋: more than this in the coarsest active level adds a coarser one.
    pub top_up: f64,
    /// ε₊: less than this in the coarsest active level drops it.
    pub top_down: f64,
    /// λ₊: more than this in the finest active level adds a finer one.
    pub base_down: f64,
    /// λ₋: less than this in the finest active level drops it.
    pub base_up: f64,
}

impl Default for Thresholds {
    /// Those of the thesis.
    fn default() -> Self {
        Self { top_up: 0.001, top_down: 0.000_01, base_down: 0.97, base_up: 0.03 }
    }
}

/// The levels of the next tree, from the registrations per level of this one; `finest`: the finest there may be. Without
/// registrations they stay.
pub fn next_levels(now: Levels, registrations: &[u32], finest: u32, thresholds: &Thresholds) -> Levels {
    let total: f64 = registrations.iter().map(|&n| f64::from(n)).sum();
    let share = |level: usize| f64::from(registrations[level]) / total;
    let first = registrations.iter().position(|&n| n > 0);
    let last = registrations.iter().rposition(|&n| n > 0);
    let (Some(first), Some(last)) = (first, last) else { return now };
    let top = match share(first) {
        s if s > thresholds.top_up => first.saturating_sub(1),
        s if s < thresholds.top_down => first + 1,
        _ => first,
    };
    let base = match share(last) {
        s if s > thresholds.base_down => last + 1,
        s if s < thresholds.base_up => last.saturating_sub(1),
        _ => last,
    };
    let base = (base as u32).min(finest);
    Levels { top: (top as u32).min(base), base }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: Levels = Levels { top: 0, base: 9 };

    fn next(shares: [u32; 10], finest: u32) -> (u32, u32) {
        let levels = next_levels(NOW, &shares, finest, &Thresholds::default());
        (levels.top, levels.base)
    }

    #[test]
    fn the_four_thresholds_of_the_thesis() {
        // Of a million registrations; levels 3 and 7 are the outermost active ones.
        let shares = |top: u32, base: u32| [0, 0, 0, top, 0, 0, 1_000_000 - top - base, base, 0, 0];
        assert_eq!(next(shares(500, 500_000), 9), (3, 7));
        assert_eq!(next(shares(1_001, 500_000), 9), (2, 7));
        assert_eq!(next(shares(1_000, 500_000), 9), (3, 7));
        assert_eq!(next(shares(9, 500_000), 9), (4, 7));
        assert_eq!(next(shares(10, 500_000), 9), (3, 7));
        assert_eq!(next(shares(500, 29_999), 9), (3, 6));
        assert_eq!(next(shares(500, 30_000), 9), (3, 7));
        assert_eq!(next(shares(500, 970_000), 9), (3, 7));
        assert_eq!(next(shares(500, 970_001), 9), (3, 8));
    }

    #[test]
    fn levels_stay_in_order_and_in_bounds() {
        assert_eq!(next([0; 10], 9), (0, 9));
        // All in one level: a coarser and a finer one are added.
        assert_eq!(next([0, 0, 0, 0, 7, 0, 0, 0, 0, 0], 9), (3, 5));
        assert_eq!(next([7, 0, 0, 0, 0, 0, 0, 0, 0, 0], 9), (0, 1));
        assert_eq!(next([0, 0, 0, 0, 0, 0, 0, 0, 0, 7], 9), (8, 9));
        assert_eq!(next([0, 0, 0, 0, 7, 0, 0, 0, 0, 0], 2), (2, 2));
    }
}
