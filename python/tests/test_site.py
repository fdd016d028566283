"""The documentation site: built without a warning, complete, and free of anything fetched from elsewhere."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

import pytest
from conftest import ROOT, load_module

import clothsim as cs
from clothsim.reproduce import CATALOGUE, find

pytest.importorskip("mkdocs", reason="the extra 'docs' is not installed")
pytest.importorskip("material", reason="the extra 'docs' is not installed")

EFFECT = re.compile(r"^<!-- effect: (.*) -->$", re.MULTILINE)


def tool(name: str) -> Any:
    """A module of tools/pages."""
    return load_module(ROOT / "tools" / "pages" / f"{name}.py")


class Page(HTMLParser):
    """What a page refers to: links, pictures and scripts, and its anchors."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.loads: list[str] = []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Collect what the tag names."""
        given = {key: value or "" for key, value in attrs}
        self.anchors |= {given[key] for key in ("id", "name") if key in given}
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        if "src" in given:
            self.loads.append(given["src"])
        if tag == "link" and given.get("rel") in ("stylesheet", "icon", "preconnect"):
            self.loads.append(given["href"])


def build(folder: Path, config: Path = ROOT / "mkdocs.yml") -> subprocess.CompletedProcess[str]:
    """Build the site as ``make docs`` does."""
    return subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "-f", str(config), "-d", str(folder)],
        cwd=ROOT, env={**os.environ, "NO_MKDOCS_2_WARNING": "1"}, capture_output=True, text=True, check=False,
    )  # fmt: skip


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    done = build(folder)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "WARNING" not in done.stdout + done.stderr, done.stdout + done.stderr
    return folder


def test_every_link_and_anchor_of_the_site_leads_somewhere(site: Path) -> None:
    pages = {path: Page(path) for path in site.rglob("*.html") if path.name != "404.html"}
    assert len(pages) > 45
    dead = []
    for path, page in pages.items():
        for link in page.links + page.loads:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            target = target / "index.html" if target.is_dir() else target
            if not target.exists():
                dead.append(f"{path.relative_to(site)}: {link}")
            elif parts.fragment and target in pages and unquote(parts.fragment) not in pages[target].anchors:
                dead.append(f"{path.relative_to(site)}: {link} has no such anchor")
    assert not dead, dead


def test_nothing_is_fetched_from_elsewhere(site: Path) -> None:
    for path in site.rglob("*.html"):
        outside = [link for link in Page(path).loads if urlsplit(link).netloc]
        assert not outside, f"{path.relative_to(site)} loads {outside}"
    for path in (site / "assets").glob("*.css"):
        assert not re.search(r"url\(['\"]?https?:|@import", path.read_text()), path.name


def test_equations_became_mathml(site: Path) -> None:
    text = "".join(path.read_text() for path in site.glob("effects/*.html"))
    assert text.count("<math") > 80
    assert "arithmatex" not in text
    assert "$$" not in re.sub(r"<script.*?</script>", "", text, flags=re.DOTALL)


def test_a_dead_link_and_a_dead_anchor_fail_the_build(tmp_path: Path) -> None:
    """Planted faults: the strict build names both."""
    docs = tmp_path / "docs"
    docs.mkdir()
    (docs / "index.md").write_text("# Home\n\n[a page](nowhere.md) and [a place](other.md#nowhere)\n")
    (docs / "other.md").write_text("# Other\n")
    validation = (ROOT / "mkdocs.yml").read_text().split("\nvalidation:")[1].split("\n\n")[0]
    (tmp_path / "mkdocs.yml").write_text(f"site_name: faults\nvalidation:{validation}\n")
    done = build(tmp_path / "site", tmp_path / "mkdocs.yml")
    assert done.returncode != 0
    assert "nowhere.md" in done.stderr
    assert "#nowhere" in done.stderr


def test_every_key_of_the_schema_is_on_its_page() -> None:
    schema = tool("schema")
    page = schema.page()
    parts = re.split(r"^## .* \{ #(schema-[a-z]+) \}$", page, flags=re.MULTILINE)
    sections = dict(zip(parts[1::2], parts[2::2], strict=True))
    for name, key in schema.keys_of_the_schema():
        shown = sections[schema.anchor(name)]
        assert f"`{key}`" in shown or f"**`{key} = " in shown, f"{name or 'scene'}.{key}"
    assert "| `tolerance` | number |" in sections["schema-solverparams"]
    assert "| `damping` | number | 1/s | `0.0` |" in sections["schema-air"]


def test_every_effect_of_a_plan_has_its_section() -> None:
    """With equation, picture, parameters, price and source."""
    scene = cs.Scene(duration=0.1)
    scene.add_cloth(cs.Mesh.grid(1.0, 1.0, 3, 3), "cotton")
    known = {effect["name"] for effect in cs.Simulation(scene, device="cpu").plan["effects"]}
    found: list[str] = []
    for path in sorted((ROOT / "docs" / "effects").glob("*.md")):
        parts = EFFECT.split(path.read_text())
        for names, text in zip(parts[1::2], parts[2::2], strict=True):
            found += names.split(", ")
            section = text.split("\n## ")[0]
            for needed in ("$$", "![", "**Parameters**", "**Source**"):
                assert needed in section, f"{path.name}: {names} has no {needed}"
            assert "<!-- price: " in section or "**Price**" in section, f"{path.name}: {names} has no price"
    assert sorted(found) == sorted(known)


def test_prices_are_those_of_the_readme() -> None:
    prices = tool("prices")
    table = prices.rows()
    filled = prices.fill("<!-- price: hinge, hinge coupling -->")
    assert f"| {table['hinge'].milliseconds} | {table['hinge'].share} | {table['hinge'].memory} |" in filled
    assert "hinge coupling †" in filled
    assert set(prices.model()) <= set(table) | {"self-contact"}
    with pytest.raises(ValueError, match="no such effect"):
        prices.fill("<!-- price: no such effect -->")


def test_the_comparison_is_with_what_the_papers_say() -> None:
    """Each stored line of a paper is the one of the module that measures it, and its checks have the same names."""
    papers = tool("papers")
    results = papers.load()["results"]
    for name, result in results.items():
        assert result["thesis"] == find(name).load().THESIS, name
        assert result["machine"]
        assert result["commit"]
    filled = papers.fill(r"<!-- comparison: 4\.7 -->")
    assert results["4.7"]["here"].split(" (")[0] in filled


def test_every_table_of_the_papers_stands_beside_ours() -> None:
    papers = tool("papers")
    page = (ROOT / "docs" / "reproduction.md").read_text(encoding="utf-8")
    measured = {entry.name for entry in CATALOGUE if entry.kind == "table" and entry.state == "reproduced"}
    assert set(papers.TABLES) == measured == set(re.findall(r"<!-- table: (.*?) -->", page))
    for name in measured:
        columns, *rows = papers.load()["results"][name]["table"]
        assert columns == list(papers.TABLES[name])
        theirs = [k for k, column in enumerate(columns) if "thesis" in column or "paper" in column]
        assert theirs, name
        assert any(row[k] not in ("0", "–") for row in rows for k in theirs), name
        assert all(len(row) == len(columns) for row in rows), name
        assert " | ".join(rows[0][2:4]) in papers.fill(f"<!-- table: {name} -->").replace("\\", ""), name
    with pytest.raises(ValueError, match=r"no such table in the store: '4\.7'"):
        papers.fill("<!-- table: 4.7 -->")


def test_a_table_is_read_from_what_a_command_wrote(tmp_path: Path) -> None:
    papers = tool("papers")
    (tmp_path / "table-6.1.csv").write_text(
        "# made by: x, y\nbenchmark,level,active in steps [%],registrations [%],thesis: active in steps [%],"
        "thesis: registrations [%],more\nFunnel,0,0,0,0,0,1\nFunnel,6,100,70.7531,100,70.8,1\n"
        "Bowline,7,50,12345.6,nan,nan,1\n"
    )
    assert papers._read("table-6.1", tmp_path / "table-6.1.csv")[1:] == [
        ["Funnel", "6", "100", "100", "70.75", "70.8"], ["Bowline", "7", "50", "–", "12,346", "–"]
    ]  # fmt: skip
    (tmp_path / "table-6.1.csv").write_text("benchmark,level\nFunnel,6\n")
    with pytest.raises(KeyError, match="active in steps"):
        papers._read("table-6.1", tmp_path / "table-6.1.csv")


def test_an_equation_that_cannot_be_read_is_named() -> None:
    equations = tool("equations")
    page = '<span class="arithmatex">\\(\\frac{a}{b}\\)</span>'
    assert "<mfrac>" in equations.to_mathml(page, "page.md")
    with pytest.raises(ValueError, match=r"page\.md.*nosuchcommand"):
        equations.to_mathml('<span class="arithmatex">\\(\\nosuchcommand{a}\\)</span>', "page.md")


def test_the_store_and_the_pictures_are_whole() -> None:
    assert json.loads((ROOT / "docs" / "reproduction.json").read_text())["results"]
    drawn = {path.stem for path in (ROOT / "docs" / "images" / "effects").glob("*.png")}
    source = (ROOT / "tools" / "pages" / "pictures.py").read_text()
    named = {name.replace("_", "-") for name in re.findall(r"^@picture\ndef (\w+)", source, flags=re.MULTILINE)}
    assert drawn == named
