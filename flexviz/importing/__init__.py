"""Import what people have — ROS bags, MCAP, CSV, Parquet, MATLAB, LeRobot — as a measurement set."""

from __future__ import annotations

from flexviz.importing.importing import Imported, import_logs
from flexviz.importing.looking import Looked, look
from flexviz.importing.mapping import Mapping, read_mapping

__all__ = ["Imported", "Looked", "Mapping", "import_logs", "look", "read_mapping"]
