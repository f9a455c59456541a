"""The package as a whole: its names, its version, and true statements of the README."""

import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import mpucal
from mpucal.calibration import MODELS
from mpucal.cli import commands
from mpucal.simulated.chip import ChipOptions

PROJECT = Path(__file__).parents[1]
DECLARED = tomllib.loads((PROJECT / "pyproject.toml").read_text())["project"]
README = (PROJECT / "README.md").read_text()
CALLS = sorted(set(re.findall(r"^ {4}mpucal (.*?)(?: +#.*)?$", README, re.MULTILINE)))


def test_every_public_name_is_there():
    assert all(getattr(mpucal, name) for name in mpucal.__all__)
    assert set(mpucal.__all__) <= set(dir(mpucal))


def test_importing_it_loads_nothing_heavy():
    program = "import sys, mpucal; print([name for name in ('numpy', 'mcap', 'click') if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_each_extra_that_is_named_can_be_installed():
    texts = [*(PROJECT / "mpucal").rglob("*.py"), *(PROJECT / "docs").rglob("*.md")]
    named = re.findall(r"mpucal\[(\w+)\]", README + "".join(path.read_text(encoding="utf-8") for path in texts))
    assert "mavlink" in named
    assert set(named) - DECLARED["optional-dependencies"].keys() == set()


def test_the_lock_file_has_what_is_asked_for():
    lines = re.findall(r"^([\w.-]+)==(\S+)", (PROJECT / "tools" / "lock.txt").read_text(), re.MULTILINE)
    locked = {canonicalize_name(name): version for name, version in lines}
    extras = DECLARED["optional-dependencies"]
    wanted = map(Requirement, [*DECLARED["dependencies"], *extras["mavlink"], *extras["plot"], *extras["dev"]])
    missing = [str(each) for each in wanted if locked.get(canonicalize_name(each.name), "0") not in each.specifier]
    assert missing == [], "run tools/lock"


def test_the_calls_of_the_readme_are_understood():
    for call in CALLS:
        name, *words = shlex.split(call)
        command = commands.get_command(None, name)
        assert command.make_context(name, words).command.name == name, call


@pytest.mark.parametrize(
    "text", ["README.md", "fixtures/README.md", "docs/session.md", "docs/comparison.md", "firmware_protocol.md"]
)
def test_links_lead_somewhere(text):
    page = PROJECT / text
    links = re.findall(r"\]\(([^):#]+)(?:#[^)]*)?\)", page.read_text())
    assert [link for link in links if not (page.parent / link).exists()] == []


@pytest.mark.parametrize(("page", "names"), [("method.md", MODELS), ("simulated-chip.md", ChipOptions.parsers())])
def test_a_page_names_each(page, names):
    text = (PROJECT / "docs" / page).read_text(encoding="utf-8")
    assert [name for name in names if f"`{name}`" not in text] == []


def test_no_large_file_is_tracked():
    """Test output that was added by accident was 12 MB once; recordings belong into fixtures/."""
    if not (PROJECT / ".git").exists():
        pytest.skip("this is no checkout")
    listed = subprocess.run(["git", "-C", PROJECT, "ls-files", "-z"], capture_output=True, text=True, check=True).stdout
    files = [PROJECT / name for name in listed.split("\0") if name and not name.startswith("fixtures/")]
    assert [path for path in files if path.is_file() and path.stat().st_size > 1_000_000] == []
