"""The command `flexviz`, also as `python -m flexviz`."""

import signal
import sys


def command() -> int:
    """Run the command of `sys.argv`; Ctrl+C while it is loaded ends it without a traceback."""
    before = signal.getsignal(signal.SIGINT)
    if before is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from flexviz.outlets.terminal import main

    signal.signal(signal.SIGINT, before)
    return main()


if __name__ == "__main__":
    sys.exit(command())
