"""Figures and tables for a paper: the same charts and numbers as the page, no wider than a column."""

import csv
import re

import pytest
from made_up import full_run, without_time, write_run
from raybench_report import figures, tables
from raybench_report.__main__ import main
from test_report_page import read

CHARTS = {"rays_per_second", "build_time", "memory", "break_even", "error_and_speed", "visits", "tests", "bytes"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The figures of a run with a skipped and a refused structure; not to be changed."""
    rows = full_run(scenes=("/models/a_b.obj", "sphereflake(depth=5)"))
    for i, row in enumerate(rows):
        if row["spec"] == "brute" and row["query"] != "build":
            rows[i] = without_time(row, "skipped", "too slow")
        if (row["spec"], row["scene"]) == ("grid", "/models/a_b.obj"):
            rows[i] = without_time(row, "refused", "3 leaks")
    run = write_run(tmp_path_factory.mktemp("figures") / "run", rows)
    assert main([str(run), "--figures"]) == 0
    return run / "figures"


def test_each_chart_is_there_as_pdf_svg_png_and_csv(folder):
    assert {path.stem for path in folder.glob("*.pdf")} == CHARTS
    for name in CHARTS:
        assert (folder / f"{name}.pdf").read_bytes().startswith(b"%PDF")
        assert (folder / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        svg = (folder / f"{name}.svg").read_text()
        assert "sphereflake(depth=5)" in svg and "a_b.obj" in svg and "/models" not in svg
        assert len(list(csv.DictReader(open(folder / f"{name}.csv")))) > 5
    assert not list(folder.glob(".*"))


def test_no_figure_is_wider_than_a_column(folder):
    for name in CHARTS:
        width = float(re.search(r'<svg[^>]*\swidth="([\d.]+)"', (folder / f"{name}.svg").read_text())[1])
        assert 150 < width <= 252, name  # a column of IEEE's two


def test_what_was_refused_or_skipped_has_no_speed(folder):
    rates = list(csv.DictReader(open(folder / "rays_per_second.csv")))
    assert not [
        r for r in rates if r["spec"] in ("brute", "null") or (r["spec"], r["scene"]) == ("grid", "/models/a_b.obj")
    ]
    tex = (folder / "structures.tex").read_text()
    assert re.search(r"^grid & REFUSED & -- & -- & ", tex, re.MULTILINE)
    assert re.search(r"^brute & [a-z: ]+ & -- & -- & ", tex, re.MULTILINE)


def test_tables_say_the_same_in_latex_and_markdown(folder):
    for name in ("speed", "structures", "break_even_points"):
        tex, md = (folder / f"{name}.tex").read_text(), (folder / f"{name}.md").read_text()
        rows = [line for line in tex.splitlines() if line.endswith(r"\\") and " & " in line][1:]
        body = [line for line in md.splitlines()[2:] if "**" not in line]
        assert len(rows) == len(body) > 4
        for one, other in zip(rows, body, strict=True):
            plain = one.removesuffix(r" \\").replace("\\_", "_").replace("\\%", "%").replace(" -- ", " – ")
            assert plain.split(" & ")[0] == other.split(" | ")[0].removeprefix("| "), name
        assert tex.count("{") == tex.count("}") and r"\toprule" in tex and r"\bottomrule" in tex
        assert not re.search(r"(?<!\\)[_%#](?!.*booktabs)", tex.split("\n", 1)[1])


def test_numbers_of_the_tables_are_those_of_the_run(folder):
    found = read(folder.parent)
    cases = found.timed_queries
    row = cases[(cases["spec"] == "embree") & (cases["label"] == "a_b.obj") & (cases["rays_label"] == "camera")].iloc[0]
    line = next(line for line in (folder / "speed.md").read_text().splitlines() if line.startswith("| embree |"))
    assert line.split(" | ")[1] == tables.figure(row["rate"] / 1e6, 3)


def test_special_letters_of_latex_are_escaped():
    table = figures.PaperTable("t", "T", ["a_b", "50 %"], [["x{y}^2", "~1"], ["a\\b & c"]], [False, True])
    text = figures.latex(table)
    assert r"a\_b & \shortstack[r]{50 \\ \%}" in text and r"x\{y\}\textasciicircum{}2 & \textasciitilde{}1" in text
    assert r"\textit{a\textbackslash{}b \& c}" in text


def test_a_folder_of_its_own_can_be_named(tmp_path, capsys):
    run = write_run(tmp_path / "run", full_run(scenes=("s",), specs=("bvh_sah", "grid")))
    assert main([str(run), "--figures", "-o", str(tmp_path / "paper")]) == 0
    assert (tmp_path / "paper" / "speed.tex").is_file() and not (run / "figures").exists()
    assert "tables (LaTeX, Markdown)" in capsys.readouterr().out
