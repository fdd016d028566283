//! Seconds by stage.

/// Seconds by stage, in the order of their first appearance.
#[derive(Debug, Default)]
pub struct Seconds(pub Vec<(&'static str, f64)>);

impl Seconds {
    /// Adds to a stage.
    pub fn add(&mut self, name: &'static str, seconds: f64) {
        match self.0.iter_mut().find(|s| s.0 == name) {
            Some(entry) => entry.1 += seconds,
            None => self.0.push((name, seconds)),
        }
    }
}
