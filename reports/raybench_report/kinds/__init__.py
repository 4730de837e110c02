"""Kinds of result folders: a module each, with what to read and what the report shows of it.

A new kind is a module with a `KIND` and its place in the list below.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path


GOOD, BAD, NEUTRAL = "correct", "refused", "neutral"


@dataclass
class Section:
    """A part of the page: a heading, sentences, charts, tables, and perhaps a template of its own beside the page's.

    nav     a short title for the row of links
    pictures  still ones: [(heading, [(data URL, caption)])]
    answer  what stands at the top of the page: (its colour there: GOOD, BAD or NEUTRAL, sentence)
    """

    name: str
    title: str
    nav: str = ""
    says: list = field(default_factory=list)
    charts: list = field(default_factory=list)
    tables: list = field(default_factory=list)
    pictures: list = field(default_factory=list)
    template: str | None = None
    data: dict = field(default_factory=dict)
    answer: tuple | None = None


@dataclass
class Table:
    """A static table: heads and rows of text or numbers."""

    name: str
    title: str
    heads: list
    rows: list

    @property
    def numeric(self):
        """Which columns have numbers."""
        return [any(isinstance(row[k], int | float) for row in self.rows) for k in range(len(self.heads))]


@dataclass
class Kind:
    """marker   the file by which such a folder is known; a pattern as of Path.glob()
    command  what leaves it
    read     folder → object with `directory`, to which `shown` is added; throws RunError
    sections (report, folders of this kind) → [Section]
    """

    name: str
    marker: str
    command: str
    read: Callable
    sections: Callable
    is_run: bool = False

    def holds(self, directory: Path):
        """Whether the folder is one of these."""
        return any(directory.glob(self.marker))


def all_kinds():
    """In the order in which folders are tried and sections stand."""
    from . import check, crossings, extremes, fuzz, history, offset, run, tradeoff, verify

    return [
        run.KIND, verify.KIND, crossings.KIND, offset.KIND, extremes.KIND, fuzz.KIND, check.KIND, tradeoff.KIND, history.KIND,
    ]  # fmt: skip
