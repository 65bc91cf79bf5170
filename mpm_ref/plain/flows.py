"""Return maps."""

def project(F, y, dt, law, flow):
    return F, y
def intact(y, flow):
    return y > 0
