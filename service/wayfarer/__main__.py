"""The `wayfarer` command, also as `python -m wayfarer`."""

import sys


def main() -> None:
    """Runs the command line. Ctrl-C ends it without a traceback while it is still loading, too."""
    try:
        from wayfarer.commands.cli import main as run

        run()
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()
