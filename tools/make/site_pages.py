"""Hooks of the documentation site: pages that lie beside docs/, and links to files that are no pages."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parents[2]
# read by people who never see the site, and so at the top of the source tree
OUTSIDE = ("firmware_protocol.md", "CONTRIBUTING.md")
SCHEMA = "calibration.schema.json"
# what the theme would fetch so that the search works in pages that are read from a folder, and what does that here
SHIM, WORKER = "https://unpkg.com/iframe-worker/shim", "javascripts/worker.js"
LINK = re.compile(r"\[([^\]]+)\]\(([^)#:]+)(#[^)]*)?\)")


def on_files(files: Files, config: Any) -> Files:
    """Add the pages that lie outside docs/, and the schema."""
    for name in OUTSIDE:
        files.append(File.generated(config, name, content=(ROOT / name).read_text(encoding="utf-8")))
    schema = (ROOT / "mpucal" / "result" / SCHEMA).read_text(encoding="utf-8")
    files.append(File.generated(config, f"reference/{SCHEMA}", content=schema))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Links as the site has them: a page's path from docs/, and the bare name of a file that is no page."""
    # links of a page in docs/ and of one beside docs/ start from different folders of the source tree
    name = page.file.src_uri
    folder = ROOT if name in OUTSIDE else (ROOT / "docs" / name).parent

    def replaced(link: re.Match[str]) -> str:
        text, target, anchor = link[1], link[2], link[3] or ""
        path = (folder / target).resolve()
        for base in (ROOT / "docs", ROOT):
            if not path.is_relative_to(base):
                continue
            uri = path.relative_to(base).as_posix()
            if files.get_file_from_path(uri) is not None:
                return f"[{text}]({'../' * name.count('/')}{uri}{anchor})"
        # a wrong link is left to the check of links
        return text if path.exists() else link[0]

    return LINK.sub(replaced, markdown)


def on_page_content(html: str, page: Any, config: Any, files: Files) -> str:
    """No default where click has none, which mkdocs-click shows by its name."""
    return html.replace("<code>Sentinel.UNSET</code>", "")


def on_post_page(output: str, page: Any, config: Any) -> str:
    """Nothing that is fetched from elsewhere."""
    return output.replace(SHIM, "../" * page.url.count("/") + WORKER)


def on_post_template(output_content: str, template_name: str, config: Any) -> str:
    """So in the page of what is not found."""
    return output_content.replace(SHIM, WORKER)
