//! Sizes of numbers that a scene may have: beyond them a run would not fail at once but diverge, stick or overflow later.
//!
//! All are far from what cloth needs and chosen so that powers and products of them that the engine forms stay finite.

use super::{Scene, SceneError};
use crate::Vec3;
use serde_json::Value;

/// Largest coordinate of a position, and largest size [m].
pub(crate) const LENGTH: f64 = 1e9;
/// Largest start velocity [m/s].
pub(crate) const VELOCITY: f64 = 1e5;

/// What a number, or the largest component of a vector, may be in size: zero, or `least` to `largest`.
struct Bound {
    /// Ends of the keys' paths, without indices.
    keys: &'static [&'static str],
    least: f64,
    largest: f64,
    unit: &'static str,
    why: &'static str,
}

/// The first row that has a key counts; what is in none is bounded by [`OTHER`].
#[rustfmt::skip]
const BOUNDS: [Bound; 21] = [
    // A region without end on one side is a way to say "all above".
    Bound { keys: &["box.min", "box.max"], least: 0.0, largest: f64::MAX, unit: " m", why: "" },
    Bound { keys: &["cloth.warp", "axis"], least: 1e-100, largest: 1e100, unit: "", why: "the square of its length is to be a number" },
    Bound {
        keys: &["width", "height", "length", "radius", "half_height", "half_extents", "half_size", "size"],
        least: 1e-7, largest: LENGTH, unit: " m", why: "a hundredth of a fibre's breadth to the Sun's",
    },
    Bound { keys: &["shape.tolerance"], least: 1e-9, largest: LENGTH, unit: " m", why: "an atom's breadth to the Sun's" },
    Bound { keys: &["position", "pivot"], least: 0.0, largest: LENGTH, unit: " m", why: "farther away, millimetres are rounded" },
    Bound { keys: &["cloth.velocity"], least: 0.0, largest: VELOCITY, unit: " m/s", why: "faster than all that falls from space" },
    Bound { keys: &["air.wind"], least: 0.0, largest: VELOCITY, unit: " m/s", why: "faster than all that falls from space" },
    Bound { keys: &["gravity"], least: 0.0, largest: 1e7, unit: " m/s²", why: "that of the fastest centrifuges" },
    Bound { keys: &["contact.thickness"], least: 1e-9, largest: 1e6, unit: " m", why: "an atom's breadth to more than any cloth's size" },
    Bound { keys: &["areal_density"], least: 1e-9, largest: 1e6, unit: " kg/m²", why: "thinner than one layer of atoms to fifty metres of lead" },
    Bound {
        keys: &["stiffness", "in_plane.warp", "in_plane.weft", "in_plane.shear", "repulsion_stiffness"],
        least: 0.0, largest: 1e12, unit: " N/m", why: "metres of steel",
    },
    Bound { keys: &["rigidity"], least: 0.0, largest: 1e9, unit: " N m", why: "a steel plate of a quarter of a metre" },
    Bound { keys: &["air.density"], least: 0.0, largest: 1e5, unit: " kg/m³", why: "denser than any metal" },
    Bound { keys: &["friction", "self_friction", "mu_c", "mu_s", "drag", "lift"], least: 0.0, largest: 1e6, unit: "", why: "nothing has a coefficient above 100" },
    Bound { keys: &["v_s"], least: 1e-12, largest: VELOCITY, unit: " m/s", why: "far below a creep to faster than all that falls from space" },
    Bound { keys: &["strain_limit", "stretch"], least: 1e-9, largest: 1e6, unit: "", why: "less is rounding, more is no limit" },
    Bound { keys: &["dt_tolerance"], least: 1e-12, largest: LENGTH, unit: " m", why: "far below an atom's breadth is rounding" },
    Bound { keys: &["time.dt", "dt_min", "dt_max"], least: 1e-12, largest: 1e6, unit: " s", why: "far below and above any step that resolves cloth" },
    Bound { keys: &["duration", "keyframes.time", "start"], least: 0.0, largest: 1e9, unit: " s", why: "30 years" },
    Bound { keys: &["fps"], least: 1e-9, largest: 1e12, unit: " 1/s", why: "far below and above any frame rate" },
    Bound { keys: &["angle", "twist"], least: 0.0, largest: 1e9, unit: " rad", why: "more turns are not resolved" },
];

/// For all other numbers.
const OTHER: Bound = Bound {
    keys: &[],
    least: 0.0,
    largest: 1e12,
    unit: "",
    why: "no quantity of cloth is larger in SI units",
};

impl Scene {
    /// Refuses numbers of absurd size, in a scene whose values are checked otherwise.
    pub(super) fn check_sizes(&self) -> Result<(), SceneError> {
        match serde_json::to_value(self) {
            Ok(value) => self.walk("", "", &value),
            Err(error) => Err(self.error("", "a scene that can be written", error.to_string())),
        }
    }

    /// `key`: path with indices, for the error; `path`: without, for the table.
    fn walk(&self, key: &str, path: &str, value: &Value) -> Result<(), SceneError> {
        let join = |path: &str, name: &str| match path {
            "" => name.to_owned(),
            _ => format!("{path}.{name}"),
        };
        match value {
            Value::Object(table) => {
                table.iter().try_for_each(|(name, v)| self.walk(&join(key, name), &join(path, name), v))
            }
            Value::Array(list) if list.iter().all(Value::is_number) => {
                // Lists of indices can be long and have no size.
                if list.iter().any(Value::is_f64) { self.check_size(key, path, list) } else { Ok(()) }
            }
            Value::Array(list) => {
                list.iter().enumerate().try_for_each(|(i, v)| self.walk(&format!("{key}[{i}]"), path, v))
            }
            Value::Number(_) => self.check_size(key, path, std::slice::from_ref(value)),
            _ => Ok(()),
        }
    }

    fn check_size(&self, key: &str, path: &str, numbers: &[Value]) -> Result<(), SceneError> {
        let size = numbers.iter().filter_map(Value::as_f64).map(f64::abs).fold(0.0, f64::max);
        let is_of =
            |end: &&str| path.strip_suffix(*end).is_some_and(|rest| rest.is_empty() || rest.ends_with('.'));
        let bound = BOUNDS.iter().find(|b| b.keys.iter().any(is_of)).unwrap_or(&OTHER);
        if size == 0.0 || (bound.least..=bound.largest).contains(&size) {
            return Ok(());
        }
        let (word, limit) = if size < bound.least { ("least", bound.least) } else { ("most", bound.largest) };
        let expected = format!("at {word} {limit:e}{} in size ({})", bound.unit, bound.why);
        let text = |n: &Value| match n.as_f64() {
            Some(x) if n.is_f64() => format!("{x:?}"),
            _ => n.to_string(),
        };
        let got = match numbers {
            [one] => text(one),
            many => format!("[{}]", many.iter().map(text).collect::<Vec<_>>().join(", ")),
        };
        Err(self.error(key, expected, got))
    }

    /// Refuses points or velocities of an asset that lie beyond `largest` (`unit`); `item` names one by its index. What
    /// is not finite is not looked at.
    pub(crate) fn check_points(
        &self,
        key: &str,
        points: &[Vec3],
        largest: f64,
        unit: &str,
        item: impl Fn(usize) -> String,
    ) -> Result<(), SceneError> {
        match points.iter().position(|p| p.amax() > largest && p.iter().all(|c| c.is_finite())) {
            Some(i) => {
                let p = points[i];
                let got = format!("[{:?}, {:?}, {:?}] at {}", p.x, p.y, p.z, item(i));
                Err(self.error(key, format!("numbers of at most {largest:e} {unit} in size"), got))
            }
            None => Ok(()),
        }
    }
}
