"""Tests of the core with AddressSanitizer and UBSan compiled into it."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
TESTS = ["test_frame.py", "test_slots.py", "test_bridge.py", "test_apply.py"]


@pytest.fixture(scope="module")
def sanitized(core):
    """Makes an environment in which code sanitized by gcc runs within Python."""
    found = subprocess.run(["gcc", "-print-file-name=libasan.so"], capture_output=True, text=True, check=True)
    library = Path(found.stdout.strip())
    if not library.is_absolute():
        pytest.skip("needs gcc's libasan")
    # Python frees much only at its end, which is no leak of the core
    asan = {"LD_PRELOAD": str(library), "ASAN_OPTIONS": "detect_leaks=0", "PYTHONMALLOC": "malloc"}
    return {**os.environ, **asan, "MPUCAL_SANITIZE": "1"}


def run(sanitized, *words):
    return subprocess.run([sys.executable, *words], env=sanitized, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_the_core_passes_its_tests_under_sanitizers(sanitized):
    paths = [str(HERE / name) for name in TESTS]
    done = run(sanitized, "-m", "pytest", "-p", "no:cacheprovider", "-p", "no:xdist", *paths)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]


@pytest.mark.slow
def test_the_sanitizers_report_a_read_out_of_bounds(sanitized, host, monkeypatch, tmp_path):
    monkeypatch.setenv("MPUCAL_SANITIZE", "1")
    host.compile_core(tmp_path)
    too_far = "ctypes.create_string_buffer(8), 200"
    program = (
        "import ctypes, importlib.util, pathlib, sys\n"
        f"spec = importlib.util.spec_from_file_location('core', {str(HERE / 'host' / 'core.py')!r})\n"
        "core = importlib.util.module_from_spec(spec); sys.modules['core'] = core; spec.loader.exec_module(core)\n"
        f"core.load_core(pathlib.Path({str(tmp_path)!r})).mpucal_crc16({too_far})\n"
    )
    done = run(sanitized, "-c", program)
    assert done.returncode != 0
    assert "heap-buffer-overflow" in done.stderr
