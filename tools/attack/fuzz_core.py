"""The firmware's core under libFuzzer, AddressSanitizer and UBSan: requests, bytes of a line, memories and blobs.

    python -m tools.attack fuzz_core --seconds 60

It needs clang with its runtime library. build/fuzz/core keeps the corpus for the next run.
"""

import shutil
import subprocess
import sys
from pathlib import Path

from mpucal.bridge import messages as wire

from .fuzz import KEPT as BUILT
from .fuzz import ROOT, TODAY, reached

SOURCES = ROOT / "mpucal" / "firmware" / "src"
HARNESS = ROOT / "tests" / "firmware" / "host" / "fuzz.c"
MISSING = "fuzz_core.py: needs clang, and its libFuzzer (on Debian: apt install clang libclang-rt-14-dev)."
WARNINGS = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"]
FLAGS = ["-std=c99", "-g", "-O1", "-fsanitize=fuzzer,address,undefined", "-fno-sanitize-recover=all"]
FRAME, LOOK, BLOB = 0, 2, 3
LONGEST = 4096


def built() -> Path:
    """Build and return the fuzzer; exit with a sentence if clang cannot."""
    BUILT.mkdir(parents=True, exist_ok=True)
    fuzzer = BUILT / "core_fuzzer"
    sources = map(str, [*sorted(SOURCES.glob("*.c")), HARNESS])
    clang = shutil.which("clang")
    words = [clang or "", *WARNINGS, *FLAGS, f"-I{SOURCES}", "-o", str(fuzzer), *sources]
    if clang is None or subprocess.run(words, check=False).returncode:
        sys.exit(MISSING)
    return fuzzer


def seeds() -> list[bytes]:
    """Return the first corpus: HELLO and then each kind of request, and the golden blobs."""

    def piece(kind: int, content: bytes) -> bytes:
        return bytes([kind, len(content)]) + content

    def request(message: wire.Message) -> bytes:
        return piece(FRAME, bytes([message.TYPE, 1]) + message.payload())

    blobs = [path.read_bytes() for path in sorted((ROOT / "fixtures" / "vectors").glob("blob*.bin"))]
    hello, looks = request(wire.Hello()), piece(LOOK, bytes(60)) * 4
    fifo = [wire.Write(0x23, b"\x78"), wire.Write(0x6A, b"\x44"), wire.Stream(12, 4), wire.Burst(0x74, 100)]
    asked = [[wire.Read(0x75, 1), wire.BlobState(), wire.BlobRead(0, 56)], fifo, [wire.BlobErase(), wire.Leave()]]
    for blob in blobs:
        chunks = [wire.BlobData(at, blob[at : at + 32]) for at in range(0, len(blob), 32)]
        commit = wire.BlobCommit(len(blob), int.from_bytes(blob[-4:], "little"))
        asked.append([wire.BlobBegin(len(blob)), *chunks, commit, wire.BlobState(), wire.BlobRead(0, 56)])
    exchanges = [hello + b"".join(map(request, several)) + looks for several in asked]
    return [*exchanges, *(piece(BLOB, blob) for blob in blobs if len(blob) < 256)]


def main(*, seconds: int = 60, first: int = TODAY) -> int:
    """Build and run the fuzzer; return 1 if it found something."""
    fuzzer, corpus = built(), BUILT / "core"
    corpus.mkdir(exist_ok=True)
    for number, seed in enumerate(seeds()):
        (corpus / f"seed{number}").write_bytes(seed)
    options = {"max_total_time": max(seconds, 1), "seed": first, "max_len": LONGEST, "print_final_stats": 1}
    words = [fuzzer, *(f"-{key}={value}" for key, value in options.items()), f"-artifact_prefix={BUILT}/core.", corpus]
    done = subprocess.run(list(map(str, words)), capture_output=True, text=True, errors="replace", check=False)
    if done.returncode:
        print(done.stderr[-6000:])
        return 1
    count, edges = reached(done.stderr)
    print(f"the firmware's core {count} executions, {edges} edges, seed {first}: nothing wrong")
    return 0
