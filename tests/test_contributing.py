"""The recipes of CONTRIBUTING.md, followed: each module and row is added, and used through the commands."""

import json
import re
import socket
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mpucal.errors import Abandoned, RefusedError, UsageError
from mpucal.result.calibration import Calibration

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
RECIPES = {
    title: dict(re.findall(r"`(mpucal/[\w/]+\.py)`[^`]*(?:`[^`\n]+`[^`]*)*?:\n\n```python\n(.*?)```", text, re.DOTALL))
    for title, text in re.findall(r"^### (.+?)\n(.*?)(?=^### |\Z)", PAGE, re.DOTALL | re.MULTILINE)
}

# the steps of a contributor: each module into its folder, and each row to the end of its table
PROGRAM = """
import importlib.util
import json
import re
import sys
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

from mpucal.__main__ import run

TABLES = {
    "mpucal/sinks/table.py": "SINKS",
    "mpucal/sources/table.py": "SOURCES",
    "mpucal/files/recorders.py": "RECORDERS",
    "mpucal/export/forms.py": "FORMS",
    "mpucal/files/formats.py": "FORMATS",
    "mpucal/chip/families.py": "FAMILIES",
    "mpucal/simulated/chip/models.py": "MODELS",
}


def load(path):
    name = path.removesuffix(".py").replace("/", ".")
    spec = importlib.util.spec_from_file_location(name, Path(name.rpartition(".")[2] + ".py"))
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def add(path, row):
    table = importlib.import_module(path.removesuffix(".py").replace("/", "."))
    name, made = re.fullmatch(r"(?:(\\w+) = )?(.*)", row.strip(), re.DOTALL).groups()
    made = eval(made, {**vars(table), **known})
    known[name] = made
    held = getattr(table, TABLES[path])
    if isinstance(held, dict):
        held[made.name] = made
    elif isinstance(held, list):
        held.append(made)
    else:
        setattr(table, TABLES[path], (*held, made))
    for who_am_i, chip in getattr(made, "parts", ()):
        table.PARTS[who_am_i] = table.Part(chip, who_am_i, made)


blocks = json.loads(Path("recipes.json").read_text())
known = {Path(path).stem: load(path) for path, text in blocks if text.startswith('\"\"\"')}
for path, text in blocks:
    if not text.startswith('\"\"\"'):
        add(path, text)
for line in sys.stdin:
    with redirect_stdout(StringIO()) as out, redirect_stderr(StringIO()) as err:
        code = run(json.loads(line))
    print(json.dumps([code, out.getvalue(), err.getvalue()]), flush=True)
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with calibrations, and with the modules of all recipes."""
    folder = tmp_path_factory.mktemp("followed")
    made = Calibration(np.diag([1.1, 1.0, 0.9]), np.array([0.5, 0.0, -0.5]))
    made.save(folder / "c.json")
    replace(made, applied_in_hardware=np.array([0.25, 0.0, 0.0])).save(folder / "in_chip.json")
    replace(made, quality={"verdict": "refused"}).save(folder / "refused.json")
    titles = ("A sink", "A source", "A source of samples", "An export form", "A reader", "A chip")
    recipes = [RECIPES[title] for title in titles]
    blocks = [block for recipe in recipes for block in recipe.items()]
    for path, text in blocks:
        assert (ROOT / path).exists() != text.startswith('"""')
        if text.startswith('"""'):
            (folder / Path(path).name).write_text(text)
    (folder / "recipes.json").write_text(json.dumps(blocks))
    (folder / "program.py").write_text(PROGRAM)
    return folder


@pytest.fixture(scope="module")
def call(folder):
    """Return a function that runs a command after all recipes, and returns what it printed."""
    with subprocess.Popen(
        [sys.executable, "program.py"], cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as program:

        def call(*words, code=0):
            print(json.dumps(words), file=program.stdin, flush=True)
            ended, out, err = json.loads(program.stdout.readline())
            assert ended == code, err
            return err if code else out

        yield call


def test_a_sink(call, folder):
    assert "notebook.txt has b_a" in call("write", "c.json", "notebook", "--bus", "sim")
    assert (folder / "notebook.txt").read_text() == "[0.5, 0.0, -0.5] m/s^2\n"
    assert all("notebook" in call(command, "--help") for command in ("session", "write"))
    wrong = UsageError.exit_code
    refused = call("session", "--mavlink", "sim", "--to", "notebook", code=wrong)
    assert "--mavlink sim has no notebook: give exactly one of --bus BUS" in refused
    assert "'notebook'" in call("write", "c.json", "diary", "--bus", "sim", code=wrong)


def test_a_source(call):
    shown = json.loads(call("show", "--shelf", "0x68", "--json"))
    assert (shown["who_am_i"], shown["chip"]) == (0x68, "MPU-6050")
    assert all("--shelf WHO_AM_I" in call(command, "--help") for command in ("session", "record", "stream", "write"))
    wrong = UsageError.exit_code
    assert "--shelf WHO_AM_I and --udp PORT." in call("session", code=wrong)
    assert "--bus and --shelf were given together" in call("session", "--shelf", "0x68", "--bus", "sim", code=wrong)


@pytest.fixture
def port():
    """A UDP port to which a sensor at rest sends 100 samples a second."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    ended = threading.Event()

    def send():
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
            while not ended.wait(0.01):
                sample = {"t": time.monotonic(), "acc": [0.0, 0.0, 9.8], "gyr": [0.0, 0.0, 0.0]}
                line.sendto(f"{json.dumps(sample)}\n".encode(), ("127.0.0.1", port))

    sensor = threading.Thread(target=send)
    sensor.start()
    yield port
    ended.set()
    sensor.join()


def test_a_source_of_samples(call, port):
    call("record", "--udp", str(port), "-o", "udp.mcap", "--seconds", "2")
    shown = json.loads(call("show", "udp.mcap", "--json"))
    assert (shown["samples"] > 0, shown["chip"]) == (True, "UDP")
    assert "of 10 s" in call("session", "--replay", "udp.mcap", "-o", "again", code=Abandoned.exit_code)
    assert json.loads(call("show", "--udp", str(port), "--json"))["where"] == "a sensor on UDP"


def test_an_export_form(call, folder):
    call("export", "in_chip.json", "--to", "octave", "-o", "c.m")
    script = (folder / "c.m").read_text()
    D, b_a = (re.search(rf"^{name} = \[(.*)\]", script, re.MULTILINE).group(1) for name in ("D", "b_a"))
    np.testing.assert_array_equal(np.array([row.split() for row in D.split(";")], float), np.diag([1.1, 1.0, 0.9]))
    assert json.loads(f"[{b_a}]") == [0.25, 0.0, -0.5]
    document = json.loads(call("export", "in_chip.json", "--to", "octave", "--json"))
    assert (document["to"], document["ending"], document["text"]) == ("octave", ".m", script)
    assert any("does not correct the gyroscope" in note for note in document["cannot_carry"])
    assert re.search(r"octave +Octave, MATLAB", call("export", "--help"))
    assert "'octave'" in call("export", "c.json", "--to", "nothing", code=UsageError.exit_code)
    call("export", "refused.json", "--to", "octave", code=RefusedError.exit_code)


def test_a_reader(call, folder):
    t = np.arange(400) * 0.01
    np.savetxt(folder / "walk.words", np.column_stack([t, np.full((400, 3), 5.7), np.zeros((400, 3))]))
    assert json.loads(call("show", "walk.words", "--json"))["samples"] == 400
    assert all("a page of words (.words)" in " ".join(call(name, "--help").split()) for name in ("calibrate", "show"))


def test_a_chip(call):
    shown = json.loads(call("show", "--bus", "sim:chip=mpu6555,temperature_c=31,hand=still", "--json"))
    assert (shown["who_am_i"], shown["chip"]) == (0x7C, "MPU-6555")
    assert shown["temperature_c"] == pytest.approx(31, abs=0.1)


def test_a_parameter_of_the_model(tmp_path, need):
    """The table with the row, run as CMake does it, and its header compiled."""
    ((path, row),) = RECIPES["A parameter of the model"].items()
    source = (ROOT / path).read_text(encoding="utf-8")
    table = re.search(r"^TABLE = \(\n.*?^\)\n", source, re.DOTALL | re.MULTILINE).group()
    longer = table.removesuffix(")\n") + f"    {row.strip()},\n)\n"
    (tmp_path / "parameters.py").write_text(source.replace(table, longer))
    names = "import parameters as p; print(p.NAMES[p.PLACES['s']], p.lanes_used('hand'), len(p.NAMES) == p.HAND)"
    done = subprocess.run([sys.executable, "-c", names], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout == "('s_x', 's_y', 's_z') 30 True\n"
    subprocess.run([sys.executable, "parameters.py", "parameters.hpp"], cwd=tmp_path, check=True)
    header = (tmp_path / "parameters.hpp").read_text()
    assert re.search(r"struct HandParameters : Parameters \{[^}]*double s\[3\];", header)
    need("g++")
    (tmp_path / "uses.cpp").write_text(
        '#include "parameters.hpp"\nstatic_assert(mpucal::Lanes::s == 27 && mpucal::LanesUsed::hand == 30);\n'
    )
    subprocess.run(["g++", "-std=c++17", "-fsyntax-only", "uses.cpp"], cwd=tmp_path, check=True)
