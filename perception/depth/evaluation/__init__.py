"""How good depth is, against exact or measured distances."""
