"""The program as a whole process: help, and the paper's study a second time (kernels compiled before)."""

import subprocess
import sys
import tempfile
import time
from pathlib import Path


def seconds(*arguments: str) -> float:
    start = time.perf_counter()
    program = str(Path(sys.executable).with_name("locbounds"))
    subprocess.run([program, *arguments], check=True, capture_output=True)
    return time.perf_counter() - start


def main() -> None:
    seconds("--help")
    print(f"locbounds --help: {min(seconds('--help') for _ in range(5)):.2f} s (best of 5)")
    with tempfile.TemporaryDirectory() as folder:
        for run in ("first", "second", "third"):
            print(f"locbounds paper fritsche2013, {run} run: {seconds('paper', 'fritsche2013', '--out', folder):.1f} s")
