//! A friction law as a table: which keys each law reads, and the law that they make.

use super::pairs;
use cloth_response::{FrictionLaw, ResponseError};
use serde::{Deserialize, Serialize};

/// Name of a friction law.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum LawName {
    /// One coefficient, at rest and sliding.
    Coulomb,
    /// A larger coefficient at rest.
    CoulombStiction,
    /// From the coefficient at rest down to that of sliding as the speed grows.
    Stribeck,
    /// The same and viscous friction.
    Viscous,
}

impl LawName {
    /// All laws.
    pub const ALL: [Self; 4] = [Self::Coulomb, Self::CoulombStiction, Self::Stribeck, Self::Viscous];

    /// The name in scene files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Coulomb => "coulomb",
            Self::CoulombStiction => "coulomb-stiction",
            Self::Stribeck => "stribeck",
            Self::Viscous => "viscous",
        }
    }

    /// The law of this name.
    ///
    /// # Errors
    /// [`TableError`] at `law` with the nearest name.
    pub fn parse(name: &str) -> Result<Self, TableError> {
        Self::ALL.into_iter().find(|law| law.name() == name).ok_or_else(|| TableError {
            key: "law",
            expected: format!("one of {:?}", Self::ALL.map(Self::name)),
            got: format!("\"{name}\""),
            unknown: Some((name.into(), Self::ALL.map(Self::name).to_vec())),
        })
    }

    /// The parameters that it reads.
    fn keys(self) -> &'static [&'static str] {
        match self {
            Self::Coulomb => &KEYS[..1],
            Self::CoulombStiction => &KEYS[..2],
            Self::Stribeck => &KEYS[..4],
            Self::Viscous => &KEYS,
        }
    }
}

const KEYS: [&str; 6] = ["mu_c", "mu_s", "v_s", "delta_s", "f_v", "delta_v"];

/// A value of a table that is not what it should be.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TableError {
    /// Its key.
    pub key: &'static str,
    /// What was expected, with the unit.
    pub expected: String,
    /// What came.
    pub got: String,
    /// A name that is not known, and those that are.
    pub unknown: Option<(String, Vec<&'static str>)>,
}

/// A friction law and its parameters, or a pair of the published ones.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FrictionTable {
    /// The law; with `pair` it may be left out and is then "coulomb-stiction".
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub law: Option<LawName>,
    /// Name of a published pair, such as "cotton-skin-forearm", in place of `mu_c` and `mu_s`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pair: Option<String>,
    /// Coefficient μ_c of sliding [-], ≥ 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mu_c: Option<f64>,
    /// Coefficient μ_s at rest [-], ≥ `mu_c`; all laws but "coulomb".
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mu_s: Option<f64>,
    /// Stribeck speed [m/s], > 0: there 1/e of the excess of `mu_s` over `mu_c` is left; "stribeck" and "viscous".
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub v_s: Option<f64>,
    /// Shape of the decrease [-], above 0 and at most 2; "stribeck" and "viscous".
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub delta_s: Option<f64>,
    /// Viscous coefficient per area of contact [N/m² (s/m)^`delta_v`], ≥ 0; "viscous".
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub f_v: Option<f64>,
    /// Exponent of the speed [-], above 0 and at most 2; "viscous".
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub delta_v: Option<f64>,
}

impl FrictionTable {
    /// The law that the table says, checked.
    ///
    /// # Errors
    /// [`TableError`]: no law, a parameter that is missing, out of range or not the law's, a pair that is not known.
    pub fn law(&self) -> Result<FrictionLaw, TableError> {
        let fail = |key, expected: &str, got: String| {
            Err(TableError { key, expected: expected.into(), got, unknown: None })
        };
        let law = match (self.law, &self.pair) {
            (Some(law), _) => law,
            (None, Some(_)) => LawName::CoulombStiction,
            (None, None) => {
                let expected = format!("one of {:?}", LawName::ALL.map(LawName::name));
                return fail("law", &expected, "nothing".into());
            }
        };
        let mut given = [self.mu_c, self.mu_s, self.v_s, self.delta_s, self.f_v, self.delta_v];
        if let Some(name) = &self.pair {
            let Some(pair) = pairs::pair(name) else {
                let known: Vec<_> = pairs::names().collect();
                return Err(TableError {
                    key: "pair",
                    expected: format!("one of {known:?}"),
                    got: format!("\"{name}\""),
                    unknown: Some((name.clone(), known)),
                });
            };
            if let Some((key, got)) = KEYS.into_iter().zip(given).take(2).find_map(|(k, v)| v.map(|v| (k, v)))
            {
                return fail(key, "no value beside pair, which has it", format!("{got}"));
            }
            given[0] = Some(pair.kinetic.value);
            given[1] = (law != LawName::Coulomb).then_some(pair.fixed.value);
        }
        let reads = law.keys();
        for (key, value) in KEYS.into_iter().zip(given) {
            match value {
                Some(got) if !reads.contains(&key) => {
                    let expected =
                        format!("no value with law = \"{}\", which reads {}", law.name(), reads.join(", "));
                    return fail(key, &expected, format!("{got}"));
                }
                None if reads.contains(&key) => {
                    let expected = format!("a value, for law = \"{}\" reads it", law.name());
                    return fail(key, &expected, "nothing".into());
                }
                _ => {}
            }
        }
        let [mu_c, mu_s, v_s, delta_s, f_v, delta_v] = given.map(Option::unwrap_or_default);
        let law = match law {
            LawName::Coulomb => FrictionLaw::Coulomb { mu_c },
            LawName::CoulombStiction => FrictionLaw::CoulombStiction { mu_c, mu_s },
            LawName::Stribeck => FrictionLaw::Stribeck { mu_c, mu_s, v_s, delta_s },
            LawName::Viscous => FrictionLaw::Viscous { mu_c, mu_s, v_s, delta_s, f_v, delta_v },
        };
        match law.check() {
            Ok(()) => Ok(law),
            Err(ResponseError::Parameter { name: "mu_s", got, .. }) => {
                let expected = format!("a finite number ≥ mu_c = {mu_c}");
                fail("mu_s", &expected, format!("{got}"))
            }
            Err(ResponseError::Parameter { name, expected, got }) => fail(name, expected, format!("{got}")),
            Err(other) => fail("law", "a friction law", other.to_string()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn full() -> FrictionTable {
        FrictionTable {
            law: Some(LawName::Viscous),
            pair: None,
            mu_c: Some(0.1),
            mu_s: Some(0.2),
            v_s: Some(0.4),
            delta_s: Some(0.2),
            f_v: Some(3.0),
            delta_v: Some(1.0),
        }
    }

    #[test]
    fn each_law_reads_its_keys_and_no_other() {
        let clear: [fn(&mut FrictionTable); 6] = [
            |t| t.mu_c = None,
            |t| t.mu_s = None,
            |t| t.v_s = None,
            |t| t.delta_s = None,
            |t| t.f_v = None,
            |t| t.delta_v = None,
        ];
        for (law, count) in LawName::ALL.into_iter().zip([1, 2, 4, 6]) {
            let mut table = FrictionTable { law: Some(law), ..full() };
            if count < 6 {
                let error = table.law().unwrap_err();
                assert!(error.key == KEYS[count] && error.expected.contains(law.name()), "{error:?}");
            }
            clear[count..].iter().for_each(|f| f(&mut table));
            assert_eq!(table.law().unwrap().name(), law.name());
            for (f, key) in clear[..count].iter().zip(KEYS) {
                let mut less = table.clone();
                f(&mut less);
                let error = less.law().unwrap_err();
                assert!(error.key == key && error.got == "nothing", "{error:?}");
            }
        }
    }

    #[test]
    fn values_out_of_range_are_named() {
        let refused = |change: fn(&mut FrictionTable)| {
            let mut table = full();
            change(&mut table);
            let error = table.law().unwrap_err();
            (error.key, error.expected, error.got)
        };
        let (key, expected, got) = refused(|t| t.mu_s = Some(0.05));
        assert_eq!((key, expected.as_str(), got.as_str()), ("mu_s", "a finite number ≥ mu_c = 0.1", "0.05"));
        assert_eq!(refused(|t| t.mu_c = Some(-0.1)).0, "mu_c");
        assert_eq!(refused(|t| t.v_s = Some(0.0)).0, "v_s");
        assert!(refused(|t| t.delta_s = Some(2.5)).1.contains('2'));
        assert_eq!(refused(|t| t.delta_s = Some(0.0)).0, "delta_s");
        assert_eq!(refused(|t| t.f_v = Some(-1.0)).0, "f_v");
        assert_eq!(refused(|t| t.delta_v = Some(f64::NAN)).0, "delta_v");
        assert_eq!(refused(|t| t.law = None).0, "law");
    }

    #[test]
    fn a_pair_gives_both_coefficients() {
        let table = FrictionTable { pair: Some("cotton-skin-forearm".into()), ..FrictionTable::default() };
        assert_eq!(table.law(), Ok(FrictionLaw::CoulombStiction { mu_c: 0.25, mu_s: 0.31 }));
        let coulomb = FrictionTable { law: Some(LawName::Coulomb), ..table.clone() };
        assert_eq!(coulomb.law(), Ok(FrictionLaw::Coulomb { mu_c: 0.25 }));
        let twice = FrictionTable { mu_c: Some(0.2), ..table.clone() };
        assert_eq!(twice.law().unwrap_err().key, "mu_c");
        let unknown = FrictionTable { pair: Some("coton-skin-forearm".into()), ..table };
        let error = unknown.law().unwrap_err();
        assert!(error.key == "pair" && error.unknown.is_some_and(|u| u.1.contains(&"cotton-skin-forearm")));
        assert!(LawName::parse("viscous").is_ok() && LawName::parse("viscuous").is_err());
    }
}
