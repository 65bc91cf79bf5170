"""Find how far a scene is from its nearest failures, and how it fails there.

geometry    all lengths of a scene scaled, or all its points shifted
axes        the directions in which a scene is changed by a factor
cell        a changed scene, with its probes
verdict     right, wrong, without its contact, stopped or refused: a changed scene beside its
            reference
cause       the name of the limit that a wrong scene met
search      outward from the scene along each axis, then on pairs of axes
answer      margins, maps and messages as plain data and as sentences
figure      margins as bars, and maps of pairs
"""
