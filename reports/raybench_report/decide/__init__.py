"""Decisions about regressions: pure functions of result files and of arrays. reports/DECISIONS.md has the rules."""
