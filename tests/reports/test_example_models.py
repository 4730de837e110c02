"""The script behind README's glass and mirror models writes models that raybench renders as glass and mirror."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
RAYBENCH = ROOT / "build" / "release" / "raybench"
TETRAHEDRON = "OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"


@pytest.mark.parametrize(("look", "rays"), [("mirror", "reflection"), ("glass", "refraction")])
def test_models_reflect_and_refract(tmp_path, look, rays):
    if not RAYBENCH.exists():
        pytest.skip("build/release/raybench is not built")
    model, out = tmp_path / "model.off", tmp_path / "out.glb"
    model.write_text(TETRAHEDRON)
    script = ROOT / "reports" / "example" / "make_glb.py"
    subprocess.run([sys.executable, script, model, look, out], check=True)
    done = subprocess.run(
        [RAYBENCH, "render", out, "--size", "64x48", "-o", tmp_path / "out.png"], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    line = next(line for line in done.stdout.splitlines() if line.startswith("rays:"))
    counts = {kind: int(count) for count, kind in (part.split() for part in line[5:].split(", "))}
    assert counts["camera"] == 64 * 48
    assert counts["shadow"] > 0
    assert counts[rays] > 0
    assert look == "glass" or counts["refraction"] == 0
