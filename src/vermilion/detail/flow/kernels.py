"""Compiled loops of the six-frame flow: assembly of the data terms, relaxation of the flows.

The unknowns of a pixel are five flows, w_1 to w_5 (numbered from 0 here). A point x of the reference
has a place in each of six images: x plus a sum of flows. A data term compares two images.
"""

from __future__ import annotations

import numpy as np

from vermilion.storage.kernels import kernel

#: For each image (synthetic and true at t, t + 1, t - 1): the flows whose sum leads from x to it.
PLACES = np.array(
    [
        [0, 0, 0, 0, 0],
        [1, 0, 0, 0, 0],
        [0, 1, 0, 0, 0],
        [1, 1, 1, 0, 0],
        [0, 0, 0, 1, 0],
        [1, 0, 0, 1, 1],
    ],
    dtype=np.float32,
)
#: The seven connections of Mono13 figure 6.
TERMS = np.array([[0, 1], [2, 3], [4, 5], [0, 2], [0, 4], [1, 3], [1, 5]])
_N = 18


@kernel(fastmath=True, error_model="numpy")
def _sample(maps, x, y, out):
    """All channels of (h, w, C) at (x, y) in pixel indices, bilinear; False outside."""
    height, width = maps.shape[:2]
    if not (x >= 0 and y >= 0 and x <= width - 1 and y <= height - 1):
        return False
    column, row = min(int(x), width - 2), min(int(y), height - 2)
    u, v = np.float32(x - column), np.float32(y - row)
    a, b, c, d = (1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v
    for k in range(maps.shape[2]):
        out[k] = (
            a * maps[row, column, k]
            + b * maps[row, column + 1, k]
            + c * maps[row + 1, column, k]
            + d * maps[row + 1, column + 1, k]
        )
    return True


@kernel(fastmath=True, error_model="numpy")
def assemble(images, masks, flows, places, terms, gradient_weight, epsilon, system, right):
    """Linearise the data terms of Mono13 eq. 9 about `flows` (lagged robust weights).

    Args:
        images: (6, h, w, 18) channels; masks: (6, h, w, 1) float32, 1 where they may be compared.
        flows: (h, w, 5, 2) px.
        gradient_weight: weight of gradient constancy against colour constancy.
        system: (h, w, 10, 10), right: (h, w, 10), filled: the increments fulfil system d = right.
    """
    height, width = flows.shape[:2]
    values = np.empty((6, _N), dtype=np.float32)
    mask = np.empty((6, 1), dtype=np.float32)
    usable = np.empty(6, dtype=np.bool_)
    pair = np.empty(4, dtype=np.float32)
    for y in range(height):
        for x in range(width):
            a, b = system[y, x], right[y, x]
            a[:] = 0
            b[:] = 0
            if masks[0, y, x, 0] < 0.5:
                continue
            for i in range(6):
                px, py = np.float32(x), np.float32(y)
                for f in range(5):
                    px += places[i, f] * flows[y, x, f, 0]
                    py += places[i, f] * flows[y, x, f, 1]
                usable[i] = (
                    _sample(images[i], px, py, values[i])
                    and _sample(masks[i], px, py, mask[i])
                    and mask[i, 0] > 0.9
                )
            for t in range(len(terms)):
                i, j = terms[t, 0], terms[t, 1]
                if not (usable[i] and usable[j]):
                    continue
                _term(
                    values[i], values[j], places[i], places[j], gradient_weight, epsilon, pair, a, b
                )


@kernel(fastmath=True, error_model="numpy")
def _term(of_i, of_j, place_i, place_j, gradient_weight, epsilon, pair, a, b):
    """Add |f_j(place j) - f_i(place i)|, of colours and of their gradients, to a pixel's system."""
    for kind in range(2):
        first, last = (0, 3) if kind == 0 else (3, 9)
        total = np.float32(0)
        for k in range(first, last):
            total += (of_j[k] - of_i[k]) ** 2
        weight = np.float32(0.5) / np.sqrt(total + epsilon * epsilon)
        if kind == 1:
            weight *= gradient_weight
        # The residual's derivative by (place i x, place i y, place j x, place j y), squared and summed.
        q = np.zeros((4, 4), dtype=np.float32)
        g = np.zeros(4, dtype=np.float32)
        for k in range(first, last):
            colour, order = k % 3, k // 3
            if order == 0:
                at_x, at_y = 3 + colour, 6 + colour
            elif order == 1:
                at_x, at_y = 9 + colour, 12 + colour
            else:
                at_x, at_y = 12 + colour, 15 + colour
            pair[0], pair[1] = -of_i[at_x], -of_i[at_y]
            pair[2], pair[3] = of_j[at_x], of_j[at_y]
            residual = of_j[k] - of_i[k]
            for m in range(4):
                g[m] += pair[m] * residual
                for n in range(4):
                    q[m, n] += pair[m] * pair[n]
        for f in range(5):
            for m in range(2):
                s = place_i[f] * g[m] + place_j[f] * g[2 + m]
                b[2 * f + m] -= weight * s
            if place_i[f] == 0 and place_j[f] == 0:
                continue
            for h in range(5):
                if place_i[h] == 0 and place_j[h] == 0:
                    continue
                for m in range(2):
                    for n in range(2):
                        a[2 * f + m, 2 * h + n] += weight * (
                            place_i[f] * (place_i[h] * q[m, n] + place_j[h] * q[m, 2 + n])
                            + place_j[f] * (place_i[h] * q[2 + m, n] + place_j[h] * q[2 + m, 2 + n])
                        )


@kernel(fastmath=True, error_model="numpy")
def edge_weights(flow, direction, alpha, scale, edges):
    """Weights of the four edges (east, south, south-east, south-west) of each pixel (Mono13 eq. 11).

    Diffusion along and across structures, each with its own robust weight; the mixed part goes to the
    diagonals, so that all weights are positive.

    Args:
        flow: (h, w, 2) px; direction: (h, w, 2) unit, across structures.
        alpha: smoothness; scale: lambda_s of the penaliser.
        edges: (h, w, 4), filled; zero at the border.
    """
    height, width = flow.shape[:2]
    tensor = np.empty((height, width, 3), dtype=np.float32)
    for y in range(height):
        for x in range(width):
            left, right = max(x - 1, 0), min(x + 1, width - 1)
            up, down = max(y - 1, 0), min(y + 1, height - 1)
            r, s = direction[y, x]
            across, along = np.float32(0), np.float32(0)
            for k in range(2):
                ux = (flow[y, right, k] - flow[y, left, k]) / max(right - left, 1)
                uy = (flow[down, x, k] - flow[up, x, k]) / max(down - up, 1)
                across += (ux * r + uy * s) ** 2
                along += (-ux * s + uy * r) ** 2
            p = alpha / np.sqrt(1 + across / (scale * scale))
            q = alpha / np.sqrt(1 + along / (scale * scale))
            tensor[y, x, 0] = p * r * r + q * s * s
            tensor[y, x, 1] = (p - q) * r * s
            tensor[y, x, 2] = p * s * s + q * r * r
    least = np.float32(0.02 * alpha)
    for y in range(height):
        for x in range(width):
            for e in range(4):
                dx, dy = (1, 0, 1, -1)[e], (0, 1, 1, 1)[e]
                if x + dx < 0 or x + dx >= width or y + dy >= height:
                    edges[y, x, e] = 0
                    continue
                one, two = tensor[y, x], tensor[y + dy, x + dx]
                mixed = 0.5 * (one[1] + two[1])
                if e == 0:
                    edges[y, x, e] = max(0.5 * (one[0] + two[0]) - abs(mixed), least)
                elif e == 1:
                    edges[y, x, e] = max(0.5 * (one[2] + two[2]) - abs(mixed), least)
                elif e == 2:
                    edges[y, x, e] = max(mixed, np.float32(0))
                else:
                    edges[y, x, e] = max(-mixed, np.float32(0))


@kernel(fastmath=True, error_model="numpy")
def relax(system, right, flows, step, edges, similarity, omega):
    """One sweep of successive over-relaxation over the increments `step` (h, w, 5, 2), in place.

    Args:
        flows: (h, w, 5, 2) about which the data was linearised.
        edges: (5, h, w, 4) smoothness weights of each flow.
        similarity: (5,) weight of the flow's own magnitude (Mono13 eq. 13).
        omega: relaxation.
    """
    height, width = flows.shape[:2]
    for y in range(height):
        for x in range(width):
            a, b = system[y, x], right[y, x]
            for f in range(5):
                total, rx, ry = similarity[f], b[2 * f], b[2 * f + 1]
                u, v = flows[y, x, f, 0], flows[y, x, f, 1]
                rx -= similarity[f] * u
                ry -= similarity[f] * v
                for n in range(8):
                    dx, dy = (1, 0, 1, -1, -1, 0, -1, 1)[n], (0, 1, 1, 1, 0, -1, -1, -1)[n]
                    nx, ny = x + dx, y + dy
                    if nx < 0 or ny < 0 or nx >= width or ny >= height:
                        continue
                    w = edges[f, y, x, n] if n < 4 else edges[f, ny, nx, n - 4]
                    total += w
                    rx += w * (flows[ny, nx, f, 0] + step[ny, nx, f, 0] - u)
                    ry += w * (flows[ny, nx, f, 1] + step[ny, nx, f, 1] - v)
                for g in range(5):
                    if g != f:
                        sx, sy = step[y, x, g, 0], step[y, x, g, 1]
                        rx -= a[2 * f, 2 * g] * sx + a[2 * f, 2 * g + 1] * sy
                        ry -= a[2 * f + 1, 2 * g] * sx + a[2 * f + 1, 2 * g + 1] * sy
                p, q = a[2 * f, 2 * f] + total, a[2 * f, 2 * f + 1]
                s = a[2 * f + 1, 2 * f + 1] + total
                determinant = p * s - q * q
                if determinant <= 0:
                    continue
                new_x = (s * rx - q * ry) / determinant
                new_y = (p * ry - q * rx) / determinant
                step[y, x, f, 0] += omega * (new_x - step[y, x, f, 0])
                step[y, x, f, 1] += omega * (new_y - step[y, x, f, 1])
