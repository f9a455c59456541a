"""The table of reasons: whole, used, and the only way to make one."""

import ast
from pathlib import Path
from string import Formatter

import pytest

import mpucal
from mpucal.reasons import KINDS, reason

PACKAGE = Path(mpucal.__file__).parent
ALL = {(code, name): row for code, kind in KINDS.items() for name, row in kind.sentences.items()}


def calls():
    """{(code, sentence): [the keywords of a call]}, of every call of `reason` in the package."""
    found = {}
    for text in (path.read_text() for path in PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(text)) if " reason(" in text or "(reason(" in text else ():
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "reason":
                code, *rest = node.args
                codes = [value.value for value in CODES_BY_ARGUMENT.get(ast.unparse(code), [code])]
                for sentence in ast.walk(rest[0]):
                    if isinstance(sentence, ast.Constant) and isinstance(sentence.value, str):
                        for each in codes:
                            found.setdefault((each, sentence.value), []).append((len(rest), node.keywords))
    return found


# a helper that is called for two codes
CODES_BY_ARGUMENT = {"code": [ast.Constant("gyro_clipped"), ast.Constant("accel_clipped")]}


def test_every_sentence_is_used_and_every_use_fills_its_places():
    made = calls()
    assert made.keys() == ALL.keys()
    for key, uses in made.items():
        row = ALL[key]
        places = {name for text in (row.what, row.remedy) for _, name, _, _ in Formatter().parse(text) if name}
        for arguments, keywords in uses:
            given = {keyword.arg for keyword in keywords}
            assert given - {"refuse"} == places, key
            assert (row.refuse is None) == (arguments == 2 or "refuse" in given), key


def test_a_row_is_whole():
    for code, kind in KINDS.items():
        assert kind.meaning.endswith("."), code
        assert (kind.refuses == "depends") == bool(kind.refused_when), code
        for row in kind.sentences.values():
            assert row.what, code
            assert row.remedy, code
            assert not row.what.endswith((".", ";"))
            assert not row.remedy.endswith(".")


def test_who_decides_whether_it_refuses():
    assert reason("never_still", "at_all").refuse
    assert not reason("gyro_clipped", "samples", False, count=1, share=0.01).refuse
    for refuse, of in ((None, ("gyro_clipped", "samples")), (False, ("never_still", "at_all"))):
        with pytest.raises(ValueError, match=of[0]):
            reason(*of, refuse=refuse, count=1, share=0.01)
