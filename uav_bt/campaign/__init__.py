"""Many flights: planned, flown in processes of their own, kept line by line, resumed."""
