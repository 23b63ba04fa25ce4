"""The command `trodden`, also as `python -m trodden`."""

from __future__ import annotations

import signal
import sys

from . import _trodden


def main() -> int:
    """Runs the command with the arguments of this process and returns its exit code."""
    # The command hears Ctrl-C itself; whoever started it may have told it not to.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _trodden.main(["trodden", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
