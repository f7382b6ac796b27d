"""Tree files as text: formatted, compared, brought to version 4; comments and order are kept."""
