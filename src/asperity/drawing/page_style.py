"""The look of the report."""

STYLE = """
:root { color-scheme: light; }
body { margin: 0; background: #f4f4f1; color: #1d1d1b;
  font: 16px/1.55 system-ui, "Segoe UI", "Helvetica Neue", Arial, sans-serif; }
main { max-width: 1020px; margin: 0 auto; padding: 2.5rem 1.5rem 4rem; }
header { border-bottom: 3px solid #0072b2; margin-bottom: 2rem; }
h1 { font-size: 2.2rem; line-height: 1.15; margin: 0 0 .5rem; letter-spacing: -.02em; }
h2 { font-size: 1.35rem; margin: 0 0 .6rem; }
h3 { font-size: 1.05rem; margin: 1.6rem 0 .2rem; }
.lead { font-size: 1.15rem; max-width: 46em; }
.meta { color: #5a5a55; font-size: .92rem; }
section { background: #fff; border: 1px solid #e2e2dc; border-radius: 8px;
  padding: 1.4rem 1.6rem; margin: 0 0 1.4rem; }
section p { max-width: 52em; }
figure { margin: 1rem 0; }
figure img { width: 100%; height: auto; display: block; }
.pair { display: grid; grid-template-columns: 1fr 1fr; gap: 0 1.2rem; }
@media (max-width: 760px) { .pair { grid-template-columns: 1fr; } }
.figures { background: #f4f4f1; border-radius: 6px; padding: .5rem .8rem; font-size: .9rem; }
section p.figures { max-width: none; }
figcaption { color: #5a5a55; font-size: .88rem; margin-top: .3rem; }
table { border-collapse: collapse; font-size: .9rem; }
table.facts th { text-align: left; font-weight: 600; padding: .18rem 1.4rem .18rem 0; }
table.claims { width: 100%; }
table.claims th { text-align: left; font-weight: 600; border-bottom: 2px solid #d5d5ce;
  padding: .4rem .6rem; vertical-align: bottom; }
table.claims td { border-bottom: 1px solid #eaeae5; padding: .45rem .6rem; vertical-align: top; }
table.claims small { color: #5a5a55; }
td.yes { color: #00634a; background: #edf7f2; font-weight: 600; min-width: 6.2em; }
td.no { color: #8a3b00; background: #fdf3ea; font-weight: 600; min-width: 6.2em; }
td.yes small, td.no small { font-weight: 400; }
.audio { display: flex; align-items: center; gap: .8rem; font-size: .88rem; color: #5a5a55; }
details summary { cursor: pointer; font-weight: 600; }
details table { margin-top: 1rem; }
code { font-size: .85em; overflow-wrap: anywhere; }
@media print { body { background: #fff; } section { break-inside: avoid; border: 0; padding: 0; } }
"""
