"""The pages of a run: summary, sheets, statements, figures."""
