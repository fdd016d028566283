"""Run the validation: ``python -m validation [TEST ...]``."""

from __future__ import annotations

import argparse
import sys
import time

from . import cantilever, drape, friction, loop, peirce, tables, targets

TESTS = {"cantilever": cantilever.run, "peirce": peirce.run, "loop": loop.run, "drape": drape.run, **friction.TESTS}


def main() -> int:
    """Run the tests named on the command line, all by default; 1 if a claimed bound does not hold."""
    parser = argparse.ArgumentParser(prog="validation", description=__doc__)
    parser.add_argument("tests", nargs="*", choices=[*TESTS, []], metavar="TEST", help=f"of {', '.join(TESTS)}")
    names = parser.parse_args().tests or list(TESTS)
    targets.write()
    results = []
    for name in names:
        start = time.perf_counter()
        own = TESTS[name]()
        results += own
        worst = max((r.deviation / r.bound for r in own if r.bound), default=0.0)
        seconds = time.perf_counter() - start
        print(
            f"{name}: {len(own)} rows in {seconds:.0f} s; worst claim at {100.0 * worst:.0f} % of its bound", flush=True
        )
    tables.write_results(results, names)
    outside = [r for r in results if not r.within]
    for r in outside:
        print(f"OUTSIDE ITS BOUND: {r.test}: {r.case}: {r.quantity}: {r.deviation:.3g} > {r.bound:.3g} ({r.measure})")
    claims = sum(r.bound is not None for r in results)
    print(f"{tables.RESULTS}: {len(results)} rows, {claims} claims, {len(outside)} outside their bounds")
    return 1 if outside else 0


if __name__ == "__main__":
    sys.exit(main())
