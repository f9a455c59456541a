"""The style sheet of the report: light and dark, wide and narrow screens, print."""

CSS = """
:root { color-scheme: light dark;
  --paper: #ffffff; --ink: #1c2024; --faint: #60646c; --line: #d9d9e0; --raised: #f5f5f8;
  --before: #b4531f; --after: #1b66b3; --x: #c3352b; --y: #18794e; --z: #1b66b3;
  --good: #18794e; --usable: #8f5f00; --refused: #b3261e; }
@media screen and (prefers-color-scheme: dark) { :root {
  --paper: #111315; --ink: #edeef0; --faint: #a5abb3; --line: #363a3f; --raised: #1a1d20;
  --before: #f0a070; --after: #70b8ff; --x: #ff8f86; --y: #4cc38a; --z: #70b8ff;
  --good: #4cc38a; --usable: #e2b447; --refused: #ff8f86; } }
* { box-sizing: border-box; }
html { -webkit-text-size-adjust: 100%; }
body { margin: 0 auto; padding: 1.5rem 1rem 4rem; max-width: 58rem; background: var(--paper);
  color: var(--ink); font: 16px/1.5 system-ui, sans-serif; overflow-wrap: break-word; }
h1 { font-size: 1.4rem; line-height: 1.25; margin: 0 0 .5rem; }
h2 { font-size: 1.1rem; margin: 2.4rem 0 .6rem; }
h3 { font-size: 1rem; margin: 1.4rem 0 .3rem; }
p, ul { margin: .5rem 0; }
.verdict { border-left: .35rem solid; padding: .6rem 1rem; background: var(--raised); font-size: 1.1rem; }
.good { border-color: var(--good); } .usable { border-color: var(--usable); }
.refused { border-color: var(--refused); }
.note, caption, th, figcaption { color: var(--faint); }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
caption { text-align: left; padding-bottom: .3rem; }
th, td { padding: .25rem 1.2rem .25rem 0; border-bottom: 1px solid var(--line); text-align: right;
  white-space: nowrap; }
th { font-weight: normal; } th[scope=row], td.words { text-align: left; }
td.words { white-space: normal; min-width: 7rem; } #accelerometer th:nth-child(5) { text-align: left; }
pre { background: var(--raised); padding: .8rem 1rem; overflow-x: auto; font-size: .85rem; }
code { user-select: all; } /* One click selects a whole command. */
figure { margin: 1.2rem 0 0; max-width: 40rem; }
figcaption { font-size: .9rem; }
svg { display: block; width: 100%; height: auto; }
@media (max-width: 34rem) { pre { font-size: .78rem; } #formula, #reproduce { white-space: pre-wrap; }
  th, td { padding-right: .7rem; font-size: .9rem; white-space: normal; }
  #accelerometer { width: 100%; } #accelerometer th:nth-child(5) { display: none; }
  #accelerometer tr { display: grid; grid-template-columns: 7rem repeat(3, 1fr);
    border-bottom: 1px solid var(--line); }
  #accelerometer th, #accelerometer td { border: 0; }
  #accelerometer td.words { grid-column: 1 / -1; padding-top: 0; }
  #accelerometer td.words:not(:empty)::before { content: "data sheet: "; color: var(--faint); } }
@media screen and (min-width: 72rem) { body { max-width: 80rem; } p:not(.verdict, #next) { max-width: 58rem; }
  .first { display: grid; grid-template-columns: minmax(0, 2.2fr) minmax(0, 1fr); gap: 0 2rem; font-size: .93rem; }
  .first > :last-child { order: -1; } .first .pair { display: block; } .first h2 { margin-top: 1rem; }
  .first ul { padding-left: 1.2rem; } }
.pair { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(21rem, 100%), 1fr)); gap: 0 1.5rem; }
details { margin: .8rem 0; } summary { cursor: pointer; font-weight: bold; }
@page { margin: 13mm; }
@media print { :root { color-scheme: light; } html { font-size: 9.5pt; } pre { white-space: pre-wrap; }
  body { max-width: none; padding: 0; font-size: 1rem; line-height: 1.35; }
  h1, h2, h3, h2 + p { break-after: avoid; } h2 { margin: 1rem 0 .3rem; } p, table, figure, li { break-inside: avoid; }
  th, td { padding: .1rem .9rem .1rem 0; } .pair { grid-template-columns: 1fr 1fr; } figure { margin-top: .4rem; }
  details:not([open]) { display: none; } }
"""
