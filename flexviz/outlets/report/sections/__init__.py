"""The sections of a report: one module each, with a function from ReportContent to Section."""
