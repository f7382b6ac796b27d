"""What all networks share before they fly: files, export, and the training loop. Imports torch."""
