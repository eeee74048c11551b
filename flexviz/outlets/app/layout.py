"""Where panels stand on pages of different size: rules for viser's docks, floating windows and canvas.

Wide pages have three columns, with legend and playback floating over the middle one. On narrower or lower
ones both become one bar under the 3D view; on still narrower ones columns become tabs: first 3D view and
plots, then the steps, too. `layout.js` measures the page, sets the classes that these rules name, and draws
bar and tabs.
"""

from __future__ import annotations

from flexviz.outlets.app.viser_private import (
    CANVAS,
    DOCK,
    DOCK_HANDLES,
    LEFT,
    NOTIFICATIONS,
    RIGHT,
    SHADOW,
    TAB,
    WINDOW,
    dock_width,
    window,
)

WITH_BAR = 1280  # [CSS pixels] narrower pages have the bar
LOW = 640  # [CSS pixels] so have lower ones: legend and playback would cover the 3D view
WITH_TABS = 1000  # [CSS pixels] narrower pages show 3D view or plots
ONE_COLUMN = 700  # [CSS pixels] narrower pages show one column
TIGHT = 1100  # [CSS pixels] narrower pages with three columns have narrower docks
BAR = 40  # [pixels] height of the bar
TABS = 34  # [pixels] height of the row of tabs
PANEL = 488  # [pixels] width of a panel that the bar opens
DOCKS = 310, 372  # [pixels] width of the left and right dock on tight pages
STEPS = 330  # [pixels] width of the steps beside 3D view or plots


def _opened(panel: str) -> str:
    return f'.fv-barred[data-fv-panel="{panel}"] {window(panel)}'


LAYOUT = f"""
#fv-bar, #fv-columns {{ display: none; position: fixed; box-sizing: border-box; z-index: 8;
  align-items: center; font-size: 12.5px; color: var(--fv-text);
  background: var(--fv-body); }}
#fv-bar button, #fv-columns button {{ border: 1px solid rgba(128, 128, 128, 0.45); border-radius: 4px;
  background: none; color: inherit; font: inherit; cursor: pointer; height: 28px; padding: 0 8px; }}
#fv-bar button[aria-pressed=true], #fv-columns button[aria-selected=true] {{ background: #0072B2; color: #fff;
  border-color: #0072B2; }}
#fv-bar svg, .fv-pin svg {{ display: block; fill: currentColor; }}
.fv-barred #fv-bar {{ display: flex; gap: 6px; bottom: 0; height: {BAR}px; padding: 0 8px;
  left: var(--fv-left); width: var(--fv-width); border-top: 1px solid rgba(128, 128, 128, 0.35);
  container-type: inline-size; }}
#fv-bar input {{ flex: 1 1 60px; min-width: 40px; accent-color: #0072B2; }}
#fv-bar output {{ white-space: nowrap; font-variant-numeric: tabular-nums; min-width: 3.4em;
  text-align: right; }}
.fv-key {{ display: flex; gap: 4px; align-items: center; white-space: nowrap; }}
.fv-key .fv-box {{ margin: 0; width: 11px; height: 15px; }}
@container (max-width: 620px) {{ .fv-key.names, #fv-bar output span {{ display: none; }} }}
@container (max-width: 420px) {{ .fv-key, #fv-bar button.fv-step {{ display: none; }} }}
.fv-barred {CANVAS} {{ bottom: {BAR}px !important; }}
.fv-barred {WINDOW} {{ display: none !important; }}
{_opened("Legend")}, {_opened("Playback")} {{ display: block !important; top: auto !important;
  left: var(--fv-left) !important; bottom: {BAR + 4}px; width: min({PANEL}px, var(--fv-width)) !important;
  height: auto !important; max-height: calc(100% - {BAR + 8}px); overflow-y: auto !important; }}
.fv-barred {NOTIFICATIONS} {{ left: calc(var(--fv-left) + 8px) !important;
  width: min(20em, calc(var(--fv-width) - 16px)) !important; min-width: 0; }}
.fv-tabbed {NOTIFICATIONS} {{ top: {TABS + 8}px !important; }}
.fv-tabbed {DOCK} {{ margin-top: {TABS}px; height: calc(100% - {TABS}px) !important; }}
.fv-tabbed #fv-columns {{ display: flex; top: 0; left: 0; right: 0; height: {TABS}px; padding: 0 8px;
  gap: 6px; }}
.fv-tabbed:not(.fv-single) #fv-columns {{ left: {STEPS}px; }}
.fv-tabbed:not(.fv-single) #fv-columns [data-column=steps] {{ display: none; }}
.fv-tabbed:not(.fv-single) {LEFT} {{ top: -{TABS}px !important; }}
.fv-tabbed:not(.fv-single) {DOCK} {{ overflow: visible !important; }}
{", ".join(f".fv-tabbed {part}" for part in (SHADOW, *DOCK_HANDLES))} {{ display: none !important; }}
.fv-tabbed {CANVAS} {{ left: {STEPS}px !important; right: 0 !important; }}
{dock_width(f".fv-tabbed {LEFT}", f"{STEPS}px")}
{dock_width(f".fv-tabbed {RIGHT}", "auto")}
.fv-tabbed {RIGHT} {{ left: {STEPS}px; bottom: {BAR}px !important; visibility: hidden; }}
.fv-tabbed[data-fv-column=plots] {RIGHT} {{ visibility: visible; }}
.fv-single {CANVAS}, .fv-single {RIGHT} {{ left: 0 !important; }}
{dock_width(f".fv-single {LEFT}", "100%")}
.fv-single {LEFT} {{ visibility: hidden; }}
.fv-single[data-fv-column=steps] {LEFT} {{ visibility: visible; }}
.fv-single[data-fv-column=steps] #fv-bar {{ display: none; }}
@media (min-width: {WITH_TABS}px) and (max-width: {TIGHT - 0.02}px) {{
{dock_width(LEFT, f"{DOCKS[0]}px")}{dock_width(RIGHT, f"{DOCKS[1]}px")}
{CANVAS} {{ left: {DOCKS[0]}px !important; right: {DOCKS[1]}px !important; }}
{SHADOW} {{ display: none; }}
{TAB} {{ padding-inline: 6px !important; }}
}}
.fv-pin {{ margin-left: auto; align-self: center; padding: 3px; border: none; border-radius: 3px;
  background: none; color: var(--fv-dimmed); cursor: pointer; }}
.fv-pin[aria-pressed=true] {{ background: #0072B2; color: #fff; }}
"""
