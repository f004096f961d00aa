"""``axialnav`` and ``python -m axialnav``: the command line, as much of it as is installed.

The verbs that fly need the core alone; every other verb needs the ``replay`` extra.
"""

from __future__ import annotations

import sys

ON_BOARD = ("live", "camera")


def main() -> int:
    """Run the command line and return its exit code; one line on stderr where the ``replay`` extra is missing."""
    if sys.argv[1:2] and sys.argv[1] in ON_BOARD:
        from axialnav.fusion.live.cli import main as on_board

        return on_board(sys.argv[1:])
    try:
        from axialnav.replay import cli
    except KeyboardInterrupt:
        print("axialnav: interrupted", file=sys.stderr)
        return 130
    except ModuleNotFoundError as missing:
        if missing.name is None or missing.name.partition(".")[0] == "axialnav":
            raise
        print(
            f"axialnav: the command line needs the package {missing.name!r}, which is not installed; "
            "install the 'replay' extra: pip install 'axialnav[replay]'",
            file=sys.stderr,
        )
        return 2
    return cli.main()


if __name__ == "__main__":
    sys.exit(main())
