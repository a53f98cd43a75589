"""Rays to the sky and to the lights, and gathering what they bring, compiled.

Apart from `kernels.py`, whose functions share nothing with these: numba's cache sees the changes of one
file only.
"""

from __future__ import annotations

import math

from vermilion.storage.kernels import kernel


@kernel(nogil=True)
def sky_rays(points, normals, vertices, directions, offset, origins_out, directions_out, owner_out):
    """Fill the rays of every vertex's upper hemisphere; returns how many there are."""
    count = 0
    for v in vertices:
        for d in range(len(directions)):
            cosine = 0.0
            for c in range(3):
                cosine += normals[v, c] * directions[d, c]
            if cosine > 0.02:
                for c in range(3):
                    origins_out[count, c] = points[v, c] + offset * normals[v, c]
                    directions_out[count, c] = directions[d, c]
                owner_out[count, 0] = v
                owner_out[count, 1] = d
                count += 1
    return count


@kernel(nogil=True)
def light_rays(points, normals, vertices, targets, offset, origins_out, directions_out, owner_out):
    """Rays from every vertex to the points (L, S, 3) on the lights; returns how many."""
    count = 0
    for v in vertices:
        for m in range(targets.shape[0]):
            for k in range(targets.shape[1]):
                length, cosine = 0.0, 0.0
                for c in range(3):
                    step = targets[m, k, c] - points[v, c]
                    length += step * step
                    cosine += step * normals[v, c]
                length = math.sqrt(length)
                if cosine > -0.25 * length:  # beyond the terminator too, for wrapped light
                    for c in range(3):
                        origins_out[count, c] = points[v, c] + offset * normals[v, c]
                        directions_out[count, c] = (targets[m, k, c] - points[v, c]) / length
                    owner_out[count, 0] = v
                    owner_out[count, 1] = m
                    count += 1
    return count


@kernel(nogil=True)
def gather_sky(owner, blocked, normals, directions, colours, out):
    """Add the light (D, 3) of directions not blocked, times the cosine, to `out` (V, 3)."""
    for i in range(len(owner)):
        if blocked[i]:
            continue
        v, d = owner[i, 0], owner[i, 1]
        cosine = 0.0
        for c in range(3):
            cosine += normals[v, c] * directions[d, c]
        for c in range(3):
            out[v, c] += cosine * colours[d, c]
