"""One command that scores `flexviz diagnose` on every kind of set, for one version or two side by side."""
