"""Laws learned from scenes: studies, their trainings, and comparisons with the true laws."""
