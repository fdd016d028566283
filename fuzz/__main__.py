"""``python -m fuzz``: fuzz for some minutes, or check files that were found."""

from __future__ import annotations

import argparse
import json
import os
import secrets
import sys
import time
from pathlib import Path
from typing import Any

from fuzz.pool import Pool, replay
from fuzz.targets import NAMES, TARGETS

_CORPUS = Path(__file__).resolve().parent / "corpus"


def main() -> int:
    """Run; 1 if there was a finding."""
    parser = argparse.ArgumentParser(
        prog="python -m fuzz", description="Fuzz all that reads, detection and whole scenes; see fuzz/README.md.",
        epilog="example: python -m fuzz --minutes 10 meshes scenes",
    )  # fmt: skip
    parser.add_argument("targets", metavar="TARGET", nargs="*", help=f"{', '.join(NAMES)} (default: all)")
    parser.add_argument("--minutes", metavar="M", type=float, default=10.0, help="how long (default 10)")
    parser.add_argument(
        "--processes", metavar="N", type=int, default=os.cpu_count() or 1, help="side by side (default: all)"
    )
    parser.add_argument("--seed", metavar="S", type=int, help="seed (default: another each time; it is printed)")
    parser.add_argument(
        "-o", "--out", metavar="OUT", type=Path, default=Path("out/fuzz"), help="folder for findings (out/fuzz)"
    )
    parser.add_argument(
        "--replay", metavar="FILE", type=Path, nargs="*", help="check these files, or the corpus, and no more"
    )
    parser.add_argument("--list", action="store_true", help="list the targets")
    parser.add_argument("--json", action="store_true", help="print one JSON object on stdout instead of text")
    options = parser.parse_args()
    if unknown := set(options.targets) - set(NAMES):
        parser.error(f"expected targets of {', '.join(NAMES)}, got {', '.join(sorted(unknown))}")
    names = options.targets or list(NAMES)
    if options.list:
        print("\n".join(f"{name:<13}{TARGETS[name]().what}" for name in names))
        return 0
    if options.replay is not None:
        return _replay(names, options.replay)
    seed = secrets.randbits(32) if options.seed is None else options.seed
    print(
        f"seed {seed}, {options.processes} processes, {options.minutes:g} minutes, findings go to {options.out}",
        file=sys.stderr,
    )
    pool = Pool(names, options.minutes, max(1, options.processes), seed, options.out)
    try:
        pool.run(_Progress(options.minutes))
    except KeyboardInterrupt:
        print("\ninterrupted", file=sys.stderr)
    facts = pool.facts()
    print(json.dumps(facts) if options.json else _table(facts))
    return 1 if facts["findings"] else 0


class _Progress:
    """A line on stderr: once a second on a terminal, else once a minute."""

    def __init__(self, minutes: float) -> None:
        self._minutes, self._next = minutes, 0.0
        self._terminal = sys.stderr.isatty()

    def __call__(self, pool: Pool) -> None:
        if time.monotonic() < self._next:
            return
        self._next = time.monotonic() + (1.0 if self._terminal else 60.0)
        facts = pool.facts()
        minutes = f"{facts['seconds'] / 60.0:.1f} of {self._minutes:g} min"
        line = f"{minutes}: {facts['cases']} cases, {facts['findings']} findings"
        print(f"\r{line} " if self._terminal else line, end="" if self._terminal else "\n", file=sys.stderr, flush=True)


def _table(facts: dict[str, Any]) -> str:
    lines = ["", f"{'target':<14}{'cases':>10}{'minutes':>9}{'slowest':>10}  findings"]
    for name, tally in facts["targets"].items():
        lines.append(
            f"{name:<14}{tally['cases']:>10}{tally['seconds'] / 60.0:>9.1f}{tally['slowest']:>9.2f}s"
            f"  {len(tally['findings'])}"
        )
    lines.append(f"{'together':<14}{facts['cases']:>10}{facts['seconds'] / 60.0:>9.1f}{'':>10}  {facts['findings']}")
    for tally in facts["targets"].values():
        lines += [f"  {found['file']}\n    {found['error'].splitlines()[0][:200]}" for found in tally["findings"]]
    return "\n".join(lines)


def _replay(names: list[str], files: list[Path]) -> int:
    bad = 0
    for name in names:
        chosen = (
            [path for path in files if path.resolve().parent.name == name]
            if files
            else sorted((_CORPUS / name).glob("*"))
        )
        for facts in replay(name, chosen):
            found = facts["finding"]
            bad += found is not None
            print(f"{facts.get('file', name)}: {'as promised' if found is None else found['traceback']}")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
