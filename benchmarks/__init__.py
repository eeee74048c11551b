"""Measurements of flexviz and of its tools. They are not part of the installed package."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small matrices: threads would only wait for each other
