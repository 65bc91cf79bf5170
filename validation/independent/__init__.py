"""Second implementations, written from the papers alone, and their agreement with the package."""
