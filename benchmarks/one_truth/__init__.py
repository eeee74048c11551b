"""The studies of whether every command gives one model, measured by one yardstick."""
