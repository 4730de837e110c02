"""`raybench check`, `doctor` and the guard of `run` by the real program: exact figures, the committed baseline, a planted
node visit and a planted delay, parameters without effect."""

import csv
import json
import os
import shutil
import subprocess
import textwrap
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
RAYBENCH = ROOT / "build" / "release" / "raybench"
pytestmark = pytest.mark.skipif(not RAYBENCH.exists(), reason="build/release/raybench is not built")

SHORT = ["--quick", "--threads", "1", "--budget", "0.001", "--repetitions", "1"]
SMALL = [*SHORT, "--rays", "1K", "--verify-rays", "64"]


def call(*words, code=0, environment=None):
    done = subprocess.run([RAYBENCH, *words], capture_output=True, text=True, env=environment)
    assert done.returncode == code, done.stdout + done.stderr
    return done


@pytest.fixture(scope="module")
def plugin(tmp_path_factory):
    """tests/plugins/delayed.cpp."""
    if shutil.which("c++") is None:
        pytest.skip("no C++ compiler here")
    library = tmp_path_factory.mktemp("plugin") / "delayed.so"
    command = (
        "c++ -std=c++20 -O3 -march=native -ffp-contract=off -fno-tree-slp-vectorize -Wall -Wextra -Werror -shared -fPIC"
    )
    source = ROOT / "tests" / "plugins" / "delayed.cpp"
    done = subprocess.run([*command.split(), "-I", ROOT, source, "-o", library], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return library


def test_the_committed_baseline_holds(tmp_path):
    """Our own structures give the figures that they gave. If a change is meant, tests/baseline/README.md says what to do."""
    structures = json.loads(call("list", "structures", "--json").stdout)
    own = [s["name"] for s in structures if s.get("family", "library") != "library"]  # a plugin has none
    known = {
        json.loads(line)["case"][1] for line in open(ROOT / "tests/baseline/small.txt") if line.startswith('{"case"')
    }
    words = ["run", "soup(size=500)", "sphereflake(depth=1)", "--structures", ",".join(s for s in own if s in known)]
    words += ["--sets", "camera,shadow,aimed", *SHORT, "--rays", "512", "--verify-rays", "256"]
    call(*words, "--no-report", "--out", tmp_path / "run")
    call("check", tmp_path / "run", "--baseline", ROOT / "tests" / "baseline" / "small.txt")


def run_command(plugin, *more, before=""):
    sets = "--sets camera,random"
    return f"{before} '{RAYBENCH}' run 'sphereflake(depth=1)' --plugin {plugin} --structures delayed,bvh_median {' '.join(SMALL)} {sets} {' '.join(more)}".strip()


def test_one_more_node_for_one_ray_in_a_thousand_is_found(plugin, tmp_path):
    changed = run_command(plugin, before="env RAYBENCH_TEST_EXTRA_VISIT=1")
    done = call("check", "--exact-only", "--run", run_command(plugin), changed, "--out", tmp_path / "out", code=1)
    assert "delayed / camera" in done.stdout and "steps" in done.stdout
    differences = json.loads((tmp_path / "out" / "check.json").read_text())["exact"]["differences"]
    assert {d["figure"] for d in differences} == {"steps"}
    assert all(0 < d["new"] - d["old"] <= 0.002 for d in differences)


def test_a_program_has_its_own_exact_figures(plugin):
    call("check", "--exact-only", "--run", run_command(plugin), run_command(plugin))


def test_again_takes_verdicts_over_and_finds_what_changed(plugin, tmp_path):
    words = ["run", "sphereflake(depth=1)", "--plugin", plugin, "--structures", "delayed,embree", *SMALL, "--no-report"]
    call(*words, "--keep-rays", "--out", tmp_path / "first")
    call(*words, "--again", tmp_path / "first", "--out", tmp_path / "second")
    call("check", tmp_path / "first", tmp_path / "second", "--exact-only")
    phases = json.loads((tmp_path / "second" / "run.json").read_text())["phases"]
    assert phases["truth"] == phases["capture"] == phases["heat_maps"] == 0
    done = call(
        "run", "sphereflake(depth=1)", *SMALL, "--again", tmp_path / "first", "--out", tmp_path / "third", code=2
    )
    assert "another program or another plugin" in done.stderr
    done = call(*words, "--again", tmp_path / "nothing", "--out", tmp_path / "fourth", code=2)
    assert "--again" in done.stderr and done.stderr.count("\n") == 1


def test_parameters_without_effect_are_told_unless_they_are_of_speed_alone(tmp_path):
    structures = "kdtree_sah,kdtree_sah(max_depth=40),grid,grid(mailbox=true),bvh_sah,bvh_sah(leaf_size=1)"
    done = call(
        "run", "sphereflake(depth=1)", "--structures", structures, *SMALL, "--no-report", "--out", tmp_path / "run"
    )
    notes = [line for line in done.stderr.splitlines() if "no effect" in line]
    assert len(notes) == 1 and "max_depth" in notes[0]
    told = json.loads((tmp_path / "run" / "run.json").read_text())
    assert [t["parameters"] for t in told["without_effect"]] == [["max_depth"]]
    assert {f["subject"] for f in told["machine_state"]} >= {"load", "cgroup", "governor", "turbo", "SMT", "virtual"}


def test_the_doctor_says_what_spoils_timings():
    findings = json.loads(call("doctor", "--json").stdout)
    assert {"load", "jitter", "memory"} <= {f["subject"] for f in findings}
    assert {f["severity"] for f in findings} <= {"fine", "unknown", "note", "warning"}
    assert "jitter" in call("doctor").stdout


@pytest.mark.parametrize(
    "words, says",
    [
        (["check"], "give BASE and HEAD"),
        (["check", "--seconds", "-1"], "--seconds"),
        (["history"], "history --help"),
        (["history", "export", ".", "--format", "xml"], "--format"),
    ],
)
def test_wrong_use_is_told_in_one_line(words, says):
    done = call(*words, code=2)
    assert says in done.stderr and done.stderr.count("\n") == 1


def test_the_example_for_other_ray_tracers_runs(tmp_path):
    """Its repository, with a second commit that looks at twice as many primitives, through the steps of action.yml."""
    if shutil.which("cc") is None:
        pytest.skip("no C compiler here")
    example, repository = ROOT / "reports" / "example" / "ci", tmp_path / "repository"
    repository.mkdir()
    for name in ("build.sh", "structure.cpp"):
        shutil.copy(example / name, repository)
    git = ["git", "-C", repository, "-c", "user.name=a", "-c", "user.email=a@b"]
    subprocess.run(["git", "init", "-q", repository], check=True)
    subprocess.run([*git, "add", "."], check=True)
    subprocess.run([*git, "commit", "-qm", "one"], check=True)
    text = (repository / "structure.cpp").read_text()
    assert "1, 4096, 64)" in text
    (repository / "structure.cpp").write_text(text.replace("1, 4096, 64)", "1, 4096, 128)"))
    subprocess.run([*git, "commit", "-qam", "two"], check=True)
    action = (ROOT / "action.yml").read_text()
    script = textwrap.dedent(action.split("      run: |\n")[1])
    run = " ".join((example / "check.yml").read_text().split("run: >-\n")[1].split("anchor:")[0].split())
    environment = {
        **os.environ, "GITHUB_ACTION_PATH": str(ROOT), "GITHUB_OUTPUT": str(tmp_path / "output"),
        "GITHUB_STEP_SUMMARY": str(tmp_path / "summary"), "BASE": "HEAD~1", "HEAD": "HEAD", "BUILD": "./build.sh",
        "RUN": run + " --verify-rays 64 --budget 0.001", "ANCHOR": "embree", "SECONDS_TO_MEASURE": "4",
        "TOLERANCE": "", "HOME": str(tmp_path),
    }  # fmt: skip
    done = subprocess.run(["bash", "-e", "-c", script], cwd=repository, env=environment, capture_output=True, text=True)
    assert done.returncode == 1, done.stdout + done.stderr
    assert (tmp_path / "output").read_text() == "verdict=fail\n"
    summary = (tmp_path / "summary").read_text()
    assert summary.startswith("### raybench check: fail") and "| rays.ply / mine" in summary.replace(str(tmp_path), "")
    assert "prims" in summary


def test_a_second_run_times_the_parts_of_rays_that_the_first_has_timed(tmp_path):
    """By its own budget it would take all rays of each case."""
    words = ["run", "soup(size=2000)", "--structures", "bvh_sah,kdtree_sah", "--quick", "--sets", "camera,random"]
    words += ["--rays", "8K", "--verify-rays", "64", "--threads", "1", "--repetitions", "1", "--no-report"]

    def parts(name, *more):
        call(*words, *more, "--out", tmp_path / name)
        with open(tmp_path / name / "cases.csv", newline="") as file:
            return [row["timed_rays"] for row in csv.DictReader(file) if row["query"] != "build"]

    first = parts("first", "--budget", "0.0001")
    assert set(first) == {"2048"}
    assert set(parts("own", "--budget", "3")) == {"8192"}
    assert parts("second", "--budget", "3", "--parts-of", tmp_path / "first") == first
    done = call(*words, "--out", tmp_path / "third", "--parts-of", tmp_path / "nowhere", code=2)
    assert "--parts-of: " in done.stderr and done.stderr.count("\n") == 1
