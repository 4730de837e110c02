"""`raybench check --run` from end to end, over a stand-in for `raybench run` (fake_run.py)."""

import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from raybench_report import results
from raybench_report.__main__ import main
from raybench_report.decide import instructions, pairs, samples

FAKE = Path(__file__).with_name("fake_run.py")


def command(*words):
    return " ".join([sys.executable, "-S", "-E", str(FAKE), *map(str, words)])


def check(a, b, *words):
    return main(["check", "--run", a, b, "--seconds", "600", *words])


def test_the_same_program_passes_whatever_the_machine_does(tmp_path, capsys):
    """The speed of whole processes varies by 20 %: only ratios to the anchor tell anything."""
    same = command(0.3, 0.002)
    assert check(same, same, "--anchor", "library", "--pairs", "30", "--out", str(tmp_path)) == 0
    captured = capsys.readouterr()
    assert "20 pairs: 0 slower, 0 undecided, 4 within tolerance" in captured.out
    assert {path.name for path in tmp_path.iterdir()} >= {"check.json", "check.md", "junit.xml", "pairs.csv", "A", "B"}
    stream = pairs.read_stream(tmp_path / "pairs.csv")
    assert len(stream.times) == 20 and {True, False} == set(stream.a_first)
    told = json.loads((tmp_path / "check.json").read_text())
    again = stream.ratios("library")
    shown = {row["name"]: row["log_ratio"] for row in told["time"]["comparisons"]}
    assert shown == pytest.approx(dict(zip([c.name for c in again.comparisons], np.median(again.log_ratios, axis=1))))


def test_a_slower_one_fails_and_is_named(capsys):
    assert check(command(0, 0.002), command(0.1, 0.002), "--anchor", "library") == 1
    out = capsys.readouterr().out
    assert "fail" in out.splitlines()[1] and "fake / own" in out.splitlines()[1] and "library" not in out


def test_noise_beyond_the_budget_is_inconclusive(capsys):
    same = command(0, 0.3)
    assert check(same, same, "--anchor", "library", "--pairs", "22") == 3
    captured = capsys.readouterr()
    assert captured.out.splitlines()[-1].startswith("inconclusive") and "--seconds" in captured.out


def test_too_few_pairs_are_said_to_be_too_few(capsys):
    same = command(0, 0.002)
    assert check(same, same, "--pairs", "3") == 3
    assert "at least 20" in capsys.readouterr().out


def test_a_budget_far_too_short_for_a_look_is_not_spent(capsys, monkeypatch):
    monkeypatch.setattr(pairs.decision, "FEWEST_PAIRS", 10**6)
    same = command(0, 0.002)
    assert check(same, same, "--pairs", "30") == 3
    assert re.search(
        r"note: 3 pairs: a decision .* a pair takes 0\.\d+ s; .*--seconds \(\d+ beyond", capsys.readouterr().out
    )


def test_a_budget_without_any_pair_still_gives_the_exact_part(capsys):
    same = command(0, 0.002)
    assert main(["check", "--run", same, same, "--seconds", "0.001"]) == 3
    assert main(["check", "--run", same, command(0, 0.002, "11.5"), "--seconds", "0.001"]) == 1
    assert "0 pairs" in capsys.readouterr().out


def test_another_counter_fails_however_fast(capsys):
    assert check(command(0, 0.002), command(-0.5, 0.002, "10.501"), "--exact-only") == 1
    assert "10.501" in capsys.readouterr().out


@pytest.mark.parametrize("b", [command("broken", 0), "/no/such/program run"])
def test_a_program_that_fails_ends_it_with_one_line(capsys, b):
    assert check(command(0, 0.002), b) == 2
    error = [line for line in capsys.readouterr().err.splitlines() if line.startswith("raybench:")]
    assert len(error) == 1 and ("something is wrong" in error[0] or "No such file" in error[0])


def test_a_structure_that_is_new_or_timed_on_other_rays_is_left_out_and_said():
    at = [samples.Comparison("s", spec, "camera", "traced", "closest", 1) for spec in ("a", "b", "c")]
    a = samples.Times({at[0]: 1.0, at[1]: 1.0}, {at[0]: 64, at[1]: 64})
    b = samples.Times({at[0]: 2.0, at[1]: 1.0, at[2]: 1.0}, {at[0]: 64, at[1]: 16, at[2]: 64})
    ratios = samples.ratios_of([(a, b)])
    assert ratios.comparisons == [at[0]] and set(ratios.left_out) == {at[1], at[2]}


def test_files_are_named_without_their_folders_unless_that_mixes_them_up():
    assert results.short_names(["/a/x.ply", "soup(file=a/b)"]) == {
        "/a/x.ply": "x.ply",
        "soup(file=a/b)": "soup(file=a/b)",
    }
    assert results.short_names(["/a/x.ply", "/b/x.ply"]) == {"/a/x.ply": "/a/x.ply", "/b/x.ply": "/b/x.ply"}


def test_all_ray_sets_of_a_structure_are_a_comparison_of_their_own():
    at = [samples.Comparison("s", "a", ray_set, "traced", "closest", 1) for ray_set in ("x", "y", "z")]
    one = samples.Times(dict.fromkeys(at, 1.0), dict.fromkeys(at))
    two = samples.Times(dict(zip(at, (2.0, 8.0, 4.0))), dict.fromkeys(at))
    ratios = samples.ratios_of([(one, two)])
    assert ratios.comparisons[3].is_summary and np.exp(ratios.log_ratios[3]) == pytest.approx(4)


def test_two_commits_are_built_and_compared(tmp_path, monkeypatch):
    """A repository of one file, whose second commit is slower."""
    git = lambda *words: subprocess.run(["git", *words], cwd=tmp_path, check=True, capture_output=True)  # noqa: E731
    git("init", "-q")
    for slowdown in (0, 0.2):
        (tmp_path / "tool.sh").write_text(f'exec {command(slowdown, 0.002)} "$@"\n')
        git("add", "tool.sh")
        git("-c", "user.name=a", "-c", "user.email=a@b", "commit", "-qm", f"by {slowdown}")
    monkeypatch.chdir(tmp_path)
    words = ["check", "--commits", "HEAD~1", "HEAD", "--build", "cp tool.sh built.sh", "--anchor", "library"]
    binary = ["--binary", f"{tmp_path}/built.sh"]
    assert main([*words, *binary]) == 2  # not in the worktree
    assert main([*words, "--binary", "sh built.sh"]) == 2
    (tmp_path / "tool.sh").write_text("")
    assert main([*words, "--build", "cp tool.sh built.sh && chmod +x built.sh && sed -i '1i #!/bin/sh' built.sh",
                 "--binary", "built.sh"]) == 1  # fmt: skip
    assert (
        "worktree"
        not in subprocess.run(["git", "worktree", "list"], capture_output=True, text=True).stdout.split("\n")[1:]
    )
    assert main(["check", "--commits", "nothing", "HEAD"]) == 2
    assert main([*words, "--build", "false"]) == 2


def test_a_cancelled_check_leaves_no_worktree_and_no_build_behind(tmp_path):
    git = lambda *words: subprocess.run(["git", *words], cwd=tmp_path, check=True, capture_output=True)  # noqa: E731
    git("init", "-q")
    git("-c", "user.name=a", "-c", "user.email=a@b", "commit", "-qm", "empty", "--allow-empty")
    mark = tmp_path / "pid"
    words = [
        "check",
        "--commits",
        "HEAD",
        "HEAD",
        "--build",
        f"sleep 100 & echo $! > {mark}.new; mv {mark}.new {mark}; wait",
    ]
    running = subprocess.Popen(
        [sys.executable, "-m", "raybench_report", *words],
        cwd=tmp_path,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    )
    deadline = time.monotonic() + 60
    while not mark.exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    running.terminate()
    assert running.communicate(timeout=60)[1].endswith(b"raybench: interrupted\n") and running.returncode == 130
    assert len(git("worktree", "list").stdout.splitlines()) == 1
    with pytest.raises(ProcessLookupError):
        for _ in range(100):  # the system takes it away in a moment
            os.kill(int(mark.read_text()), 0)
            time.sleep(0.05)


def test_instructions_are_counted_over_as_few_passes_as_there_can_be():
    words = ["env", "A=1", "raybench", "run", "s", "--repetitions", "9", "--passes=2", "--rays", "1K"]
    assert instructions.shortest(words) == [
        *["env", "A=1", "raybench", "run", "s", "--rays", "1K", "--repetitions", "1", "--passes", "1"]
    ]
