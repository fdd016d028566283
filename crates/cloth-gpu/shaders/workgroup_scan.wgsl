// Exclusive scan over the invocations of a workgroup. Every invocation must reach it.
// Source without subgroups: Hillis & Steele 1986 (inclusive form, shifted).

struct Scanned {
    before: Sum,
    total: Sum,
}

//#if SUBGROUP
struct Lane {
    @builtin(local_invocation_index) index: u32,
    @builtin(subgroup_invocation_id) lane: u32,
    @builtin(subgroup_size) lanes: u32,
}

// One sum per subgroup; a subgroup has at least four lanes.
var<workgroup> sh_sums: array<Sum, WORKGROUP / 4u>;

fn scan_workgroup(own: Sum, me: Lane) -> Scanned {
    let through = subgroupInclusiveAdd(own);
    let mine = me.index / me.lanes;
    workgroupBarrier();         // whoever reads the sums of an earlier call is done
    if me.lane == me.lanes - 1u { sh_sums[mine] = through; }
    workgroupBarrier();
    var out = Scanned(through - own, Sum());
    for (var g = 0u; g < WORKGROUP / me.lanes; g++) {
        if g == mine { out.before += out.total; }
        out.total += sh_sums[g];
    }
    return out;
}
//#end
//#if !SUBGROUP
struct Lane {
    @builtin(local_invocation_index) index: u32,
}

var<workgroup> sh_sums: array<Sum, WORKGROUP>;

fn scan_workgroup(own: Sum, me: Lane) -> Scanned {
    workgroupBarrier();         // whoever reads the sums of an earlier call is done
    sh_sums[me.index] = own;
    for (var step = 1u; step < WORKGROUP; step <<= 1u) {
        workgroupBarrier();
        var left = Sum();
        if me.index >= step { left = sh_sums[me.index - step]; }
        workgroupBarrier();
        sh_sums[me.index] = add(left, sh_sums[me.index]);
    }
    workgroupBarrier();
    var before = Sum();
    if me.index > 0u { before = sh_sums[me.index - 1u]; }
    return Scanned(before, sh_sums[WORKGROUP - 1u]);
}
//#end
