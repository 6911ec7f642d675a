#!/usr/bin/env python3
"""Draws exploration.svg from a recording: top view of the cave with the agents' paths, and explored share.

    python3 -m venv /tmp/maes-draw && /tmp/maes-draw/bin/pip install mcap mcap-ros2-support
    maes run --agents 5 --record run.mcap
    /tmp/maes-draw/bin/python docs/images/draw.py run.mcap docs/images/exploration.svg

The same recording gives the same picture. It is also an example of how to read a recording without ROS.
"""

import sys
from xml.sax.saxutils import escape

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

# The palette of Okabe and Ito, distinguishable with colour vision deficiency.
COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"]
INK = "#1f2328"
GREY = "#59636e"
RULE = "#d1d9e0"
PAPER = "#ffffff"
ROCK = "#8c959f"
# From a column of the cave with few free cells to one with many.
OPEN = ["#d3dae1", "#e2e7ec", "#eff2f5", "#fafbfc"]

WIDTH, HEIGHT = 920, 470
MAP = {"x": 58, "y": 56, "size": 340}
PLOT = {"x": 482, "y": 56, "width": 410, "height": 340}

# Path simplification: points nearer than this to the line without them are dropped, metres.
TOLERANCE_M = 0.05


def read_m3dm(data):
    """Sizes along x, y, z and the walls of a map: a function of cell coordinates (docs/maps.md)."""
    head = int.from_bytes(data[:3], "big")
    size_x, size_z, size_y, padding = head >> 17, head >> 10 & 127, head >> 3 & 127, head & 7

    def is_wall(x, y, z):
        bit = padding + (x * size_z + z) * size_y + y
        return data[3 + bit // 8] >> (7 - bit % 8) & 1 == 1

    return (size_x, size_y, size_z), is_wall


def read(file):
    """What the picture needs of a recording."""
    with open(file, "rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        documents = {attachment.name: attachment.data for attachment in reader.iter_attachments()}
        if "map.m3dm" not in documents:
            sys.exit(
                f"{file}: no attachment map.m3dm, so the map is too large for this picture or the file is another one"
            )
        ways, shares, cell_m, result = {}, [], 1.0, None
        for _schema, channel, message, content in reader.iter_decoded_messages(
            topics=["/sim/scenario", "/sim/progress", "/sim/result", "/tf"]
        ):
            if channel.topic == "/tf":
                for transform in content.transforms:
                    agent = int(transform.child_frame_id.removeprefix("agent_").removesuffix("/base_link"))
                    place = transform.transform.translation
                    ways.setdefault(agent, []).append((place.x, place.y))
            elif channel.topic == "/sim/progress":
                shares.append((message.log_time * 1e-9, content.explored, list(content.explored_by)))
            elif channel.topic == "/sim/scenario":
                cell_m = content.cell_m
            else:
                result = content
    return read_m3dm(documents["map.m3dm"]), cell_m, ways, shares, result


def distance_squared(point, start, end):
    """From a point to a segment."""
    way = (end[0] - start[0], end[1] - start[1])
    to_point = (point[0] - start[0], point[1] - start[1])
    length_squared = way[0] ** 2 + way[1] ** 2
    along = 0.0 if length_squared == 0 else (to_point[0] * way[0] + to_point[1] * way[1]) / length_squared
    along = min(max(along, 0.0), 1.0)
    return (to_point[0] - along * way[0]) ** 2 + (to_point[1] - along * way[1]) ** 2


def simplified(points):
    """The points without those that hardly bend the line (Douglas and Peucker)."""
    keep = {0, len(points) - 1}
    spans = [(0, len(points) - 1)]
    while spans:
        first, last = spans.pop()
        off = [distance_squared(point, points[first], points[last]) for point in points[first + 1 : last]]
        if off and max(off) > TOLERANCE_M**2:
            farthest = first + 1 + off.index(max(off))
            keep.add(farthest)
            spans += [(first, farthest), (farthest, last)]
    return [points[number] for number in sorted(keep)]


def colour_of(agent):
    return COLOURS[agent % len(COLOURS)]


def polyline(points, colour, width, extra=""):
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    return f'<polyline points="{path}" stroke="{colour}" stroke-width="{width}" {extra}/>'


def text(x, y, content, anchor="start", colour=INK, extra=""):
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{colour}" {extra}>{escape(content)}</text>'


def draw_cave(size, is_wall, scale, height):
    """The cave from above: the more free cells a column has, the lighter it is."""
    size_x, size_y, size_z = size
    free = [[sum(not is_wall(x, y, z) for z in range(size_z)) for x in range(size_x)] for y in range(size_y)]
    most = max(map(max, free))
    out = []
    for level, colour in enumerate(OPEN):
        path = []
        for y, row in enumerate(free):
            x = 0
            while x < size_x:
                end = x
                while end < size_x and row[end] > 0 and min((row[end] * len(OPEN) - 1) // most, len(OPEN) - 1) == level:
                    end += 1
                if end > x:
                    left, top = x * scale, height - (y + 1) * scale
                    path.append(f"M{left:.1f} {top:.1f}h{(end - x) * scale:.1f}v{scale:.1f}h{-(end - x) * scale:.1f}z")
                x = max(end, x + 1)
        out.append(f'<path d="{"".join(path)}" fill="{colour}"/>')
    return out


def draw_map(size, is_wall, cell_m, ways):
    """Left: the cave and the ways."""
    x0, y0 = MAP["x"], MAP["y"]
    per_cell = MAP["size"] / max(size[0], size[1])
    width, height = size[0] * per_cell, size[1] * per_cell

    def at(x, y):
        return x / cell_m * per_cell, height - y / cell_m * per_cell

    out = [text(x0, y0 - 24, "The cave from above and the way of each agent", extra='font-weight="600"')]
    out.append(f'<g transform="translate({x0} {y0})" shape-rendering="crispEdges">')
    out.append(f'<rect width="{width:.1f}" height="{height:.1f}" fill="{ROCK}"/>')
    out += draw_cave(size, is_wall, per_cell, height) + ["</g>"]
    out.append(f'<g transform="translate({x0} {y0})" fill="none" stroke-linejoin="round" stroke-linecap="round">')
    for agent, way in sorted(ways.items()):
        out.append(polyline([at(*point) for point in simplified(way)], colour_of(agent), 1.6))
    out.append("</g>")
    for agent, way in sorted(ways.items()):
        x, y = at(*way[-1])
        ring = f'r="8" fill="{PAPER}" stroke="{colour_of(agent)}" stroke-width="2.2"'
        out.append(f'<circle cx="{x0 + x:.1f}" cy="{y0 + y:.1f}" {ring}/>')
        out.append(text(x0 + x, y0 + y + 4, str(agent), "middle", extra='font-weight="600" font-size="11.5"'))
    starts = [at(*way[0]) for way in ways.values()]
    x, y = sum(x for x, _ in starts) / len(starts), sum(y for _, y in starts) / len(starts)
    out.append(f'<path d="M{x0 + x - 5:.1f} {y0 + y:.1f}h10m-5 -5v10" stroke="{INK}" stroke-width="2.4"/>')
    step = 10 if max(size[0], size[1]) * cell_m <= 60 else 20
    for metres in range(0, int(size[0] * cell_m) + 1, step):
        out.append(text(x0 + metres / cell_m * per_cell, y0 + height + 18, str(metres), "middle", GREY))
    for metres in range(0, int(size[1] * cell_m) + 1, step):
        out.append(text(x0 - 8, y0 + height - metres / cell_m * per_cell + 4, str(metres), "end", GREY))
    out.append(text(x0 + width / 2, y0 + height + 36, "x, metres", "middle", GREY))
    out.append(
        text(0, 0, "y, metres", "middle", GREY, f'transform="translate({x0 - 36} {y0 + height / 2:.1f}) rotate(-90)"')
    )
    return out


def draw_plot(shares, result):
    """Right: the explored share over time."""
    x0, y0, width, height = PLOT["x"], PLOT["y"], PLOT["width"], PLOT["height"]
    end_s = shares[-1][0]
    step_min = next(step for step in (1, 2, 5, 10, 20, 60) if end_s / 60 / step <= 8)

    def at(t_s, share):
        return x0 + t_s / end_s * width, y0 + height - share * height

    out = [text(x0, y0 - 24, "Free cells seen, percent of the cave", extra='font-weight="600"')]
    for percent in range(0, 101, 20):
        x, y = at(0, percent / 100)
        out.append(f'<path d="M{x:.1f} {y:.1f}h{width}" stroke="{RULE}"/>')
        out.append(text(x - 8, y + 4, str(percent), "end", GREY))
    for minute in range(0, int(end_s / 60) + 1, step_min):
        x, _ = at(minute * 60, 0)
        out.append(f'<path d="M{x:.1f} {y0 + height}v5" stroke="{GREY}"/>')
        out.append(text(x, y0 + height + 18, str(minute), "middle", GREY))
    out.append(text(x0 + width / 2, y0 + height + 36, "sim time, minutes", "middle", GREY))
    out.append('<g fill="none" stroke-linejoin="round" stroke-linecap="round">')
    for agent in range(len(shares[0][2])):
        points = [at(t_s, by[agent]) for t_s, _, by in shares]
        out.append(polyline(points, colour_of(agent), 1.6))
    out.append(polyline([at(t_s, share) for t_s, share, _ in shares], INK, 3))
    out.append("</g>")
    # The key lies below on the right, where curves that only rise seldom come.
    rows = len(shares[0][2]) + 1
    left, top = x0 + width - 126, y0 + height - 22 * rows
    out.append(f'<rect x="{left - 8}" y="{top - 34}" width="134" height="{22 * rows + 26}" fill="{PAPER}"/>')
    out.append(text(x0 + width - 2, top - 20, "at the end, percent", "end", GREY, 'font-size="12"'))
    names = [("team", INK, 3)] + [(f"agent {a}", colour_of(a), 2) for a in range(len(shares[0][2]))]
    for row, (name, colour, line) in enumerate(names):
        share = result.explored if row == 0 else result.explored_by[row - 1]
        y = top + 22 * row
        out.append(f'<path d="M{left} {y:.1f}h22" stroke="{colour}" stroke-width="{line}" stroke-linecap="round"/>')
        out.append(text(left + 30, y + 4, name))
        out.append(text(x0 + width - 2, y + 4, f"{share * 100:.0f}", "end"))
    return out


def main():
    if len(sys.argv) != 3:
        sys.exit("usage: draw.py RECORDING.mcap PICTURE.svg")
    (size, is_wall), cell_m, ways, shares, result = read(sys.argv[1])
    if result is None or not ways:
        sys.exit(f"{sys.argv[1]}: the run has no result or no poses")
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}"'
        ' font-family="system-ui, -apple-system, Segoe UI, Helvetica, Arial, sans-serif" font-size="13" role="img">',
        "<title>A cave from above with the ways of its agents, and the share of it that they have seen</title>",
        f'<rect x="0.5" y="0.5" width="{WIDTH - 1}" height="{HEIGHT - 1}" rx="8" fill="{PAPER}" stroke="{RULE}"/>',
        *draw_map(size, is_wall, cell_m, ways),
        *draw_plot(shares, result),
        text(
            MAP["x"],
            HEIGHT - 14,
            "+ start  ·  numbered circles: last position  ·  lighter ground: more free cells above one another",
            colour=GREY,
            extra='font-size="12"',
        ),
        "</svg>",
    ]
    with open(sys.argv[2], "w", encoding="utf-8") as picture:
        picture.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
