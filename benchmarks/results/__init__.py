"""Everything that `docs/results.md` states: its commands, its figures and the page itself."""
