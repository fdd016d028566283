//! The table. Textile laboratories report in gf and cm; the values stay in those units here and are converted once.

use super::{Fabric, Quantity, Reference, Source};

/// References of the published values.
pub const SOURCES: [Reference; 4] = [
    Reference {
        key: "kumari2016",
        about: "Kumari, Khurana 2016, Regenerated Cellulose-Based Denim Fabric for Tropical Regions: table 5, read at the \
                publisher's page. Its columns of weight (94 to 109 mg/cm²) and of friction (MIU 1.6 to 1.8) cannot be in \
                the printed units and are not used.",
    },
    Reference {
        key: "matsudaira2015",
        about: "Matsudaira, Masuda, Wada, Yokura 2015, Shape Factor of Flared Skirts Compared with That of Circular \
                Fabrics: table 1, read through a transcription in public code, which leaves out its column of shear.",
    },
    Reference {
        key: "penava2014",
        about: "Penava, Šimić Penava, Knezić 2014, Determination of the Elastic Constants of Plain Woven Fabrics by a \
                Tensile Test in Various Directions: tables 1 and 3, read through transcriptions in public code. The \
                stiffness is the modulus of small strains times the thickness, the same for warp and weft.",
    },
    Reference {
        key: "wong2014",
        about: "Wong 2014, Improvements to Physically Based Cloth Simulation: coefficients of figure 4.7, fitted there to \
                the loop that [ngongoc2004] measured. They carry no unit; read in the units of the instrument, gf and cm.",
    },
];

/// Damping time of stretch and shear [s].
pub(super) const IN_PLANE_DAMPING: Quantity = estimate(2e-3, "of a plausible size; no measurement was found");
/// Damping time of linear and nonlinear bending [s].
pub(super) const BENDING_DAMPING: Quantity = estimate(5e-3, "of a plausible size; no measurement was found");

const fn published(value: f64, key: &'static str, at: &'static str) -> Quantity {
    Quantity { value, source: Source::Published { key, at } }
}

const fn estimate(value: f64, basis: &'static str) -> Quantity {
    Quantity { value, source: Source::Estimate(basis) }
}

/// Rigidity of Kawabata's bending tester [gf cm²/cm] in N m.
const fn rigidity(b: f64) -> f64 {
    b * 9.806_65e-5
}

/// Coercive couple of Kawabata's bending tester [gf cm/cm] in N m/m.
const fn couple(two_hb: f64) -> f64 {
    two_hb * 9.806_65e-3
}

/// Shear stiffness of Kawabata's shear tester [gf/(cm °)] in N/m.
const fn shear(g: f64) -> f64 {
    g * 0.980_665 * 180.0 / std::f64::consts::PI
}

/// Weight [mg/cm²] in kg/m².
const fn weight(w: f64) -> f64 {
    w * 1e-2
}

const fn mean(v: [f64; 6]) -> f64 {
    (v[0] + v[1] + v[2] + v[3] + v[4] + v[5]) / 6.0
}

const MASS: &str = "table 1";
const MODULUS: &str = "table 3, modulus times thickness";
const PENAVA: &str = "penava2014";
const MATSUDAIRA: &str = "matsudaira2015";
const KUMARI: &str = "kumari2016";
const SAMPLES: &str = "table 5, mean of samples A to F";

const TRANSITION: Quantity = estimate(
    50.0,
    "Kawabata's tester reads the rigidity between 0.5 and 1.5 per cm, where it takes the curve as straight",
);

const SHEAR_BASIS: &str = "readings of apparel are of the order of 0.3 to 1 gf/(cm °), 17 to 56 N/m";
const RIGIDITY_BASIS: &str = "of the size of the fabrics of [feng2022], half of which have 4e-6 to 4e-5 N m";
const COTTON_LOOP: &str = "ratio 2HB/B of cotton-broadcloth [matsudaira2015]";
const WOOL_LOOP: &str = "ratio 2HB/B of wool-tropical [matsudaira2015]";
const FILAMENT_LOOP: &str = "ratio 2HB/B of polyester-tropical and polyester-faille [matsudaira2015]";
const FRICTION_BASIS: &str = "what presets of public cloth simulators take; not measured";

/// Ratios 2HB/B [1/m] behind the estimated loops.
const COTTON_RATIO: f64 = 105.0;
const WOOL_RATIO: f64 = 49.0;
const FILAMENT_RATIO: f64 = 37.0;

/// Coefficients of figure 4.7 of [wong2014]: b_1, b_2 [gf cm²/cm], |c_1| [gf cm³/cm].
const TWILL: [f64; 3] = [0.76, 0.26, 0.38];
/// K_0 = (b_1 − b_2)/(2 |c_1|) [1/cm].
const TWILL_TRANSITION: f64 = (TWILL[0] - TWILL[1]) / (2.0 * TWILL[2]);
const FITTED: &str = "figure 4.7";

/// In alphabetical order.
pub(super) const FABRICS: [Fabric; 15] = [
    Fabric {
        name: "acrylic-twill",
        about: "acrylic twill, the measured loop that the thesis fits",
        areal_density: estimate(0.25, "a twill of medium weight"),
        thickness: None,
        tensile: [
            estimate(180.0, "between the wool and the cotton of [penava2014]"),
            estimate(150.0, "between the wool and the cotton of [penava2014]"),
        ],
        shear: estimate(35.0, SHEAR_BASIS),
        rigidity: published(rigidity(TWILL[1]), "wong2014", FITTED),
        coercive_couple: published(couple((TWILL[0] - TWILL[1]) * TWILL_TRANSITION), "wong2014", FITTED),
        transition_curvature: published(TWILL_TRANSITION * 100.0, "wong2014", FITTED),
        friction: None,
    },
    Fabric {
        name: "cotton",
        about: "plain cotton",
        areal_density: published(0.1503, PENAVA, MASS),
        thickness: Some(published(0.318e-3, PENAVA, MASS)),
        tensile: [published(261.0, PENAVA, MODULUS); 2],
        shear: estimate(40.0, SHEAR_BASIS),
        rigidity: estimate(1.0e-5, "cotton-broadcloth [matsudaira2015] has 1.16e-5 N m"),
        coercive_couple: estimate(1.0e-5 * COTTON_RATIO, COTTON_LOOP),
        transition_curvature: TRANSITION,
        friction: Some(estimate(0.35, FRICTION_BASIS)),
    },
    Fabric {
        name: "cotton-broadcloth",
        about: "plain cotton, stiff for its weight: drape coefficient 83 %",
        areal_density: published(weight(12.38), MATSUDAIRA, "table 1, fabric A"),
        thickness: Some(published(0.497e-3, MATSUDAIRA, "table 1, fabric A")),
        tensile: [estimate(261.0, "cotton of [penava2014]"); 2],
        shear: estimate(40.0, SHEAR_BASIS),
        rigidity: published(rigidity(0.118), MATSUDAIRA, "table 1, fabric A"),
        coercive_couple: published(couple(0.124), MATSUDAIRA, "table 1, fabric A"),
        transition_curvature: TRANSITION,
        friction: Some(estimate(0.35, FRICTION_BASIS)),
    },
    Fabric {
        name: "cotton-jersey",
        about: "knitted cotton of a T-shirt",
        areal_density: estimate(0.16, "a common weight of T-shirts, 140 to 180 g/m²"),
        thickness: None,
        tensile: [
            estimate(35.0, "knits of [wang2011] have 17 to 65 N/m at small strains"),
            estimate(20.0, "knits of [wang2011] have 17 to 65 N/m at small strains"),
        ],
        shear: estimate(20.0, SHEAR_BASIS),
        rigidity: estimate(3.0e-6, "a limp knit, in the lower quarter of the fabrics of [feng2022]"),
        coercive_couple: estimate(3.0e-6 * COTTON_RATIO, COTTON_LOOP),
        transition_curvature: TRANSITION,
        friction: None,
    },
    Fabric {
        name: "denim",
        about: "denim with regenerated cellulose, mean of six",
        areal_density: estimate(0.4, "12 oz/yd², a common weight of jeans"),
        thickness: Some(published(mean([1.066, 1.188, 0.801, 1.040, 0.887, 0.973]) * 1e-3, KUMARI, SAMPLES)),
        tensile: [
            estimate(900.0, "several times the plain cotton of [penava2014], as its yarns are heavier"),
            estimate(600.0, "several times the plain cotton of [penava2014], as its yarns are heavier"),
        ],
        shear: published(shear(mean([2.180, 1.538, 3.398, 1.613, 1.538, 1.500])), KUMARI, SAMPLES),
        rigidity: published(rigidity(mean([0.172, 0.144, 0.227, 0.147, 0.207, 0.148])), KUMARI, SAMPLES),
        coercive_couple: published(couple(mean([0.139, 0.142, 0.105, 0.141, 0.214, 0.159])), KUMARI, SAMPLES),
        transition_curvature: TRANSITION,
        friction: Some(estimate(0.5, FRICTION_BASIS)),
    },
    Fabric {
        name: "denim-raw",
        about: "unwashed heavy cotton denim",
        areal_density: estimate(0.45, "13 oz/yd², a common weight of raw denim"),
        thickness: None,
        tensile: [
            estimate(900.0, "several times the plain cotton of [penava2014], as its yarns are heavier"),
            estimate(600.0, "several times the plain cotton of [penava2014], as its yarns are heavier"),
        ],
        shear: estimate(90.0, "somewhat below denim [kumari2016]"),
        rigidity: estimate(8.0e-5, "the cotton denim of [wang2011] has 6e-5 to 1e-4 N m"),
        coercive_couple: estimate(8.0e-5 * 86.0, "ratio 2HB/B of denim [kumari2016]"),
        transition_curvature: TRANSITION,
        friction: Some(estimate(0.5, FRICTION_BASIS)),
    },
    Fabric {
        name: "linen",
        about: "plain linen",
        areal_density: estimate(0.18, "a common weight of shirts and dresses, 150 to 200 g/m²"),
        thickness: None,
        tensile: [
            estimate(400.0, "above the cotton of [penava2014], as flax stretches less than cotton"),
            estimate(350.0, "above the cotton of [penava2014], as flax stretches less than cotton"),
        ],
        shear: estimate(30.0, SHEAR_BASIS),
        rigidity: estimate(2.0e-5, RIGIDITY_BASIS),
        coercive_couple: estimate(2.0e-5 * COTTON_RATIO, COTTON_LOOP),
        transition_curvature: TRANSITION,
        friction: None,
    },
    Fabric {
        name: "polyester",
        about: "plain polyester",
        areal_density: published(0.1646, PENAVA, MASS),
        thickness: Some(published(0.252e-3, PENAVA, MASS)),
        tensile: [published(120.0, PENAVA, MODULUS); 2],
        shear: estimate(25.0, SHEAR_BASIS),
        rigidity: estimate(7.0e-6, "polyester-tropical [matsudaira2015] has 7.6e-6 N m"),
        coercive_couple: estimate(7.0e-6 * FILAMENT_RATIO, FILAMENT_LOOP),
        transition_curvature: TRANSITION,
        friction: None,
    },
    Fabric {
        name: "polyester-faille",
        about: "limp fine polyester: drape coefficient 28 %",
        areal_density: published(weight(10.43), MATSUDAIRA, "table 1, fabric F"),
        thickness: Some(published(0.226e-3, MATSUDAIRA, "table 1, fabric F")),
        tensile: [estimate(120.0, "polyester of [penava2014]"); 2],
        shear: estimate(15.0, "the limpest of its table; below the usual 17 to 56 N/m"),
        rigidity: published(rigidity(0.019), MATSUDAIRA, "table 1, fabric F"),
        coercive_couple: published(couple(0.007), MATSUDAIRA, "table 1, fabric F"),
        transition_curvature: TRANSITION,
        friction: None,
    },
    Fabric {
        name: "polyester-tropical",
        about: "plain polyester for light suits: drape coefficient 51 %",
        areal_density: published(weight(11.65), MATSUDAIRA, "table 1, fabric C"),
        thickness: Some(published(0.340e-3, MATSUDAIRA, "table 1, fabric C")),
        tensile: [estimate(120.0, "polyester of [penava2014]"); 2],
        shear: estimate(25.0, SHEAR_BASIS),
        rigidity: published(rigidity(0.077), MATSUDAIRA, "table 1, fabric C"),
        coercive_couple: published(couple(0.029), MATSUDAIRA, "table 1, fabric C"),
        transition_curvature: TRANSITION,
        friction: None,
    },
    Fabric {
        name: "silk",
        about: "light silk of a scarf",
        areal_density: estimate(0.06, "14 momme, a common weight of scarves and linings"),
        thickness: None,
        tensile: [
            estimate(180.0, "between the polyester and the cotton of [penava2014]"),
            estimate(140.0, "between the polyester and the cotton of [penava2014]"),
        ],
        shear: estimate(15.0, "a limp fabric; below the usual 17 to 56 N/m"),
        rigidity: estimate(2.0e-6, "polyester-faille [matsudaira2015], as limp, has 1.9e-6 N m"),
        coercive_couple: estimate(2.0e-6 * FILAMENT_RATIO, FILAMENT_LOOP),
        transition_curvature: TRANSITION,
        friction: Some(estimate(0.25, FRICTION_BASIS)),
    },
    Fabric {
        name: "silk-satin",
        about: "heavy silk satin of a dress",
        areal_density: estimate(0.095, "22 momme, a common weight of dresses"),
        thickness: None,
        tensile: [
            estimate(200.0, "between the polyester and the cotton of [penava2014]"),
            estimate(150.0, "between the polyester and the cotton of [penava2014]"),
        ],
        shear: estimate(17.0, SHEAR_BASIS),
        rigidity: estimate(3.5e-6, "between silk and polyester-tropical [matsudaira2015]"),
        coercive_couple: estimate(3.5e-6 * FILAMENT_RATIO, FILAMENT_LOOP),
        transition_curvature: TRANSITION,
        friction: Some(estimate(0.25, FRICTION_BASIS)),
    },
    Fabric {
        name: "wool",
        about: "plain wool, soft and thick",
        areal_density: published(0.2348, PENAVA, MASS),
        thickness: Some(published(0.568e-3, PENAVA, MASS)),
        tensile: [published(97.0, PENAVA, MODULUS); 2],
        shear: estimate(30.0, SHEAR_BASIS),
        rigidity: estimate(1.5e-5, RIGIDITY_BASIS),
        coercive_couple: estimate(1.5e-5 * WOOL_RATIO, WOOL_LOOP),
        transition_curvature: TRANSITION,
        friction: Some(estimate(0.4, FRICTION_BASIS)),
    },
    Fabric {
        name: "wool-lycra",
        about: "plain wool with elastane",
        areal_density: published(0.1782, PENAVA, MASS),
        thickness: Some(published(0.328e-3, PENAVA, MASS)),
        tensile: [published(25.0, PENAVA, MODULUS); 2],
        shear: estimate(15.0, "a limp fabric; below the usual 17 to 56 N/m"),
        rigidity: estimate(8.0e-6, "wool-tropical [matsudaira2015] has 6.6e-6 N m"),
        coercive_couple: estimate(8.0e-6 * WOOL_RATIO, WOOL_LOOP),
        transition_curvature: TRANSITION,
        friction: Some(estimate(0.4, FRICTION_BASIS)),
    },
    Fabric {
        name: "wool-tropical",
        about: "plain wool for light suits: drape coefficient 50 %",
        areal_density: published(weight(16.29), MATSUDAIRA, "table 1, fabric B"),
        thickness: Some(published(0.407e-3, MATSUDAIRA, "table 1, fabric B")),
        tensile: [estimate(97.0, "wool of [penava2014]"); 2],
        shear: estimate(30.0, SHEAR_BASIS),
        rigidity: published(rigidity(0.067), MATSUDAIRA, "table 1, fabric B"),
        coercive_couple: published(couple(0.033), MATSUDAIRA, "table 1, fabric B"),
        transition_curvature: TRANSITION,
        friction: Some(estimate(0.4, FRICTION_BASIS)),
    },
];
