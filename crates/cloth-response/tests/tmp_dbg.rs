mod support;
use cloth_response::collision::mesh::generators::grid;
use cloth_response::{FrictionRule, ResponseParams, Vec3};
use support::{World, cloth, collider, placed};
#[test]
fn dbg() {
    let slope: f64 = 0.4;
    let mu = 0.3;
    let turn = [0.0, 0.0, slope];
    let card = placed(grid(0.1, 0.1, 6, 6).unwrap(), [0.0; 3], [0.0, 0.004, 0.0]);
    let plane = placed(grid(1.0, 1.0, 5, 5).unwrap(), [0.0; 3], [0.013, 0.0, 0.017]);
    let p = ResponseParams {
        thickness: 0.004,
        friction: FrictionRule { default: mu, ..Default::default() },
        ..Default::default()
    };
    let mut w =
        World::new(&[cloth(placed(card, turn, [0.0; 3])), collider(placed(plane, turn, [0.0; 3]))], p);
    let down = Vec3::new(-slope.cos(), -slope.sin(), 0.0);
    let n = Vec3::new(-slope.sin(), slope.cos(), 0.0);
    let a = 9.81 * (slope.sin() - mu * slope.cos()) * 0.005;
    let mut last = 0.0;
    for s in 0..60 {
        let info = w.step(0.005);
        let vs: Vec<f64> = w.body(0).map(|i| w.v[i].dot(&down)).collect();
        let m = w.momentum().0 / w.body(0).map(|i| 1.0 / w.inv_mass[i]).sum::<f64>();
        let ys: Vec<f64> = w.body(0).map(|i| w.x[i].dot(&n)).collect();
        let mx = |v: &Vec<f64>| v.iter().cloned().fold(f64::MIN, f64::max);
        let mn = |v: &Vec<f64>| v.iter().cloned().fold(f64::MAX, f64::min);
        println!(
            "{s} dv/a {:.4} spread {:.2e} y {:.6} {:.6} sweeps {} res {:.1e} n {} imp {}",
            (m.dot(&down) - last) / a,
            mx(&vs) - mn(&vs),
            mn(&ys),
            mx(&ys),
            info.sweeps,
            info.residual,
            info.proximities,
            info.impulses
        );
        last = m.dot(&down);
    }
}
