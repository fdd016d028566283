//! What rigid impact zones do to momentum.

#![allow(clippy::unwrap_used, reason = "a failure here is a failure of the test")]

mod support;

use cloth_response::ResponseParams;
use cloth_response::collision::mesh::generators::grid;
use support::{Random, World, cloth, placed};

/// Rounding of sums over 100 vertices of 1e-4 kg at 25 m/s [N s].
const MOMENTUM_ERROR: f64 = 1e-13;

/// Sheets that meet by zones alone keep their momentum, whatever zones they make and merge.
#[test]
fn zones_keep_momentum() {
    let mut zones = 0;
    for seed in 0..20 {
        let mut random = Random(seed);
        let mut world = World::new(
            &[
                cloth(placed(grid(0.2, 0.2, 7, 7).unwrap(), [0.1, 0.0, 0.2], [0.0, 0.05, 0.0])),
                cloth(placed(grid(0.2, 0.2, 6, 6).unwrap(), [0.0, 0.4, 0.0], [0.013, 0.0, 0.007])),
            ],
            ResponseParams {
                thickness: 0.004,
                max_passes: 1,
                max_zone_passes: 30,
                ..ResponseParams::default()
            },
        );
        world.gravity = [0.0; 3].into();
        let down = 5.0 + random.unit() * 20.0;
        for i in 0..world.x.len() {
            world.v[i] = random.vector() * 2.0;
            if i < world.first[1] {
                world.v[i].y -= down;
            }
        }
        for _ in 0..6 {
            let (before, speed) = (world.momentum().0, world.v.clone());
            let info = world.step(0.004);
            // Holding back takes momentum away; zones do not.
            if info.zones > 0 && info.held_vertices == 0 {
                zones += info.zones;
                assert_ne!(speed, world.v, "a zone changes velocities");
                let error = (world.momentum().0 - before).norm();
                assert!(error < MOMENTUM_ERROR, "seed {seed}: {error:e}");
            }
        }
    }
    assert!(zones > 20, "{zones} zones");
}
