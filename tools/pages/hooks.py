"""What MkDocs calls while it builds the site: generated pages, linked files of the repository, prices, equations."""

from __future__ import annotations

from typing import Any

import equations
import extension
import linked
import papers
import prices
import schema
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

GENERATED = {"scene-schema.md": schema.page, "api/core.md": extension.page}


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that are made from data, and what pages link to outside ``docs``."""
    for path, make in GENERATED.items():
        files.append(File.generated(config, path, content=make()))
    for file in linked.files(files, config):
        files.append(file)
    return files


def on_page_markdown(markdown: str, page: Page, **_: Any) -> str:
    """Fill in prices and comparisons, and let links point to where the site has their targets."""
    source = page.file.src_uri
    markdown = prices.fill(markdown)
    markdown = papers.fill(markdown)
    return linked.rewrite(markdown, source)


def on_page_content(html: str, page: Page, **_: Any) -> str:
    """Turn equations into MathML."""
    return equations.to_mathml(html, page.file.src_uri)
