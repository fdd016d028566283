// What a scan adds up: words, pairs of words as 64-bit numbers (low, high), or sixteen counters of 16 bits in two halves.
// Sums wrap.
//#if WIDE
alias Sum = vec2<u32>;

fn add(a: Sum, b: Sum) -> Sum {
    let low = a.x + b.x;
    return Sum(low, a.y + b.y + select(0u, 1u, low < a.x));
}

fn widen(a: u32) -> Sum {
    return Sum(a, 0u);
}
//#end
//#if NARROW
alias Sum = u32;

fn add(a: Sum, b: Sum) -> Sum {
    return a + b;
}

fn widen(a: u32) -> Sum {
    return a;
}
//#end
//#if PACKED
alias Sum = vec4<u32>;

fn add(a: Sum, b: Sum) -> Sum {
    return a + b;
}
//#end
