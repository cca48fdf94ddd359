"""Random scenes with obstacles, of several families. `ground.py` judges them."""

import math
import random


def spread(random, centre, size):
    return [c + random.uniform(-size, size) for c in centre]


def star(random, centre, count, low, high):
    """Returns a simple polygon with deep notches."""
    turns = [math.tau * (k + random.uniform(-0.3, 0.3)) / count for k in range(count)]
    radii = [random.uniform(low, high) for _ in turns]
    return [[centre[0] + r * math.cos(turn), centre[1] + r * math.sin(turn)] for r, turn in zip(radii, turns)]


def moved(random, centre, corners):
    angle = random.uniform(0, math.tau)
    c, s = math.cos(angle), math.sin(angle)
    return [[centre[0] + c * x - s * y, centre[1] + s * x + c * y] for x, y in corners]


def comb(random, centre):
    """Returns a polygon with parallel slots."""
    teeth, deep, wide = random.randint(2, 6), random.uniform(0.5, 6), random.uniform(0.02, 1)
    gap = random.uniform(0.05, 3)
    corners = [[0.0, -wide]]
    for k in range(teeth):
        left = k * (wide + gap)
        corners += [[left, 0.0], [left, deep], [left + wide, deep], [left + wide, 0.0]]
    corners = corners[:1] + corners[2:-1] + [[corners[-1][0], -wide]]
    return moved(random, centre, corners)


def around(random, centre, radius):
    """Returns a ring with an opening."""
    thick, opening = random.uniform(0.05, 1), random.uniform(0.03, 0.4)
    count, first = random.randint(8, 24), random.uniform(0, 1)
    turns = [math.tau * (first + opening + (1 - opening) * k / count) for k in range(count + 1)]
    ring = lambda r: [[centre[0] + r * math.cos(turn), centre[1] + r * math.sin(turn)] for turn in turns]
    return ring(radius) + ring(radius + thick)[::-1]


def shape(random, centre, reach):
    kind = random.choice(["circle", "circle", "star", "thin", "comb", "around", "line", "zigzag", "short", "triangle"])
    at = spread(random, centre, reach)
    if kind == "circle":
        radius = random.choice([random.uniform(0.2, 2), random.uniform(0.001, 0.02)])
        return f"circle = {{ center = {at}, radius = {radius!r} }}"
    if kind in ("line", "short"):
        size = 12 if kind == "line" else 0.02
        return f"line = {[at, spread(random, at, size)]}"
    if kind == "zigzag":
        corners = [at]
        for _ in range(random.randint(2, 12)):
            corners.append(spread(random, corners[-1], 3))
        return f"line = {corners}"
    if kind == "thin":
        length, wide = random.uniform(1, 20), random.choice([1e-6, 0.001, 0.05])
        corners = moved(random, at, [[-length, -wide], [length, -wide], [length, wide], [-length, wide]])
    elif kind == "star":
        corners = star(random, at, random.randint(3, 20), 0.1, random.uniform(0.5, 4))
    elif kind == "comb":
        corners = comb(random, at)
    elif kind == "around":
        corners = around(random, centre, random.uniform(3, 20))
    else:
        corners = star(random, at, 3, 0.3, 3)
    return f"polygon = {corners[::random.choice([1, -1])]}"


def team(random, benches):
    body = random.choice([2.2, random.uniform(0.8, 3)])
    inset = random.choice([0.275, random.uniform(0.01, 0.12) * body])
    head = random.choice([3.41 if body == 2.2 else 1.5 * body, body, random.uniform(0.7, 1.6) * body])
    width = random.choice([0.3, random.uniform(0.02, 0.6)])
    return {"benches": benches, "head_length": head, "body_length": body, "width": width, "hole_inset": inset}


def route(random, least_radius):
    pieces = []
    for _ in range(random.randint(1, 7)):
        if random.random() < 0.4:
            pieces.append(f'{{ kind = "line", length = {random.choice([random.uniform(0.5, 8), 1.0])!r} }}')
        else:
            side = random.choice(["left", "right"])
            radius = random.uniform(least_radius, 3 * least_radius)
            turns = random.choice([0.25, random.uniform(0.05, 0.9)])
            pieces.append(f'{{ kind = "arc", radius = {radius!r}, side = "{side}", turns = {turns!r} }}')
    return pieces


def path(random, kind, longest):
    """Returns the lines of a path, and how far its coordinates reach."""
    if kind == "spiral":
        pitch, turns = random.uniform(0.5, 2.0), random.uniform(3, 8)
        return ['kind = "spiral"', f"pitch = {pitch!r}", f"start_turn = {turns!r}"], pitch * turns
    if kind == "turnaround":
        pitch, radius = random.uniform(1.0, 2.0), random.uniform(1.6, 2.5) * longest
        lead = random.uniform(5, 60)
        lines = ['kind = "turnaround"', f"pitch = {pitch!r}", f"turn_radius = {radius!r}", f"lead_in = {lead!r}"]
        return lines + [f"arc_ratio = {random.uniform(1, 2)!r}", f"lead_out = {random.uniform(5, 30)!r}"], radius + 4
    lines = ['kind = "pieces"', f"heading_turns = {random.choice([0, 0.25, random.uniform(0, 1)])!r}"]
    return lines + [f"pieces = [{', '.join(route(random, 0.9 * longest))}]"], 12


# Families: the kind of the path, a greatest number of benches, how far from the origin, and the number of obstacles.
FAMILIES = {
    "route": ("pieces", 14, 0, 5),
    "spiral": ("spiral", 14, 0, 5),
    "placed": ("pieces", 9, 20, 5),
    "coil": ("spiral", 40, 15, 6),
    "turnaround": ("turnaround", 12, 10, 6),
    "far": ("pieces", 8, 1e4, 4),
    "far coil": ("spiral", 8, 1e5, 4),
    "many": ("pieces", 6, 0, 64),
    "touching": ("pieces", 8, 5, 4),
}


def random_scene(family, seed):
    """Returns the text of a scene."""
    draw = random.Random(f"{family} {seed}")
    kind, benches, far, count = FAMILIES[family]
    sizes = team(draw, draw.randint(1, benches))
    longest = max(sizes["head_length"], sizes["body_length"]) - 2 * sizes["hole_inset"]
    lines, reach = path(draw, kind, longest)
    lines = ["[team]", *(f"{key} = {value!r}" for key, value in sizes.items()), "[path]", *lines]
    centre = [0.0, 0.0]
    if kind == "pieces":
        centre = spread(draw, centre, far or 5)
        lines.append(f"start = {centre}")
    if kind != "pieces" or draw.random() < 0.5:
        origin = spread(draw, [0.0, 0.0], far)
        turns = draw.choice([0.0, 0.25, draw.uniform(-1, 1)])
        mirror = draw.random() < 0.5
        x, y = centre[0], -centre[1] if mirror else centre[1]
        c, s = math.cos(math.tau * turns), math.sin(math.tau * turns)
        centre = [origin[0] + c * x - s * y, origin[1] + s * x + c * y]
        lines += ["[placement]", f"origin = {origin}", f"rotation_turns = {turns!r}", f"mirror = {str(mirror).lower()}"]
    lines += ["[motion]", f"head_speed = {draw.choice([1.0, draw.uniform(0.3, 3.0)])!r}"]
    lines += [f'on_contact = "{draw.choice(["stop", "continue"])}"', "[alerts]", "[stage]"]
    if draw.random() < 0.5:
        size = draw.uniform(1.2, 4) * reach
        corners = star(draw, centre, draw.randint(3, 24), 0.6 * size, size)
        keep_out = draw.choice([0.0, draw.uniform(0, 1)])
        lines.append(f"boundary = {{ polygon = {corners}, keep_out = {keep_out!r} }}")
    number = 0
    for _ in range(draw.randint(1, count)):
        given = [shape(draw, centre, reach)]
        if family == "touching":
            # Two houses with a common wall, and a fence that ends at or near a corner of theirs.
            at, wide = spread(draw, centre, reach), draw.uniform(0.2, 3)
            x, y = at
            given += [f"polygon = {[[x, y], [x + wide, y], [x + wide, y + 1], [x, y + 1]]}"]
            given += [f"polygon = {[[x + wide, y], [x + 2 * wide, y], [x + wide, y + 1]]}"]
            given += [f"line = {[spread(draw, at, 4), [x, y + draw.choice([0.0, 1e-3])]]}"]
        for text in given:
            keep_out = draw.choice([0.0, 0.0, draw.uniform(0, 1)])
            lines += ["[[stage.obstacles]]", f'name = "obstacle {number}"', f"keep_out = {keep_out!r}", text]
            number += 1
    return "\n".join(lines) + "\n"
