"""`python -m flexviz` is the command `flexviz`."""

from flexviz.cli import main

raise SystemExit(main())
