#!/bin/sh
# Make sure there is a Chromium with fonts for the browser tests; usage: install_chromium.sh PYTHON
# Nothing is done when one is there: $FLEXVIZ_CHROMIUM, chromium or google-chrome on the PATH, or Playwright's.
set -u
python=$1

playwright_has_one() {
    "$python" - <<'PY'
import pathlib, sys
from playwright.sync_api import sync_playwright
with sync_playwright() as playwright:
    sys.exit(not pathlib.Path(playwright.chromium.executable_path).exists())
PY
}

[ -n "${FLEXVIZ_CHROMIUM:-}" ] && [ -x "$FLEXVIZ_CHROMIUM" ] && exit 0
for name in chromium chromium-browser google-chrome; do
    command -v "$name" >/dev/null 2>&1 && exit 0
done
playwright_has_one 2>/dev/null && exit 0

if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null 2>&1; then
    echo "installing Chromium and fonts with apt-get" >&2
    { apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends \
        chromium fonts-dejavu-core fonts-liberation; } >&2
    command -v chromium >/dev/null 2>&1 && exit 0
fi

echo "installing Playwright's Chromium" >&2
if "$python" -m playwright install chromium >&2; then
    exit 0
fi

cat >&2 <<'END'
No Chromium was found and none could be installed. The browser tests need one:
  Debian:         sudo apt install chromium fonts-dejavu-core fonts-liberation
  other systems:  install Chromium or Chrome so that "chromium" or "google-chrome" is on the PATH,
                  or set FLEXVIZ_CHROMIUM to its program file
END
exit 1
