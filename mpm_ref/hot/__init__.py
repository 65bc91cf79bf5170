"""HOT: the implicit step as a minimisation, with every method it is compared to."""
