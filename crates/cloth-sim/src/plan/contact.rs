//! Effects of contact, and what the engine decides about them step by step.

use super::Effects;
use crate::Scene;
use crate::bodies::Bodies;
use crate::contact::ContactStage;
use crate::friction::LawName;
use crate::scene::{Choice, Contact, ContactMethod};
use cloth_response::FrictionLaw;

pub(super) fn plan_contact(
    effects: &mut Effects,
    scene: &Scene,
    bodies: &Bodies,
    stage: Option<&ContactStage>,
) {
    let (Some(stage), Some(contact)) = (stage, &scene.contact) else {
        for name in ["contact", "contact constraints", "self-contact", "collider contact", "friction"] {
            effects.off(name, "the scene has no [contact]");
        }
        for law in LawName::ALL {
            effects.off(&law_effect(law), "the scene has no [contact]");
        }
        effects.off("intersection count", "the scene has no [contact]");
        return;
    };
    let mesh = &stage.mesh;
    effects.on(
        "contact",
        format!("[contact] with detector \"{}\"", stage.continuous.detection.detector),
        mesh.triangles.len(),
        stage.bytes(),
    );
    match contact.method {
        ContactMethod::VelocityFilter => {
            effects.off("contact constraints", "contact.method = \"velocity-filter\"");
        }
        ContactMethod::Constraints => {
            let why =
                "contact.method = \"constraints\": cloth vertices on colliders (its memory is contact's)";
            effects.on("contact constraints", why, bodies.cloth_vertices, 0);
        }
    }
    let selves = bodies.cloth.iter().zip(&mesh.bodies).filter(|(_, rule)| rule.self_collision);
    let self_triangles: usize = selves.map(|(c, _)| c.mesh.triangles.len()).sum();
    if self_triangles > 0 {
        effects.on("self-contact", "contact.self and cloth.self_collision", self_triangles, 0);
    } else {
        effects.off("self-contact", "contact.self is false, or each cloth's self_collision is");
    }
    let others: usize = bodies.colliders.iter().map(|c| c.triangles.len()).sum();
    if others > 0 {
        effects.on("collider contact", "the scene has colliders", others, 0);
    } else {
        effects.off("collider contact", "the scene has no collider");
    }
    plan_friction(effects, scene, contact, stage);
    if stage.allow {
        effects.on("intersection count", "intersections are allowed", mesh.triangles.len(), 0);
    } else {
        effects.off("intersection count", "intersections are not allowed, so there are none");
    }
}

/// Name of the effect of a friction law.
fn law_effect(law: LawName) -> String {
    format!("friction {}", law.name())
}

/// One effect per friction law, with the number of pairs of bodies that have it, and one for all of them.
fn plan_friction(effects: &mut Effects, scene: &Scene, contact: &Contact, stage: &ContactStage) {
    /// Keys that are named.
    const NAMED: usize = 4;
    let (cloths, bodies) = (scene.cloth.len(), stage.mesh.bodies.len());
    let meeting = (0..cloths)
        .flat_map(|a| (a..bodies).map(move |b| (a, b)))
        .filter(|&(a, b)| a != b || stage.mesh.bodies[a].self_collision);
    // Of each law: pairs, and the keys that ask for it with the kind of pair.
    let mut found = LawName::ALL.map(|law| (law, 0, Vec::<String>::new()));
    for (a, b) in meeting {
        let law = scene.friction_law(contact, a, b);
        let viscous = matches!(law, FrictionLaw::Viscous { f_v, .. } if f_v > 0.0);
        if !(law.static_coefficient() > 0.0 || viscous) {
            continue;
        }
        let kind = match (a == b, b < cloths) {
            (true, _) => "self-contact",
            (_, true) => "cloth on cloth",
            _ => "colliders",
        };
        let Some((_, pairs, keys)) = found.iter_mut().find(|(name, ..)| name.name() == law.name()) else {
            continue;
        };
        *pairs += 1;
        let key = format!("{kind}: {}", scene.friction_entry(contact, a, b).0);
        if !keys.contains(&key) {
            keys.push(key);
        }
    }
    let pairs = found.iter().map(|(_, pairs, _)| pairs).sum();
    if pairs > 0 {
        let table = size_of::<u16>() * bodies * bodies;
        effects.on("friction", "a coefficient of friction above zero", pairs, table);
    } else {
        effects.off("friction", "every coefficient of friction is zero");
    }
    for (law, pairs, keys) in found {
        if pairs == 0 {
            effects
                .off(&law_effect(law), format!("no pair of bodies that meet has law = \"{}\"", law.name()));
            continue;
        }
        let more =
            if keys.len() > NAMED { format!(" and {} more", keys.len() - NAMED) } else { String::new() };
        let why = keys[..keys.len().min(NAMED)].join(", ") + &more;
        effects.on(&law_effect(law), why, pairs, 0);
    }
}

/// The effect of limited edges.
pub(super) fn plan_strain(effects: &mut Effects, scene: &Scene, stage: Option<&ContactStage>) {
    match stage.filter(|stage| stage.limited_edges > 0) {
        None => effects.off("strain limit", "no cloth has a strain_limit"),
        Some(stage) if scene.contact.is_some() => {
            let why = "cloth with strain_limit (its memory is contact's)";
            effects.on("strain limit", why, stage.limited_edges, 0);
        }
        Some(stage) => {
            effects.on("strain limit", "cloth with strain_limit", stage.limited_edges, stage.bytes());
        }
    }
}

/// What the engine decides by itself, step by step.
pub(super) fn plan_auto(effects: &mut Effects, scene: &Scene, bodies: &Bodies, stage: Option<&ContactStage>) {
    let meeting = stage.filter(|_| scene.contact.is_some());
    let selves = meeting.is_some_and(|s| s.mesh.bodies.iter().any(|b| b.self_collision));
    match (scene.effects.self_collision, meeting) {
        (Choice::On, _) => effects.off("flatness proofs", "effects.self_collision = \"on\""),
        (Choice::Auto, Some(stage)) if selves => {
            let why = "effects.self_collision = \"auto\": no search of cloth near itself where normals and contour prove it flat";
            effects.on("flatness proofs", why, stage.mesh.triangles.len(), 0);
        }
        (Choice::Auto, _) => effects.off("flatness proofs", "no cloth meets itself"),
    }
    match (scene.effects.ccd, meeting) {
        (Choice::On, _) => effects.off("gap proofs", "effects.ccd = \"on\""),
        (Choice::Auto, Some(stage)) => {
            let why = "effects.ccd = \"auto\": no continuous detection of what moves less than its gap";
            effects.on("gap proofs", why, stage.mesh.vertex_count, 0);
        }
        (Choice::Auto, None) => effects.off("gap proofs", "the scene has no [contact]"),
    }
    plan_slow_friction(effects, scene, meeting);
    match scene.effects.sleep {
        None => effects.off("sleep", "the scene has no effects.sleep"),
        Some(sleep) => {
            let why = format!("effects.sleep: cloth slower than {} m/s for {} s", sleep.speed, sleep.time);
            effects.on("sleep", why, bodies.cloth.len(), 2 * bodies.vertices);
        }
    }
}

/// Steps without the terms of friction that depend on speed.
fn plan_slow_friction(effects: &mut Effects, scene: &Scene, meeting: Option<&ContactStage>) {
    let name = "slow friction";
    if scene.effects.friction == Choice::On {
        return effects.off(name, "effects.friction = \"on\"");
    }
    let Some(stage) = meeting else {
        return effects.off(name, "the scene has no [contact]");
    };
    if stage.constraints.is_some() {
        return effects.off(name, "contact.method = \"constraints\" has a friction of its own");
    }
    let Some(speed) = stage.responder.slow_speed() else {
        return effects.off(name, "all laws are Coulomb's: no term depends on speed");
    };
    let when = if speed == f64::INFINITY {
        "in all steps, as no law differs by more".to_owned()
    } else if speed > 0.0 {
        format!("while no contact can slide faster than {speed:.3e} m/s")
    } else {
        "while all contacts stick".to_owned()
    };
    let tolerance = scene.effects.friction_tolerance;
    let why = format!("effects.friction = \"auto\": Coulomb's law {when} (friction_tolerance {tolerance})");
    effects.on(name, why, stage.mesh.bodies.len(), 0);
}
