"""Command line: python -m raybench_report DIR, extremes DIR, heat FOLDER --out FILE.png, check ..., history ..."""

import argparse
import sys
from pathlib import Path

from . import extremes, heat, page, plots, results


def main(argv=None):
    """Does what the arguments say. Returns 0, or 2 after one line on stderr when the input is unfit."""
    argv = sys.argv[1:] if argv is None else argv
    commands = {"heat": _heat, "extremes": _extremes}
    draw = commands.get(argv[0], _report) if len(argv) > 1 else _report
    try:
        if argv[:1] in (["check"], ["history"]):
            return _decide(argv)
        print(draw(argv), end="")
    except SystemExit as error:  # by argparse
        return error.code
    except KeyboardInterrupt:
        print("raybench_report: interrupted", file=sys.stderr)
        return 130
    except (results.RunError, OSError) as error:
        print(f"raybench_report: {error}", file=sys.stderr)
        return 2
    return 0


def _decide(argv):
    """`raybench check` and `raybench history`; their exit codes."""
    if argv[0] == "check":  # scipy and ruptures take a while to import
        from .decide import command as chosen
    else:
        from .decide import history as chosen
    return chosen.main(argv[1:])


def _report(argv):
    """Draws DIR/plots and DIR/report.html."""
    parser = argparse.ArgumentParser(
        prog="raybench_report",
        description="Draws the plots (PNG and SVG) and report.html of a run from its CSV and JSON files.",
        epilog="raybench_report heat --help: a sheet of heat maps; extremes --help: the plots of raybench extremes.",
    )
    parser.add_argument("directory", metavar="DIR", type=Path, help="what `raybench run --out DIR` wrote")
    directory = parser.parse_args(argv).directory
    if (directory / "extremes.csv").is_file() and not (directory / "cases.csv").is_file():
        return _extremes(["extremes", str(directory)])
    run = results.read(directory)
    drawn = plots.draw_all(run)
    written = page.write(run, drawn, heat.draw_all(run))
    return f"{len(drawn)} plots as PNG and SVG in {directory / 'plots'}; {written}\n"


def _extremes(argv):
    """Draws DIR/plots and DIR/extremes.html."""
    parser = argparse.ArgumentParser(
        prog="raybench_report extremes", description="Draws a figure for each suite of `raybench extremes`."
    )
    parser.add_argument("directory", metavar="DIR", type=Path, help="what `raybench extremes --out DIR` wrote")
    directory = parser.parse_args(argv[1:]).directory
    found = extremes.read(directory)
    drawn = extremes.draw_all(found)
    written = extremes.write(found, drawn)
    return f"{len(drawn)} plots as PNG and SVG in {directory / 'plots'}; {written}\n"


def _heat(argv):
    """Draws a sheet of heat maps."""
    parser = argparse.ArgumentParser(
        prog="raybench_report heat", description="Draws the heat maps of one scene as a sheet with legends."
    )
    parser.add_argument("folder", metavar="FOLDER", type=Path, help="holds heat.json and the maps")
    parser.add_argument("--out", metavar="FILE.png", type=Path, required=True)
    parser.add_argument("--kind", choices=[*heat.KINDS, "both"], default="both")
    parser.add_argument("--scale", choices=["linear", "log", "auto"], default="auto")
    arguments = parser.parse_args(argv[1:])
    kinds = tuple(heat.KINDS) if arguments.kind == "both" else (arguments.kind,)
    heat.write(heat.read(arguments.folder), arguments.out, kinds, arguments.scale)
    return ""


if __name__ == "__main__":
    sys.exit(main())
