"""Load the compiled modules of build/asan in place of the installed ones; to be imported before mpucal.

As a plugin of pytest: `-p tools.attack.sanitized`, in the environment of `environment`.
"""

import os
import subprocess
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

ROOT = Path(__file__).parents[2]
BUILT = ROOT / "build" / "asan"
MODULES = ("kernel._kernel", "files._text", "files._packed", "chip._flips")


def build() -> None:
    """Compile the modules as for an installation, but with sanitizers and another optimisation level."""
    options = ["-DMPUCAL_SANITIZE=ON", f"-DPython_EXECUTABLE={sys.executable}"]
    targets = [name.partition(".")[2] for name in MODULES]
    for command in (["-S", ROOT, "-B", BUILT, *options], ["--build", BUILT, "--target", *targets]):
        subprocess.run(["cmake", *map(str, command)], check=True, stdout=subprocess.DEVNULL)


def environment() -> dict[str, str]:
    """Return an environment in which Python loads these modules and allocates each block of memory by malloc."""
    # the library of C++, too: otherwise its exceptions are not intercepted
    libraries = [
        subprocess.run(["gcc", f"-print-file-name={name}"], capture_output=True, text=True, check=True).stdout.strip()
        for name in ("libasan.so", "libstdc++.so")
    ]
    asan = "detect_leaks=0:allocator_may_return_null=1"
    return {
        **os.environ,
        "LD_PRELOAD": " ".join(libraries),
        "ASAN_OPTIONS": asan,
        "UBSAN_OPTIONS": "print_stacktrace=1",
        "PYTHONMALLOC": "malloc",
        "PYTHONPATH": str(ROOT),
    }


if "libasan" in os.environ.get("LD_PRELOAD", ""):
    for name in MODULES:
        path = next(BUILT.glob(f"{name.partition('.')[2]}.*.so"))
        spec = spec_from_file_location(f"mpucal.{name}", path)
        assert spec is not None and spec.loader is not None
        module = module_from_spec(spec)
        sys.modules[f"mpucal.{name}"] = module
        spec.loader.exec_module(module)
