//! The structs of the host equal those of the kernels; every kernel is valid WGSL.
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use cloth_gpu::kernel::Source;
use cloth_gpu::layout::{
    Bounds, Entry, Grid, LengthParams, OctreeParams, PairParams, SceneParams, SubdivisionParams,
};
use cloth_gpu::stages::{
    bounds, cells, compact, features, narrow_filter, octree, pairs, scan, sort, subdivision,
};
use std::mem::offset_of;

/// Name, offset and size of each member, and the struct's size.
type Layout = (Vec<(String, usize)>, usize);

fn layout_in_wgsl(name: &str) -> Layout {
    let module = naga::front::wgsl::parse_str(include_str!("../shaders/layout.wgsl")).unwrap();
    let found = module.types.iter().find(|(_, t)| t.name.as_deref() == Some(name));
    let Some((_, naga::Type { inner: naga::TypeInner::Struct { members, span }, .. })) = found else {
        panic!("no struct {name}")
    };
    let members = members.iter().map(|m| (m.name.clone().unwrap(), m.offset as usize)).collect();
    (members, *span as usize)
}

macro_rules! layout {
    ($type:ident { $($member:ident),* $(,)? }) => {
        (
            stringify!($type),
            (vec![$((stringify!($member).to_owned(), offset_of!($type, $member))),*], size_of::<$type>()),
        )
    };
}

#[test]
fn layouts_are_equal() {
    for (name, host) in [
        layout!(LengthParams { most, word, shift, extra }),
        layout!(SceneParams { triangles, second, all_active, thickness, low, is_thin, high, pad }),
        layout!(Grid { low, size, cells, inverse }),
        layout!(PairParams { most, word, start_low, start_high, count, pad_0, pad_1, pad_2 }),
        layout!(Bounds { low_0, is_active, high_0, body, low_1, pad_low, high_1, pad_high }),
        layout!(SubdivisionParams { triangles, second, room, coarseness, low, least, high, pad }),
        layout!(Entry { centre, radius, triangle, control, key, level }),
        layout!(OctreeParams {
            low,
            triangles,
            inverse,
            base,
            top,
            page,
            room,
            two_stage,
            level,
            pad_0,
            pad_1,
            pad_2,
        }),
    ] {
        assert_eq!(host, layout_in_wgsl(name), "{name}");
    }
}

#[test]
fn swapped_members_are_noticed() {
    let (_, host) = layout!(LengthParams { word, most, shift, extra });
    assert_ne!(host, layout_in_wgsl("LengthParams"));
}

fn all_sources() -> Vec<Source> {
    let mut all = vec![compact::source(), bounds::source()];
    all.extend([false, true].map(features::source));
    all.extend(narrow_filter::sources());
    all.extend(cells::sources());
    all.extend(pairs::sources());
    all.extend(subdivision::sources());
    all.extend(octree::sources());
    for flag in [false, true] {
        for subgroups in [false, true] {
            all.extend(scan::sources::<u32>(subgroups, flag));
            all.extend(scan::sources::<[u32; 2]>(subgroups, flag));
            all.extend(sort::sources(subgroups, flag));
        }
    }
    all
}

#[test]
fn every_kernel_is_valid() {
    for source in all_sources() {
        let wgsl = source.wgsl();
        let module = naga::front::wgsl::parse_str(&wgsl)
            .unwrap_or_else(|e| panic!("{}: {}", source.name, e.emit_to_string(&wgsl)));
        naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::all())
            .validate(&module)
            .unwrap_or_else(|e| panic!("{}: {e:?}", source.name));
        assert_eq!(module.entry_points.len(), 1, "{}", source.name);
        assert_eq!(module.entry_points[0].name, source.name);
        // Bindings count up from 0 in the order of the lines: what the pipeline's layout takes for granted.
        let mut bindings: Vec<(naga::Span, u32)> = module
            .global_variables
            .iter()
            .filter_map(|(h, v)| v.binding.map(|b| (module.global_variables.get_span(h), b.binding)))
            .collect();
        bindings.sort_by_key(|b| b.0.to_range().map(|r| r.start));
        assert!(bindings.iter().map(|b| b.1).eq(0..bindings.len() as u32), "{}: {bindings:?}", source.name);
        assert!(bindings.len() <= 9, "{}: more than 8 arrays", source.name);
    }
}
