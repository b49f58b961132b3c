"""The command ``organza``, which the package installs."""

from __future__ import annotations

import signal
import sys

from . import _native


def main() -> int:
    """Runs the command line of this process and returns its exit status."""
    # Python would notice Ctrl-C only when the command has ended.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _native.run_command(sys.argv, _native.__file__ or "")


if __name__ == "__main__":
    sys.exit(main())
