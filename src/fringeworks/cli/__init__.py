"""The command line: one verb per arrow of the line, each in a module of its own; no logic.

What a verb needs beyond typer it imports when it runs, so that ``--help`` answers at once.
"""

from __future__ import annotations


def main() -> None:
    """Entry point of the console script."""
    from fringeworks.cli.app import app

    app()
