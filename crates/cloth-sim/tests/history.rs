//! `effects.history = "auto"`: hinges remember their path only once they have left the elastic range.
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

mod common;

use cloth_sim::Simulation;
use common::{bits, build, scene, simulation};

const PLASTIC: &str =
    r#"{ model = "plastic", rigidity = 1e-5, elastic_limit = 12.0, hardening = 2e-6, damping = 0.01 }"#;
const HYSTERESIS: &str =
    r#"{ model = "hysteresis", b1 = 2e-5, b2 = 1e-5, c1 = -1e-7, plasticity = 0.3, fatigue = 0.1 }"#;

/// A strip that is held flat at one end, hangs down behind it, and is waved; `more` in its effects.
fn strip(bending: &str, top: &str, more: &str) -> String {
    format!(
        r#"
duration = 1.0
[time]
dt = 0.005
{top}
[effects]
{more}
[[cloth]]
name = "strip"
mesh = {{ generator = "grid", width = 0.4, height = 0.1, nx = 17, ny = 5 }}
pins = [{{ box = {{ min = [-0.21, -1.0, -1.0], max = [-0.16, 1.0, 1.0] }}, keyframes = [{{ time = 0.1 }}, {{ time = 0.3, position = [0.0, 0.05, 0.0] }}, {{ time = 0.5 }}] }}]
[cloth.material]
areal_density = 0.2
in_plane = {{ model = "baraff-witkin", warp = 200.0, weft = 200.0, shear = 20.0, damping = 0.002 }}
bending = {bending}
"#
    )
}

const AUTO: &str = "history = \"auto\"\nhistory_tolerance = 0.02";

/// Memory of the bending law in the report [B]: of all hinges, or of those that remember.
fn memory(sim: &Simulation, law: &str) -> usize {
    let bytes = |name: &str| sim.report().effects.iter().find(|e| e.name == name).map_or(0, |e| e.bytes);
    bytes(law) + bytes("elastic hinges")
}

fn remembering(sim: &Simulation) -> usize {
    sim.report().steps.last().unwrap().remembering.unwrap()
}

#[test]
fn plastic_cloth_has_the_same_bits_with_memory_where_it_flows() {
    for top in
        ["", "integrator = \"implicit-newton\"", "integrator = \"semi-implicit\"", "indefinite = \"raw\""]
    {
        let mut whole = simulation(&strip(PLASTIC, top, ""));
        let mut auto = build(&scene(&strip(PLASTIC, top, AUTO)), 2);
        let hinges = auto.plan().effects.iter().find(|e| e.name == "elastic hinges").unwrap().elements;
        for step in 0..60 {
            whole.step().unwrap();
            auto.step().unwrap();
            assert_eq!(bits(&whole), bits(&auto), "{top}: step {step}");
        }
        assert_eq!(whole.hinges(), auto.hinges(), "{top}");
        let kept = remembering(&auto);
        assert!(0 < kept && kept < hinges / 2, "{top}: {kept} of {hinges}");
        assert_eq!(whole.report().steps[0].remembering, None);
        // 16 bytes each, and 4 for its name.
        assert_eq!(memory(&whole, "plastic") - memory(&auto, "plastic"), 16 * hinges - 20 * kept, "{top}");
        let mut resumed = Simulation::resume(&auto.checkpoint(), Some(1)).unwrap();
        for _ in 0..20 {
            resumed.step().unwrap();
            auto.step().unwrap();
            assert_eq!(bits(&resumed), bits(&auto), "{top}");
        }
        assert_eq!(remembering(&resumed), remembering(&auto));
    }
}

/// The largest distance of vertices after so many steps [m], and how many hinges remember.
fn apart(tolerance: f64, steps: usize) -> (f64, usize, usize) {
    let mut whole = simulation(&strip(HYSTERESIS, "", ""));
    let mut auto =
        simulation(&strip(HYSTERESIS, "", &format!("history = \"auto\"\nhistory_tolerance = {tolerance}")));
    let mut most = 0.0_f64;
    for _ in 0..steps {
        whole.step().unwrap();
        auto.step().unwrap();
        let pairs = whole.positions().iter().zip(auto.positions());
        most = most.max(pairs.map(|(a, b)| (a - b).norm()).fold(0.0, f64::max));
    }
    (most, remembering(&auto), auto.hinges().len())
}

#[test]
fn hysteresis_without_history_stays_near_in_proportion_to_the_tolerance() {
    // A strip of 0.4 m: what a tolerance of 2 % does to it, and what one that forgets the loop altogether does.
    let (near, kept, hinges) = apart(0.02, 100);
    let (far, few, _) = apart(0.9, 100);
    assert!(near < 1e-3, "{near}");
    assert!(far > 5.0 * near, "a fault of that kind is seen: {far} {near}");
    assert!(kept < hinges && few < kept, "{few} {kept} of {hinges}");
}

#[test]
fn hinges_that_sleep_keep_what_they_remember() {
    let napkins = |more: &str| {
        format!(
            r#"
duration = 5.0
[time]
dt = 0.005
[air]
damping = 5.0
[contact]
thickness = 0.005
[effects]
sleep = {{ speed = 0.02, time = 0.05 }}
{more}
[[cloth]]
name = "lying"
mesh = {{ generator = "grid", width = 0.2, height = 0.2, nx = 7, ny = 7 }}
position = [0.0, 0.006, 0.0]
material = {{ areal_density = 0.2, in_plane = {{ model = "spring", stiffness = 50.0 }}, bending = {PLASTIC} }}
[[cloth]]
name = "hanging"
mesh = {{ generator = "grid", width = 0.2, height = 0.2, nx = 7, ny = 7 }}
position = [1.0, 1.0, 0.0]
pins = [{{ vertices = [0, 1, 7, 8], keyframes = [{{ time = 0.0 }}, {{ time = 1.0, position = [0.1, 0.0, 0.0] }}] }}]
material = {{ areal_density = 0.2, in_plane = {{ model = "spring", stiffness = 50.0 }}, bending = {PLASTIC} }}
[[collider]]
name = "floor"
shape = {{ type = "plane", half_size = 1.0 }}
"#
        )
    };
    let (mut whole, mut auto) = (simulation(&napkins("")), simulation(&napkins(AUTO)));
    let mut asleep = 0;
    for step in 0..120 {
        whole.step().unwrap();
        auto.step().unwrap();
        assert_eq!(bits(&whole), bits(&auto), "step {step}");
        asleep += auto.asleep().len();
        if step == 80 {
            auto = Simulation::resume(&auto.checkpoint(), Some(1)).unwrap();
        }
    }
    assert!(asleep > 20, "{asleep}");
    assert_eq!(whole.hinges(), auto.hinges());
    assert!(remembering(&auto) > 0);
}

#[test]
fn the_plan_says_what_is_left_out_and_why() {
    let plan = |text: &str| {
        let sim = simulation(text);
        let effect = sim.plan().effects.iter().find(|e| e.name == "elastic hinges").unwrap().clone();
        (effect.on, effect.elements, effect.why)
    };
    let (on, hinges, why) = plan(&strip(HYSTERESIS, "", AUTO));
    assert!(on && hinges > 100 && why.contains("2.020 % of its transition_curvature"), "{why}");
    let (on, _, why) = plan(&strip(PLASTIC, "", AUTO));
    assert!(on && why.contains("elastic_limit"), "{why}");
    let (on, hinges, why) = plan(&strip(PLASTIC, "", ""));
    assert!(!on && hinges == 0 && why.contains("effects.history = \"on\""), "{why}");
    let linear = r#"{ model = "hinge", rigidity = 1e-5 }"#;
    assert!(!plan(&strip(linear, "", AUTO)).0);
}
