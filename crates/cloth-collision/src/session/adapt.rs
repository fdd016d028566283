//! How many frames the next session lasts, from what the last ones cost.

use super::options::Frames;

/// Frames without a session after one that did not pay; doubled each time that it happens again, up to the larger number.
const PAUSE: [u32; 2] = [8, 128];
/// Frames after which one frame alone says what detection costs without a session: the first time, and again.
const MEASURE: [u32; 2] = [64, 256];
/// Share of its first frame's cost from which on a session's average raises the question.
const DOUBTFUL: f64 = 0.75;
/// Frames for which the answer holds.
const SURE: u32 = 16;
/// n_f moves on by its quarter, at least by one; until it first turns round, by its half where the cost has just fallen to less
/// than this share.
const STEP: u32 = 4;
const LONG_STEP: u32 = 2;
const FALLS: f64 = 0.95;
/// n_f of the first session times the square root of the mean step in mean edge lengths, by measurement. Per frame, a session
/// costs its first frame over n_f and tests of the pairs in reach of the balls, which grow with n_f steps: the sum is least near
/// an n_f that is inverse to the root of the step.
const FIRST: f64 = 1.2;
/// Of two sessions in a row, the second is worse beyond this: scenes change, too.
const WORSE: f64 = 1.02;

/// What the next frame is to be if no session goes on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Plan {
    /// Tree update and traversal for one frame alone.
    Alone,
    /// A session of so many frames with this α.
    Session { frames: u32, alpha: f64 },
}

/// n_f by cost per frame, whatever its unit. While it gets better from session to session, n_f moves on; when it gets worse, n_f
/// turns round. A session that hardly pays has a frame alone measured, unless that was done lately; above the cost of that n_f is
/// halved. At one frame, sessions pause.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Adaptation {
    rule: Frames,
    frames: u32,
    /// No motion has been seen.
    is_fresh: bool,
    is_growing: bool,
    /// How often n_f has turned round.
    turns: u32,
    previous: Option<f64>,
    /// Cost of a frame alone.
    alone: Option<f64>,
    since_alone: u32,
    is_in_doubt: bool,
    pause: u32,
    paused: u32,
    /// Of the present session.
    cost: f64,
    count: u32,
    first: f64,
}

impl Adaptation {
    pub(super) fn new(rule: Frames) -> Self {
        let (Frames::Fixed { frames, .. } | Frames::Adaptive { first: frames, .. }) = rule;
        Self {
            rule,
            frames,
            is_fresh: matches!(rule, Frames::Adaptive { .. }),
            is_growing: true,
            turns: 0,
            previous: None,
            alone: None,
            since_alone: 0,
            is_in_doubt: false,
            pause: PAUSE[0],
            paused: 0,
            cost: 0.0,
            count: 0,
            first: 0.0,
        }
    }

    /// Whether n_f is to be chosen from the motion.
    pub(super) fn is_fresh(&self) -> bool {
        self.is_fresh
    }

    /// Chooses the first n_f for a motion of so many mean edge lengths per step: the rule's, or less.
    pub(super) fn starts_with(&mut self, steps_in_edges: f64) {
        self.is_fresh = false;
        let most = FIRST / steps_in_edges.sqrt();
        if most < f64::from(self.frames) {
            self.frames = (most.round() as u32).max(self.frames.min(2));
        }
    }

    pub(super) fn plan(&self) -> Plan {
        match self.rule {
            Frames::Fixed { frames: 1, .. } | Frames::Adaptive { most: 1, .. } => Plan::Alone,
            Frames::Fixed { frames, alpha } => {
                Plan::Session { frames, alpha: alpha.unwrap_or(f64::from(frames - 1)) }
            }
            Frames::Adaptive { .. } => {
                if self.paused > 0
                    || self.is_in_doubt
                    || self.since_alone >= MEASURE[usize::from(self.alone.is_some())]
                {
                    return Plan::Alone;
                }
                let frames = self.frames.max(2);
                Plan::Session { frames, alpha: f64::from(frames - 1) }
            }
        }
    }

    /// A frame alone was this dear. `was_planned`: the plan said so, not the motion.
    pub(super) fn frame_alone(&mut self, cost: f64, was_planned: bool) {
        if was_planned {
            self.alone = Some(cost);
            self.since_alone = 0;
            self.paused = self.paused.saturating_sub(1);
            if std::mem::take(&mut self.is_in_doubt) && self.previous.is_some_and(|session| session >= cost) {
                self.halve();
            }
        }
    }

    /// A session's first frame (with the end of the one before) was this dear.
    pub(super) fn first_frame(&mut self, cost: f64) {
        self.session_ends();
        (self.cost, self.count, self.first) = (cost, 1, cost);
        self.since_alone += 1;
    }

    /// A further frame was this dear. True if the session had better end: a new one costs less than this frame did.
    pub(super) fn further_frame(&mut self, cost: f64) -> bool {
        self.cost += cost;
        self.count += 1;
        self.since_alone += 1;
        let is_worse = cost > self.first && matches!(self.rule, Frames::Adaptive { .. });
        if is_worse {
            let lasted = self.count;
            self.session_ends();
            self.frames = self.frames.min(lasted);
            (self.is_growing, self.turns) = (false, self.turns.saturating_add(1));
        }
        is_worse
    }

    /// Another call about the same frame.
    pub(super) fn same_frame(&mut self, cost: f64) {
        self.cost += cost;
    }

    /// The present session, if there is one, is over.
    pub(super) fn session_ends(&mut self) {
        let Frames::Adaptive { most, .. } = self.rule else { return };
        if self.count == 0 {
            return;
        }
        let average = self.cost / f64::from(self.count);
        self.count = 0;
        if self.previous.is_some_and(|previous| average > WORSE * previous) {
            (self.is_growing, self.turns) = (!self.is_growing, self.turns.saturating_add(1));
        }
        let falls = self.turns == 0 && self.previous.is_some_and(|previous| average < FALLS * previous);
        self.previous = Some(average);
        let is_sure = self.alone.is_some() && self.since_alone < SURE.max(2 * self.frames);
        let pays = self.alone.is_none_or(|alone| average < alone);
        if is_sure && !pays {
            self.halve();
            return;
        }
        self.is_in_doubt = !is_sure && (!pays || average > DOUBTFUL * self.first);
        let step = (self.frames / if falls { LONG_STEP } else { STEP }).max(1);
        self.frames = if self.is_growing {
            (self.frames + step).min(most)
        } else {
            (self.frames - step).max(2.min(most))
        };
        self.pause = PAUSE[0];
    }

    /// Sessions of half the length, or none for a while.
    fn halve(&mut self) {
        let Frames::Adaptive { most, .. } = self.rule else { return };
        self.frames = (self.frames / 2).max(1);
        if self.frames == 1 {
            self.paused = self.pause;
            self.pause = (2 * self.pause).min(PAUSE[1]);
            self.previous = None;
            (self.is_growing, self.turns) = (true, 0);
            self.frames = 2.min(most);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs with the given cost of a session's first and further frames and of a frame alone; n_f of each session.
    fn sessions(rule: Frames, first: impl Fn(u32) -> f64, further: f64, alone: f64, frames: u32) -> Vec<u32> {
        let mut adaptation = Adaptation::new(rule);
        let (mut seen, mut left) = (vec![], 0);
        for _ in 0..frames {
            if left > 0 {
                left = if adaptation.further_frame(further) { 0 } else { left - 1 };
                continue;
            }
            adaptation.session_ends();
            match adaptation.plan() {
                Plan::Alone => {
                    adaptation.frame_alone(alone, true);
                    seen.push(1);
                }
                Plan::Session { frames, alpha } => {
                    assert_eq!(alpha, f64::from(frames - 1));
                    adaptation.first_frame(first(frames));
                    seen.push(frames);
                    left = frames - 1;
                }
            }
        }
        seen
    }

    const RULE: Frames = Frames::Adaptive { first: 4, most: 20 };

    #[test]
    fn sessions_grow_while_they_get_cheaper() {
        let seen = sessions(RULE, |_| 10.0, 1.0, 8.0, 2 * MEASURE[1]);
        assert_eq!(seen[..6], [4, 5, 7, 10, 15, 20]);
        assert_eq!(*seen.iter().max().unwrap(), 20);
        assert!(seen[1..].contains(&1), "measured again: {seen:?}");
    }

    #[test]
    fn the_first_session_is_shorter_where_motion_is_larger() {
        let first = |steps_in_edges: f64| {
            let mut adaptation = Adaptation::new(Frames::Adaptive { first: 8, most: 20 });
            assert!(adaptation.is_fresh());
            adaptation.starts_with(steps_in_edges);
            assert!(!adaptation.is_fresh());
            match adaptation.plan() {
                Plan::Session { frames, .. } => frames,
                Plan::Alone => 1,
            }
        };
        let motions = [0.0, 0.02, 0.04, 0.1, 0.3, 10.0, f64::INFINITY, f64::NAN];
        assert_eq!(motions.map(first), [8, 8, 6, 4, 2, 2, 2, 8]);
        assert!(!Adaptation::new(Frames::Fixed { frames: 8, alpha: None }).is_fresh());
    }

    #[test]
    fn sessions_settle_where_they_are_cheapest() {
        // 9.5/n + 0.1 n: cheapest at 10.
        let seen = sessions(RULE, |n| 10.0 + 0.1 * f64::from(n * n), 0.5, 80.0, 2000);
        let last = &seen[seen.len() - 20..];
        assert!(last.iter().all(|&n| n == 1 || (7..=15).contains(&n)), "{last:?}");
    }

    #[test]
    fn sessions_that_do_not_pay_pause_longer_and_longer() {
        let seen = sessions(RULE, |_| 20.0, 9.0, 8.0, 400);
        let tries = seen.iter().filter(|&&n| n > 1).count();
        assert!(tries > 3 && tries < 20, "{seen:?}");
    }

    #[test]
    fn a_frame_alone_is_measured_when_sessions_hardly_pay() {
        // A session's average is far below its first frame: nothing to ask.
        assert!(!sessions(RULE, |_| 10.0, 1.0, 8.0, MEASURE[0]).contains(&1));
        // 8.2 to 8.5 of 10: asked once for several sessions, and the answer is that they pay.
        let seen = sessions(RULE, |_| 10.0, 8.0, 20.0, 200);
        let asked = seen.iter().filter(|&&n| n == 1).count();
        assert!(asked > 1 && 2 * asked < seen.len(), "{seen:?}");
        assert_eq!(*seen.iter().max().unwrap(), 20);
    }

    #[test]
    fn a_frame_dearer_than_a_new_session_ends_it() {
        let mut adaptation = Adaptation::new(RULE);
        adaptation.frame_alone(80.0, true);
        adaptation.first_frame(10.0);
        assert!(!adaptation.further_frame(10.0));
        assert!(adaptation.further_frame(10.5));
        assert_eq!(adaptation.frames, 3, "as long as it lasted");
    }

    #[test]
    fn fixed_numbers_stay() {
        let fixed = Frames::Fixed { frames: 7, alpha: None };
        assert!(sessions(fixed, |_| 10.0, 9.0, 8.0, 100).iter().all(|&n| n == 7));
        let one = Frames::Fixed { frames: 1, alpha: None };
        assert!(sessions(one, |_| 10.0, 9.0, 8.0, 100).iter().all(|&n| n == 1));
        let alpha = Frames::Fixed { frames: 3, alpha: Some(0.5) };
        assert_eq!(Adaptation::new(alpha).plan(), Plan::Session { frames: 3, alpha: 0.5 });
    }
}
