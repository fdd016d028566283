//! Coefficients of friction of fabric on something, by the name of the pair, each with its source.
//!
//! Friction belongs to a pair of surfaces and to how it was measured: load, speed and moisture change it more than the
//! fibre does. The static coefficient is the force at which sliding starts over the normal force, the kinetic one that
//! which keeps it going.

use cloth_core::material::library::Reference;

/// Where a coefficient comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// Published, and read where it was published.
    Published {
        /// Key of the reference, one of [`SOURCES`].
        key: &'static str,
        /// Where in the reference.
        at: &'static str,
    },
    /// Attributed to a publication, but not read there.
    SecondHand {
        /// Key of the reference, one of [`SOURCES`].
        key: &'static str,
        /// Where it was read.
        at: &'static str,
    },
    /// Not measured on this pair; what it rests on.
    Estimate(&'static str),
}

/// A coefficient of friction \[-\].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coefficient {
    /// The value.
    pub value: f64,
    /// Where it comes from.
    pub source: Source,
}

/// Two surfaces and their coefficients.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// Name, as a scene file has it in `friction = { pair = "…" }`.
    pub name: &'static str,
    /// What slides on what.
    pub about: &'static str,
    /// μ_s, at which sliding starts.
    pub fixed: Coefficient,
    /// μ_c, of sliding; at most μ_s.
    pub kinetic: Coefficient,
}

/// The pair called `name`.
pub fn pair(name: &str) -> Option<&'static Pair> {
    PAIRS.iter().find(|pair| pair.name == name)
}

/// Names of the pairs, in alphabetical order.
pub fn names() -> impl Iterator<Item = &'static str> + Clone {
    PAIRS.iter().map(|pair| pair.name)
}

const fn published(value: f64, key: &'static str, at: &'static str) -> Coefficient {
    Coefficient { value, source: Source::Published { key, at } }
}

const fn second_hand(value: f64, key: &'static str, at: &'static str) -> Coefficient {
    Coefficient { value, source: Source::SecondHand { key, at } }
}

const fn estimate(value: f64, basis: &'static str) -> Coefficient {
    Coefficient { value, source: Source::Estimate(basis) }
}

/// References of the coefficients.
pub const SOURCES: [Reference; 4] = [
    Reference {
        key: "cottenden2008",
        about: "Cottenden, Wong, Cottenden, Farbrot 2008, Development and Validation of a New Method for Measuring Friction \
                between Skin and Nonwoven Materials: ranges of the abstract; static only.",
    },
    Reference {
        key: "lamsal2024",
        about: "Lamsal, Bush 2024, Coefficient of Friction Between Pant Fabrics and Seat Covers: An In-Vivo Experimental \
                Study: ranges of the abstract over five fabrics of trousers.",
    },
    Reference {
        key: "morton2008",
        about: "Morton, Hearle 2008, Physical Properties of Textile Fibres, chapter 25. Attributed to it from memory and not \
                checked: the numbers were read in a lecture script that names no source. Fibres on fibres, not fabrics.",
    },
    Reference {
        key: "temel2022",
        about: "Temel, Johnson, Lloyd 2022, Evaluating the Repeatability of Friction Coefficient Measurements and Tactile \
                Perceptions in Skin–Textile Interactions Across Body Regions: abstract.",
    },
];

const TEMEL: &str = "temel2022";
const LAMSAL: &str = "lamsal2024";
const COTTENDEN: &str = "cottenden2008";
const MORTON: &str = "morton2008";

const SCRIPT: &str = "chapter 25, attributed: read in a lecture script that names no source";
const PRESETS: &str = "what presets of public cloth simulators take; not measured";
const RATIO: &str = "1.2 times the kinetic one, as cotton on the forearm [temel2022]";
const FOUR_FIFTHS: &str = "four fifths of the static one, as cotton on the forearm [temel2022]";

/// In alphabetical order.
#[rustfmt::skip]
static PAIRS: [Pair; 13] = [
    Pair {
        name: "cotton-cotton",
        about: "plain cotton on itself",
        fixed: estimate(0.42, RATIO),
        kinetic: estimate(0.35, PRESETS),
    },
    Pair {
        name: "cotton-skin-chest",
        about: "cotton on dry skin of the chest, the most of six places",
        fixed: published(0.90, TEMEL, "abstract, chest, ±0.19"),
        kinetic: published(0.79, TEMEL, "abstract, chest, ±0.20"),
    },
    Pair {
        name: "cotton-skin-forearm",
        about: "cotton on dry skin of the back of the forearm, the least of six places",
        fixed: published(0.31, TEMEL, "abstract, dorsal forearm, ±0.07"),
        kinetic: published(0.25, TEMEL, "abstract, dorsal forearm, ±0.05"),
    },
    Pair {
        name: "denim-denim",
        about: "denim on itself",
        fixed: estimate(0.6, RATIO),
        kinetic: estimate(0.5, PRESETS),
    },
    Pair {
        name: "nonwoven-skin",
        about: "nonwoven of hygiene products on dry skin of the inside of the forearm",
        fixed: published(0.4, COTTENDEN, "abstract, middle of 0.3 to 0.5, three nonwovens"),
        kinetic: estimate(0.32, FOUR_FIFTHS),
    },
    Pair {
        name: "nonwoven-wet-skin",
        about: "nonwoven of hygiene products on soaked skin of the inside of the forearm",
        fixed: published(1.1, COTTENDEN, "abstract, middle of 0.9 to 1.3, three nonwovens"),
        kinetic: estimate(0.88, FOUR_FIFTHS),
    },
    Pair {
        name: "nylon-fibres",
        about: "nylon fibres on each other",
        fixed: second_hand(0.47, MORTON, SCRIPT),
        kinetic: second_hand(0.40, MORTON, SCRIPT),
    },
    Pair {
        name: "silk-silk",
        about: "light silk on itself",
        fixed: estimate(0.3, RATIO),
        kinetic: estimate(0.25, PRESETS),
    },
    Pair {
        name: "trousers-office-seat",
        about: "fabrics of trousers, worn, on the woven cover of an office chair",
        fixed: published(0.392, LAMSAL, "abstract, middle of 0.336 to 0.448"),
        kinetic: estimate(0.31, "the abstract reports a substantial drop after sliding, not how large: four fifths"),
    },
    Pair {
        name: "trousers-vinyl",
        about: "fabrics of trousers, worn, on the vinyl cover of a wheelchair",
        fixed: published(0.5375, LAMSAL, "abstract, middle of 0.503 to 0.572"),
        kinetic: estimate(0.53, "the abstract reports no such drop after sliding as on the office chair"),
    },
    Pair {
        name: "viscose-fibres",
        about: "viscose fibres on each other",
        fixed: second_hand(0.35, MORTON, SCRIPT),
        kinetic: second_hand(0.26, MORTON, SCRIPT),
    },
    Pair {
        name: "wool-fibres",
        about: "wool fibres on each other, along their scales",
        fixed: second_hand(0.13, MORTON, SCRIPT),
        kinetic: second_hand(0.11, MORTON, SCRIPT),
    },
    Pair {
        name: "wool-wool",
        about: "plain wool on itself",
        fixed: estimate(0.48, RATIO),
        kinetic: estimate(0.4, PRESETS),
    },
];

/// All pairs, in alphabetical order.
pub fn pairs() -> &'static [Pair] {
    &PAIRS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_have_order_sources_and_sense() {
        assert!(names().is_sorted());
        let keys: Vec<&str> = SOURCES.iter().map(|s| s.key).collect();
        assert!(keys.is_sorted());
        let mut used = Vec::new();
        for pair in pairs() {
            assert!(pair.kinetic.value > 0.0 && pair.fixed.value >= pair.kinetic.value, "{}", pair.name);
            for source in [pair.fixed.source, pair.kinetic.source] {
                match source {
                    Source::Published { key, at } | Source::SecondHand { key, at } => {
                        assert!(keys.contains(&key) && !at.is_empty(), "{}", pair.name);
                        used.push(key);
                    }
                    Source::Estimate(basis) => {
                        assert!(!basis.is_empty(), "{}", pair.name);
                        // A reference that an estimate names is listed.
                        if let Some((_, rest)) = basis.split_once('[') {
                            assert!(keys.contains(&rest.split(']').next().unwrap_or("")), "{basis}");
                        }
                    }
                }
            }
        }
        assert!(keys.iter().all(|key| used.contains(key)), "a reference that nothing uses");
        assert!(pair("cotton-skin-forearm").is_some_and(|p| p.fixed.value == 0.31));
        assert!(pair("cotton").is_none());
    }

    #[test]
    fn references_are_in_the_bibliography() {
        let bibliography = include_str!("../../../../REFERENCES.bib");
        for source in SOURCES {
            assert!(bibliography.contains(&format!("{{{},", source.key)), "{}", source.key);
        }
    }
}
