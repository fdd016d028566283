//! What the responder says that it holds, against what the allocator gets back when it goes.

#![allow(clippy::unwrap_used, reason = "a failure here is a failure of the test")]

mod support;

use cloth_response::collision::mesh::generators::grid;
use cloth_response::{Responder, ResponseParams};
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};
use support::{World, cloth, placed};

/// The system's allocator with a count of the bytes in use.
struct Counting;

static IN_USE: AtomicUsize = AtomicUsize::new(0);

// SAFETY: the system's allocator does the work; the count changes no pointer and no layout.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        IN_USE.fetch_add(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller's promise about `layout` is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        IN_USE.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller's promise about `pointer` and `layout` is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// A hash set's spare slots and the coefficients of friction are not counted.
const UNCOUNTED: f64 = 0.1;

/// One test, so that no other allocates meanwhile.
#[test]
fn bytes_are_those_that_the_allocator_counts() {
    let sheet = |turn: f64, height: f64| {
        cloth(placed(grid(0.2, 0.2, 15, 15).unwrap(), [0.0, turn, 0.0], [0.0, height, 0.0]))
    };
    let params = ResponseParams { thickness: 0.004, ..ResponseParams::default() };
    let mut world = World::with_threads(&[sheet(0.0, 0.01), sheet(0.4, 0.0)], params.clone(), 1);
    for i in world.body(0) {
        world.v[i].y = -5.0;
    }
    let release = |world: &mut World| {
        let next = Responder::new(&world.mesh, params.clone()).unwrap();
        let claimed = world.responder.bytes() as f64;
        let before = IN_USE.load(Ordering::Relaxed);
        drop(std::mem::replace(&mut world.responder, next));
        let freed = (before - IN_USE.load(Ordering::Relaxed)) as f64;
        assert!((claimed - freed).abs() <= UNCOUNTED * freed, "claims {claimed}, gives back {freed}");
        claimed
    };
    let idle = release(&mut world);
    world.responder.set_rest(&world.mesh, &world.x.clone()).unwrap();
    let mut impulses = 0;
    for _ in 0..5 {
        impulses += world.step(0.005).impulses;
    }
    let used = release(&mut world);
    assert!(impulses > 100 && used > 1.5 * idle, "contacts take room: {idle} then {used}");
}
