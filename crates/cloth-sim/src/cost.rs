//! What an element of each effect took in one step on one thread of a machine: a committed table that plans estimate with.
//!
//! `python benches/effect_prices.py --write` measures it anew. Another machine, mesh, tolerance or state of contact takes another time:
//! the report of a run has what it did take.

use serde::Deserialize;
use std::collections::BTreeMap;
use std::sync::OnceLock;

/// The committed table.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Model {
    /// Processor, commit and command.
    machine: String,
    commit: String,
    command: String,
    /// Name of the effect, nanoseconds per element and step on one thread.
    nanoseconds: BTreeMap<String, f64>,
}

fn model() -> Option<&'static Model> {
    static MODEL: OnceLock<Option<Model>> = OnceLock::new();
    MODEL.get_or_init(|| serde_json::from_str(include_str!("cost_model.json")).ok()).as_ref()
}

/// Estimate of what a step takes for an effect with so many elements [ms].
pub(crate) fn estimate(effect: &str, elements: usize) -> Option<f64> {
    model()?.nanoseconds.get(effect).map(|ns| 1e-6 * ns * elements as f64)
}

/// Where the estimates come from, in words.
pub(crate) fn source() -> String {
    model().map_or_else(String::new, |m| format!("{} at {} ({})", m.machine, m.commit, m.command))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_can_be_read_and_its_numbers_are_times() {
        let model = model().expect("crates/cloth-sim/src/cost_model.json is a cost model");
        assert!(!model.nanoseconds.is_empty());
        assert!(model.nanoseconds.values().all(|ns| ns.is_finite() && *ns >= 0.0));
        assert_eq!(estimate("no such effect", 5), None);
        let ns = model.nanoseconds["integrator"];
        assert_eq!(estimate("integrator", 1000), Some(1e-6 * ns * 1000.0));
    }
}
