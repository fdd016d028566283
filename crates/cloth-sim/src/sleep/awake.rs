//! The dynamics of the cloth that is awake, rebuilt whenever something falls asleep or wakes.

use crate::constraints::failure;
use crate::guard::Alarm;
use crate::step::Failure;
use crate::{SimError, Simulation, Vec3, plan};
use cloth_core::{
    Bending, ClothPart, ClothSystem, Energy, History, Integrator, Motion, Pins, StepInfo, Work,
};
use std::sync::Arc;

/// The dynamics of awake cloth: its vertices without gaps.
pub(crate) struct Awake {
    /// `None`: all sleep.
    pub(crate) integrator: Option<Integrator>,
    cloths: Vec<usize>,
    /// The vertex of each of its own.
    vertices: Vec<usize>,
    /// Its own index of awake pins, and their places in the list of all.
    pins: Vec<u32>,
    pin_rows: Vec<usize>,
    /// Of what sleeps.
    energy: Energy,
}

impl Awake {
    fn gather(&self, all: &[Vec3]) -> Vec<Vec3> {
        self.vertices.iter().map(|&i| all[i]).collect()
    }

    pub(crate) fn energy(&self, x: &[Vec3], v: &[Vec3]) -> Energy {
        let mut energy = self.energy;
        if let Some(integrator) = &self.integrator {
            energy += integrator.system().energy(&self.gather(x), &self.gather(v));
        }
        energy
    }

    /// [`Integrator::step`] of the awake cloth among the vertices of all bodies; `pins`: all of the scene's.
    pub(crate) fn step(
        &mut self,
        x: &mut [Vec3],
        v: &mut [Vec3],
        time: f64,
        dt: f64,
        pins: &Pins<'_>,
    ) -> Result<StepInfo, Failure> {
        let (mut own_x, mut own_v) = (self.gather(x), self.gather(v));
        let rows = |all: &[Vec3]| self.pin_rows.iter().map(|&row| all[row]).collect::<Vec<_>>();
        let (pin_x, pin_v) = (rows(pins.x_t1), rows(pins.v_t1));
        let Some(integrator) = &mut self.integrator else {
            return Ok(StepInfo { converged: true, ..StepInfo::default() });
        };
        let own_pins = Pins { vertices: &self.pins, x_t1: &pin_x, v_t1: &pin_v };
        let own_index =
            |vertices: Vec<u32>| vertices.iter().map(|&i| self.vertices[i as usize] as u32).collect();
        let info =
            integrator.step(&mut own_x, &mut own_v, time, dt, &own_pins).map_err(|error| {
                match failure(error) {
                    Failure::Alarm(alarm) => {
                        Failure::Alarm(Alarm { vertices: own_index(alarm.vertices), ..alarm })
                    }
                    other => other,
                }
            })?;
        for (own, &i) in self.vertices.iter().enumerate() {
            (x[i], v[i]) = (own_x[own], own_v[own]);
        }
        Ok(info)
    }

    /// [`Integrator::work`] of the awake cloth, between states of all bodies.
    pub(crate) fn work(&self, from: Motion<'_>, to: Motion<'_>, dt: f64) -> Work {
        let Some(integrator) = &self.integrator else { return Work::default() };
        let [x0, v0, x1, v1] = [from.x, from.v, to.x, to.v].map(|all| self.gather(all));
        integrator.work(Motion { x: &x0, v: &v0 }, Motion { x: &x1, v: &v1 }, dt, &self.pins)
    }

    pub(crate) fn accept(&mut self) {
        if let Some(integrator) = &mut self.integrator {
            integrator.accept();
        }
    }

    pub(super) fn bytes(&self) -> usize {
        self.integrator.as_ref().map_or(0, Integrator::bytes)
            + self.vertices.len() * size_of::<usize>()
            + self.pins.len() * (size_of::<u32>() + size_of::<usize>())
    }
}

impl Simulation {
    /// What bending laws remember of the path so far.
    pub(crate) fn memory(&self) -> Vec<f64> {
        self.memories().concat()
    }

    /// The same, one list per cloth of [`Simulation::remembering`].
    pub(crate) fn memories(&self) -> Vec<Vec<f64>> {
        let mut memories = self.integrator.system().memories(&self.state.x);
        let Some(awake) = self.sleeper.as_ref().and_then(|s| s.awake.as_ref()) else { return memories };
        let Some(integrator) = &awake.integrator else { return memories };
        let own = integrator.system().memories(&awake.gather(&self.state.x));
        let theirs = self.remembering().zip(&mut memories).filter(|(cloth, _)| awake.cloths.contains(cloth));
        for ((_, memory), own) in theirs.zip(own) {
            *memory = own;
        }
        memories
    }

    /// The cloths whose law remembers, where each cloth has one law.
    fn remembering(&self) -> impl Iterator<Item = usize> {
        let remembers = |c: &usize| {
            let body = &self.bodies.cloth[*c];
            matches!(body.material.bending, Bending::Plastic(_) | Bending::Hysteresis(_))
                && !body.topology.hinges.is_empty()
        };
        (0..self.bodies.cloth.len()).filter(remembers)
    }

    /// Of laws whose hinges remember only where they must: how many do, as of the start of the last step; of sleeping cloth as it
    /// fell asleep.
    pub(crate) fn histories(&self) -> Vec<History> {
        let mut list = self.integrator.system().histories();
        let Some(awake) = self.sleeper.as_ref().and_then(|s| s.awake.as_ref()) else { return list };
        let Some(integrator) = &awake.integrator else { return list };
        let theirs = self.remembering().zip(&mut list).filter(|(cloth, _)| awake.cloths.contains(cloth));
        for ((_, history), own) in theirs.zip(integrator.system().histories()) {
            *history = own;
        }
        list
    }

    /// Makes dynamics, masses and marks those of the cloth that is awake.
    pub(crate) fn rebuild_awake(&mut self) -> Result<(), SimError> {
        if self.sleeper.is_none() {
            return Ok(());
        }
        let memories = self.memories();
        let stage = |error: cloth_core::CoreError| crate::contact::stage("sleep", &error);
        self.integrator.set_memory(&memories.concat()).map_err(stage)?;
        let Some(mut sleeper) = self.sleeper.take() else { return Ok(()) };
        for (c, range) in sleeper.cloths.iter().enumerate() {
            sleeper.asleep[range.clone()].fill(self.state.rest.asleep[c]);
        }
        let masses = self.integrator.system().masses();
        for (i, m) in masses.iter().enumerate() {
            self.inv_mass[i] = if sleeper.asleep[i] { 0.0 } else { m.recip() };
        }
        for &v in &self.pins.vertices {
            self.inv_mass[v as usize] = 0.0;
        }
        let any = self.state.rest.asleep.contains(&true);
        // While none sleeps, all count as moving; else each attempt marks what does.
        sleeper.moving.fill(true);
        sleeper.awake = any.then(|| self.awake(&memories)).transpose()?;
        self.sleeper = Some(sleeper);
        Ok(())
    }

    /// The dynamics of awake cloth with its part of [`Simulation::memories`].
    fn awake(&self, memories: &[Vec<f64>]) -> Result<Awake, SimError> {
        let (asleep, cloths): (Vec<usize>, Vec<usize>) =
            (0..self.bodies.cloth.len()).partition(|&c| self.state.rest.asleep[c]);
        // By what sleeps alone: the same bits whenever it is asked.
        let (sleeping, its_own) = self.dynamics_of(&asleep, memories)?;
        let own = |all: &[Vec3]| its_own.iter().map(|&i| all[i]).collect::<Vec<_>>();
        let energy = sleeping.system().energy(&own(&self.state.x), &own(&self.state.v));
        let mut awake =
            Awake { integrator: None, cloths, vertices: vec![], pins: vec![], pin_rows: vec![], energy };
        if awake.cloths.is_empty() {
            return Ok(awake);
        }
        let (integrator, vertices) = self.dynamics_of(&awake.cloths, memories)?;
        for (row, &v) in self.pins.vertices.iter().enumerate() {
            if let Ok(own) = vertices.binary_search(&(v as usize)) {
                awake.pins.push(own as u32);
                awake.pin_rows.push(row);
            }
        }
        (awake.integrator, awake.vertices) = (Some(integrator), vertices);
        Ok(awake)
    }

    /// The dynamics of some cloths by themselves, and the vertex of each of its own.
    fn dynamics_of(
        &self,
        cloths: &[usize],
        memories: &[Vec<f64>],
    ) -> Result<(Integrator, Vec<usize>), SimError> {
        let (mut vertices, mut parts) = (Vec::new(), Vec::new());
        for &c in cloths {
            let body = &self.bodies.cloth[c];
            parts.push(ClothPart {
                mesh: &body.mesh,
                topology: &body.topology,
                rest: &body.rest,
                material: &body.material,
                first_vertex: vertices.len(),
                triangles: None,
            });
            vertices.extend(body.first_vertex..body.first_vertex + body.x.len());
        }
        let error =
            |error: cloth_core::CoreError| SimError::InvalidScene(plan::core_error(&self.scene, &error));
        let environment = crate::simulation::environment(&self.scene);
        let mut system = ClothSystem::new(&parts, &environment, vertices.len()).map_err(error)?;
        crate::simulation::keep_history(&self.scene, &mut system).map_err(error)?;
        let params = *self.integrator.params();
        let mut integrator = Integrator::new(system, params, Arc::clone(&self.pool)).map_err(error)?;
        let theirs = self.remembering().zip(memories).filter(|(cloth, _)| cloths.contains(cloth));
        let own: Vec<f64> = theirs.flat_map(|(_, memory)| memory).copied().collect();
        integrator.set_memory(&own).map_err(error)?;
        Ok((integrator, vertices))
    }

    /// Each hinge of a bending law with memory as it stands; none where no material asks for memory.
    pub fn hinges(&self) -> Vec<cloth_core::bending::HingeState> {
        let mut hinges = self.integrator.system().hinge_states(&self.state.x);
        let Some(awake) = self.sleeper.as_ref().and_then(|s| s.awake.as_ref()) else { return hinges };
        let Some(integrator) = &awake.integrator else { return hinges };
        let own = integrator.system().hinge_states(&awake.gather(&self.state.x));
        let is_awake = |hinge: &cloth_core::bending::HingeState| {
            awake.vertices.binary_search(&(hinge.vertices[0] as usize)).is_ok()
        };
        for (hinge, mine) in hinges.iter_mut().filter(|h| is_awake(h)).zip(own) {
            *hinge = cloth_core::bending::HingeState { vertices: hinge.vertices, ..mine };
        }
        hinges
    }
}
