"""Mission files that ship with the project; `README.md` beside them lists them."""
