"""The program `mpm-ref`, which `python -m mpm_ref` also runs.

Ctrl-C while the modules are imported, which takes seconds, ends it in one line too.
"""

import sys

INTERRUPT = 130     # exit status of Ctrl-C

try:
    from .cli import main
except KeyboardInterrupt:
    print("mpm-ref: interrupted", file=sys.stderr)
    raise SystemExit(INTERRUPT) from None

if __name__ == "__main__":
    main()
