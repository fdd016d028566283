//! The march: through the steps of many pairs at once, in rounds, each pair with its own time.
//!
//! A round asks for each pair that is still under way: where is the next coplanar time ([`super::cubic`]), and how far
//! beyond it does some direction separate the features ([`super::separation`])? Both are asked of groups of as many pairs
//! as there are lanes; the pairs that a question has settled leave before the next one, so that the lanes stay full.

use super::cubic::Cubic;
use super::filter::{self, Points};
use super::lanes::{Doubles, Lanes, MAX_DOUBLES, Mask, Row, Rows, Vector};
use super::separation::Relative;
use crate::StencilKind;

/// Progress, as a fraction of the step, below which the march has arrived at a contact. The returned time is earlier
/// than the true one by about this much at a transversal contact.
const MIN_PROGRESS: f64 = 1e-9;
/// Marches end at a contact after so many rounds. Transversal contacts need about three; coplanar motion and
/// contacts at a thickness converge linearly.
const MAX_ROUNDS: usize = 512;
/// The time of a pair that is not in contact.
pub(crate) const NEVER: f64 = f64::INFINITY;

/// What a stencil gives to the march.
pub(crate) trait Motion<L: Lanes, const K: usize> {
    const KIND: StencilKind;
    /// The motion of the points, four at t0 and the same at t1.
    fn new(p: &Points<L>, thickness: f64) -> Self;
    fn relative(&self) -> &Relative<L, K>;
    /// Multiplies all lengths by a power of two.
    fn scale(&mut self, factor: L);
    /// det = 0 where the four points are coplanar.
    fn cubic(&self) -> Cubic<L>;
    /// Where the features all but touch at t, well inside both. No certificate.
    fn is_inside(&self, t: L) -> L::Mask;
    /// Directions along which the features may be apart at t, until `visit` is content. No certificate.
    fn directions(&self, t: L, visit: &mut impl Directions<L>);
}

/// Who looks for separating directions.
pub(crate) trait Directions<L> {
    /// Takes one and says whether that is enough.
    fn is_content(&mut self, n: Vector<L>) -> bool;
}

/// Asks how far the directions separate.
struct Reach<'m, L, const K: usize> {
    relative: &'m Relative<L, K>,
    from: L,
    until: L,
}

impl<L: Lanes, const K: usize> Directions<L> for Reach<'_, L, K> {
    #[inline(always)]
    fn is_content(&mut self, n: Vector<L>) -> bool {
        self.until = self.until.max(self.relative.separated_until(n, self.from));
        !(!self.until.greater(L::splat(1.0))).any()
    }
}

/// What a question says of a group: the pairs that go on, and everyone's time. A pair that does not go on is in contact
/// at that time, or [`NEVER`].
struct Answer<L: Lanes> {
    goes_on: L::Mask,
    time: L,
}

/// The power of two that brings a positive finite extent near 1; at the far ends of the range it only brings it closer.
#[inline(always)]
fn unit_scale<L: Doubles>(extent: L) -> L {
    const LARGEST: f64 = f64::from_bits((1023 + 1000) << 52);
    const SMALLEST: f64 = f64::from_bits((1023 - 1000) << 52);
    extent.inverse_exponent().max(L::splat(SMALLEST)).min(L::splat(LARGEST))
}

/// Scales the motion to unit size.
#[inline(always)]
fn to_unit<L: Doubles, M: Motion<L, K>, const K: usize>(motion: &mut M) {
    let factor = unit_scale(motion.relative().extent);
    motion.scale(factor);
}

/// The questions.
#[derive(Debug, Clone, Copy)]
enum Question {
    /// When is the next time at which the points may be coplanar?
    Root,
    /// When is the first time that no direction gets past?
    Direction,
}

/// What needs no time: is the pair apart along an axis, is it a contact for its lack of size?
#[inline(always)]
fn start<L: Doubles, M: Motion<L, K>, const K: usize>(motion: &M, t: L) -> Answer<L> {
    let relative = motion.relative();
    let is_apart = relative.separated_by_axis();
    let has_size = relative.extent.greater(L::splat(0.0)) & L::splat(f64::INFINITY).greater(relative.extent);
    Answer { goes_on: has_size & !is_apart, time: L::select(is_apart, L::splat(NEVER), t) }
}

#[inline(always)]
fn root<L: Doubles, M: Motion<L, K>, const K: usize>(mut motion: M, t: L) -> Answer<L> {
    to_unit(&mut motion);
    let (rootless, t) = motion.cubic().first_root_bound(t);
    let is_contact = motion.is_inside(t);
    Answer { goes_on: !(rootless | is_contact), time: L::select(rootless, L::splat(NEVER), t) }
}

#[inline(always)]
fn direction<L: Doubles, M: Motion<L, K>, const K: usize>(mut motion: M, t: L) -> Answer<L> {
    to_unit(&mut motion);
    let mut visit = Reach { relative: motion.relative(), from: t, until: t };
    motion.directions(t, &mut visit);
    let until = visit.until;
    let is_apart = until.greater(L::splat(1.0));
    let moves = (until - t).greater(L::splat(MIN_PROGRESS));
    let time = L::select(is_apart, L::splat(NEVER), L::select(moves, until, t));
    Answer { goes_on: moves & !is_apart, time }
}

/// Marches all pairs (as many as there are `times`; `pairs` are their numbers, and the list is used up) from t = 0 and leaves
/// their times in `times`. With `filters`, those that [`filter`] shows to be apart are never in contact, whatever the march
/// says; returns how many the others are. All points are finite.
#[inline(always)]
pub(crate) fn march<'a, L: Doubles, M: Motion<L, K>, const K: usize>(
    rows: impl Fn(u32) -> Rows<'a>,
    thickness: f64,
    filters: bool,
    pairs: &mut [u32],
    times: &mut [f64],
) -> usize {
    times.fill(0.0);
    let (mut count, mut marched) = (pairs.len(), pairs.len());
    let mut is_first = true;
    // A loop over the questions, so that each is compiled once.
    for step in 0..2 * MAX_ROUNDS {
        // Most pairs are found to be apart in the first round: the filter need not be asked about these.
        if step == 2 && filters {
            marched -= overrule::<L, M, K>(&rows, thickness, times);
            count = keep(&mut pairs[..count], |pair| times[pair as usize] != NEVER);
        }
        if count == 0 && step >= 2 {
            break;
        }
        let question = if step % 2 == 0 { Question::Root } else { Question::Direction };
        if matches!(question, Question::Root) && thickness > 0.0 {
            continue;
        }
        count = ask::<L, M, K>(question, is_first, &rows, thickness, &mut pairs[..count], times);
        is_first = false;
    }
    marched
}

/// Keeps the pairs that are `wanted`, in their order, at the front; returns how many they are.
#[inline(always)]
fn keep(pairs: &mut [u32], wanted: impl Fn(u32) -> bool) -> usize {
    let mut kept = 0;
    for k in 0..pairs.len() {
        let pair = pairs[k];
        pairs[kept] = pair;
        kept += usize::from(wanted(pair));
    }
    kept
}

/// Takes back the times of the pairs that [`filter`] shows to be apart; returns how many they are.
#[inline(always)]
fn overrule<'a, L: Doubles, M: Motion<L, K>, const K: usize>(
    rows: &impl Fn(u32) -> Rows<'a>,
    thickness: f64,
    times: &mut [f64],
) -> usize {
    let (mut next, mut overruled) = (0, 0);
    while next < times.len() {
        let (mut group, mut count) = ([0; MAX_DOUBLES + 1], 0);
        while next < times.len() && count < L::COUNT {
            group[count] = next as u32;
            count += usize::from(times[next] != NEVER);
            next += 1;
        }
        if count == 0 {
            break;
        }
        let apart = filter::apart::<L>(M::KIND, &points(rows, &group[..count]), thickness).bits();
        for lane in 0..count {
            if apart >> lane & 1 == 1 {
                times[group[lane] as usize] = NEVER;
                overruled += 1;
            }
        }
    }
    overruled
}

/// Asks all pairs, notes their times, and brings those that go on to the front; returns how many they are. The first time
/// it asks also what needs no time.
#[inline(always)]
fn ask<'a, L: Doubles, M: Motion<L, K>, const K: usize>(
    question: Question,
    is_first: bool,
    rows: &impl Fn(u32) -> Rows<'a>,
    thickness: f64,
    pairs: &mut [u32],
    times: &mut [f64],
) -> usize {
    let mut kept = 0;
    let mut first = 0;
    while first < pairs.len() {
        let count = L::COUNT.min(pairs.len() - first);
        let points = points(rows, &pairs[first..first + count]);
        let mut t = [0.0; MAX_DOUBLES];
        for lane in 0..count {
            t[lane] = times[pairs[first + lane] as usize];
        }
        let (motion, t) = (M::new(&points, thickness), L::from_array(&t));
        let before = if is_first { Some(start(&motion, t)) } else { None };
        let Answer { mut goes_on, mut time } = match question {
            Question::Root => root(motion, t),
            Question::Direction => direction(motion, t),
        };
        if let Some(before) = before {
            time = L::select(before.goes_on, time, before.time);
            goes_on = goes_on & before.goes_on;
        }
        let (goes_on, time) = (goes_on.bits(), time.to_array());
        for lane in 0..count {
            let pair = pairs[first + lane];
            times[pair as usize] = time[lane];
            pairs[kept] = pair;
            kept += (goes_on >> lane & 1) as usize;
        }
        first += count;
    }
    kept
}

/// The points of a group of at least one pair and at most as many as there are lanes; further lanes repeat the last one.
#[inline(always)]
pub(crate) fn points<'a, L: Doubles>(rows: &impl Fn(u32) -> Rows<'a>, pairs: &[u32]) -> Points<L> {
    static ORIGIN: Row = [0.0; 4];
    let mut all: [Rows<'_>; MAX_DOUBLES] = [[&ORIGIN; 8]; MAX_DOUBLES];
    for lane in 0..L::COUNT {
        all[lane] = rows(pairs[lane.min(pairs.len() - 1)]);
    }
    let mut points = [L::gather(&all, 0); 8];
    for k in 1..8 {
        points[k] = L::gather(&all, k);
    }
    points
}
