"""The `gesture-bot` command."""

STYLES = {"ok": "green", "look": "yellow", "bad": "bold red"}
"""Colours of what a check finds."""
