"""README's example of a structure compiles as the plugin that README says it is."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
RAYBENCH = ROOT / "build" / "release" / "raybench"


@pytest.fixture(scope="module")
def plugin(tmp_path_factory):
    """The example, compiled by README's own command line."""
    if shutil.which("c++") is None:
        pytest.skip("no C++ compiler here")
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    folder = tmp_path_factory.mktemp("plugin")
    (folder / "chunks.cpp").write_text(re.search(r"```cpp\n(.*?)```", text, re.DOTALL).group(1))
    command = re.search(r"^ *(c\+\+ .*chunks\.so)$", text, re.MULTILINE).group(1)
    command = command.replace("path/to/raybench", str(ROOT)).split()
    done = subprocess.run([*command, "-Wall", "-Wextra", "-Werror"], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return folder / "chunks.so"


def test_the_example_is_a_plugin_that_raybench_lists(plugin):
    if not RAYBENCH.exists():
        pytest.skip("build/release/raybench is not built")
    for what in (["structures"], ["structure", "chunks"]):
        done = subprocess.run([RAYBENCH, "--plugin", plugin, "list", *what], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        assert "chunks" in done.stdout
    assert "primitives in a group" in done.stdout


def test_the_example_keeps_its_claim(plugin, tmp_path):
    if not RAYBENCH.exists():
        pytest.skip("build/release/raybench is not built")
    command = [
        RAYBENCH,
        "--plugin",
        plugin,
        "run",
        "sphereflake(depth=2)",
        "--structures",
        "chunks",
        "--rays",
        "1024",
        "--verify-rays",
        "512",
        "--no-report",
        "--out",
        tmp_path / "out",
    ]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_every_file_that_the_documents_link_to_is_there():
    for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md"):
        text = re.sub(r"```.*?```", "", (ROOT / name).read_text(encoding="utf-8"), flags=re.DOTALL)
        for link in re.findall(r"\]\(([^)#:]+)\)", text):
            assert (ROOT / link).exists(), f"{name} links to {link}"
