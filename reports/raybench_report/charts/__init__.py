"""Every chart of the report, a module an idea."""
