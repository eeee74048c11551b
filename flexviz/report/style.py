"""Style sheet of the HTML report for screen and print."""

from __future__ import annotations

CSS = """
:root { color-scheme: light; --ink: #1a1a1a; --faint: #595959; --line: #d0d0d0; --blue: #0072B2;
  --good: #009E73; --warn: #E69F00; --bad: #D55E00; }
* { box-sizing: border-box; }
body { margin: 0; background: #ffffff; color: var(--ink);
  font: 15px/1.5 system-ui, -apple-system, "Segoe UI", "DejaVu Sans", Arial, sans-serif; }
main { max-width: 920px; margin: 0 auto; padding: 28px 24px 60px; }
header { border-bottom: 3px solid var(--blue); padding-bottom: 12px; margin-bottom: 20px; }
h1 { font-size: 26px; line-height: 1.25; margin: 0 0 4px; overflow-wrap: anywhere; }
h2 { font-size: 20px; margin: 36px 0 10px; padding-top: 10px; border-top: 1px solid var(--line); }
section:first-of-type > h2 { border-top: none; margin-top: 0; padding-top: 0; }
h3 { font-size: 16px; margin: 24px 0 6px; overflow-wrap: anywhere; }
p { margin: 8px 0; max-width: 78ch; overflow-wrap: anywhere; }
.sub { color: var(--faint); margin: 0; }
.quiet { color: var(--faint); font-size: 13.5px; }
.tag { display: inline-block; border: 1px solid var(--faint); border-radius: 3px; padding: 0 7px;
  font-size: 12.5px; margin-right: 6px; }
.callout { border-left: 6px solid var(--faint); background: #f5f5f5; padding: 11px 15px; margin: 12px 0;
  font-size: 16.5px; max-width: none; }
.callout b { font-weight: 600; }
.callout.good { border-color: var(--good); background: #eef8f4; }
.callout.missing { border-color: var(--blue); background: #eef5fa; }
.callout.unknown { border-color: var(--bad); background: #fcf2ec; }
.callout.warn { border-color: var(--warn); background: #fdf6e6; font-size: 14.5px; }
.tiles { display: flex; flex-wrap: wrap; gap: 12px; margin: 16px 0; padding: 0; }
.tiles > div { flex: 1 1 190px; border: 1px solid var(--line); border-radius: 4px; padding: 9px 13px; }
.tiles dt { color: var(--faint); font-size: 13px; }
.tiles dd { margin: 0; }
.tiles .value { font-size: 19px; font-weight: 600; line-height: 1.3; font-variant-numeric: tabular-nums; }
.tiles .note { color: var(--faint); font-size: 12.5px; line-height: 1.35; }
.wide { overflow-x: auto; margin: 12px 0 16px; }
table { border-collapse: collapse; font-size: 13.5px; font-variant-numeric: tabular-nums;
  min-width: min(100%, 34em); }
caption { text-align: left; font-weight: 600; font-size: 14px; padding: 4px 0; }
th, td { text-align: left; padding: 3px 12px 3px 0; border-bottom: 1px solid #e6e6e6; vertical-align: top; }
th { color: var(--faint); font-weight: 600; border-bottom: 1px solid var(--faint); vertical-align: bottom; }
td { overflow-wrap: anywhere; }
th.n, td.n { text-align: right; white-space: nowrap; overflow-wrap: normal; }
th.n { white-space: normal; }
td.heat { padding: 3px 8px; border: 2px solid #ffffff; }
table.dense { font-size: 12px; }
table.dense th, table.dense td { padding-right: 8px; }
figure { margin: 16px 0 20px; }
figure svg { display: block; width: 100%; height: auto;
  font: 12px system-ui, "DejaVu Sans", Arial, sans-serif; }
figcaption { font-size: 13.5px; color: var(--faint); max-width: 88ch; overflow-wrap: anywhere; }
figcaption b { color: var(--ink); }
ul { margin: 8px 0; padding-left: 22px; max-width: 78ch; }
li { margin: 4px 0; overflow-wrap: anywhere; }
pre { background: #f5f5f5; border: 1px solid #e0e0e0; border-radius: 3px; padding: 9px 12px;
  font-size: 12.5px; line-height: 1.45; white-space: pre-wrap; overflow-wrap: anywhere; margin: 6px 0 14px; }
code, pre { font-family: ui-monospace, "DejaVu Sans Mono", Menlo, Consolas, monospace; }
footer { margin-top: 40px; border-top: 1px solid var(--line); padding-top: 8px; color: var(--faint);
  font-size: 12.5px; }
@page { size: A4; margin: 15mm 14mm 16mm;
  @bottom-right { content: counter(page) " / " counter(pages); font-size: 8pt; color: #595959; } }
@media print {
  body { font-size: 10.5pt; }
  main { max-width: none; padding: 0; }
  h1 { font-size: 18pt; }
  h2 { font-size: 14pt; margin-top: 16pt; }
  h3 { font-size: 11.5pt; margin-top: 12pt; }
  h2, h3, caption { break-after: avoid; }
  .quiet, figcaption, table, .tiles dt, .tiles .note { font-size: 9pt; }
  .callout { font-size: 11.5pt; }
  .callout.warn { font-size: 10pt; }
  .tiles .value { font-size: 13.5pt; }
  .tiles > div { flex-basis: 38mm; }
  table.dense, pre { font-size: 7.5pt; }
  th, td { padding-right: 7px; }
  caption { font-size: 9.5pt; }
  .wide { overflow: visible; }
  figure svg { width: 165mm; }
  figure, .callout, .tiles, tr, li, pre, table.short { break-inside: avoid; }
  thead { display: table-header-group; }
  p, li { orphans: 3; widows: 3; }
  p, ul, figcaption { max-width: none; }
  * { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
}
"""
