"""Ctrl-C before anything listens for it."""

import subprocess
import sys

import pytest

PROGRAM = """
import sys

class CtrlC:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            raise KeyboardInterrupt

sys.meta_path.insert(0, CtrlC())
from mpucal.__main__ import main
main(["session", "--bus", "sim", "-o", {folder!r}])
"""


@pytest.mark.parametrize("module", ["click", "mpucal.cli", "mpucal.cli.session", "numpy", "mpucal.runner"])
def test_ctrl_c_while_python_imports_is_one_sentence(tmp_path, module):
    program = PROGRAM.format(module=module, folder=str(tmp_path / "board"))
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.stderr.lstrip() == "mpucal: interrupted; what was recorded until then is kept.\n"
    assert done.returncode == 4
    assert list(tmp_path.iterdir()) == []
