"""Find the ingredients of a scene that its quantities of interest do not require.

ingredients  the parts of a scene that can be removed, each with its removal
symmetry     the symmetric half of a scene
variant      a scene after removals, and its difference from the scene as given
removal      runs with one ingredient less, then without all that are not required
code_parts   arrays, stages and kernels that the code uses for a scene
answer       the table, the JSON file and the lean scene
"""
