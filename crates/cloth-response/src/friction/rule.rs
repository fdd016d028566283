//! Which law a pair of bodies has.

use super::law::FrictionLaw;
use crate::ResponseError;
use cloth_collision::{Body, CollisionMesh};

/// The friction law of each pair of bodies.
///
/// Bodies are those of the collision mesh, in its order. The order within a pair does not matter.
#[derive(Debug, Clone, PartialEq)]
pub struct FrictionRule {
    laws: Vec<FrictionLaw>,
    pairs: Pairs,
}

/// How a pair finds its entry in the list of laws.
#[derive(Debug, Clone, PartialEq)]
enum Pairs {
    Uniform,
    /// 0: both are cloth; 1: one is a collider.
    ByKind,
    /// `index[a · bodies + b]`, symmetric.
    Table {
        bodies: usize,
        index: Vec<u16>,
    },
}

impl Default for FrictionRule {
    /// Coulomb with 0.2 between cloth and 0.3 between cloth and colliders.
    fn default() -> Self {
        Self::by_kind(FrictionLaw::Coulomb { mu_c: 0.2 }, FrictionLaw::Coulomb { mu_c: 0.3 })
    }
}

impl FrictionRule {
    /// One law for all pairs.
    pub fn uniform(law: FrictionLaw) -> Self {
        Self { laws: vec![law], pairs: Pairs::Uniform }
    }

    /// One law for cloth against itself and other cloth, one for cloth against colliders.
    pub fn by_kind(cloth: FrictionLaw, collider: FrictionLaw) -> Self {
        Self { laws: vec![cloth, collider], pairs: Pairs::ByKind }
    }

    /// A law for each pair of `bodies` bodies: `f(a, b)` is asked once for each a ≤ b.
    ///
    /// Equal laws are kept once. Of more than 65,536 different laws (more than 361 bodies with a law of its own for each
    /// pair) [`FrictionRule::check`] refuses the rule.
    pub fn from_pairs(bodies: usize, f: impl Fn(usize, usize) -> FrictionLaw) -> Self {
        let mut laws: Vec<FrictionLaw> = Vec::new();
        let mut index = vec![0; bodies * bodies];
        for a in 0..bodies {
            for b in a..bodies {
                let law = f(a, b);
                let known = laws.iter().position(|l| *l == law).unwrap_or_else(|| {
                    laws.push(law);
                    laws.len() - 1
                });
                let entry = u16::try_from(known).unwrap_or(u16::MAX);
                (index[a * bodies + b], index[b * bodies + a]) = (entry, entry);
            }
        }
        Self { laws, pairs: Pairs::Table { bodies, index } }
    }

    /// The different laws.
    pub fn laws(&self) -> &[FrictionLaw] {
        &self.laws
    }

    /// Whether every pair has a Coulomb law: then the response runs the kernel for that alone.
    pub fn is_coulomb(&self) -> bool {
        self.laws.iter().all(|law| matches!(law, FrictionLaw::Coulomb { .. }))
    }

    /// Index in [`FrictionRule::laws`] of the law between bodies `a` and `b` of `bodies`.
    pub fn index(&self, bodies: &[Body], a: u32, b: u32) -> usize {
        match &self.pairs {
            Pairs::Uniform => 0,
            Pairs::ByKind => usize::from(!(bodies[a as usize].dynamic && bodies[b as usize].dynamic)),
            Pairs::Table { bodies: count, index } => usize::from(index[a as usize * count + b as usize]),
        }
    }

    /// The law between bodies `a` and `b` of `bodies`.
    pub fn law(&self, bodies: &[Body], a: u32, b: u32) -> &FrictionLaw {
        &self.laws[self.index(bodies, a, b)]
    }

    /// [`FrictionRule::index`], given one vertex of either side.
    pub(crate) fn index_of(&self, mesh: &CollisionMesh, first: u32, second: u32) -> usize {
        self.index(&mesh.bodies, mesh.vertex_body[first as usize], mesh.vertex_body[second as usize])
    }

    /// Checks every law, and that a table fits the number of bodies.
    ///
    /// # Errors
    /// [`ResponseError::Parameter`], [`ResponseError::Length`].
    pub fn check(&self, body_count: usize) -> Result<(), ResponseError> {
        self.laws.iter().try_for_each(FrictionLaw::check)?;
        if self.laws.len() > usize::from(u16::MAX) + 1 {
            return Err(ResponseError::Parameter {
                name: "friction",
                expected: "at most 65536 different laws",
                got: self.laws.len() as f64,
            });
        }
        match self.pairs {
            Pairs::Table { bodies, .. } if bodies != body_count => {
                Err(ResponseError::Length { name: "friction", expected: body_count, got: bodies })
            }
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CLOTH: Body = Body { dynamic: true, self_collision: true };
    const COLLIDER: Body = Body { dynamic: false, self_collision: false };

    fn coulomb(mu_c: f64) -> FrictionLaw {
        FrictionLaw::Coulomb { mu_c }
    }

    /// Each pair has its own law, whichever body comes first.
    #[test]
    fn pairs_find_their_law() {
        let bodies = [CLOTH, CLOTH, COLLIDER];
        let rule = FrictionRule::by_kind(coulomb(0.1), coulomb(0.2));
        for (a, b, mu_c) in [(0, 0, 0.1), (1, 0, 0.1), (0, 2, 0.2), (2, 1, 0.2)] {
            assert_eq!(*rule.law(&bodies, a, b), coulomb(mu_c));
        }
        let rule = FrictionRule::from_pairs(3, |a, b| {
            assert!(a <= b);
            coulomb((a + 10 * b.min(1)) as f64)
        });
        for (a, b, mu_c) in
            [(0, 0, 0.0), (0, 1, 10.0), (1, 0, 10.0), (2, 0, 10.0), (2, 1, 11.0), (2, 2, 12.0)]
        {
            assert_eq!(*rule.law(&bodies, a, b), coulomb(mu_c), "{a} {b}");
        }
        assert_eq!(rule.laws().len(), 4, "equal laws are kept once");
        assert_eq!(*FrictionRule::uniform(coulomb(0.7)).law(&bodies, 2, 1), coulomb(0.7));
    }

    /// A rule is Coulomb only if all of it is; a table for other bodies and a bad law are refused.
    #[test]
    fn rules_are_checked() {
        let mixed =
            FrictionRule::by_kind(coulomb(0.1), FrictionLaw::CoulombStiction { mu_c: 0.1, mu_s: 0.1 });
        assert!(FrictionRule::default().is_coulomb() && !mixed.is_coulomb());
        assert_eq!(mixed.check(7), Ok(()));
        let table = FrictionRule::from_pairs(2, |_, _| coulomb(0.1));
        assert_eq!(table.check(2), Ok(()));
        assert_eq!(table.check(3), Err(ResponseError::Length { name: "friction", expected: 3, got: 2 }));
        assert!(matches!(
            FrictionRule::uniform(coulomb(-1.0)).check(1),
            Err(ResponseError::Parameter { name: "mu_c", .. })
        ));
    }
}
