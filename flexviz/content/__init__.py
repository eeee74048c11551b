"""What is said and shown of a result, independent of any medium: records, texts, charts, sessions, scenes."""
