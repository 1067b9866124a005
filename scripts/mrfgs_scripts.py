"""Helpers of the Python scripts: the program, its maps, and environments for packages."""
import os
import shutil
import subprocess
import sys
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TARGET = Path(os.environ.get("CARGO_TARGET_DIR") or ROOT / "target")
PROGRAM = Path(os.environ.get("MRFGS") or TARGET / "release" / "mrfgs")


def build(script):
    """Builds the program as packages have it, unless the environment variable MRFGS names one."""
    line = ["cargo", "build", "--release", "--locked", "--quiet", "--features", "mrfgs-cli/live"]
    if not os.environ.get("MRFGS") and subprocess.run(line, cwd=ROOT).returncode != 0:
        sys.exit(f"{script}: cannot build mrfgs")


def in_environment(script, packages):
    """Re-executes the script in an environment with the packages."""
    folder = TARGET / script / "environment"
    python = folder / "bin" / "python"
    if Path(sys.prefix).resolve() == folder.resolve():
        return
    mark = folder / "installed"
    if not mark.exists() or mark.read_text() != "\n".join(packages):
        print(f"{script}: installing " + ", ".join(packages), file=sys.stderr)
        shutil.rmtree(folder, ignore_errors=True)
        venv.create(folder, with_pip=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *packages], check=True)
        mark.write_text("\n".join(packages))
    os.execv(python, [python, *sys.argv])


def read_pfm(file):
    """Reads a grey PFM from a path or bytes, top row first. Raises ValueError if it is not one."""
    import numpy as np

    data = file if isinstance(file, bytes) else Path(file).read_bytes()
    kind, size, scale, values = data.split(b"\n", 3)
    width, height = map(int, size.split())
    if kind.strip() != b"Pf" or len(values) != 4 * width * height:
        raise ValueError(f"not a grey PFM of {width} x {height} pixels")
    return np.frombuffer(values, "<f4" if float(scale) < 0 else ">f4").reshape(height, width)[::-1]
