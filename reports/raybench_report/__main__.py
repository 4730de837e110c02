"""Command line: python -m raybench_report DIR..., explain A B DIR, heat FOLDER --out FILE.png, check ..., history ...,
tradeoff ..., tune ..., advise ..."""

import argparse
import json
import sys
from importlib import import_module
from pathlib import Path

from .errors import RunError


def main(argv=None):
    """Does what the arguments say. Returns 0, or 2 after one line on stderr when the input is unfit."""
    argv = sys.argv[1:] if argv is None else argv
    commands = {"heat": _heat, "explain": _explain}
    draw = commands.get(argv[0], _report) if len(argv) > 1 else _report
    try:
        if argv and argv[0] in COMMANDS:
            return _command(argv)
        print(draw(argv), end="")
    except SystemExit as error:  # by argparse
        return error.code
    except KeyboardInterrupt:
        print("raybench: interrupted", file=sys.stderr)
        return 130
    except (RunError, OSError) as error:
        print(f"raybench: {error}", file=sys.stderr)
        return 2
    return 0


# What decides, measures or advises by itself; imported when asked for: scipy, ruptures and optuna take a while.
COMMANDS = {
    "check": ".decide.command", "history": ".decide.history", "tradeoff": ".trade.command", "tune": ".trade.tune",
    "advise": ".trade.advise",
}  # fmt: skip


def _command(argv):
    """`raybench check` and others; their exit codes."""
    return import_module(COMMANDS[argv[0]], __package__).main(argv[1:])


def _report(argv):
    """Writes report.html, or figures and tables for a paper."""
    parser = argparse.ArgumentParser(
        prog="raybench report",
        description="Makes one self-contained page of result folders, several runs side by side.",
        epilog="python -m raybench_report heat --help: a sheet of heat maps; explain --help: the gap between two structures.",
    )
    parser.add_argument(
        "directories",
        metavar="DIR",
        nargs="+",
        type=Path,
        help="what run, verify, extremes, fuzz, check-plugin, check or tradeoff wrote with --out, or the store of history add",
    )
    parser.add_argument(
        "-o", "--out", metavar="FILE", type=Path, help="the page; default: report.html in the first DIR"
    )
    parser.add_argument(
        "--figures",
        action="store_true",
        help="write figures (PDF, SVG, PNG) and tables (LaTeX, Markdown, CSV) instead, to the folder `figures`, or --out",
    )
    arguments = parser.parse_args(argv)
    if arguments.figures:
        from . import figures

        return figures.write(arguments.out or arguments.directories[0] / "figures", *_read(arguments.directories))
    out = arguments.out or arguments.directories[0] / "report.html"
    write_page(arguments.directories, out)
    return f"report  {out} ({out.stat().st_size / 1e6:.1f} MB)\n"


def write_page(directories, out):
    """Writes the page of result folders. Throws RunError, OSError."""
    from . import page

    page.write(out, *_read(directories))


def _read(directories):
    """(report, sections) of result folders."""
    from . import report  # pandas takes a while to import
    from .kinds import all_kinds

    kinds = all_kinds()
    found = report.read(directories, kinds)
    return found, [
        section
        for kind in kinds
        if (
            folders := [f for f in [*found.runs, *found.others] if kind.holds(f.directory) and _first(kinds, f) is kind]
        )
        for section in kind.sections(found, folders)
    ]


def _first(kinds, folder):
    return next(kind for kind in kinds if kind.holds(folder.directory))


def _explain(argv):
    """Prints why one structure is slower than another."""
    from . import explain, report
    from .kinds import all_kinds

    parser = argparse.ArgumentParser(
        prog="raybench explain",
        description="Splits the gap between two structures into visits, primitive tests and bytes, and time per each.",
    )
    parser.add_argument("one", metavar="A")
    parser.add_argument("other", metavar="B")
    parser.add_argument("directory", metavar="DIR", type=Path, help="what `raybench run --out DIR` wrote")
    parser.add_argument("--scene", help="one scene only")
    parser.add_argument("--rays", help="one ray set only")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args(argv[1:])
    found = report.read([arguments.directory], [kind for kind in all_kinds() if kind.is_run])
    run = found.runs[0].shown
    gaps = explain.gaps(found, arguments.one, arguments.other, run, arguments.scene, arguments.rays)
    if arguments.json:
        return json.dumps(explain.as_json(gaps), indent=1) + "\n"
    return explain.text(found, arguments.one, arguments.other, gaps, run)


def _heat(argv):
    """Draws a sheet of heat maps."""
    from . import heat, heat_sheet

    parser = argparse.ArgumentParser(
        prog="python -m raybench_report heat", description="Draws the heat maps of one scene as a sheet with legends."
    )
    parser.add_argument("folder", metavar="FOLDER", type=Path, help="holds heat.json and the maps")
    parser.add_argument("--out", metavar="FILE.png", type=Path, required=True)
    parser.add_argument("--kind", choices=[*heat.KINDS, "both"], default="both")
    parser.add_argument("--scale", choices=["linear", "log", "auto"], default="auto")
    arguments = parser.parse_args(argv[1:])
    kinds = tuple(heat.KINDS) if arguments.kind == "both" else (arguments.kind,)
    heat_sheet.write(heat.read(arguments.folder), arguments.out, kinds, arguments.scale)
    return ""


if __name__ == "__main__":
    sys.exit(main())
