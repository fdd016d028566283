//! `contact.detector = "auto"`: when which method is measured, and what follows. Seconds come in, decisions
//! go out; no clock, no detector.
//!
//! - **Watch.** The method at work is watched. If detection takes less than [`WORTH`] of the step, or less than [`LEAST`],
//!   there is nothing to gain: the next look is after twice as many steps.
//! - **Probe.** Else all methods do [`BLOCK`] steps each, in turn, [`ROUNDS`] times over, so that a trend of
//!   the scene meets all of them. A method's cost is the lesser of its means. Its turn ends as soon as it has
//!   taken what the cheapest mean takes for a whole turn: it cannot win any more. A probe therefore costs at
//!   most what detection in as many steps costs anyway, and one step beyond per turn.
//! - **Choose.** The cheapest, if it is cheaper than the one at work by [`MARGIN`]. The next probe is after
//!   [`REST`] steps, each confirmed choice doubles that, and a cost that is more than [`DRIFT`] times higher
//!   or lower than when it was chosen brings it on.

/// Steps of the first look.
const FIRST: usize = 8;
/// Least part of the step that detection takes for a probe.
const WORTH: f64 = 0.05;
/// Time of detection in a step \[s\] below which a probe, which builds what it measures, does not pay.
const LEAST: f64 = 0.25e-3;
/// Steps of a method's turn.
const BLOCK: usize = 8;
/// Turns of each method.
const ROUNDS: usize = 2;
/// Least gain that makes a change.
const MARGIN: f64 = 0.1;
/// Steps from a probe to the next.
const REST: usize = 128;
/// Most steps from one look to the next.
const LONGEST: usize = 1 << 13;
/// Change of the cost that brings on a probe, and over how many steps it is seen.
const DRIFT: f64 = 2.0;
const WINDOW: usize = 16;

/// Sums over steps.
#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    steps: usize,
    detection: f64,
    all: f64,
}

impl Tally {
    fn add(&mut self, detection: f64, all: f64) {
        self.steps += 1;
        self.detection += detection;
        self.all += all;
    }

    fn mean(&self) -> f64 {
        self.detection / self.steps as f64
    }

    fn is_worth_it(&self) -> bool {
        self.detection >= WORTH * self.all && self.mean() >= LEAST
    }
}

/// What to do before the next step.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Next {
    /// Nothing.
    Keep,
    /// The method of that place has its turn.
    Turn(usize),
    /// The method of that place from here on; the cost per step of each \[s\].
    Chosen(usize, Vec<Option<f64>>),
}

/// The schedule for methods that are known by their places.
#[derive(Debug)]
pub(super) struct Choice {
    /// The method that was chosen last.
    pub(super) chosen: usize,
    /// Places that may have a turn.
    open: Vec<bool>,
    /// Places in the order of the turns left; the first one has its turn. Empty: no probe.
    turns: Vec<usize>,
    /// Least mean of each place in this probe \[s\].
    costs: Vec<Option<f64>>,
    now: Tally,
    /// The last steps, to see the cost change.
    window: Tally,
    /// Cost per step when it was chosen \[s\]; NaN before the first choice.
    cost: f64,
    /// Steps until the next look.
    interval: usize,
}

impl Choice {
    /// So many methods, of which the one at `first` is at work.
    pub(super) fn new(count: usize, first: usize) -> Self {
        Self {
            chosen: first,
            open: vec![true; count],
            turns: Vec::new(),
            costs: vec![None; count],
            now: Tally::default(),
            window: Tally::default(),
            cost: f64::NAN,
            interval: FIRST,
        }
    }

    /// After a step in which detection took so many seconds, and all so many.
    pub(super) fn observe(&mut self, detection: f64, all: f64) -> Next {
        if self.only().is_some() {
            return Next::Keep;
        }
        self.now.add(detection, all);
        if let Some(&place) = self.turns.first() {
            return self.in_turn(place);
        }
        self.window.add(detection, all);
        if self.window.steps == WINDOW {
            let change = self.window.mean() / self.cost;
            let drifts = !(change.is_nan() || (1.0 / DRIFT..=DRIFT).contains(&change));
            let last = std::mem::take(&mut self.window);
            // Not right after a probe: it must stay rare.
            if drifts && last.is_worth_it() && self.now.steps >= REST / 2 {
                return self.probe();
            }
        }
        if self.now.steps < self.interval {
            return Next::Keep;
        }
        if self.now.is_worth_it() {
            return self.probe();
        }
        self.now = Tally::default();
        self.interval = (2 * self.interval).min(LONGEST);
        Next::Keep
    }

    fn probe(&mut self) -> Next {
        let mut order: Vec<usize> = (0..self.open.len()).filter(|k| self.open[*k]).collect();
        let start = order.iter().position(|k| *k == self.chosen).unwrap_or(0);
        order.rotate_left(start);
        self.turns = order.repeat(ROUNDS);
        self.costs.fill(None);
        (self.now, self.window) = (Tally::default(), Tally::default());
        Next::Turn(self.turns[0])
    }

    fn in_turn(&mut self, place: usize) -> Next {
        let best = self.costs.iter().flatten().copied().fold(f64::INFINITY, f64::min);
        let cannot_win = self.now.detection > BLOCK as f64 * best;
        if self.now.steps < BLOCK && !cannot_win {
            return Next::Keep;
        }
        let mean = if cannot_win { self.now.mean().max(best) } else { self.now.mean() };
        let cost = self.costs[place].get_or_insert(mean);
        *cost = cost.min(mean);
        self.now = Tally::default();
        self.turns.remove(0);
        match self.turns.first() {
            Some(&next) => Next::Turn(next),
            None => self.choose(),
        }
    }

    fn choose(&mut self) -> Next {
        let cost = |k: usize| self.costs[k].unwrap_or(f64::INFINITY);
        let cheapest =
            (0..self.costs.len()).min_by(|a, b| cost(*a).total_cmp(&cost(*b))).unwrap_or(self.chosen);
        let changes = cost(cheapest) < (1.0 - MARGIN) * cost(self.chosen);
        if changes {
            self.chosen = cheapest;
        }
        self.interval = if changes || self.interval < REST { REST } else { (2 * self.interval).min(LONGEST) };
        self.cost = self.costs[self.chosen].unwrap_or(f64::NAN);
        Next::Chosen(self.chosen, self.costs.clone())
    }

    /// Takes a method out that cannot be had; what has its turn then. To be called while it has its turn or
    /// is at work.
    pub(super) fn close(&mut self, place: usize) -> Next {
        self.open[place] = false;
        self.costs[place] = None;
        self.turns.retain(|k| *k != place);
        self.now = Tally::default();
        if let Some(only) = self.only() {
            self.turns.clear();
            self.chosen = only;
            return Next::Chosen(only, self.costs.clone());
        }
        match self.turns.first() {
            Some(&next) => Next::Turn(next),
            None => self.choose(),
        }
    }

    /// The only method that is left, if there is no other.
    fn only(&self) -> Option<usize> {
        let mut left = (0..self.open.len()).filter(|k| self.open[*k]);
        left.next().filter(|_| left.next().is_none())
    }

    /// Goes on with the method of that place, those of `closed` being gone; no probe is under way then.
    pub(super) fn restart(&mut self, chosen: usize, closed: impl Fn(usize) -> bool) {
        for (place, open) in self.open.iter_mut().enumerate() {
            *open &= !closed(place);
        }
        let open = std::mem::take(&mut self.open);
        *self = Self { open, ..Self::new(self.costs.len(), chosen) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps with methods that take what `cost` says (place, step); the method of each step, and the choices
    /// with their steps.
    fn run(
        choice: &mut Choice,
        steps: usize,
        all: f64,
        cost: impl Fn(usize, usize) -> f64,
    ) -> (Vec<usize>, Vec<(usize, usize)>) {
        let (mut at_work, mut used, mut chosen) = (choice.chosen, vec![], vec![]);
        for step in 0..steps {
            used.push(at_work);
            let detection = cost(at_work, step);
            match choice.observe(detection, all + detection) {
                Next::Keep => {}
                Next::Turn(place) => at_work = place,
                Next::Chosen(place, costs) => {
                    assert!(costs.iter().zip(&choice.open).all(|(cost, open)| cost.is_some() == *open));
                    at_work = place;
                    chosen.push((step + 1, place));
                }
            }
        }
        (used, chosen)
    }

    #[test]
    fn the_cheapest_is_chosen_and_looks_grow_rare() {
        let mut choice = Choice::new(3, 0);
        let (used, chosen) = run(&mut choice, 3000, 1.0, |place, _| [3.0, 1.0, 2.0][place]);
        // What is dearer than the second is given up in its turns once that is known.
        let first = [[0; FIRST].as_slice(), &[0; BLOCK], &[1; BLOCK], &[2; BLOCK / 2 + 1], &[0; 3]].concat();
        assert_eq!(&used[..first.len()], &first);
        assert_eq!(chosen[0].1, 1);
        assert!(chosen.iter().all(|c| c.1 == 1));
        let gaps: Vec<usize> = chosen.windows(2).map(|w| w[1].0 - w[0].0).collect();
        assert!(gaps.len() >= 3 && gaps[0] >= REST && gaps.is_sorted_by(|a, b| a < b), "{gaps:?}");
        let others = used.iter().filter(|place| **place != 1).count();
        assert!(others < 150, "{others} steps of 3000 with another one");
    }

    /// A method that is very slow takes one step per turn.
    #[test]
    fn what_cannot_win_is_given_up() {
        let mut choice = Choice::new(2, 0);
        let (used, chosen) = run(&mut choice, 100, 0.0, |place, _| [1.0, 1000.0][place]);
        assert_eq!(used.iter().filter(|place| **place == 1).count(), ROUNDS);
        assert_eq!(chosen, [(FIRST + ROUNDS * (BLOCK + 1), 0)]);
    }

    #[test]
    fn detection_that_takes_little_is_left_alone() {
        let mut choice = Choice::new(2, 0);
        let (used, chosen) = run(&mut choice, 5000, 100.0, |place, _| [1.0, 0.1][place]);
        assert!(chosen.is_empty() && used.iter().all(|place| *place == 0));
    }

    #[test]
    fn detection_that_takes_no_time_is_left_alone() {
        let chosen = |seconds: f64| {
            let mut choice = Choice::new(2, 0);
            run(&mut choice, 500, 0.0, |place, _| seconds * [1.0, 0.1][place]).1
        };
        assert!(chosen(0.9 * LEAST).is_empty());
        assert!(!chosen(1.1 * LEAST).is_empty(), "the other method is cheaper");
    }

    /// Neither noise below the margin nor a spike in one turn changes the choice.
    #[test]
    fn small_gains_and_spikes_change_nothing() {
        let mut choice = Choice::new(2, 0);
        let (_, chosen) =
            run(&mut choice, 2000, 0.0, |place, step| [1.0, 0.95][place] + f64::from(step == 10));
        assert!(!chosen.is_empty() && chosen.iter().all(|c| c.1 == 0));
    }

    #[test]
    fn a_cost_that_changes_brings_on_a_probe() {
        let mut choice = Choice::new(2, 0);
        let change = 400;
        let (_, chosen) = run(&mut choice, 700, 0.0, |place, step| match place {
            0 => 1.0,
            _ if step < change => 0.5,
            _ => 4.0,
        });
        let last = chosen.iter().find(|c| c.0 > change).unwrap();
        assert_eq!(last.1, 0);
        let steady = run(&mut Choice::new(2, 0), 700, 0.0, |place, _| [1.0, 0.5][place]).1;
        assert!(last.0 > change && last.0 <= change + WINDOW + 3 * BLOCK + REST / 2, "{chosen:?}");
        assert!(steady.iter().all(|c| c.1 == 1), "planted: without the change it stays");
    }

    #[test]
    fn methods_that_cannot_be_had_are_left_out() {
        let mut choice = Choice::new(3, 0);
        let mut next = Next::Keep;
        while next == Next::Keep {
            next = choice.observe(1.0, 1.0);
        }
        assert_eq!(next, Next::Turn(0));
        for _ in 0..BLOCK {
            next = choice.observe(1.0, 1.0);
        }
        assert_eq!(next, Next::Turn(1));
        assert_eq!(choice.close(1), Next::Turn(2));
        // One is left: it is chosen, and from here on nothing is watched.
        assert_eq!(choice.close(2), Next::Chosen(0, vec![Some(1.0), None, None]));
        assert!((0..1000).all(|_| choice.observe(1.0, 1.0) == Next::Keep));
        let mut choice = Choice::new(3, 2);
        choice.restart(0, |place| place > 1);
        let (used, chosen) = run(&mut choice, 100, 0.0, |place, _| [1.0, 0.5, 0.1][place]);
        assert!(chosen[0].1 == 1 && !used.contains(&2));
    }
}
