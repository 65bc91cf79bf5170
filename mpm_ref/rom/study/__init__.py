"""Reduced runs of scenes: `case` says what of a scene a reduced run knows, `march` steps it,
`errors` measures it beside the full-order run. The method itself is in `rom`, which knows no scene.
"""
