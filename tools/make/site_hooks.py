"""The documentation site: pages that lie beside docs/, links to files that are no pages, the notebook, docstrings.

The docstrings' `name : what it is` is made into the name and text that numpydoc has.
"""

import base64
import re
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import griffe
import nbformat
from mkdocs.structure.files import File, Files
from nbclient import NotebookClient

ROOT = Path(__file__).parents[2]
# also read by people without the site, and therefore at the top of the source tree
OUTSIDE = ("firmware_protocol.md", "CONTRIBUTING.md")
SCHEMA = "calibration.schema.json"
# script that the theme would fetch for the search in pages opened from a folder, and its local replacement
SHIM, WORKER = "https://unpkg.com/iframe-worker/shim", "javascripts/worker.js"
LINK = re.compile(r"\[([^\]]+)\]\(([^)#:]+)(#[^)]*)?\)")
NOTEBOOK = "notebook"
TIMEOUT_S = 300
# the part of a line that was overwritten after a carriage return
WRITTEN_OVER = re.compile(r"^.*\r(?!\n)", re.MULTILINE)
# the theme lets a table without a class scroll on a narrow screen
TABLE = re.compile(r"<table[^>]*>")


def on_files(files: Files, config: Any) -> Files:
    """Add the pages that lie outside docs/, the schema, and the notebook with its pictures."""
    for name in OUTSIDE:
        files.append(File.generated(config, name, content=(ROOT / name).read_text(encoding="utf-8")))
    schema = (ROOT / "mpucal" / "result" / SCHEMA).read_text(encoding="utf-8")
    files.append(File.generated(config, f"reference/{SCHEMA}", content=schema))
    files.append(File.generated(config, f"{NOTEBOOK}.md", content="\n\n".join(_notebook(files, config))))
    return files


def _notebook(files: Files, config: Any) -> Iterator[str]:
    """Run docs/notebook.ipynb, and yield its parts with what its cells gave; a cell that raises ends the build."""
    notebook = nbformat.read(f"{config.docs_dir}/{NOTEBOOK}.ipynb", as_version=4)
    with tempfile.TemporaryDirectory() as folder:
        client = NotebookClient(
            notebook, timeout=TIMEOUT_S, coalesce_streams=True, resources={"metadata": {"path": folder}}
        )
        if config.extra["run_notebook"]:
            client.execute(stderr=subprocess.DEVNULL)  # where the kernel prints that it uses TCP
    for cell in notebook.cells:
        yield cell.source if cell.cell_type == "markdown" else _fenced(cell.source, "python")
        for output in cell.get("outputs", ()):
            yield _shown(output, f"{NOTEBOOK}-{cell.id}.png", files, config)


def _shown(output: Any, picture: str, files: Files, config: Any) -> str:
    """Return an output of a cell in Markdown: a picture, a table, or text."""
    data = output.get("data", {})
    if "image/png" in data:
        files.append(File.generated(config, picture, content=base64.b64decode(data["image/png"])))
        return f"![{data['text/plain']}]({picture})"
    if "text/html" in data:
        return TABLE.sub("<table>", data["text/html"])
    return _fenced(WRITTEN_OVER.sub("", output.get("text", data.get("text/plain", ""))).strip("\n"), "text")


def _fenced(text: str, language: str) -> str:
    return f"```{language}\n{text}\n```"


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Return a page with links as the site has them: a page's path from docs/, or the bare name of a file."""
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
    """Remove the name that mkdocs-click shows for a missing default."""
    return html.replace("<code>Sentinel.UNSET</code>", "")


def on_post_page(output: str, page: Any, config: Any) -> str:
    """Replace the script that the theme would fetch."""
    return output.replace(SHIM, "../" * page.url.count("/") + WORKER)


def on_post_template(output_content: str, template_name: str, config: Any) -> str:
    """Leave out the theme's 404 page: its links begin at the root of a server, which a folder does not have."""
    return "" if template_name == "404.html" else output_content


SECTION = re.compile(r"^ *(Parameters|Attributes|Raises)\n *-+\n(.*?)(?=\n\n|\Z)", re.MULTILINE | re.DOTALL)
# several may share a line: "acc : (n, 3) m/s^2. gyr : (n, 3) rad/s."
ITEM = re.compile(r"(?:^ *|(?<=[.;] ))((?:\w+, )*\w+) : ", re.MULTILINE)


class ProjectDocstrings(griffe.Extension):
    """Gives each argument, attribute or error a line of its own, and its text the line below."""

    def on_instance(self, *, obj: Any, **_: Any) -> None:
        """Rewrite an object's docstring."""
        if obj.docstring is not None:
            obj.docstring.value = SECTION.sub(_items, obj.docstring.value)


def _items(section: re.Match[str]) -> str:
    _, *parts = ITEM.split(section[2])
    items = [f"{name}\n    {' '.join(text.split())}" for name, text in zip(parts[::2], parts[1::2], strict=True)]
    return f"{section[1]}\n{'-' * len(section[1])}\n" + "\n".join(items)
