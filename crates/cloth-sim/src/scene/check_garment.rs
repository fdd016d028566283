//! Materials, regions and seams of a cloth, as far as the scene alone can tell.

use super::{BoxRegion, Cloth, MaterialChoice, Region, Scene, SceneError, Seam};
use cloth_core::{CoreError, Material, material::library};

impl Scene {
    pub(super) fn check_garment(&self, cloth: &Cloth, key: &str) -> Result<(), SceneError> {
        for (i, region) in cloth.regions.iter().enumerate() {
            self.check_region(region, &format!("{key}.regions[{i}]"))?;
        }
        for (i, seam) in cloth.seams.iter().enumerate() {
            self.check_seam(seam, &format!("{key}.seams[{i}]"))?;
        }
        Ok(())
    }

    fn check_region(&self, region: &Region, key: &str) -> Result<(), SceneError> {
        self.resolve_material(&region.material, &format!("{key}.material"))?;
        let given = [
            region.group.is_some(),
            region.triangles.is_some(),
            region.vertices.is_some(),
            region.region.is_some(),
        ];
        let count = given.iter().filter(|g| **g).count();
        if count != 1 {
            let got = if count == 0 { "none" } else { "more than one" };
            return Err(self.error(key, "exactly one of group, triangles, vertices, box", got));
        }
        match &region.region {
            Some(region) => self.check_box(region, &format!("{key}.box")),
            None => Ok(()),
        }
    }

    fn check_seam(&self, seam: &Seam, key: &str) -> Result<(), SceneError> {
        if seam.pairs.is_some() == seam.edges.is_some() {
            let got = if seam.pairs.is_some() { "both" } else { "neither" };
            return Err(self.error(key, "exactly one of pairs, edges", got));
        }
        for (i, run) in seam.edges.iter().flatten().enumerate() {
            if run.len() < 2 {
                let got = run.len().to_string();
                return Err(self.error(&format!("{key}.edges[{i}]"), "two vertices at least", got));
            }
        }
        self.not_negative(&format!("{key}.start"), seam.start, "s")?;
        self.not_negative(&format!("{key}.duration"), seam.duration, "s")?;
        match seam.stiffness {
            Some(stiffness) => self.positive(&format!("{key}.stiffness"), stiffness, "N/m"),
            None => Ok(()),
        }
    }

    pub(super) fn check_box(&self, region: &BoxRegion, key: &str) -> Result<(), SceneError> {
        self.finite(&format!("{key}.min"), &region.min, "m")?;
        self.finite(&format!("{key}.max"), &region.max, "m")?;
        if (0..3).any(|a| region.min[a] > region.max[a]) {
            let got = format!("{:?} and {:?}", region.min, region.max);
            return Err(self.error(key, "min ≤ max along each axis", got));
        }
        Ok(())
    }

    /// The parameters of a material, checked; `key` is where the scene names it.
    pub(crate) fn resolve_material(
        &self,
        choice: &MaterialChoice,
        key: &str,
    ) -> Result<Material, SceneError> {
        let (name_key, result) = match choice {
            MaterialChoice::Named(name) => (key.to_owned(), library::named(name)),
            MaterialChoice::Fabric(choice) => (format!("{key}.fabric"), choice.material()),
            MaterialChoice::Given(material) => (key.to_owned(), material.check().map(|()| *material)),
        };
        result.map_err(|error| match error {
            CoreError::UnknownMaterial { got, known } => self
                .error(&name_key, format!("one of {known:?}"), format!("\"{got}\""))
                .with_nearest(&got, known.into_iter()),
            CoreError::Parameter { name, expected, got } => {
                let name = match choice {
                    MaterialChoice::Fabric(_) => name.trim_start_matches("bending."),
                    _ => name,
                };
                self.error(&format!("{key}.{name}"), expected, format!("{got}"))
            }
            CoreError::Missing { name, expected } => {
                self.error(&format!("{key}.{name}"), expected, "nothing")
            }
            other => self.error(key, "a material", other.to_string()),
        })
    }
}
