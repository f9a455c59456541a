"""A hook of the documentation site: runs docs/notebook.ipynb, and makes a page of it with what its cells gave."""

from __future__ import annotations

import base64
import re
import subprocess
import tempfile
from collections.abc import Iterator
from typing import Any

import nbformat
from mkdocs.structure.files import File, Files
from nbclient import NotebookClient

NAME = "notebook"
TIMEOUT_S = 300
# of a line that was written over, what stayed
WRITTEN_OVER = re.compile(r"^.*\r(?!\n)", re.MULTILINE)

# the theme lets a table without a class scroll on a narrow screen
TABLE = re.compile(r"<table[^>]*>")


def on_files(files: Files, config: Any) -> Files:
    """Add the page and its pictures; a cell that raises ends the build."""
    notebook = nbformat.read(f"{config.docs_dir}/{NAME}.ipynb", as_version=4)
    with tempfile.TemporaryDirectory() as folder:
        client = NotebookClient(
            notebook, timeout=TIMEOUT_S, coalesce_streams=True, resources={"metadata": {"path": folder}}
        )
        client.execute(stderr=subprocess.DEVNULL)  # the kernel says there that it uses TCP
    parts: list[str] = []
    for cell in notebook.cells:
        parts.append(cell.source if cell.cell_type == "markdown" else _fenced(cell.source, "python"))
        for output in cell.get("outputs", ()):
            parts += _shown(output, f"{NAME}-{cell.id}.png", files, config)
    files.append(File.generated(config, f"{NAME}.md", content="\n\n".join(parts)))
    return files


def _shown(output: Any, picture: str, files: Files, config: Any) -> Iterator[str]:
    """An output of a cell in Markdown: a picture, a table, or text."""
    data = output.get("data", {})
    if "image/png" in data:
        files.append(File.generated(config, picture, content=base64.b64decode(data["image/png"])))
        yield f"![{data['text/plain']}]({picture})"
    elif "text/html" in data:
        yield TABLE.sub("<table>", data["text/html"])
    else:
        yield _fenced(WRITTEN_OVER.sub("", output.get("text", data.get("text/plain", ""))).strip("\n"), "text")


def _fenced(text: str, language: str) -> str:
    return f"```{language}\n{text}\n```"
