"""Run a scene under many settings, and measure the same quantities in each run.

setting     a scene with other grid spacing, particles, time step, transfer or integrator
probes      material points that all runs of a scene share, whatever their particles
quantity    quantities of interest: positions, fronts, energies, impulses, means in a box
observation one run: its quantities at given times, its cost, and how it ended
contacts    bodies that come near a collider, a wall or each other
store       a folder of observations, so that no run is made twice
"""
