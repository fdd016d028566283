"""Makes the studies of the gallery again, in the order of its page: `python tools/gallery.py [NAME…]`."""

from __future__ import annotations

import argparse
import re
import shlex
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def commands() -> dict[str, list[str]]:
    """The words of each command on the page, by the name of its folder."""
    blocks = re.findall(r"```sh\n(.*?)```", (ROOT / "gallery" / "README.md").read_text(), flags=re.S)
    lines = [shlex.split(line) for block in blocks for line in block.splitlines() if line.startswith("clothsim ")]
    return {Path(words[words.index("-o") + 1]).name: words for words in lines}


def main() -> int:
    """Run them; 1 if one fails."""
    known = commands()
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", metavar="NAME", nargs="*", help=f"which (default: all): {', '.join(known)}")
    names = parser.parse_args().names or list(known)
    if strange := [name for name in names if name not in known]:
        parser.error(f"expected names of {', '.join(known)}, got {', '.join(strange)}")
    failed, start = [], time.monotonic()
    for k, name in enumerate(names):
        print(f"[{k + 1}/{len(names)}] {shlex.join(known[name])}", flush=True)
        began = time.monotonic()
        done = subprocess.run([sys.executable, "-m", *known[name], "--overwrite"], cwd=ROOT, check=False)
        print(f"{name}: {time.monotonic() - began:.0f} s, exit code {done.returncode}", flush=True)
        failed += [name] if done.returncode else []
    print(f"all: {time.monotonic() - start:.0f} s" + (f"; failed: {', '.join(failed)}" if failed else ""))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
