"""Find how far a scene is from its nearest failures, and how it fails there.

    geometry    all lengths of a scene scaled, or all its points shifted
    axes        the directions in which a scene is changed by a factor
    verdict     right, wrong, stopped, refused: a changed scene beside its reference
    search      outward from the scene along each axis, then between the last good factor and the
                first bad one; then two axes at a time
    answer      margins, maps and messages as plain data and as sentences
    figure      margins as bars, maps of pairs
"""
