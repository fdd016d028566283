//! What the hierarchy says that it holds, against what the allocator gets back when it goes.

#![allow(clippy::unwrap_used, reason = "a failure here is a failure of the test")]

use cloth_collision::mesh::generators::{grid, sphere};
use cloth_collision::{Body, Bvh, CollisionMesh, Detector, Mode, Query};
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

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

/// One test, so that no other allocates meanwhile.
#[test]
fn bytes_are_those_that_the_allocator_counts() {
    let (cloth, ball) = (grid(1.0, 1.0, 21, 21).unwrap(), sphere(0.3, 2).unwrap());
    let mesh = CollisionMesh::new(&[
        (Body { dynamic: true, self_collision: true }, cloth.vertices.len(), &cloth.triangles),
        (Body { dynamic: false, self_collision: false }, ball.vertices.len(), &ball.triangles),
    ])
    .unwrap();
    let x: Vec<_> = cloth.vertices.iter().chain(&ball.vertices).copied().collect();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let mut bvh = Bvh::new(&mesh, &x).unwrap();
    let planned = bvh.bytes();
    let query = Query { x_t0: &x, x_t1: &x, thickness: 0.01, mode: Mode::Continuous, active: None };
    bvh.detect(&mesh, &query, &pool).unwrap();
    bvh.proximity(&mesh, &x, 0.01, None, &pool).unwrap();
    assert_eq!(bvh.bytes(), planned, "known before the first query");
    let before = IN_USE.load(Ordering::Relaxed);
    drop(bvh);
    assert_eq!(before - IN_USE.load(Ordering::Relaxed), planned);
}
