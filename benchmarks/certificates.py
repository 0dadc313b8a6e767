#!/usr/bin/env python3
"""Certificates of whole scenes, judged by both checkers, as a table. SPDX-License-Identifier: BSD-3-Clause

    python3 benchmarks/certificates.py TETHER SCENE.toml..."""
import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[1]
VERDICTS = {0: "holds", 1: "BROKEN", 2: "not judged"}


def main(program, *scenes):
    worst = 0
    print("| scene | `tether verify` | `verify.py` | judgements | MB |\n|---|---|---|---|---|")
    for scene in map(pathlib.Path, scenes):
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "run.cert"
            subprocess.run([str(pathlib.Path(program).resolve()), "run", scene.name, "--certificate", str(file), "--quiet"],
                           cwd=scene.parent, capture_output=True)
            ours = subprocess.run([program, "verify", str(file)], capture_output=True, text=True)
            other = subprocess.run([sys.executable, str(ROOT / "scene/tools/verify.py"), str(file)], capture_output=True, text=True)
            count = re.search(r"judgements: (\d+)", ours.stdout)
            size = file.stat().st_size / 1e6 if file.exists() else 0
        print(f"| {scene.stem} | {VERDICTS.get(ours.returncode, 'CRASHED')} | {VERDICTS.get(other.returncode, 'CRASHED')} | "
              f"{count.group(1) if count else 0} | {size:.2f} |")
        worst = max(worst, ours.returncode, other.returncode)
    return 1 if worst else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
