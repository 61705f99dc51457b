"""The shell: ``locbounds COMMAND``. Nothing heavy is imported before a command needs it."""

from locbounds.cli.app import main

__all__ = ["main"]
