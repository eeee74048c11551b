"""A click into a plot over time moves the robots there.

viser reports no click into a plot, so a script on the page writes the instant into the time slider.
"""

from __future__ import annotations

from flexviz.wording import escape

TIME_LABEL = "Time [s]"  # of the slider
PLAYHEAD_LABEL = "now"  # of the series that marks the playback time
CLICK = 4  # [pixels] a press may move; more is a drag, which zooms
SCRIPT = f"""
if (!window.flexvizClicks) {{
  window.flexvizClicks = true;
  let down = null;
  const plot = e => e.target.closest ? e.target.closest('.u-over') : null;
  document.addEventListener('mousedown', e => {{ down = plot(e) ? [e.clientX, e.clientY] : null; }}, true);
  document.addEventListener('mouseup', e => {{
    const over = plot(e);
    if (!over || !down || Math.hypot(e.clientX - down[0], e.clientY - down[1]) > {CLICK}) return;
    const known = Object.values((window.__viserTestpoints || {{}}).uplots || {{}}).map(one => one.chart);
    const chart = known.find(one => one.over === over);
    if (!chart || !chart.series.some(one => one.label === '{PLAYHEAD_LABEL}')) return;
    const time = chart.posToVal(e.clientX - over.getBoundingClientRect().left, 'x');
    const label = [...document.querySelectorAll('label')].find(l => l.textContent.trim() === '{TIME_LABEL}');
    const row = label && label.closest('.mantine-Flex-root');
    const input = row && row.querySelector('input:not([type=hidden])');
    if (!input) return;
    const set = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, 'value').set;
    set.call(input, time.toFixed(2));
    input.dispatchEvent(new Event('input', {{ bubbles: true }}));
  }}, true);
}}
"""
HTML = f'<img src="data:," alt="" style="display: none" onerror="{escape(SCRIPT)}">'
