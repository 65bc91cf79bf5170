"""Studies of reduced models: full-order runs of a scene under many parameters, a reduced model of
them, and reduced runs that are recorded and evaluated.

A TOML file says what a study is (`tables`, `study_file`, `study`). Its runs are made by `generate`
and read by `dataset`; `reduce` computes or trains the reduced model; `run` steps it with `samples`,
`monitor` checks its states, `display` gives the bodies of a state, `record` writes and `resume`
continues the results file; `play` steps it under commands; `evaluate` compares runs that were held
out, with `baselines` and `errors`. `methods` has the parts in which LDM and NSF differ.
"""
