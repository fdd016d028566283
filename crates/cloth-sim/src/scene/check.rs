//! Value ranges and what belongs together, as far as the scene alone can tell.

use super::{Cloth, Collider, ContactMethod, Effects, Keyframe, Pin, Rotation, Scene, SceneError};
use crate::device::method_names;

impl Scene {
    /// Refuses values out of range, names that are not known or not unique, and keys that exclude each other.
    ///
    /// # Errors
    /// The first defect, with file and line where the scene was read from a file.
    pub fn check(&self) -> Result<(), SceneError> {
        if let Some(g) = self.gravity {
            self.finite("gravity", &g, "m/s²")?;
        }
        self.positive("duration", self.duration, "s")?;
        self.check_steps()?;
        self.positive("time.newton_tolerance", self.time.newton_tolerance, "")?;
        self.at_least_one("time.newton_max_iterations", self.time.newton_max_iterations)?;
        self.at_least_one("time.bending_substeps", self.time.bending_substeps)?;
        if self.time.max_halvings > MAX_HALVINGS {
            return Err(self.error("time.max_halvings", "0 to 16", self.time.max_halvings.to_string()));
        }
        // A relative residual of 1 is what no work at all reaches.
        let tolerance = self.solver.tolerance;
        if !(tolerance > 0.0 && tolerance < 1.0) {
            return Err(self.error("solver.tolerance", "a number > 0 and < 1", tolerance.to_string()));
        }
        self.at_least_one("solver.max_iterations", self.solver.max_iterations)?;
        self.finite("air.wind", &self.air.wind, "m/s")?;
        self.not_negative("air.density", self.air.density, "kg/m³")?;
        self.not_negative("air.drag", self.air.drag, "")?;
        self.not_negative("air.lift", self.air.lift, "")?;
        self.not_negative("air.damping", self.air.damping, "1/s")?;
        self.positive("output.fps", self.output.fps, "1/s")?;
        self.not_negative("output.checkpoint_interval", self.output.checkpoint_interval, "s")?;
        self.check_contact()?;
        self.check_effects()?;
        self.check_names()?;
        self.check_all_friction()?;
        self.check_strain_limits()?;
        for (i, cloth) in self.cloth.iter().enumerate() {
            self.check_cloth(cloth, &format!("cloth[{i}]"))?;
        }
        for (i, collider) in self.collider.iter().enumerate() {
            self.check_collider(collider, &format!("collider[{i}]"))?;
        }
        self.check_generated()?;
        self.check_sizes()
    }

    fn check_steps(&self) -> Result<(), SceneError> {
        let time = &self.time;
        if let Some(dt) = time.fixed() {
            self.positive("time.dt", dt, "s")?;
        }
        self.positive("time.dt_tolerance", time.dt_tolerance, "m")?;
        self.positive("time.dt_max", time.dt_max, "s")?;
        self.positive("time.dt_min", time.dt_min, "s")?;
        if time.fixed().is_none() && time.dt_min > time.dt_max {
            let expected = format!("at most time.dt_max = {} s", time.dt_max);
            return Err(self.error("time.dt_min", expected, time.dt_min.to_string()));
        }
        Ok(())
    }

    fn check_contact(&self) -> Result<(), SceneError> {
        let Some(contact) = &self.contact else { return Ok(()) };
        self.positive("contact.thickness", contact.thickness, "m")?;
        self.not_negative("contact.repulsion_stiffness", contact.repulsion_stiffness, "N/m")?;
        self.at_least_one("contact.max_passes", contact.max_passes)?;
        let scheme = self.time.integrator;
        if contact.method == ContactMethod::Constraints && scheme.is_explicit() {
            let got = format!("\"constraints\" with time.integrator = {}", quoted(&scheme));
            return Err(self.error("contact.method", CONSTRAINED, got));
        }
        let detectors = method_names();
        if !detectors.contains(&contact.detector.as_str()) {
            let got = format!("\"{}\"", contact.detector);
            return Err(self
                .error("contact.detector", format!("one of {detectors:?}"), got)
                .with_nearest(&contact.detector, detectors.into_iter()));
        }
        Ok(())
    }

    fn check_effects(&self) -> Result<(), SceneError> {
        let Effects { friction_tolerance, history_tolerance, .. } = self.effects;
        for (key, tolerance) in [
            ("effects.friction_tolerance", friction_tolerance),
            ("effects.history_tolerance", history_tolerance),
        ] {
            if !(tolerance > 0.0 && tolerance < 1.0) {
                return Err(self.error(key, "a number > 0 and < 1", tolerance.to_string()));
            }
        }
        let Some(sleep) = &self.effects.sleep else { return Ok(()) };
        self.positive("effects.sleep.speed", sleep.speed, "m/s")?;
        self.positive("effects.sleep.time", sleep.time, "s")?;
        if let Some(i) = self.cloth.iter().position(|c| !(c.regions.is_empty() && c.seams.is_empty())) {
            let got = format!("effects.sleep with cloth[{i}].regions or seams");
            return Err(self.error("effects.sleep", "cloth without regions and seams", got));
        }
        if self.contact.as_ref().is_some_and(|c| c.method == ContactMethod::Constraints) {
            let got = "effects.sleep with contact.method = \"constraints\"";
            return Err(self.error("effects.sleep", "contact.method = \"velocity-filter\"", got));
        }
        Ok(())
    }

    fn check_names(&self) -> Result<(), SceneError> {
        if self.cloth.is_empty() {
            return Err(self.error("cloth", "at least one piece of cloth", "none"));
        }
        let names = (self.cloth.iter().enumerate().map(|(i, c)| (format!("cloth[{i}].name"), &c.name)))
            .chain(self.collider.iter().enumerate().map(|(i, c)| (format!("collider[{i}].name"), &c.name)));
        let mut seen: Vec<(String, &String)> = Vec::new();
        for (key, name) in names {
            if name.is_empty() {
                return Err(self.error(&key, "a name", "an empty string"));
            }
            if let Some((first, _)) = seen.iter().find(|(_, other)| *other == name) {
                return Err(self.error(
                    &key,
                    "a name that no other body has",
                    format!("\"{name}\" ({first} too)"),
                ));
            }
            seen.push((key, name));
        }
        Ok(())
    }

    fn check_cloth(&self, cloth: &Cloth, key: &str) -> Result<(), SceneError> {
        self.resolve_material(&cloth.material, &format!("{key}.material"))?;
        self.check_garment(cloth, key)?;
        self.finite(&format!("{key}.warp"), &cloth.warp, "")?;
        if cloth.warp == [0.0; 3] {
            return Err(self.error(
                &format!("{key}.warp"),
                "a direction of any length but zero",
                "[0, 0, 0]",
            ));
        }
        self.finite(&format!("{key}.position"), &cloth.position, "m")?;
        self.finite(&format!("{key}.velocity"), &cloth.velocity, "m/s")?;
        self.check_rotation(cloth.rotation.as_ref(), &format!("{key}.rotation"))?;
        for (i, pin) in cloth.pins.iter().enumerate() {
            self.check_pin(pin, &format!("{key}.pins[{i}]"))?;
        }
        Ok(())
    }

    fn check_pin(&self, pin: &Pin, key: &str) -> Result<(), SceneError> {
        match (&pin.vertices, &pin.region) {
            (Some(_), Some(_)) => return Err(self.error(key, "either vertices or box", "both")),
            (None, None) => return Err(self.error(key, "vertices or box", "neither")),
            (None, Some(region)) => self.check_box(region, &format!("{key}.box"))?,
            (Some(vertices), None) if vertices.is_empty() => {
                return Err(self.error(&format!("{key}.vertices"), "at least one vertex", "none"));
            }
            _ => {}
        }
        if let Some(name) = &pin.collider {
            if !pin.keyframes.is_empty() {
                return Err(self.error(key, "either keyframes or collider", "both"));
            }
            if !self.collider.iter().any(|c| &c.name == name) {
                let known: Vec<&str> = self.collider.iter().map(|c| c.name.as_str()).collect();
                return Err(self
                    .error(
                        &format!("{key}.collider"),
                        format!("the name of a collider, one of {known:?}"),
                        format!("\"{name}\""),
                    )
                    .with_nearest(name, known.into_iter()));
            }
        }
        if let Some(pivot) = &pin.pivot {
            self.finite(&format!("{key}.pivot"), pivot, "m")?;
        }
        self.check_keyframes(&pin.keyframes, &format!("{key}.keyframes"))
    }

    fn check_collider(&self, collider: &Collider, key: &str) -> Result<(), SceneError> {
        let given = [collider.shape.is_some(), collider.mesh.is_some(), collider.sequence.is_some()];
        let count = given.iter().filter(|g| **g).count();
        if count != 1 {
            let got = if count == 0 { "none" } else { "more than one" };
            return Err(self.error(key, "exactly one of shape, mesh, sequence", got));
        }
        if let Some(sequence) = &collider.sequence {
            let key = format!("{key}.sequence");
            if sequence.file.is_some() == sequence.asset.is_some() {
                let got = if sequence.file.is_some() { "both" } else { "neither" };
                return Err(self.error(&key, "exactly one of file, asset", got));
            }
            if let Some(fps) = sequence.fps {
                self.positive(&format!("{key}.fps"), fps, "1/s")?;
            }
            if let Some(scale) = sequence.scale {
                self.positive(&format!("{key}.scale"), scale, "m")?;
            }
            let of_files = [
                ("scale", sequence.scale.is_some()),
                ("up", sequence.up.is_some()),
                ("animation", sequence.animation.is_some()),
                ("part", sequence.part.is_some()),
            ];
            if let Some((name, _)) = of_files.into_iter().find(|(_, given)| *given && sequence.file.is_none())
            {
                return Err(self.error(&format!("{key}.{name}"), "nothing without a file", "a value"));
            }
            self.finite(&format!("{key}.start"), &[sequence.start], "s")?;
            if !collider.keyframes.is_empty() {
                return Err(self.error(&format!("{key}.keyframes"), "none beside a sequence", "some"));
            }
        }
        self.finite(&format!("{key}.position"), &collider.position, "m")?;
        self.check_rotation(collider.rotation.as_ref(), &format!("{key}.rotation"))?;
        self.check_keyframes(&collider.keyframes, &format!("{key}.keyframes"))?;
        Ok(())
    }

    fn check_keyframes(&self, keyframes: &[Keyframe], key: &str) -> Result<(), SceneError> {
        for (i, frame) in keyframes.iter().enumerate() {
            let key = format!("{key}[{i}]");
            self.finite(&format!("{key}.time"), &[frame.time], "s")?;
            if i > 0 && frame.time <= keyframes[i - 1].time {
                return Err(self.error(
                    &format!("{key}.time"),
                    format!("a time later than {} s", keyframes[i - 1].time),
                    format!("{}", frame.time),
                ));
            }
            if let Some(position) = &frame.position {
                self.finite(&format!("{key}.position"), position, "m")?;
            }
            self.check_rotation(frame.rotation.as_ref(), &format!("{key}.rotation"))?;
        }
        Ok(())
    }

    fn check_rotation(&self, rotation: Option<&Rotation>, key: &str) -> Result<(), SceneError> {
        let Some(rotation) = rotation else { return Ok(()) };
        self.finite(&format!("{key}.angle"), &[rotation.angle], "rad")?;
        self.finite(&format!("{key}.axis"), &rotation.axis, "")?;
        if rotation.axis == [0.0; 3] {
            return Err(self.error(&format!("{key}.axis"), "an axis of any length but zero", "[0, 0, 0]"));
        }
        Ok(())
    }

    pub(super) fn finite(&self, key: &str, values: &[f64], unit: &str) -> Result<(), SceneError> {
        match values.iter().find(|x| !x.is_finite()) {
            Some(x) => Err(self.error(key, with_unit("finite numbers", unit), format!("{x}"))),
            None => Ok(()),
        }
    }

    pub(super) fn positive(&self, key: &str, value: f64, unit: &str) -> Result<(), SceneError> {
        if value.is_finite() && value > 0.0 {
            return Ok(());
        }
        Err(self.error(key, with_unit("a finite number > 0", unit), format!("{value}")))
    }

    pub(super) fn not_negative(&self, key: &str, value: f64, unit: &str) -> Result<(), SceneError> {
        if value.is_finite() && value >= 0.0 {
            return Ok(());
        }
        Err(self.error(key, with_unit("a finite number ≥ 0", unit), format!("{value}")))
    }

    fn at_least_one(&self, key: &str, value: usize) -> Result<(), SceneError> {
        if value > 0 { Ok(()) } else { Err(self.error(key, "an integer ≥ 1", "0")) }
    }
}

/// 2¹⁶ sub-steps of one step; a step that still fails is stuck.
const MAX_HALVINGS: u32 = 16;

/// What contact constraints work with.
const CONSTRAINED: &str = "\"velocity-filter\", or \"constraints\" with one of the implicit integrators (\"implicit-euler\", \
                           \"implicit-newton\", \"semi-implicit\")";

/// The name of a choice as a scene file writes it, in quotes.
fn quoted(value: &impl serde::Serialize) -> String {
    serde_json::to_value(value).map_or_else(|_| String::new(), |name| name.to_string())
}

fn with_unit(expected: &str, unit: &str) -> String {
    if unit.is_empty() { expected.into() } else { format!("{expected} [{unit}]") }
}
