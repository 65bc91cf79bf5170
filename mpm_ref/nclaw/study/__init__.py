"""Laws learned from scenes: studies and their trainings; learned laws beside the true ones."""
