"""Fixtures and settings of all tests."""

import fcntl
import gc
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from functools import cache
from importlib.util import find_spec
from itertools import chain
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import HealthCheck, settings
from hypothesis.internal.conjecture import providers

# Programs of tools/ are tested, too. The folder comes last: the sources of mpucal in it have no kernel.
if str(Path(__file__).parents[1]) in sys.path:
    sys.path.remove(str(Path(__file__).parents[1]))
sys.path.append(str(Path(__file__).parents[1]))

from mpucal.session.beside import ONE_THREAD

# let programs that tests start use compiled bytecode, which a shell may forbid: compiling mpucal takes half a second
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
# Debian keeps i2c-tools' programs where a user's PATH may not go
os.environ["PATH"] = os.pathsep.join((os.environ["PATH"], "/usr/sbin", "/sbin"))
os.environ.update(ONE_THREAD)  # as the program does, and before NumPy or SciPy loads
# notes of writes belong to no home; workers of xdist and what tests start inherit the folder of the first process
if "PYTEST_XDIST_WORKER" not in os.environ:
    STATE = tempfile.TemporaryDirectory(prefix="mpucal-state-")
    os.environ["XDG_STATE_HOME"] = STATE.name

PROJECT = str(Path(__file__).parents[1])
UNTRACKED = pytest.StashKey[set[str]]()
LEFT = pytest.StashKey[list[str]]()

# in the background or under nohup these are ignored, which a test's programs would inherit
signal.signal(signal.SIGINT, signal.default_int_handler)
if hasattr(signal, "SIGHUP"):
    signal.signal(signal.SIGHUP, signal.SIG_DFL)

# `gate` runs the same examples every time; `search` draws others, by the seed of --hypothesis-seed (`make search`).
# Durations on a busy machine prove nothing, and no test changes the values of its fixtures.
QUIET = [HealthCheck.too_slow, HealthCheck.function_scoped_fixture]
PATIENT = {"deadline": None, "database": None, "suppress_health_check": QUIET}
settings.register_profile("gate", derandomize=True, **PATIENT)
settings.register_profile("search", print_blob=True, **PATIENT)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "gate"))
if settings.get_current_profile_name() == "gate":
    # Hypothesis draws numbers and texts of the project's modules, too: of those loaded so far, and which these are
    # depends on the tests that a worker ran before.
    providers._get_local_constants = lambda: providers._local_constants

# some imports of all tests; a few tests may need less
NEEDED = ("jsonschema", "matplotlib", "mypy", "polars", "pyarrow", "pymavlink", "rosbags", "yaml")


def pytest_configure(config: pytest.Config) -> None:
    """Say in a sentence what all tests need, where they are asked for without it."""
    missing = [name for name in NEEDED if find_spec(name) is None]
    if missing and config.args_source is config.ArgsSource.TESTPATHS:
        raise pytest.UsageError(
            f"{', '.join(missing)} missing: pip install 'mpucal[mavlink,plot,dev]', or name a folder."
        )


# Files whose tests wait longest go first: a process that takes one last would work alone.
FIRST = ("test_command.py", "test_port.py", "test_browser.py", "test_firefox.py", "test_site.py", "test_hangup.py")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Order the files; those of a file stay as they are."""
    items.sort(key=lambda item: item.path.name not in FIRST)


def pytest_collection_finish() -> None:
    """Exempt what all tests share from garbage collection, which would take a tenth of a run."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """Return one more than there are processors: tests of bridges and browsers wait for most of their time."""
    return (os.cpu_count() or 1) + 1


def untracked() -> set[str]:
    """Files of the checkout that git neither tracks nor ignores; none where this is no checkout."""
    if not Path(PROJECT, ".git").exists() or shutil.which("git") is None:
        return set()
    words = ("git", "-C", PROJECT, "ls-files", "--others", "--exclude-standard")
    return set(subprocess.run(words, capture_output=True, text=True, check=True).stdout.splitlines())


def pytest_sessionstart(session: pytest.Session) -> None:
    """Keep which files there were."""
    if not hasattr(session.config, "workerinput"):
        session.config.stash[UNTRACKED] = untracked()


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Fail a run that left files in the checkout."""
    if not hasattr(session.config, "workerinput"):
        session.config.stash[LEFT] = sorted(untracked() - session.config.stash[UNTRACKED])
        if session.config.stash[LEFT]:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED


def missing_packages() -> list[str]:
    """Debian packages of tools/ci_packages.txt that are not installed; none where this is no Debian."""
    if shutil.which("dpkg-query") is None:
        return []
    lines = Path(PROJECT, "tools", "ci_packages.txt").read_text(encoding="utf-8").splitlines()
    wanted = [names.split("|") for line in lines if (names := line.partition("#")[0].strip())]
    words = ("dpkg-query", "--show", "--showformat", "${Package} ${Status}\n", *chain(*wanted))
    shown = subprocess.run(words, capture_output=True, text=True, check=False).stdout
    there = {line.partition(" ")[0] for line in shown.splitlines() if line.endswith(" install ok installed")}
    return [names[0] for names in wanted if there.isdisjoint(names)]


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Say what the run left behind, and why tests were skipped."""
    for path in config.stash[LEFT]:
        terminalreporter.write_line(
            f"{path} was left in the checkout by this run: a test writes outside its folder.", red=True
        )
    skipped = Counter(
        report.longrepr[2].removeprefix("Skipped: ") for report in terminalreporter.stats.get("skipped", [])
    )
    if missing := missing_packages() if skipped else []:
        terminalreporter.write_line(
            f"{skipped.total()} tests were skipped, most for lack of Debian packages: {', '.join(missing)}. "
            "`sudo tools/ci_packages` installs these."
        )
    else:
        for reason, count in skipped.most_common():
            terminalreporter.write_line(f"{count} skipped: {reason}")


@pytest.fixture
def uncollected():
    """Run without collection of garbage: hypothesis hooks it, and a KeyboardInterrupt raised in the hook is lost."""
    gc.disable()
    yield
    gc.enable()


@pytest.fixture(scope="session", autouse=True)
def elsewhere(tmp_path_factory):
    """A folder to run in: what a test starts looks for modules where it runs, too."""
    home = Path.cwd()
    os.chdir(tmp_path_factory.mktemp("elsewhere"))
    yield
    os.chdir(home)


@pytest.fixture(scope="session")
def need():
    """Return a function that skips a test where one of the programs or files that it names is missing."""

    def need(*wanted: str | Path) -> None:
        missing = [str(of) for of in wanted if not (of.exists() if isinstance(of, Path) else shutil.which(of))]
        if missing:
            pytest.skip(f"needs {' and '.join(missing)}; programs are of the packages in tools/ci_packages.txt")

    return need


@pytest.fixture(scope="session")
def shared(need):
    """Return a function that returns the paths of recordings of others, which may lie beside the project."""

    def paths(*names: str) -> list[Path]:
        found = [Path(PROJECT).parent / "shared" / name for name in names]
        need(*found)
        return found

    return paths


@pytest.fixture(scope="session")
def chromium():
    """A browser, of which the headless shell is twice as fast; playwright runs once in a process."""
    names = ("chromium-headless-shell", "chromium", "google-chrome")
    if (found := next(filter(None, map(shutil.which, names)), None)) is None:
        pytest.skip("there is no Chromium here")
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with api.sync_playwright() as p:
        browser = p.chromium.launch(executable_path=found, args=["--no-sandbox", "--disable-gpu"])
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def page(chromium):
    """A page that keeps what it fetched."""
    context = chromium.new_context(reduced_motion="reduce")
    page = context.new_page()
    page.fetched = []
    page.on("request", lambda asked: page.fetched.append(asked.url))
    yield page
    context.close()


@pytest.fixture(scope="session")
def save():
    """Write a recording into a file, in the format of its suffix."""
    from mpucal.files import open_writer
    from mpucal.files.rows import Rows

    def call(recording, path):
        rows = Rows.of(recording)
        with open_writer(Path(path), rows, "") as write:
            for samples in rows.runs:
                write(samples)

    return call


@pytest.fixture(scope="session")
def once(tmp_path_factory):
    """A folder that is filled once in a run, by the first worker of xdist that asks; nothing is to be changed in it."""
    shared = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        shared = shared.parent

    def call(name, make):
        folder = shared / "once" / name
        folder.parent.mkdir(exist_ok=True)
        with (folder.parent / f"{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not folder.exists():
                made = Path(tempfile.mkdtemp(dir=folder.parent))
                make(made)
                made.rename(folder)
        return folder

    return call


@pytest.fixture
def mpucal(capsys, tmp_path, monkeypatch):
    """The command, in this process and in an empty folder: its exit code, which must be `code` if given, and output."""
    from mpucal.__main__ import run

    monkeypatch.chdir(tmp_path)

    def call(*words, code=None):
        capsys.readouterr()
        found = run([str(word) for word in words])
        out, err = capsys.readouterr()
        assert code in (None, found), err
        return SimpleNamespace(code=found, out=out, err=err)

    return call


@pytest.fixture(scope="session")
def check_numbered():
    """Check that a recording of a numbered feed has only its samples, in order, and a gap wherever some are missing."""
    import numpy as np

    from tools.lab.feeds import numbers

    def check(recording, gaps=None):
        np.testing.assert_array_equal(recording.gyr, np.broadcast_to(recording.gyr[0], recording.gyr.shape))
        assert (recording.acc[:, 1:] == recording.acc[0, 1:]).all()
        steps = np.diff(numbers(recording))
        assert (steps >= 1).all()
        assert recording.gap[1:].tolist() == (steps != 1).tolist()
        assert (np.diff(recording.t) > 0).all()
        assert gaps is None or recording.gap.sum() == gaps

    return check


@pytest.fixture
def walk(once):
    """A capture of twenty seconds, which a session goes through to its end."""
    from mpucal.__main__ import run

    def make(folder):
        words = ["record", "--bus", "sim", "--rate", "25", "--seconds", "20", "-o", str(folder / "walk.mcap")]
        assert run(words) == 0

    return once("walk", make) / "walk.mcap"


@pytest.fixture(scope="session")
def program():
    """The command that runs a program of tools/, from any folder."""

    def call(folder, name, *words):
        code = f"import sys; sys.path.append({PROJECT!r}); from tools.programs import run; run({folder!r})"
        return [sys.executable, "-P", "-c", code, name, *map(str, words)]

    return call


@cache
def by_hand(seed, motion, rate_hz=100, **how):
    """An MPU-6050 in a hand, simulated once, as finely as a hand's jerks of 60 ms and tremor of 10 Hz need it."""
    from tools.lab.scenarios.recordings import hand_scenario

    return hand_scenario(seed, motion, rate_hz=rate_hz, truth_hz=400, **how)


@pytest.fixture(scope="session")
def hand():
    """A factory of hand-held simulated recordings."""
    return by_hand


@pytest.fixture(scope="session")
def in_hand():
    """An MPU-6050 that a hand turned through twelve poses."""
    return by_hand(1, "pose12")
