//! `contact.detector = "auto"`: the methods that are candidates, measured while the simulation goes on.
//!
//! Results do not depend on it: every method finds the same contacts, bit for bit. What was chosen and why is
//! in the report.

use super::choice::{Choice, Next};
use super::continuous::{Kind, Seat};
use super::{CPU_DEFAULT, Device, GpuDetector, SharedGpu};
use crate::Vec3;
use crate::collision::{CollisionMesh, detector};
use crate::report::Chosen;

/// Candidates on the CPU.
const ON_CPU: [&str; 2] = [CPU_DEFAULT, "session"];
/// Candidates on a GPU that is no software adapter.
const ON_GPU: [&str; 2] = ["virtual-subdivision", "octree"];

/// The candidates of one simulation.
pub(super) struct Auto {
    names: Vec<&'static str>,
    choice: Choice,
    /// Who has the seat now; the place that was chosen unless a probe is under way.
    seated: usize,
    /// Built and waiting for their turn.
    waiting: Vec<(usize, Seat)>,
    device: Device,
    shared: &'static SharedGpu,
    /// Seconds that tests say a method takes, in place of measured ones.
    #[cfg(test)]
    pub(super) planted: Option<fn(&str) -> f64>,
}

impl Auto {
    /// With `first` at work; `on_gpu`: the GPU's methods are candidates.
    pub(super) fn new(first: &'static str, device: Device, shared: &'static SharedGpu, on_gpu: bool) -> Self {
        let mut names: Vec<&'static str> = Vec::new();
        if on_gpu {
            names.extend(ON_GPU);
        }
        if device != Device::Gpu {
            names.extend(ON_CPU);
        }
        let place = names.iter().position(|name| *name == first).unwrap_or_else(|| {
            names.push(first);
            names.len() - 1
        });
        let choice = Choice::new(names.len(), place);
        Self {
            names,
            choice,
            seated: place,
            waiting: Vec::new(),
            device,
            shared,
            #[cfg(test)]
            planted: None,
        }
    }

    /// After a step in which `seat` took so many seconds, and all so many; the method that was chosen, if a
    /// probe has ended.
    pub(super) fn observe(
        &mut self,
        seat: &mut Seat,
        seconds: [f64; 2],
        mesh: &CollisionMesh,
        x: &[Vec3],
    ) -> Option<Chosen> {
        let [detection, all] = seconds;
        #[cfg(test)]
        let [detection, all] = self.planted.map_or([detection, all], |p| [p(self.names[self.seated]); 2]);
        let before = self.choice.chosen;
        let mut next = self.choice.observe(detection, all);
        loop {
            match next {
                Next::Keep => return None,
                Next::Turn(place) => match self.seat(place, seat, mesh, x) {
                    Some(()) => return None,
                    None => next = self.choice.close(place),
                },
                Next::Chosen(place, costs) => match self.seat(place, seat, mesh, x) {
                    Some(()) => {
                        self.waiting.clear();
                        return Some(self.chosen(before, place, &costs, seat));
                    }
                    None => next = self.choice.close(place),
                },
            }
        }
    }

    /// Gives the seat to the method of that place; `None` if it cannot be had.
    fn seat(&mut self, place: usize, seat: &mut Seat, mesh: &CollisionMesh, x: &[Vec3]) -> Option<()> {
        if place == self.seated {
            return Some(());
        }
        let new = match self.waiting.iter().position(|(k, _)| *k == place) {
            Some(k) => self.waiting.swap_remove(k).1,
            None => self.build(place, mesh, x)?,
        };
        let old = std::mem::replace(seat, new);
        self.waiting.push((self.seated, old));
        self.seated = place;
        Some(())
    }

    fn build(&self, place: usize, mesh: &CollisionMesh, x: &[Vec3]) -> Option<Seat> {
        let name = self.names[place];
        if name == CPU_DEFAULT {
            return Some(Seat { kind: Kind::Tree, device: "cpu".to_owned() });
        }
        if ON_CPU.contains(&name) {
            let detector = detector(name, mesh, x).ok()?;
            return Some(Seat { kind: Kind::Cpu(detector), device: "cpu".to_owned() });
        }
        let (gpu, device) = GpuDetector::new(self.shared, mesh, name, self.device).ok()?;
        Some(Seat { kind: Kind::Gpu(Box::new(gpu)), device })
    }

    fn chosen(&self, before: usize, place: usize, costs: &[Option<f64>], seat: &Seat) -> Chosen {
        let seconds: Vec<(String, f64)> = self
            .names
            .iter()
            .zip(costs)
            .filter_map(|(name, cost)| cost.map(|seconds| ((*name).to_owned(), seconds)))
            .collect();
        let others: Vec<String> = seconds
            .iter()
            .filter(|(name, _)| *name != self.names[place])
            .map(|(name, seconds)| format!("{} with \"{name}\"", milliseconds(*seconds)))
            .collect();
        let own = costs[place].map_or_else(|| "not measured".to_owned(), milliseconds);
        let stays = if before == place { ", and stays" } else { "" };
        let why = if others.is_empty() {
            "the only one that can be had".to_owned()
        } else {
            format!("measured: {own} per step against {}{stays}", others.join(", "))
        };
        Chosen {
            step: 0,
            time: 0.0,
            detector: self.names[place].to_owned(),
            device: seat.device.clone(),
            why,
            seconds_per_step: seconds,
        }
    }

    /// Goes on with the tree, without the GPU's methods.
    pub(super) fn lose_gpu(&mut self) {
        self.waiting.clear();
        let tree = self.names.iter().position(|name| *name == CPU_DEFAULT);
        let names = &self.names;
        if let Some(tree) = tree {
            self.choice.restart(tree, |place| !ON_CPU.contains(&names[place]));
            self.seated = tree;
        }
    }

    /// Memory of what waits, here and on the GPU \[B\].
    pub(super) fn waiting_bytes(&self) -> (usize, u64) {
        let kinds = || self.waiting.iter().map(|(_, seat)| &seat.kind);
        (kinds().map(Kind::bytes).sum(), kinds().map(Kind::device_bytes).sum())
    }

    #[cfg(test)]
    pub(super) fn waiting(&self) -> usize {
        self.waiting.len()
    }

    /// What the plan says before anything is measured.
    pub(super) fn outlook(&self) -> String {
        let others: Vec<String> = self
            .names
            .iter()
            .enumerate()
            .filter(|(k, _)| *k != self.choice.chosen)
            .map(|(_, name)| format!("\"{name}\""))
            .collect();
        if others.is_empty() {
            String::new()
        } else {
            format!(
                "; measured against {} where detection takes 5 % of a step and 0.25 ms",
                others.join(", ")
            )
        }
    }
}

/// In words.
fn milliseconds(seconds: f64) -> String {
    format!("{:.3} ms", 1e3 * seconds)
}
