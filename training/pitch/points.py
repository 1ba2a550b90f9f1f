"""What the pitch network names: the points, lines and arcs of a pitch, as `reconstructor/src/calibration/locate/names.rs` has them.

World: metres, y up, origin at the centre mark, x along the touchline, z towards the main camera. "Far" is z < 0.
"""

import numpy as np

CIRCLE = 9.15
PENALTY_MARK = 11.0
PENALTY_AREA = (16.5, 20.16)
GOAL_AREA = (5.5, 9.16)
GOAL = (3.66, 2.44)
ARC_ANGLE = np.arccos((PENALTY_AREA[0] - PENALTY_MARK) / CIRCLE)
SPACING = 1.0


def points(length, width):
    """The 43 named points, (43, 3)."""
    half_x, half_z = length / 2, width / 2
    found = [(0, 0, 0), (0, 0, -half_z), (0, 0, half_z), (0, 0, -CIRCLE), (0, 0, CIRCLE), (-CIRCLE, 0, 0), (CIRCLE, 0, 0)]
    arc_z = CIRCLE * np.sin(ARC_ANGLE)
    for side in (-1, 1):
        goal = side * half_x
        for far in (-1, 1):
            found.append((goal, 0, far * half_z))
            for depth, half in (PENALTY_AREA, GOAL_AREA):
                found += [(goal, 0, far * half), (goal - side * depth, 0, far * half)]
            found.append((goal - side * PENALTY_AREA[0], 0, far * arc_z))
            found += [(goal, 0, far * GOAL[0]), (goal, GOAL[1], far * GOAL[0])]
        found += [(goal - side * PENALTY_MARK, 0, 0), (goal - side * (PENALTY_MARK + CIRCLE), 0, 0)]
    return np.array(found, float)


def _line(a, b):
    a, b = np.asarray(a, float), np.asarray(b, float)
    steps = max(int(np.ceil(np.linalg.norm(b - a) / SPACING)), 1)
    return a + (b - a) * np.linspace(0, 1, steps + 1)[:, None]


def _arc(x, start, sweep):
    angles = start + sweep * np.linspace(0, 1, max(int(np.ceil(CIRCLE * abs(sweep) / SPACING)), 4) + 1)
    return np.stack([x + CIRCLE * np.cos(angles), np.zeros_like(angles), CIRCLE * np.sin(angles)], 1)


def lines(length, width):
    """The 22 kinds of lines, each a list of polylines (n, 3)."""
    half_x, half_z = length / 2, width / 2
    kinds = [
        [_line((-half_x, 0, -half_z), (half_x, 0, -half_z))],
        [_line((-half_x, 0, half_z), (half_x, 0, half_z))],
        [_line((0, 0, -half_z), (0, 0, half_z))],
        [_arc(0.0, 0.0, 2 * np.pi)],
    ]
    for side in (-1, 1):
        goal = side * half_x
        kinds.append([_line((goal, 0, -half_z), (goal, 0, half_z))])
        for depth, half in (PENALTY_AREA, GOAL_AREA):
            front = goal - side * depth
            kinds.append([_line((goal, 0, -half), (front, 0, -half))])
            kinds.append([_line((front, 0, -half), (front, 0, half))])
            kinds.append([_line((goal, 0, half), (front, 0, half))])
        middle = np.pi if side > 0 else 0.0
        kinds.append([_arc(goal - side * PENALTY_MARK, middle - ARC_ANGLE, 2 * ARC_ANGLE)])
        post, bar = GOAL
        kinds.append([_line((goal, 0, -post), (goal, bar, -post)), _line((goal, bar, -post), (goal, bar, post)), _line((goal, bar, post), (goal, 0, post))])
    return kinds


def area(length, width):
    """The outline of the pitch, (n, 3)."""
    half_x, half_z = length / 2, width / 2
    corners = [(-half_x, 0, -half_z), (half_x, 0, -half_z), (half_x, 0, half_z), (-half_x, 0, half_z), (-half_x, 0, -half_z)]
    return np.concatenate([_line(a, b) for a, b in zip(corners, corners[1:])])


POINTS = len(points(105.0, 68.0))
LINES = len(lines(105.0, 68.0))
CHANNELS = POINTS + LINES + 1


def mirrored(axis):
    """Where each channel goes when the world is mirrored: axis 0 left to right (x), 2 far to near (z)."""
    sign = np.ones(3)
    sign[axis] = -1.0

    def match(ours):
        means = [np.concatenate([np.atleast_2d(part) for part in parts]) for parts in ours]
        # A shape is known by its middle and its extent.
        keys = [np.concatenate([m.min(0) + m.max(0), m.max(0) - m.min(0)]) for m in means]
        turned = [np.concatenate([(m * sign).min(0) + (m * sign).max(0), m.max(0) - m.min(0)]) for m in means]
        return [int(np.argmin([np.abs(key - other).sum() for other in keys])) for key in turned]

    of_points = match([[p] for p in points(105.0, 68.0)])
    of_lines = match(lines(105.0, 68.0))
    return np.array(of_points + [POINTS + k for k in of_lines] + [CHANNELS - 1])


if __name__ == "__main__":
    for axis in (0, 2):
        permutation = mirrored(axis)
        assert (permutation[permutation] == np.arange(CHANNELS)).all(), "mirroring twice changes nothing"
    print(POINTS, "points,", LINES, "kinds of lines,", CHANNELS, "channels")
