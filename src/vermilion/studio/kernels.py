"""Per-pixel colour, compiled: the solid texture and the shading of ray hits.

All functions that `shade_hits` calls stay in this file: numba's cache does not see changes elsewhere.
"""

from __future__ import annotations

import math

import numpy as np

from vermilion.storage.kernels import kernel

SKIN, MOUTH, TEETH, EYE, TONGUE = 0, 1, 2, 3, 4
MASK = 63  # noise volumes are 64 cells wide


@kernel(fastmath=True)
def _smoothstep(low, high, value):
    t = min(max((value - low) / (high - low), 0.0), 1.0)
    return t * t * (3.0 - 2.0 * t)


@kernel(fastmath=True)
def _noise(volume, x, y, z):
    """Trilinear value of the tiling volume, cells as unit."""
    fx, fy, fz = math.floor(x), math.floor(y), math.floor(z)
    tx, ty, tz = x - fx, y - fy, z - fz
    i, j, k = int(fx) & MASK, int(fy) & MASK, int(fz) & MASK
    i1, j1, k1 = (i + 1) & MASK, (j + 1) & MASK, (k + 1) & MASK
    a = volume[i, j, k] * (1 - tz) + volume[i, j, k1] * tz
    b = volume[i, j1, k] * (1 - tz) + volume[i, j1, k1] * tz
    c = volume[i1, j, k] * (1 - tz) + volume[i1, j, k1] * tz
    d = volume[i1, j1, k] * (1 - tz) + volume[i1, j1, k1] * tz
    return (a * (1 - ty) + b * ty) * (1 - tx) + (c * (1 - ty) + d * ty) * tx


@kernel(fastmath=True)
def _octave(volume, x, y, z, cell, footprint, turn):
    """Noise of blobs some three cells wide, faded out where a pixel is too wide for it."""
    fade = math.exp(-0.35 * (footprint / cell) ** 2)
    if fade < 0.02:
        return 0.0
    s = 1.0 / cell
    # A turn of the axes keeps the tiles of different octaves from falling together.
    u, v = x * 0.8 - y * 0.6 * turn, x * 0.6 * turn + y * 0.8
    return fade * _noise(volume, u * s, v * s, (z + 0.37 * turn * x) * s)


@kernel(fastmath=True)
def _brow(x, y, brows):
    """Distance in mm to the nearer brow's line, relative to its half width there."""
    best = 1e9
    for side in range(2):
        for k in range(4):
            ax, ay = brows[side, k, 0], brows[side, k, 1]
            bx, by = brows[side, k + 1, 0] - ax, brows[side, k + 1, 1] - ay
            t = ((x - ax) * bx + (y - ay) * by) / (bx * bx + by * by)
            t = min(max(t, 0.0), 1.0)
            along = (k + t) / 4.0  # 0 at the first point of this side
            inner = along if side == 0 else 1.0 - along  # 1 next to the nose
            width = 1.3 + 2.6 * min(inner * 1.6, 1.0)
            dx, dy = x - ax - t * bx, y - ay - t * by
            best = min(best, math.sqrt(dx * dx + dy * dy) / width)
    return best


@kernel(fastmath=True)
def _skin_albedo(out, volume, look, brows, chin, p, lip, inside, footprint):
    x, y, z = p[0] + look.shift_mm[0], p[1] + look.shift_mm[1], p[2] + look.shift_mm[2]
    coarse = _octave(volume, x, y, z, 7.0, footprint, 1.0)
    middle = _octave(volume, x, y, z, 1.9, footprint, -1.0)
    fine = _octave(volume, x, y, z, 0.72, footprint, 0.6)
    pores = _octave(volume, x, y, z, 0.33, footprint, -0.4)
    spots = _octave(volume, x, y, z, 1.15, footprint, 0.3)
    g = look.grain
    value = 1.0 + g * (0.05 * coarse + 0.05 * middle + 0.075 * fine + 0.08 * pores)
    value *= 1.0 - 0.30 * _smoothstep(1.5, 2.6, spots)
    red = 0.028 * coarse + 0.014 * middle
    r = look.skin[0] * value * (1.0 + 0.5 * red)
    gr = look.skin[1] * value * (1.0 - red)
    b = look.skin[2] * value * (1.0 - 1.1 * red)
    ax, brow_top = abs(p[0]), max(brows[0, 2, 1], brows[1, 2, 1])
    if p[1] > brow_top - 30.0:
        strands = _octave(volume, x * 2.2, y * 0.8, z, 0.55, footprint, 0.8)
        d = _brow(p[0], p[1], brows) if p[2] > 0.0 else 2.0
        if d < 2.0:
            w = (1.0 - _smoothstep(0.35, 1.35, d + 0.22 * strands)) * 0.82
            r += (look.brows[0] - r) * w
            gr += (look.brows[1] - gr) * w
            b += (look.brows[2] - b) * w
        line = brow_top + 60.0 - 0.0035 * ax * ax + 2.5 * middle
        w = _smoothstep(-4.0, 5.0, p[1] - line + 0.55 * max(0.0, 20.0 - p[2]))
        w = min(max(w * (0.86 + 0.14 * strands), 0.0), 1.0)
        r += (look.hair[0] - r) * w
        gr += (look.hair[1] - gr) * w
        b += (look.hair[2] - b) * w
    collar = chin - 62.0 - 0.02 * max(p[2], 0.0) + 0.2 * ax
    if p[1] < collar:
        weave = 1.0 + 0.2 * fine
        r, gr, b = look.cloth[0] * weave, look.cloth[1] * weave, look.cloth[2] * weave
    if lip > -3.0:
        lines = _octave(volume, x * 1.7, y * 0.35, z * 0.35, 0.6, footprint, 0.0)
        w = _smoothstep(-0.45, 0.45, lip + 0.12 * middle)
        shade = 1.0 + g * (0.10 * lines + 0.05 * middle + 0.06 * fine + 0.05 * pores)
        r += (look.lips[0] * shade - r) * w
        gr += (look.lips[1] * shade - gr) * w
        b += (look.lips[2] * shade - b) * w
        deep = _smoothstep(1.5, 4.5, inside)
        dark = 1.0 - 0.6 * _smoothstep(8.0, 25.0, inside)
        r += (look.inside[0] * dark - r) * deep
        gr += (look.inside[1] * dark - gr) * deep
        b += (look.inside[2] * dark - b) * deep
        if look.tattoo > 0.0 and lip > 0.0:
            n = 0.8 * _octave(volume, x, y, z, 0.34, footprint, 0.5)
            n += 0.5 * _octave(volume, x, y, z, 0.62, footprint, -0.7)
            soft = 0.16 + 0.35 * footprint
            ink = _smoothstep(-soft, soft, n + 0.05)
            w = _smoothstep(0.0, 0.45, lip) * (1.0 - _smoothstep(2.2, 3.2, inside)) * look.tattoo
            grain = 1.0 + 0.06 * pores
            inks = look.paint_dark + (look.paint_light - look.paint_dark) * np.float32(ink)
            r += (inks[0] * grain - r) * w
            gr += (inks[1] * grain - gr) * w
            b += (inks[2] * grain - b) * w
    out[0], out[1], out[2] = max(r, 0.004), max(gr, 0.004), max(b, 0.004)


@kernel(fastmath=True)
def _eye_albedo(out, volume, look, p):
    radius = math.sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]) + 1e-6
    angle = math.acos(min(max(p[2] / radius, -1.0), 1.0))
    vein = _noise(volume, p[0] * 2.0, p[1] * 5.0, p[2] * 2.0)
    out[0], out[1], out[2] = 0.62, 0.57 - 0.02 * vein, 0.54 - 0.025 * vein
    side = _smoothstep(0.5, 1.1, angle)
    out[1] -= 0.10 * side
    out[2] -= 0.12 * side
    if angle < 0.52:
        spoke = _noise(volume, math.atan2(p[1], p[0]) * 9.0, angle * 9.0, 3.0)
        bright = (1.0 + 0.30 * spoke) * (0.55 + 1.1 * (0.5 - abs(angle - 0.27)))
        limbus = 1.0 - _smoothstep(0.43, 0.52, angle)
        pupil = _smoothstep(0.17, 0.21, angle)
        for c in range(3):
            ring = look.iris[c] * bright * pupil + 0.006
            out[c] = out[c] * (1.0 - limbus) * (0.4 + 0.6 * (1 - limbus)) + ring * limbus


@kernel(fastmath=True, nogil=True)
def shade_hits(
    out,
    triangle,
    bary,
    directions,
    distance,
    pixel_angle,
    triangles,
    material,
    normals,
    solid,
    lip,
    inside,
    sky,
    visible,
    light_direction,
    light_colour,
    volume,
    look,
    brows,
    chin,
    background,
):
    """Linear RGB (N, 3) of ray hits into `out`.

    Diffuse light is the baked sky plus each light's share that is not shadowed, wrapped round the
    terminator more in red than in blue, as light does in skin; the gloss is Blinn-Phong.
    """
    albedo = np.zeros(3)
    p, n, s = np.zeros(3), np.zeros(3), np.zeros(3)
    n_lights = light_direction.shape[0]
    seen = np.zeros(n_lights)
    for i in range(len(triangle)):
        t = triangle[i]
        if t < 0:
            out[i, 0], out[i, 1], out[i, 2] = background[0], background[1], background[2]
            continue
        lip_here, inside_here = 0.0, 0.0
        p[:] = 0.0
        n[:] = 0.0
        s[:] = 0.0
        seen[:] = 0.0
        for k in range(3):
            v, w = triangles[t, k], bary[i, k]
            lip_here += w * lip[v]
            inside_here += w * inside[v]
            for c in range(3):
                p[c] += w * solid[v, c]
                n[c] += w * normals[v, c]
                s[c] += w * sky[v, c]
            for m in range(n_lights):
                seen[m] += w * visible[v, m]
        kind = material[t]
        dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
        length = math.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]) + 1e-9
        facing = -(n[0] * dx + n[1] * dy + n[2] * dz) / length
        footprint = distance[i] * pixel_angle / math.sqrt(max(facing, 0.15))
        gloss, power, wrap, bump = 0.028, 14.0, 1.0, 0.05
        if kind == SKIN:
            _skin_albedo(albedo, volume, look, brows, chin, p, lip_here, inside_here, footprint)
            if lip_here > 0.0:
                gloss, power, bump = 0.035, 26.0, 0.04
            if inside_here > 2.0:
                gloss, power, bump = 0.03 * look.wet, 60.0, 0.0
        elif kind == EYE:
            _eye_albedo(albedo, volume, look, p)
            gloss, power, wrap, bump = 0.05, 420.0, 0.6, 0.0
        elif kind == TEETH:
            grain = 1.0 + 0.05 * _octave(volume, p[0], p[1], p[2], 1.0, footprint, 1.0)
            for c in range(3):
                albedo[c] = look.teeth[c] * grain
            gloss, power, bump = 0.04 * look.wet, 90.0, 0.0
        else:
            grain = 1.0 + 0.12 * _octave(volume, p[0], p[1], p[2], 0.8, footprint, 1.0)
            for c in range(3):
                albedo[c] = (look.tongue[c] if kind == TONGUE else look.gums[c]) * grain
            gloss, power, bump = 0.03 * look.wet, 50.0, 0.0
        if bump > 0.0:
            for c in range(3):
                shift = 17.3 * (c + 1)
                n[c] += bump * _octave(volume, p[0] + shift, p[1], p[2], 0.5, footprint, 0.9)
            length = math.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]) + 1e-9
        nx, ny, nz = n[0] / length, n[1] / length, n[2] / length
        facing = max(-(nx * dx + ny * dy + nz * dz), 0.0)
        fresnel = gloss + (0.5 - gloss) * (1.0 - facing) ** 5
        r, g, b = s[0] * albedo[0], s[1] * albedo[1], s[2] * albedo[2]
        shine = gloss * 1.2  # the sky's gloss
        r, g, b = r + shine * s[0], g + shine * s[1], b + shine * s[2]
        for m in range(n_lights):
            lx, ly, lz = light_direction[m, 0], light_direction[m, 1], light_direction[m, 2]
            cosine = nx * lx + ny * ly + nz * lz
            wr, wg, wb = 0.22 * wrap, 0.10 * wrap, 0.06 * wrap
            shadow = seen[m]
            r += albedo[0] * light_colour[m, 0] * shadow * max(cosine + wr, 0.0) / (1 + wr)
            g += albedo[1] * light_colour[m, 1] * shadow * max(cosine + wg, 0.0) / (1 + wg)
            b += albedo[2] * light_colour[m, 2] * shadow * max(cosine + wb, 0.0) / (1 + wb)
            if cosine > 0.0:
                hx, hy, hz = lx - dx, ly - dy, lz - dz
                half = (nx * hx + ny * hy + nz * hz) / math.sqrt(hx * hx + hy * hy + hz * hz)
                if half > 0.0:
                    lobe = fresnel * (power + 8.0) / 8.0 * half ** int(power) * cosine * shadow
                    r += lobe * light_colour[m, 0]
                    g += lobe * light_colour[m, 1]
                    b += lobe * light_colour[m, 2]
        out[i, 0], out[i, 1], out[i, 2] = r, g, b
