"""The columns of all result tables, from columns.json, which the C++ part is built with too."""

import json
from pathlib import Path

_DATA = json.loads((Path(__file__).parent / "columns.json").read_text(encoding="utf-8"))
FORMAT = _DATA["format"]  # of result folders


def columns_of(table):
    """(name, type, unit, whether it varies between runs, meaning) of each column of a table such as "cases.csv"."""
    return [
        (name, row["type"], row.get("unit", ""), row.get("varies", False), row["meaning"])
        for row in _DATA["tables"][table]
        for name in row["columns"]
    ]


def later(table):
    """Names of the columns that older folders of the same format lack."""
    return [name for row in _DATA["tables"][table] if row.get("later") for name in row["columns"]]


def markdown(table):
    """The table's columns as reports/README.md shows them."""
    lines = ["| column | type | meaning |", "|---|---|---|"]
    for row in _DATA["tables"][table]:
        names = [f"`{name}`" for name in row["columns"]]
        kind = ", ".join([row["type"], *([row["unit"]] if "unit" in row else [])])
        star = "*" if row.get("varies") else ""
        lines.append(f"| {', '.join(names)}{star} | {kind} | {row['meaning'].replace('|', chr(92) + '|')} |")
    return "\n".join(lines)


if __name__ == "__main__":
    for name in _DATA["tables"]:
        print(f"## {name}\n\n{markdown(name)}\n")
