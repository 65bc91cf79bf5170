"""Studies of NSF's reduced model, whose stress is inferred: what differs from LDM's, file by file
as in the folder above.
"""
