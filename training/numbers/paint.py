"""Numbers in many hands, painted on rendered backs that carry none: the renderer knows one hand only."""

import cv2
import numpy as np
from PIL import Image, ImageDraw, ImageFont

FONTS = ["DejaVuSans-Bold", "DejaVuSansCondensed-Bold", "DejaVuSans", "DejaVuSansMono-Bold", "DejaVuSerif-Bold", "DejaVuSerifCondensed-Bold"]
HERSHEY = [cv2.FONT_HERSHEY_SIMPLEX, cv2.FONT_HERSHEY_DUPLEX, cv2.FONT_HERSHEY_COMPLEX, cv2.FONT_HERSHEY_TRIPLEX]
# As synthesis/src/lettering.rs, and two other hands: corners on a grid of 4 × 6 steps, '|' lifts the pen.
STROKES = [
    ["10 30 41 45 36 16 05 01 10", "11 20 26|16 36", "01 10 30 41 42 06 46", "01 10 30 41 42 33 44 45 36 16 05|33 13", "36 30 04 44", "40 00 03 33 44 45 36 16 05", "41 30 10 01 05 16 36 45 44 33 03", "00 40 16", "10 30 41 42 33 13 02 01 10|13 04 05 16 36 45 44 33", "05 16 36 45 41 30 10 01 02 13 43"],
    ["00 40 46 06 00", "10 20 26", "00 40 43 03 06 46", "00 40 46 06|43 03", "00 03 43|40 46", "40 00 03 43 46 06", "40 00 06 46 43 03", "00 40 46", "00 40 46 06 00|03 43", "06 46 40 00 03 43"],
    ["20 41 42 44 45 26 05 01 20", "02 20 26", "01 20 41 42 05 06 46", "00 40 23 44 45 26 05", "46 40 04 44", "40 00 02 32 43 45 26 05", "30 02 05 26 45 43 23 03", "00 40 14 16", "20 41 42 23 02 01 20|23 04 05 26 45 44 23", "16 43 41 20 01 03 23 43"],
]
TALL = 160  # pixels of a glyph's height in the sheet
WIDE_MAX = 0.36  # metres


def glyphs(text, rng):
    """Ink 0..1 of a text, cut to the ink."""
    kind = rng.choice(3, p=[0.45, 0.2, 0.35])
    if kind == 0:
        hand = STROKES[rng.integers(len(STROKES))]
        stroke = int(TALL * rng.uniform(0.10, 0.22))
        wide = TALL * rng.uniform(0.42, 0.68)
        step = wide + stroke + TALL * rng.uniform(0.04, 0.14)
        sheet = np.zeros((TALL * 2, int(step * len(text) + TALL)), np.uint8)
        for k, digit in enumerate(text):
            for line in hand[int(digit)].split("|"):
                corners = np.array([[int(c[0]) / 4 * wide + k * step, int(c[1]) / 6 * TALL] for c in line.split()]) + TALL / 2
                cv2.polylines(sheet, [corners.round().astype(np.int32)], False, 255, stroke, cv2.LINE_AA)
    elif kind == 1:
        font, thick = HERSHEY[rng.integers(len(HERSHEY))], int(rng.integers(10, 26))
        sheet = np.zeros((TALL * 2, TALL * 4), np.uint8)
        cv2.putText(sheet, text, (TALL // 2, TALL * 3 // 2), font, TALL / 22, 255, thick, cv2.LINE_AA)
    else:
        font = ImageFont.truetype(f"{FONTS[rng.integers(len(FONTS))]}.ttf", TALL)
        sheet = Image.new("L", (TALL * 4, TALL * 2))
        ImageDraw.Draw(sheet).text((TALL // 2, TALL // 4), text, font=font, fill=255, stroke_width=int(rng.integers(0, 6)))
        sheet = np.array(sheet)
    rows, columns = np.nonzero(sheet > 32)
    sheet = sheet[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
    return sheet.astype(np.float32) / 255


def colours(shirt, rng):
    """An ink that stands apart from the shirt, and perhaps a rim."""
    light = shirt @ [0.299, 0.587, 0.114]
    for _ in range(20):
        plain = rng.random() < 0.7
        ink = np.repeat(rng.choice([rng.uniform(0, 0.15), rng.uniform(0.85, 1)]), 3) if plain else rng.uniform(0, 1, 3)
        if abs(ink @ [0.299, 0.587, 0.114] - light) > 0.25:
            break
    rim = rng.uniform(0, 1, 3) if rng.random() < 0.2 else None
    return ink, rim


def on_back(picture, visible, project, shoulders, across, down, behind, shirt, text, rng):
    """Paints a number on the back in a picture of 0..1, where the person is `visible` (0..1); None where it does not fit. `project` takes world
    points (N, 3) to its pixels; the axes are of the trunk."""
    sheet = glyphs(text, rng)
    tall = rng.uniform(0.17, 0.33)
    wide = tall * sheet.shape[1] / sheet.shape[0] * rng.uniform(0.75, 1.15)
    limit = WIDE_MAX if len(text) == 2 else 0.22
    wide = min(wide, limit * rng.uniform(0.85, 1.0))
    middle = rng.normal(0, 0.012)
    top = rng.uniform(0.01, 0.11)
    columns, rows = 24, 24
    u = (np.linspace(0, 1, columns) - 0.5) * wide + middle
    v = np.linspace(0, 1, rows) * tall + top
    radius = rng.uniform(0.20, 0.40)
    angle = u / radius
    thick = rng.uniform(0.09, 0.13)
    points = shoulders + np.sin(angle)[None, :, None] * radius * across + v[:, None, None] * down + (thick - radius * (1 - np.cos(angle)))[None, :, None] * behind
    pixels = project(points.reshape(-1, 3)).reshape(rows, columns, 2)
    low = np.floor(pixels.reshape(-1, 2).min(0)).astype(int) - 2
    high = np.ceil(pixels.reshape(-1, 2).max(0)).astype(int) + 3
    size = high - low
    if (size > 400).any() or (low < 0).any() or (high[::-1] > picture.shape[:2]).any():
        return None
    # The sheet is drawn into a finer picture, which is then averaged.
    fine = 6
    # The inverse map, from scattered points: a smooth polynomial of the fourth order fits a bent sheet well.
    x = ((pixels - low) * 2 / size - 1).reshape(-1, 2)
    terms = lambda p: np.stack([p[:, 0] ** i * p[:, 1] ** j for i in range(5) for j in range(5 - i)], 1)
    target = np.stack(np.meshgrid(np.linspace(0, 1, columns), np.linspace(0, 1, rows)), -1).reshape(-1, 2)
    solved, *_ = np.linalg.lstsq(terms(x), target, rcond=None)
    grid = np.stack(np.meshgrid((np.arange(size[0] * fine) + 0.5) / fine - 0.5, (np.arange(size[1] * fine) + 0.5) / fine - 0.5), -1).reshape(-1, 2)
    place = (terms(grid * 2 / size - 1) @ solved).astype(np.float32)
    shape = (size[1] * fine, size[0] * fine)
    rim_px = max(int(TALL * 0.04), 1)
    ink, rim = colours(shirt, rng)
    padded = cv2.copyMakeBorder(sheet, rim_px * 2, rim_px * 2, rim_px * 2, rim_px * 2, cv2.BORDER_CONSTANT)
    def drawn(sheet):
        map_x = (place[:, 0] * (sheet.shape[1] - 4 * rim_px) + 2 * rim_px).reshape(shape)
        map_y = (place[:, 1] * (sheet.shape[0] - 4 * rim_px) + 2 * rim_px).reshape(shape)
        return cv2.resize(cv2.remap(sheet, map_x, map_y, cv2.INTER_LINEAR), tuple(size), interpolation=cv2.INTER_AREA)
    blur = rng.uniform(0.25, 0.9)
    seen = visible[low[1] : high[1], low[0] : high[0]]
    soft = lambda cover: (cv2.GaussianBlur(cover, (0, 0), blur) * seen)[..., None]
    out = picture.copy()
    part = out[low[1] : high[1], low[0] : high[0]]
    shade = cv2.GaussianBlur(part, (0, 0), max(size.max() / 4, 1)) @ np.array([0.299, 0.587, 0.114], np.float32)
    shade = (shade / max(shirt @ [0.299, 0.587, 0.114], 0.05)).clip(0.4, 1.6)[..., None]
    if rim is not None:
        cover = soft(drawn(cv2.dilate(padded, np.ones((rim_px * 2 + 1, rim_px * 2 + 1)))))
        part[:] = part * (1 - cover) + (rim * shade).clip(0, 1) * cover
    cover = soft(drawn(padded))
    part[:] = part * (1 - cover) + (ink * shade).clip(0, 1) * cover
    return out
