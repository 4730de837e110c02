"""Command line: python -m raybench_report DIR."""

import argparse
import sys
from pathlib import Path

from . import page, plots, results


def main(argv=None):
    """Draws DIR/plots and DIR/report.html. Returns 0, or 2 after one line on stderr when DIR is unfit."""
    parser = argparse.ArgumentParser(
        prog="raybench_report",
        description="Draws the plots (PNG and SVG) and report.html of a run from its CSV and JSON files.",
    )
    parser.add_argument("directory", metavar="DIR", type=Path, help="what `raybench run --out DIR` wrote")
    try:
        arguments = parser.parse_args(argv)
    except SystemExit as error:
        return error.code
    try:
        run = results.read(arguments.directory)
        drawn = plots.draw_all(run)
        written = page.write(run, drawn)
    except (results.RunError, OSError) as error:
        print(f"raybench_report: {error}", file=sys.stderr)
        return 2
    print(f"{len(drawn)} plots as PNG and SVG in {arguments.directory / 'plots'}; {written}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
