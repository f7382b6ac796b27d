"""Reports of campaigns: a page with figures, tables and comparisons."""
