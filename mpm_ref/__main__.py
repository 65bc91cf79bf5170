"""The program `mpm-ref`, which `python -m mpm_ref` also runs."""

import sys

INTERRUPT = 130     # exit status of Ctrl-C


def main():
    """Run the command line; Ctrl-C while its modules are imported ends it in one line too."""
    try:
        from .cli import main as run

        run()
    except KeyboardInterrupt:
        print("mpm-ref: interrupted", file=sys.stderr)
        raise SystemExit(INTERRUPT) from None


if __name__ == "__main__":
    main()
