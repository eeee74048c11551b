"""The parts of a report, one file each: a function from what there is to tell to a section."""
