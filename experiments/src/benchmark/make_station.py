"""Writes station.obj: the imported world of the benchmark exploration-1. `python make_station.py`.

A closed station of 48 x 36 x 15 m: two storeys with a hall, a shaft, rooms with doors, columns and
a gallery. A mesh of boxes whose sides lie on whole metres, as a modelling program would export it.
"""

SIZE = (48, 36, 15)
FLOOR = 7


def boxes():
    x, y, z = SIZE
    # The shell.
    yield (0, 0, 0), (x, y, 1)
    yield (0, 0, z - 1), (x, y, z)
    yield (0, 0, 1), (1, y, z - 1)
    yield (x - 1, 0, 1), (x, y, z - 1)
    yield (1, 0, 1), (x - 1, 1, z - 1)
    yield (1, y - 1, 1), (x - 1, y, z - 1)
    # The upper floor is open over the hall (x 16 to 32, y 10 to 26) and at a shaft in two corners.
    yield (1, 1, FLOOR), (16, 32, FLOOR + 1)
    yield (5, 32, FLOOR), (16, 35, FLOOR + 1)
    yield (32, 4, FLOOR), (47, 35, FLOOR + 1)
    yield (32, 1, FLOOR), (43, 4, FLOOR + 1)
    yield (16, 1, FLOOR), (32, 10, FLOOR + 1)
    yield (16, 26, FLOOR), (32, 35, FLOOR + 1)
    # Rooms on both floors: walls along y with doors, then walls along x.
    for low, high in [(1, FLOOR), (FLOOR + 1, 14)]:
        for at in (16, 31):
            for first, last in [(1, 4), (7, 10), (26, 29), (32, 35)]:
                yield (at, first, low), (at + 1, last, high)
        for at in (11, 23):
            for first, last in [(1, 6), (9, 15), (32, 38), (41, 47)]:
                yield (first, at, low), (last, at + 1, high)
    # Columns of the hall, from floor to ceiling.
    for column_x in (20, 27):
        for column_y in (14, 21):
            yield (column_x, column_y, 1), (column_x + 1, column_y + 1, 14)
    # Crates.
    for corner in [(4, 4, 1), (40, 28, 1), (4, 28, 8), (40, 6, 8), (22, 3, 1)]:
        yield corner, tuple(at + by for at, by in zip(corner, (3, 2, 3)))


FACES = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]


def main():
    lines = ["# maes: exploration-1, station", "o station"]
    faces = []
    for number, (low, high) in enumerate(boxes()):
        for dx, dy, dz in [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]:
            point = [high[axis] if by else low[axis] for axis, by in enumerate((dx, dy, dz))]
            lines.append("v " + " ".join(str(along) for along in point))
        for a, b, c, d in FACES:
            first = 8 * number + 1
            faces.append(f"f {a + first} {b + first} {c + first} {d + first}")
    with open("station.obj", "w", encoding="ascii") as file:
        file.write("\n".join(lines + faces) + "\n")


main()
