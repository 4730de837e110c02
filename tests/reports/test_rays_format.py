"""tracer/rays/RAYS.md's reader reads what raybench writes, and its hash names the scene as raybench does."""

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
RAYBENCH = ROOT / "build" / "release" / "raybench"

OFF = "OFF\n5 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n7 8 9.5\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"


@pytest.fixture(scope="module")
def documented():
    """What the example in RAYS.md defines."""
    text = (ROOT / "tracer" / "rays" / "RAYS.md").read_text(encoding="utf-8")
    names = {}
    exec(re.search(r"```python\n(.*?)```", text, re.DOTALL).group(1), names)
    return names


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A folder with scene.off and its rays."""
    if not RAYBENCH.exists():
        pytest.skip("build/release/raybench is not built")
    folder = tmp_path_factory.mktemp("rays")
    (folder / "scene.off").write_text(OFF)
    command = [RAYBENCH, "rays", "record", "scene.off", "-o", "rays", "--rays", "1000", "--depth", "0"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return folder


def test_the_documented_reader_reads_every_file(documented, recorded):
    files = sorted((recorded / "rays").glob("*.rays"))
    assert [file.stem for file in files] == ["aimed", "ambient_occlusion", "camera", "diffuse", "random", "shadow.0"]
    for file in files:
        rays, header = documented["read_rays"](file)
        assert len(rays) == 1000
        assert header["kind"] == file.stem.removesuffix(".0")
        assert header["query"] == (file.stem in ("ambient_occlusion", "shadow.0"))
        assert header["order"] == "traced"
        assert header["name"] == "scene.off"
        assert np.isfinite(rays["org"]).all() and (rays["tnear"] < rays["tfar"]).all()
    rays, _ = documented["read_rays"](recorded / "rays" / "camera.rays")
    assert np.allclose((rays["dir"] ** 2).sum(axis=1), 1, atol=1e-6)
    assert (rays["org"] == rays["org"][0]).all()


def test_the_scene_hash_is_that_of_the_documented_arrays(documented, recorded):
    numbers = OFF.split()[4:]
    positions = np.array(numbers[:15], "<f4")
    triangles = np.array(numbers[15:], "<u4").reshape(4, 4)[:, 1:]
    counts = np.array([5, 4, 0], "<u8")
    expected = documented["content_hash"](counts.tobytes(), positions.tobytes(), triangles.tobytes())
    _, header = documented["read_rays"](recorded / "rays" / "camera.rays")
    assert header["scene"] == f"{expected:016x}"


def test_a_damaged_file_does_not_pass(documented, recorded, tmp_path):
    good = (recorded / "rays" / "camera.rays").read_bytes()
    for position in (1, 20, 60, 200, 250, 300, len(good) - 1):
        bad = bytearray(good)
        bad[position] ^= 4
        (tmp_path / "bad.rays").write_bytes(bad)
        with pytest.raises(AssertionError):
            documented["read_rays"](tmp_path / "bad.rays")
