"""What every room uses: errors, files, other processes, documents, units. It knows no robots."""
