"""Look at the wheel and the source distribution in a folder: tags, metadata, contents, sizes.

Run: python tools/wheel/check_dist.py DIST       (by `make wheel`; exits with 1 and a line for each finding)
"""

from __future__ import annotations

import email
import json
import re
import subprocess
import sys
import tarfile
import zipfile
from collections.abc import Iterable, Mapping
from email.message import Message
from pathlib import Path

PYTHONS = ("3.10", "3.11", "3.12", "3.13")
EXTRAS = {"usd", "view", "plot", "sweep", "robot", "all"}
LICENCES = {"LICENSE-APACHE", "LICENSE-MIT"}
WHEEL_LIMIT, SDIST_LIMIT, FILE_LIMIT = 20e6, 3e6, 250e3  # bytes: far more is something that does not belong there
# Nothing of this is for those who install.
JUNK = re.compile(
    r"(^|/)(tests?|target|benches|out|\.venv|__pycache__|\.\w+_cache|\.ci)/|\.(so|pyc|npz|png|ply|proptest-regressions)$"
)


def wheel_findings(name: str, files: Mapping[str, int], metadata: Message, tags: Iterable[str]) -> list[str]:
    """What is wrong with a wheel of this name, its files with their sizes, its metadata and tags."""
    found = []
    if not re.fullmatch(r"clothsim-[\d.]+-cp310-abi3-\w+\.whl", name):
        found.append(f"{name}: expected the stable ABI of Python 3.10, cp310-abi3")
    if "linux_" in name and "manylinux" not in name:
        found.append(f"{name}: expected a manylinux tag, as package indices ask for")
    found += [f"tag {tag}: not in the name" for tag in tags if tag.split("-")[-1] not in name]
    needed = ["clothsim/__init__.py", "clothsim/py.typed", "clothsim/_core.pyi", "clothsim/_cli/__init__.py"]
    found += [f"{path}: missing" for path in needed if path not in files]
    found += [f"{licence}: missing" for licence in LICENCES if not any(f.endswith(f"/{licence}") for f in files)]
    native = [f for f in files if f.endswith((".so", ".pyd", ".dylib"))]
    if len(native) != 1 or not native[0].startswith("clothsim/_core"):
        found.append(f"expected the extension alone, got {native}")
    inside = [f for f in files if f not in native and ".dist-info/" not in f]
    found += [f"{f}: outside the package" for f in inside if not f.startswith("clothsim/")]
    found += [f"{f}: does not belong into a wheel" for f in inside if JUNK.search(f)]
    return found + metadata_findings(metadata)


def metadata_findings(metadata: Message) -> list[str]:
    """What is missing in the core metadata."""
    found = []
    for key, expected in {
        "Name": "clothsim", "Requires-Python": ">=3.10", "License-Expression": "MIT OR Apache-2.0",
        "Description-Content-Type": "text/markdown; charset=UTF-8; variant=GFM",
    }.items():  # fmt: skip
        if metadata[key] != expected:
            found.append(f"metadata: {key}: expected {expected}, got {metadata[key]}")
    if not (metadata["Summary"] or "").strip():
        found.append("metadata: no summary")
    if not str(metadata.get_payload() or metadata["Description"] or "").strip():
        found.append("metadata: no description")
    if not set(metadata.get_all("License-File", [])) >= LICENCES:
        found.append("metadata: License-File: both licences expected")
    classifiers = set(metadata.get_all("Classifier", []))
    wanted = {f"Programming Language :: Python :: {v}" for v in PYTHONS}
    found += [f"metadata: no classifier {c}" for c in sorted(wanted - classifiers)]
    missing = EXTRAS - set(metadata.get_all("Provides-Extra", []))
    return found + [f"metadata: no extra {extra}" for extra in sorted(missing)]


def sdist_findings(files: Mapping[str, int], crates: Iterable[str], lock: str, locked: set[str]) -> list[str]:
    """What is wrong with a source distribution that has these files (without the folder at their head)."""
    needed = {
        "pyproject.toml",
        "PKG-INFO",
        "Cargo.toml",
        "Cargo.lock",
        "python/README.md",
        "examples/drape.toml",
    } | LICENCES
    needed |= {f"crates/{crate}/{part}" for crate in crates for part in ("Cargo.toml", "src/lib.rs")}
    found = [f"{path}: missing" for path in sorted(needed - set(files))]
    found += [f"{path}: does not belong into a source distribution" for path in sorted(files) if JUNK.search(path)]
    found += [f"{path}: {size / 1e3:.0f} kB" for path, size in sorted(files.items()) if size > FILE_LIMIT]
    return found + (
        [] if set(re.findall(r'^name = "(.+)"$', lock, re.M)) == locked else ["Cargo.lock: not that of the tree"]
    )


def extension_crates() -> list[str]:
    """The workspace's crates that the extension is made of."""
    done = subprocess.run(
        ["cargo", "metadata", "--no-deps", "--format-version", "1"], check=True, capture_output=True, text=True
    )
    return [p["name"] for p in json.loads(done.stdout)["packages"] if p["name"] != "cloth-benches"]


def main(folder: Path) -> int:
    """Check what the folder holds, and say how large it is."""
    [wheel], [sdist] = folder.glob("*.whl"), folder.glob("*.tar.gz")
    found = []
    with zipfile.ZipFile(wheel) as archive:
        files = {i.filename: i.file_size for i in archive.infolist()}
        read = {Path(f).name: archive.read(f).decode() for f in files if re.search(r"\.dist-info/(METADATA|WHEEL)$", f)}
        tags = email.message_from_string(read["WHEEL"]).get_all("Tag", [])
        found += wheel_findings(wheel.name, files, email.message_from_string(read["METADATA"]), tags)
    with tarfile.open(sdist) as archive:
        members = {m.name.split("/", 1)[1]: m.size for m in archive.getmembers() if m.isfile()}
        stored = archive.extractfile(f"{sdist.name.removesuffix('.tar.gz')}/Cargo.lock")
        lock = stored.read().decode() if stored else ""
    tree = set(re.findall(r'^name = "(.+)"$', Path("Cargo.lock").read_text(), re.M))
    found += sdist_findings(members, extension_crates(), lock, tree)
    for path, limit in ((wheel, WHEEL_LIMIT), (sdist, SDIST_LIMIT)):
        size = path.stat().st_size
        print(f"{path.name}: {size / 1e6:.1f} MB")
        if size > limit:
            found.append(f"{path.name}: {size / 1e6:.1f} MB, more than {limit / 1e6:.0f} MB")
    for line in found:
        print(f"check_dist: {line}", file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1] if len(sys.argv) > 1 else "dist")))
