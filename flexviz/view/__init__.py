"""What the screen shows, computed: plots, tables, sentences, colours and poses as plain data.

Nothing here knows a browser. The app renders these, tests read them, a report can print them.
"""
