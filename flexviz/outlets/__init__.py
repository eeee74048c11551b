"""Where results go: terminal, app, reports, recordings, batches, exports."""
