"""Training, evaluation and export: what `perception` learns from is made and handed on here."""
