"""One script per figure: `python -m figures [NAME...] --profile P` draws from results alone."""
