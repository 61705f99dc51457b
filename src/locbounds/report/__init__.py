"""Results for people: figures, tables, files, and scenarios in words."""
