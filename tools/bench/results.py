"""Results of a bench as Markdown and JSON, kept with the date and the commit; plots as SVG."""
import datetime
import html
import json
import math
import os
import pathlib
import platform
import subprocess

HERE = pathlib.Path(__file__).resolve().parent
FOLDER = HERE / "results"
WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 480, 320, 64, 16, 40, 48
COLOURS = ("#0b5394", "#b45f06", "#38761d", "#741b47")


def processor():
    try:
        lines = pathlib.Path("/proc/cpuinfo").read_text().splitlines()
        return next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def commit():
    def git(*words):
        return subprocess.run(["git", "-C", str(HERE), *words], capture_output=True, text=True).stdout.strip()

    return git("rev-parse", "--short=10", "HEAD") + ("+" if git("status", "--porcelain", "--untracked-files=no") else "")


def circumstances():
    """When, of what, on what. The commit ends in + where files differ from it."""
    return dict(
        date=datetime.datetime.now(datetime.timezone.utc).strftime("%Y-%m-%d %H:%M UTC"), commit=commit(), processor=processor(),
        cores=len(os.sched_getaffinity(0)), load=round(os.getloadavg()[0], 2),
    )


def keep(name, before, markdown, data, plots=None):
    """Writes results/DATE-COMMIT-NAME.md, .json and a .svg for each of `plots`; `before`: the circumstances at the start."""
    FOLDER.mkdir(exist_ok=True)
    stem = f"{before['date'][:10]}-{before['commit'].rstrip('+')}-{name}"
    head = f"# {name}, {before['date']}, commit {before['commit']}\n"
    head += f"{before['processor']}, {before['cores']} cores; load before {before['load']}.\n"
    pictures = ""
    for title, svg in (plots or {}).items():
        file = FOLDER / f"{stem}-{title}.svg"
        file.write_text(svg)
        pictures += f"\n![{title}]({file.name})\n"
    (FOLDER / f"{stem}.md").write_text(head + "\n" + markdown.strip() + "\n" + pictures)
    (FOLDER / f"{stem}.json").write_text(json.dumps(dict(before, **data), indent=1) + "\n")
    print(f"\nkept: {FOLDER / stem}.md, .json" + (f" and {len(plots)} plots" if plots else ""))


def table(columns, rows):
    """Markdown."""
    lines = ["| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


def ticks(low, high):
    """Powers of ten between the two, and 2 and 5 times them where there are few."""
    tens = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    steps = (1,) if math.log10(high / low) > 2 else (1, 2, 5)
    return [s * 10.0**t for t in tens for s in steps if low * 0.999 <= s * 10.0**t <= high * 1.001]


def short(value):
    return f"{value:,.0f}" if 1 <= value < 1e5 else f"{value:.0e}".replace("e+0", "e").replace("e-0", "e-") if value >= 1e5 else f"{value:g}"


def plot(title, x_name, y_name, series):
    """A log-log plot. `series`: name to points (x, y)."""
    points = [p for curve in series.values() for p in curve]

    def reach(k):
        low, high = min(p[k] for p in points), max(p[k] for p in points)
        # At least a factor of four, with a little room.
        pad = max(1.1, math.sqrt(4 / (high / low)))
        return low / pad, high * pad

    (x0, x1), (y0, y1) = reach(0), reach(1)
    across = lambda x: LEFT + (WIDTH - LEFT - RIGHT) * math.log(x / x0) / math.log(x1 / x0)
    down = lambda y: HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * math.log(y / y0) / math.log(y1 / y0)
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" font-size="11">',
           f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#fff"/>',
           f'<text x="{WIDTH / 2}" y="16" text-anchor="middle" font-size="13">{html.escape(title)}</text>']
    for x in ticks(x0, x1):
        out.append(f'<path d="M{across(x):.1f} {TOP}V{HEIGHT - BOTTOM}" stroke="#ddd"/>'
                   f'<text x="{across(x):.1f}" y="{HEIGHT - BOTTOM + 15}" text-anchor="middle">{short(x)}</text>')
    for y in ticks(y0, y1):
        out.append(f'<path d="M{LEFT} {down(y):.1f}H{WIDTH - RIGHT}" stroke="#ddd"/>'
                   f'<text x="{LEFT - 5}" y="{down(y) + 4:.1f}" text-anchor="end">{short(y)}</text>')
    out.append(f'<text x="{(LEFT + WIDTH - RIGHT) / 2}" y="{HEIGHT - 10}" text-anchor="middle">{html.escape(x_name)}</text>'
               f'<text transform="translate(14 {(TOP + HEIGHT - BOTTOM) / 2}) rotate(-90)" text-anchor="middle">{html.escape(y_name)}</text>')
    for k, (name, curve) in enumerate(series.items()):
        colour = COLOURS[k % len(COLOURS)]
        path = " ".join(f"{across(x):.1f},{down(y):.1f}" for x, y in curve)
        out.append(f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="2"/>')
        out += [f'<circle cx="{across(x):.1f}" cy="{down(y):.1f}" r="3" fill="{colour}"/>' for x, y in curve]
        if len(series) > 1:
            out.append(f'<text x="{LEFT + 6}" y="{TOP - 8}" dx="{k * 150}" fill="{colour}">{html.escape(name)}</text>')
    return "\n".join(out + ["</svg>"]) + "\n"
