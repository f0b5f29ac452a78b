"""The `poise` command, one module a verb."""
