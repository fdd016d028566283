//! Friction and strain limits of a scene: how they are written, and which entry counts for which pair of bodies.

use super::{Contact, Scene, SceneError};
use crate::friction::{FrictionTable, TableError};
use cloth_response::{FrictionLaw, StrainLimit};
use serde::{Deserialize, Serialize};

/// Friction: a number is the coefficient of Coulomb's law [-], ≥ 0; a table names a law or a published pair.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(untagged)]
pub enum Friction {
    /// Coulomb's law with this coefficient [-], ≥ 0.
    Coefficient(f64),
    /// A law with its parameters.
    Law(FrictionTable),
}

impl Friction {
    /// The law, checked.
    ///
    /// # Errors
    /// [`TableError`]; its key is empty for a plain number.
    pub fn law(&self) -> Result<FrictionLaw, TableError> {
        match self {
            Self::Law(table) => table.law(),
            &Self::Coefficient(mu_c) if mu_c.is_finite() && mu_c >= 0.0 => Ok(FrictionLaw::Coulomb { mu_c }),
            Self::Coefficient(mu_c) => Err(TableError {
                key: "",
                expected: "a finite number ≥ 0".into(),
                got: mu_c.to_string(),
                unknown: None,
            }),
        }
    }
}

/// Friction of two bodies, before all other entries.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PairFriction {
    /// Names of the two bodies, at least one of them cloth; a piece of cloth twice is that cloth against itself.
    pub between: [String; 2],
    /// Friction between them.
    pub friction: Friction,
}

/// How far edges of a piece of cloth may be strained: a number is the largest stretch.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(untagged)]
pub enum StrainLimitSource {
    /// Largest stretch [-], > 0: no edge is longer than (1 + stretch) times its rest length.
    Stretch(f64),
    /// Stretch and compression.
    Both(StrainLimitTable),
}

/// Bounds of the strain of a cloth's edges.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StrainLimitTable {
    /// Largest stretch [-], > 0: no edge is longer than (1 + stretch) times its rest length.
    pub stretch: f64,
    /// Largest compression [-], above 0 and below 1: no edge is shorter than (1 − compression) times its rest length; by
    /// default any, as cloth gives way by folding.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub compression: Option<f64>,
}

impl StrainLimitSource {
    /// The limit.
    pub fn limit(&self) -> StrainLimit {
        match *self {
            Self::Stretch(stretch) => StrainLimit { stretch, compression: None },
            Self::Both(StrainLimitTable { stretch, compression }) => StrainLimit { stretch, compression },
        }
    }
}

impl Scene {
    /// Name of a body; cloth first, in scene order.
    pub(crate) fn body_name(&self, body: usize) -> &str {
        match self.cloth.get(body) {
            Some(cloth) => &cloth.name,
            None => &self.collider[body - self.cloth.len()].name,
        }
    }

    /// The entry that says which friction two bodies have, and its key. Bodies are numbered cloth first, in scene order;
    /// at least one is cloth.
    ///
    /// The most specific entry counts: `contact.pairs`; of cloth and a collider then the collider's `friction`, the
    /// cloth's, the contact's; of cloth and itself the cloth's `self_friction`, the contact's. Two pieces of cloth each
    /// bring the `self_friction` that they have against themselves, and the smoother one counts: the lower coefficient at
    /// rest, then the lower one of sliding, then the first in the scene.
    pub(crate) fn friction_entry<'a>(
        &'a self,
        contact: &'a Contact,
        a: usize,
        b: usize,
    ) -> (String, &'a Friction) {
        let (a, b) = (a.min(b), a.max(b));
        let names = [self.body_name(a), self.body_name(b)];
        let same = |pair: &PairFriction| {
            let [first, second] = [&pair.between[0], &pair.between[1]];
            (first == names[0] && second == names[1]) || (first == names[1] && second == names[0])
        };
        if let Some(i) = contact.pairs.iter().position(same) {
            return (format!("contact.pairs[{i}].friction"), &contact.pairs[i].friction);
        }
        let own = |i: usize| match &self.cloth[i].self_friction {
            Some(own) => (format!("cloth[{i}].self_friction"), own),
            None => ("contact.self_friction".into(), &contact.self_friction),
        };
        if b >= self.cloth.len() {
            let collider = b - self.cloth.len();
            return match (&self.collider[collider].friction, &self.cloth[a].friction) {
                (Some(own), _) => (format!("collider[{collider}].friction"), own),
                (None, Some(own)) => (format!("cloth[{a}].friction"), own),
                (None, None) => ("contact.friction".into(), &contact.friction),
            };
        }
        let (first, second) = (own(a), own(b));
        let size = |friction: &Friction| {
            friction.law().map_or((0.0, 0.0), |law| (law.static_coefficient(), law.kinetic_coefficient()))
        };
        if size(second.1) < size(first.1) { second } else { first }
    }

    /// The friction law of two bodies of a checked scene, numbered as in [`Scene::friction_entry`]; without friction for
    /// two colliders, which never meet.
    pub(crate) fn friction_law(&self, contact: &Contact, a: usize, b: usize) -> FrictionLaw {
        const NONE: FrictionLaw = FrictionLaw::Coulomb { mu_c: 0.0 };
        if a.min(b) >= self.cloth.len() {
            return NONE;
        }
        let law = self.friction_entry(contact, a, b).1.law().unwrap_or(NONE);
        // A law that never holds is none: it would only call for the kernel that knows all laws.
        let drags = matches!(law, FrictionLaw::Viscous { f_v, .. } if f_v > 0.0);
        if law.static_coefficient() > 0.0 || drags { law } else { NONE }
    }

    /// Refuses friction that is no law, and pairs that are none.
    pub(super) fn check_all_friction(&self) -> Result<(), SceneError> {
        for (i, cloth) in self.cloth.iter().enumerate() {
            for (name, own) in [("friction", &cloth.friction), ("self_friction", &cloth.self_friction)] {
                if let Some(own) = own {
                    self.check_friction(&format!("cloth[{i}].{name}"), own)?;
                }
            }
        }
        for (i, collider) in self.collider.iter().enumerate() {
            if let Some(own) = &collider.friction {
                self.check_friction(&format!("collider[{i}].friction"), own)?;
            }
        }
        let Some(contact) = &self.contact else { return Ok(()) };
        self.check_friction("contact.friction", &contact.friction)?;
        self.check_friction("contact.self_friction", &contact.self_friction)?;
        for (i, pair) in contact.pairs.iter().enumerate() {
            self.check_pair(&pair.between, &format!("contact.pairs[{i}].between"), &contact.pairs[..i])?;
            self.check_friction(&format!("contact.pairs[{i}].friction"), &pair.friction)?;
        }
        Ok(())
    }

    fn check_friction(&self, key: &str, friction: &Friction) -> Result<(), SceneError> {
        let Err(error) = friction.law() else { return Ok(()) };
        let key = if error.key.is_empty() { key.into() } else { format!("{key}.{}", error.key) };
        let refused = self.error(&key, error.expected, error.got);
        Err(match error.unknown {
            Some((got, known)) => refused.with_nearest(&got, known.into_iter()),
            None => refused,
        })
    }

    fn check_pair(
        &self,
        between: &[String; 2],
        key: &str,
        before: &[PairFriction],
    ) -> Result<(), SceneError> {
        let is_cloth = |name: &String| self.cloth.iter().any(|c| &c.name == name);
        let names = || {
            let cloth = self.cloth.iter().map(|c| c.name.as_str());
            cloth.chain(self.collider.iter().map(|c| c.name.as_str()))
        };
        for (i, name) in between.iter().enumerate() {
            if !names().any(|known| known == name) {
                let known: Vec<&str> = names().collect();
                let expected = format!("the name of a body, one of {known:?}");
                return Err(self
                    .error(&format!("{key}[{i}]"), expected, format!("\"{name}\""))
                    .with_nearest(name, names()));
            }
        }
        let got = || format!("\"{}\" and \"{}\"", between[0], between[1]);
        if !between.iter().any(is_cloth) {
            return Err(self.error(key, "at least one piece of cloth", got()));
        }
        let mut sorted = between.clone();
        sorted.sort();
        for (j, other) in before.iter().enumerate() {
            let mut same = other.between.clone();
            same.sort();
            if same == sorted {
                let expected = format!("a pair that no other entry has (contact.pairs[{j}] has it)");
                return Err(self.error(key, expected, got()));
            }
        }
        Ok(())
    }

    /// Refuses strain limits out of range.
    pub(super) fn check_strain_limits(&self) -> Result<(), SceneError> {
        use cloth_response::ResponseError;
        for (i, cloth) in self.cloth.iter().enumerate() {
            let Some(source) = &cloth.strain_limit else { continue };
            let key = format!("cloth[{i}].strain_limit");
            match (source.limit().check(), source) {
                (Ok(()), _) => {}
                (Err(ResponseError::Parameter { expected, got, .. }), StrainLimitSource::Stretch(_)) => {
                    return Err(self.error(&key, expected, format!("{got}")));
                }
                (Err(ResponseError::Parameter { name, expected, got }), StrainLimitSource::Both(_)) => {
                    return Err(self.error(&format!("{key}.{name}"), expected, format!("{got}")));
                }
                (Err(other), _) => return Err(self.error(&key, "a strain limit", other.to_string())),
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCENE: &str = r#"
duration = 1.0
[contact]
friction = 0.31
self_friction = 0.21
[[contact.pairs]]
between = ["wall", "b"]
friction = { law = "coulomb-stiction", mu_c = 0.32, mu_s = 0.4 }
[[contact.pairs]]
between = ["c", "c"]
friction = 0.22
[[contact.pairs]]
between = ["a", "c"]
friction = 0.23
[[cloth]]
name = "a"
mesh = { generator = "disc", radius = 1.0, rings = 3 }
material = "cotton"
friction = 0.33
[[cloth]]
name = "b"
mesh = { generator = "disc", radius = 1.0, rings = 3 }
material = "cotton"
friction = 0.34
self_friction = { law = "coulomb-stiction", mu_c = 0.1, mu_s = 0.25 }
[[cloth]]
name = "c"
mesh = { generator = "disc", radius = 1.0, rings = 3 }
material = "cotton"
self_friction = 0.24
[[collider]]
name = "wall"
shape = { type = "box", half_extents = [1.0, 1.0, 1.0] }
friction = 0.35
[[collider]]
name = "floor"
shape = { type = "plane", half_size = 1.0 }
"#;

    #[test]
    fn the_most_specific_entry_counts() {
        let scene = Scene::parse_toml(SCENE, "test.toml").unwrap();
        let contact = scene.contact.as_ref().unwrap();
        let (a, b, c, wall, floor) = (0, 1, 2, 3, 4);
        for (pair, key, mu_c) in [
            ((b, wall), "contact.pairs[0].friction", 0.32),
            ((a, wall), "collider[0].friction", 0.35),
            ((c, wall), "collider[0].friction", 0.35),
            ((a, floor), "cloth[0].friction", 0.33),
            ((b, floor), "cloth[1].friction", 0.34),
            ((c, floor), "contact.friction", 0.31),
            ((a, a), "contact.self_friction", 0.21),
            ((b, b), "cloth[1].self_friction", 0.1),
            ((c, c), "contact.pairs[1].friction", 0.22),
            // The smoother at rest, 0.21 of a and 0.24 of c, against the 0.25 of b.
            ((a, b), "contact.self_friction", 0.21),
            ((b, c), "cloth[2].self_friction", 0.24),
            ((a, c), "contact.pairs[2].friction", 0.23),
        ] {
            for (i, j) in [pair, (pair.1, pair.0)] {
                assert_eq!(scene.friction_entry(contact, i, j).0, key, "{i} {j}");
                assert_eq!(scene.friction_law(contact, i, j).kinetic_coefficient(), mu_c, "{i} {j}");
            }
        }
        assert_eq!(scene.friction_law(contact, b, wall).static_coefficient(), 0.4);
        assert_eq!(scene.friction_law(contact, wall, floor).static_coefficient(), 0.0);
    }

    /// Else the response would run the kernel that knows all laws, for nothing.
    #[test]
    fn a_law_that_never_holds_is_none() {
        let law = |table: &str| {
            let text = SCENE.replacen("friction = 0.31", &format!("friction = {{ {table} }}"), 1);
            let scene = Scene::parse_toml(&text, "test.toml").unwrap();
            scene.friction_law(scene.contact.as_ref().unwrap(), 2, 4)
        };
        let stribeck = "law = \"stribeck\", v_s = 0.1, delta_s = 1.0";
        let viscous = "law = \"viscous\", v_s = 0.1, delta_s = 1.0, delta_v = 1.0";
        for table in [
            "law = \"coulomb-stiction\", mu_c = 0.0, mu_s = 0.0".to_owned(),
            format!("{stribeck}, mu_c = 0.0, mu_s = 0.0"),
            format!("{viscous}, mu_c = 0.0, mu_s = 0.0, f_v = 0.0"),
        ] {
            assert_eq!(law(&table), FrictionLaw::Coulomb { mu_c: 0.0 }, "{table}");
        }
        assert_eq!(law(&format!("{stribeck}, mu_c = 0.0, mu_s = 0.1")).name(), "stribeck");
        assert_eq!(law(&format!("{viscous}, mu_c = 0.0, mu_s = 0.0, f_v = 1.0")).name(), "viscous");
    }

    #[test]
    fn of_equal_cloth_the_smoother_in_motion_counts_then_the_first() {
        let text = SCENE.replace("self_friction = 0.24", "self_friction = 0.25");
        let scene = Scene::parse_toml(&text, "test.toml").unwrap();
        let contact = scene.contact.as_ref().unwrap();
        assert_eq!(scene.friction_entry(contact, 1, 2).0, "cloth[1].self_friction");
        let same = "self_friction = { law = \"coulomb-stiction\", mu_c = 0.1, mu_s = 0.25 }";
        let scene = Scene::parse_toml(&SCENE.replace("self_friction = 0.24", same), "test.toml").unwrap();
        let contact = scene.contact.as_ref().unwrap();
        assert_eq!(scene.friction_entry(contact, 1, 2).0, "cloth[1].self_friction");
    }
}
