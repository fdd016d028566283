//! The response of cloth sliding on an inclined plane, by law of friction; one thread.
//!
//! The scene is one step of 8192 triangles, a quarter of them folded back: contact with the plane and with itself.

#![allow(missing_docs, reason = "criterion's macros make public items")]
#![allow(clippy::unwrap_used, reason = "a bench that cannot start has nothing to measure")]

use cloth_benches::incline::{Incline, law};
use cloth_response::FrictionRule;
use criterion::{Criterion, criterion_group, criterion_main};

fn laws(c: &mut Criterion) {
    let mut group = c.benchmark_group("response, 8192 triangles on an incline");
    group.sample_size(40);
    for name in ["coulomb", "coulomb-stiction", "stribeck", "viscous"] {
        let mut scene = Incline::new(FrictionRule::uniform(law(name).unwrap()), 1).unwrap();
        group.bench_function(name, |b| b.iter(|| scene.respond().unwrap()));
    }
    group.finish();
}

criterion_group!(response, laws);
criterion_main!(response);
