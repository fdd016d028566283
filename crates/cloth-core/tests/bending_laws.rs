//! Bending laws alone, against a literal reading of chapter 4 and against closed forms.

#![allow(clippy::unwrap_used, reason = "a failure fails the test")]

use cloth_core::CoreError;
use cloth_core::bending::{Curve, Hysteresis, Law, Linear, Plastic, Trace, trace};

/// Rounding of a few hundred steps of numbers of order one.
const ROUNDING: f64 = 1e-11;

fn hysteresis(b: [f64; 3], plasticity: f64, fatigue: f64) -> Law {
    Law::Hysteresis(Hysteresis::new(Curve::new(b[0], b[1], b[2]).unwrap(), plasticity, fatigue).unwrap())
}

fn follow(law: &Law, path: &[f64]) -> Trace {
    trace(law, path).unwrap()
}

/// Repeatable numbers in [0, 1).
struct Random(u64);

impl Random {
    fn value(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Turning points of all sizes against `scale`.
    fn path(&mut self, n: usize, scale: f64) -> Vec<f64> {
        (0..n)
            .map(|_| {
                let size = [0.3, 1.0, 3.0, 6.0][(self.value() * 4.0) as usize];
                (2.0 * self.value() - 1.0) * size * scale
            })
            .collect()
    }
}

/// Chapter 4 as printed, with the signs of the notes: curves through p with the coefficients of (4.8), window corners as
/// points, cycles with their flags, zero moments by bisection.
struct Reading {
    b: [f64; 3],
    plasticity: f64,
    fatigue: f64,
    rest: f64,
    /// Upper and lower corner of the window (K, M).
    upper: [f64; 2],
    lower: [f64; 2],
    /// Start of the curve being followed, current point, direction.
    p: [f64; 2],
    now: [f64; 2],
    direction: f64,
    reached_line: bool,
    /// (K_m, M_m) and whether friction had been overcome, while recovering.
    recovery: Option<([f64; 2], bool)>,
}

impl Reading {
    fn new(b: [f64; 3], plasticity: f64, fatigue: f64) -> Self {
        let mut reading = Self {
            b,
            plasticity,
            fatigue,
            rest: 0.0,
            upper: [0.0; 2],
            lower: [0.0; 2],
            p: [0.0; 2],
            now: [0.0; 2],
            direction: 0.0,
            reached_line: false,
            recovery: None,
        };
        let [k0, _, ma] = reading.sizes();
        (reading.upper, reading.lower) = ([k0, ma], [-k0, -ma]);
        reading
    }

    /// K_0, M_0, M_a.
    fn sizes(&self) -> [f64; 3] {
        let [b1, b2, c1] = self.b;
        let k0 = (b2 - b1) / (2.0 * c1);
        let m0 = (b1 - b2) * k0 + c1 * k0 * k0;
        [k0, m0, m0 + b2 * k0]
    }

    /// The moment at K on the way there, by (4.4) and (4.8) or on the straight side.
    fn moment(&self, k: f64) -> f64 {
        let (s, sigma) = (if self.direction > 0.0 { self.lower } else { self.upper }, self.direction);
        let d = if self.direction > 0.0 { self.upper } else { self.lower };
        let [k0, m0, _] = self.sizes();
        let b2 = self.b[1];
        if sigma * (k - d[0]) >= 0.0 {
            return sigma * m0 + b2 * k;
        }
        let (kp, mp) = (self.p[0] - s[0], self.p[1] - s[1]);
        let beta = b2 + 2.0 * (2.0 * m0 * sigma + b2 * kp - mp) / (2.0 * k0 * sigma - kp);
        let gamma = (-2.0 * m0 * sigma - b2 * kp + mp) / (2.0 * k0 * sigma - kp).powi(2);
        let x = k - self.p[0];
        self.p[1] + beta * x + gamma * x * x
    }

    fn go(&mut self, k: f64) {
        self.now = [k, self.moment(k)];
        let d = if self.direction > 0.0 { self.upper } else { self.lower };
        if self.direction * (k - d[0]) >= 0.0 {
            let [k0, _, ma] = self.sizes();
            let other = [self.now[0] - self.direction * 2.0 * k0, self.now[1] - self.direction * 2.0 * ma];
            (self.upper, self.lower) =
                if self.direction > 0.0 { (self.now, other) } else { (other, self.now) };
            self.reached_line = true;
        }
    }

    fn end_cycle(&mut self) {
        let Some((peak, overcome)) = self.recovery.take() else { return };
        self.reached_line = false;
        if !overcome {
            return;
        }
        let [k0, m0, ma] = self.sizes();
        let [b1, b2, c1] = self.b;
        let side = peak[1].signum();
        let xi = (side * (peak[1] - self.now[1]) / (2.0 * ma)).min(1.0);
        let kr = if peak[1].abs() > 2.0 * ma {
            m0 / b2
        } else {
            peak[0].abs() + (-b1 + (b1 * b1 + 2.0 * c1 * peak[1].abs()).sqrt()) / -c1
        };
        let delta = side * xi * self.plasticity * kr;
        let middle = 0.5 * (self.upper[0] + self.lower[0]);
        let (u, m) = ((self.now[0] - middle) / k0, self.now[1] - b2 * self.now[0]);
        self.rest += delta;
        self.now[0] -= delta;
        self.b[0] = b2 - (1.0 - self.fatigue * xi).sqrt() * (b2 - b1);
        let [new_k0, new_m0, new_ma] = self.sizes();
        let held = (m + b2 * delta).clamp(-new_m0, new_m0);
        self.now[1] = b2 * self.now[0] + held;
        let u = (u + held / new_m0 - m / m0).clamp(-1.0, 1.0);
        let middle = [self.now[0] - u * new_k0, b2 * (self.now[0] - u * new_k0)];
        self.upper = [middle[0] + new_k0, middle[1] + new_ma];
        self.lower = [middle[0] - new_k0, middle[1] - new_ma];
        self.p = self.now;
    }

    /// One sample of a path: the moment there.
    fn sample(&mut self, total: f64) -> f64 {
        let way = total - self.rest - self.now[0];
        if way == 0.0 {
            return self.now[1];
        }
        if way.signum() != self.direction {
            self.direction = way.signum();
            self.p = self.now;
            let bending = self.now[1] * self.direction >= 0.0;
            if bending {
                self.end_cycle();
                self.reached_line = false;
            } else {
                let [_, _, ma] = self.sizes();
                let overcome = self.reached_line && self.now[1].abs() > ma;
                self.recovery = Some((self.now, overcome));
            }
        }
        if self.recovery.is_some() && self.moment(total - self.rest) * self.direction >= 0.0 {
            let (mut from, mut to) = (self.now[0], total - self.rest);
            for _ in 0..200 {
                let middle = 0.5 * (from + to);
                if self.moment(middle) * self.direction < 0.0 { from = middle } else { to = middle }
            }
            self.go(to);
            self.now[1] = 0.0;
            self.end_cycle();
        }
        self.go(total - self.rest);
        self.now[1]
    }
}

#[test]
fn random_paths_agree_with_a_literal_reading() {
    let mut random = Random(7);
    let mut ends = 0;
    for case in 0..400 {
        let b2 = 0.2 + 2.0 * random.value();
        let b = [b2 * (1.0 + 3.0 * random.value()), b2, -0.3 - 3.0 * random.value()];
        let k0 = (b[0] - b[1]) / (-2.0 * b[2]);
        let (plasticity, fatigue) =
            if case % 3 == 0 { (0.0, 0.0) } else { (random.value(), 0.5 * random.value()) };
        let path = random.path(60, k0);
        let got = follow(&hysteresis(b, plasticity, fatigue), &path);
        let mut reading = Reading::new(b, plasticity, fatigue);
        for (i, &k) in path.iter().enumerate() {
            let moment = reading.sample(k);
            let scale = b[0] * k0;
            assert!((got.moment[i] - moment).abs() < ROUNDING * scale, "{case} {i}: {moment}");
            assert!((got.rest_curvature[i] - reading.rest).abs() < ROUNDING * k0, "{case} {i}");
            assert!((got.b1[i] - reading.b[0]).abs() < ROUNDING * b[0], "{case} {i}");
            assert!((got.frictional_moment[i] - reading.sizes()[1]).abs() < ROUNDING * scale, "{case} {i}");
        }
        ends += usize::from(reading.rest != 0.0);
    }
    assert!(ends > 200, "{ends} of the paths must leave a residual curvature");
    // A fault of one per cent in a coefficient is seen.
    let (path, b) = (random.path(20, 0.5), [3.0, 1.0, -2.0]);
    let got = follow(&hysteresis(b, 0.0, 0.0), &path);
    let mut faulty = Reading::new([3.03, 1.0, -2.0], 0.0, 0.0);
    assert!(path.iter().zip(&got.moment).any(|(&k, m)| (faulty.sample(k) - m).abs() > 1e-3));
}

#[test]
fn samples_in_between_change_nothing() {
    let mut random = Random(11);
    let law = hysteresis([3.4, 2.0, -2.23], 0.3, 0.1);
    let coarse = random.path(80, 0.3);
    let mut fine = Vec::new();
    let mut from = 0.0;
    for &to in &coarse {
        fine.extend((1..=50).map(|i| from + (to - from) * f64::from(i) / 50.0));
        *fine.last_mut().unwrap() = to;
        from = to;
    }
    let (a, b) = (follow(&law, &coarse), follow(&law, &fine));
    for i in 0..coarse.len() {
        let j = 50 * i + 49;
        assert!((a.moment[i] - b.moment[j]).abs() < ROUNDING, "{i}");
        assert!((a.rest_curvature[i] - b.rest_curvature[j]).abs() < ROUNDING, "{i}");
        assert!((a.dissipated[i] - b.dissipated[j]).abs() < ROUNDING * 10.0, "{i}");
    }
}

/// ∮ M dK by the trapezoidal rule.
fn area(curvature: &[f64], moment: &[f64]) -> f64 {
    curvature.windows(2).zip(moment.windows(2)).map(|(k, m)| 0.5 * (m[0] + m[1]) * (k[1] - k[0])).sum()
}

/// `n` samples from `from` to `to`, the start left out.
fn ramp(from: f64, to: f64, n: usize) -> impl Iterator<Item = f64> {
    (1..=n).map(move |i| if i == n { to } else { from + (to - from) * i as f64 / n as f64 })
}

#[test]
fn loop_area_and_gap_have_their_closed_forms() {
    let b = [3.4, 2.0, -2.23];
    let curve = Curve::new(b[0], b[1], b[2]).unwrap();
    let (k0, m0) = (curve.k0(), curve.m0());
    let n = 4000;
    for k in [0.2, 0.7, 1.0, 1.5, 4.0] {
        let km = k * k0;
        let mut path: Vec<f64> = ramp(0.0, km, n).collect();
        let cycles = 40;
        for _ in 0..cycles {
            path.extend(ramp(km, -km, n));
            path.extend(ramp(-km, km, n));
        }
        let got = follow(&hysteresis(b, 0.0, 0.0), &path);
        let last = path.len() - 1 - 2 * n;
        let loop_area = area(&path[last..], &got.moment[last..]);
        let closed = if k >= 1.0 {
            4.0 * m0 * (km - 2.0 / 3.0 * k0)
        } else {
            8.0 / 3.0 * m0 * k0 * k.powi(3) / (1.0 + k * k)
        };
        // Trapezoidal rule: error of the order of c_1 K_m³/n².
        assert!((loop_area - closed).abs() < 1e-6 * closed, "{k}: {loop_area} {closed}");
        let dissipated = got.dissipated[path.len() - 1] - got.dissipated[last];
        assert!((dissipated - closed).abs() < 1e-10 * closed, "{k}: {dissipated} {closed}");
        if k >= 2.0 {
            let (down, up) = (last + n / 2, last + n + n / 2);
            assert!(path[down].abs() < 1e-12 && path[up].abs() < 1e-12);
            let gap = (got.moment[up] - got.moment[down]).abs();
            assert!((gap - 2.0 * m0).abs() < 1e-10, "2 M0 = {}, gap {gap}", 2.0 * m0);
        }
    }
}

#[test]
fn what_is_dissipated_never_falls() {
    let mut random = Random(3);
    for _ in 0..50 {
        let turns = random.path(60, 0.4);
        let mut path = Vec::new();
        let mut from = 0.0;
        for to in turns {
            path.extend(ramp(from, to, 10));
            from = to;
        }
        for law in [
            hysteresis([3.4, 2.0, -2.23], 0.0, 0.0),
            hysteresis([3.4, 1.0, -2.23], 0.4, 0.0),
            Law::Plastic(Plastic::new(2.0, 0.2, 0.3).unwrap()),
        ] {
            let got = follow(&law, &path);
            let fall = got.dissipated.windows(2).map(|d| d[0] - d[1]).fold(0.0, f64::max);
            assert!(fall < ROUNDING, "{law:?}: {fall:e}");
            assert!(got.dissipated[path.len() - 1] > 0.0);
        }
    }
}

#[test]
fn one_sided_cycles_add_up_to_the_closed_form_and_end_the_loop() {
    let b = [5.20, 2.51, -4.45];
    let (plasticity, fatigue) = (0.15, 0.1);
    let m0 = Curve::new(b[0], b[1], b[2]).unwrap().m0();
    let law = hysteresis(b, plasticity, fatigue);
    let mut path = Vec::new();
    let (mut rest, mut friction) = (0.0, m0);
    for _ in 0..300 {
        // Far past 2 M_a, then to just beyond M = 0: ξ = 1, K_r = M_0/b_2.
        path.extend([4.0, rest + friction / b[1] - 1e-9]);
        rest += plasticity * friction / b[1];
        friction *= 1.0 - fatigue;
    }
    let got = follow(&law, &path);
    for n in [1, 2, 5, 20] {
        let expected = plasticity * m0 / b[1] * (1.0 - (1.0 - fatigue).powi(n)) / fatigue;
        let rest = got.rest_curvature[2 * n as usize - 1];
        assert!((rest - expected).abs() < 1e-10, "{n}: {rest} {expected}");
        let left = got.b1[2 * n as usize - 1];
        let expected = b[1] + (1.0 - fatigue).powf(0.5 * f64::from(n)) * (b[0] - b[1]);
        assert!((left - expected).abs() < 1e-10, "{n}: {left} {expected}");
    }
    assert!((got.b1[599] - b[1]).abs() < 1e-6 && got.frictional_moment[599] < 1e-12);
    // No loop left: a straight line through the rest curvature.
    let straight = b[1] * (4.0 - got.rest_curvature[598]);
    assert!((got.moment[598] - straight).abs() < 1e-6);
}

#[test]
fn complete_plasticity_and_fatigue_are_exact() {
    let b = [3.0, 1.0, -2.0];
    let m0 = Curve::new(b[0], b[1], b[2]).unwrap().m0();
    // λ = 1, complete recovery: an unused place about K_r = M_0/b_2.
    let kr = m0 / b[1];
    let got = follow(&hysteresis(b, 1.0, 0.0), &[5.0, kr, kr + 0.1, kr - 0.2]);
    let fresh = follow(&hysteresis(b, 1.0, 0.0), &[0.1, -0.2]);
    assert!((got.rest_curvature[3] - kr).abs() < ROUNDING);
    assert!((got.moment[2] - fresh.moment[0]).abs() < ROUNDING);
    assert!((got.moment[3] - fresh.moment[1]).abs() < ROUNDING);
    // μ = 1: b_1 = b_2 exactly, and the law goes on as a line.
    let got = follow(&hysteresis(b, 0.0, 1.0), &[5.0, -5.0, 3.0, -2.0]);
    assert_eq!((got.b1[3], got.frictional_moment[3]), (1.0, 0.0));
    assert_eq!(&got.moment[2..], &[3.0, -2.0]);
    // λ = 0 moves no rest curvature.
    assert!(follow(&hysteresis(b, 0.0, 0.3), &[5.0, -5.0, 3.0]).rest_curvature.iter().all(|r| *r == 0.0));
}

#[test]
fn laws_without_a_loop_agree() {
    let path = Random(5).path(100, 2.0);
    let line = follow(&Law::Linear(Linear::new(1.5).unwrap()), &path);
    let expected: Vec<f64> = path.iter().map(|k| 1.5 * k).collect();
    assert_eq!(line.moment, expected);
    let curve = Curve::new(1.5, 1.5, 0.0).unwrap();
    assert_eq!(follow(&Law::Nonlinear(curve), &path).moment, expected);
    for (m, e) in follow(&hysteresis([1.5, 1.5, 0.0], 0.5, 0.5), &path).moment.iter().zip(&expected) {
        assert!((m - e).abs() < ROUNDING);
    }
    // First loading is the nonlinear law.
    let (b, up): ([f64; 3], Vec<f64>) = ([3.0, 1.0, -2.0], ramp(0.0, 2.0, 30).collect());
    let nonlinear = follow(&Law::Nonlinear(Curve::new(b[0], b[1], b[2]).unwrap()), &up);
    for (m, e) in follow(&hysteresis(b, 0.2, 0.2), &up).moment.iter().zip(&nonlinear.moment) {
        assert!((m - e).abs() < ROUNDING);
    }
}

#[test]
fn plastic_flow_starts_at_the_limit_and_dissipates_only_there() {
    let (rigidity, limit) = (2.0, 0.5);
    let law = Law::Plastic(Plastic::new(rigidity, limit, 0.0).unwrap());
    let got = follow(&law, &[0.4, -0.4, 1.5, 0.0, -2.0]);
    assert_eq!(got.dissipated[1], 0.0);
    assert_eq!(got.rest_curvature[2], 1.0);
    assert_eq!(got.moment[2], rigidity * limit);
    assert_eq!(got.moment[4], -rigidity * limit);
    assert!((got.dissipated[2] - rigidity * limit * 1.0).abs() < ROUNDING);
    let harder = follow(&Law::Plastic(Plastic::new(rigidity, limit, 2.0).unwrap()), &[1.5]);
    assert!((harder.moment[0] - (1.0 + 1.0)).abs() < ROUNDING, "{}", harder.moment[0]);
}

#[test]
fn a_path_with_nan_is_refused() {
    let law = hysteresis([3.0, 1.0, -2.0], 0.0, 0.0);
    let error = trace(&law, &[0.0, 1.0, f64::NAN]).unwrap_err();
    assert!(matches!(error, CoreError::NotFinite { name: "curvature", index: 2, .. }), "{error}");
    assert_eq!(trace(&law, &[]).unwrap(), Trace::default());
}
