"""The `gesture-bot` command."""
