"""Best subsets by dropping columns, compiled: branch and bound.

Let W be the inverse of the triangular factor of a set S, with only the rows of the columns that may still leave
("free"); M = W W' and b = W z. Removing column j costs b[j]^2 / M[j, j], and M and b then lose one rank. The row of M
required to remove a column is built from the vectors of the columns removed before, so a node costs a few passes over
one row. Where that would lose more digits than `GUARD` allows, W is recomputed by Householder QR.

The state is a tuple. ``work[:, d, :]`` contains for level d: 0 the vector of the removed column, 1 the diagonal of M,
2 b, 3 the costs, 4 the costs in the order of the free columns, 5 the smallest acceptable diagonal. ``moments[d]`` and
``triangles[d]`` are M and the triangular factor (columns as rows, y last) at levels where they were computed.
``orders``: 0 the free columns in descending order of cost, 1 the indices of the children, 2 the columns of the
triangular factor. ``numbers``: 0 number of free columns, 1 size of the set, 2 number of remaining children, 3 level
where M was computed, 4 number of columns of the triangular factor there, 5 [0] the level, 6 [0] whether some columns
are nearly dependent, 7 the removed column. ``rss``: residual sum of squares of the set.
"""

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.models.kernels.subsets import ByteArray, IntArray, Lists, compiled, exact, householder, offer

State = tuple[FloatArray, FloatArray, FloatArray, IntArray, IntArray, FloatArray]

#: smallest remaining share of M[j, j] before W is recomputed: at most five digits are lost
GUARD = 1e-5


@compiled
def gather(state: State, source: int, inside: ByteArray, free: IntArray, n_free: int) -> tuple[FloatArray, int]:
    """Return the triangular factor of the permanently retained columns, free columns and y, and the number retained."""
    _, _, triangles, orders, numbers, _ = state
    p = len(inside)
    had = numbers[4, source]
    columns = np.zeros((p + 1, had))
    kept = 0
    for i in range(had):
        k = orders[2, source, i]
        if inside[k] and not (free[:n_free] == k).any():
            columns[kept] = triangles[source, i, :had]
            kept += 1
    for f in range(n_free):
        for i in range(had):
            if orders[2, source, i] == free[f]:
                columns[kept + f] = triangles[source, i, :had]
    columns[kept + n_free] = triangles[source, p, :had]
    columns = columns[: kept + n_free + 1]
    householder(columns, kept + n_free)
    return columns, kept


@compiled
def renew(state: State, source: int, level: int, inside: ByteArray, free: IntArray, n_free: int) -> None:
    """Compute W, M and b of the free columns from the triangular factor at level `source`; store them at `level`."""
    work, moments, triangles, orders, numbers, _ = state
    p = len(inside)
    columns, kept = gather(state, source, inside, free, n_free)
    m = n_free
    W = np.zeros((m, m))
    orders[2, level, :m] = free[:m]
    triangles[level, :, :m] = 0.0
    triangles[level, :m, :m] = columns[kept : kept + m, kept : kept + m]
    triangles[level, p, :m] = columns[kept + m, kept : kept + m]
    numbers[4, level] = m
    for i in range(m):  # by rows: each is then exact for a triangle with errors only in the last digits
        W[i, i] = 1.0 / columns[kept + i, kept + i]
        for c in range(i + 1, m):
            total = 0.0
            for k in range(i, c):
                total += W[i, k] * columns[kept + c, kept + k]
            W[i, c] = -total / columns[kept + c, kept + c]
    M, D, B, C, limits = moments[level], work[1, level], work[2, level], work[3, level], work[5, level]
    M[:] = 0.0
    D[:] = 1.0
    B[:] = 0.0
    for i in range(m):
        k = free[i]
        total = 0.0
        for c in range(i, m):
            total += W[i, c] * triangles[level, p, c]
        B[k] = total
        for j in range(i + 1):
            total = 0.0
            for c in range(i, m):
                total += W[i, c] * W[j, c]
            M[k, free[j]] = M[free[j], k] = total
        D[k] = M[k, k]
    C[:] = B * B / D
    limits[:] = GUARD * D
    numbers[3, level] = level


@compiled
def begin(triangle: FloatArray, state: State, lists: Lists, inside: ByteArray, residual: float) -> None:
    """Initialise the root node (all columns) with all its children."""
    work, _, triangles, orders, numbers, rss = state
    p = len(inside)
    orders[2, 0, :p] = np.arange(p)
    triangles[0] = triangle.T
    numbers[4, 0] = p
    inside[:] = 1
    renew(state, 0, 0, inside, np.arange(p), p)
    if lists[3][p] > residual:
        offer(lists, p, residual, inside, -1, -1)
    costs = work[3, 0, :p]
    order = np.argsort(-costs)
    inflated = work[1, 0, :p].max() > 1 / GUARD
    if inflated:
        order = np.concatenate((order[work[1, 0, order] > 1 / GUARD], order[work[1, 0, order] <= 1 / GUARD]))
    for i in range(p):
        k = order[i]
        orders[0, 0, i] = k
        orders[1, 0, i] = i
        work[4, 0, i] = costs[k]
        if p > 1 and residual + costs[k] < lists[3][p - 1]:
            offer(lists, p - 1, residual + costs[k], inside, k, -1)
    numbers[0, 0], numbers[1, 0], numbers[2, 0], rss[0] = p, p, p - 1, residual
    numbers[5, 0] = 0
    numbers[6, 0] = inflated


@compiled
def drop(  # noqa: PLR0912, PLR0915 - a single function is a tenth faster
    state: State, lists: Lists, inside: ByteArray, budget: int
) -> int:
    """Continue the search until it is complete or `budget` nodes were visited; return their number.

    The search is complete when ``state`` is at level 0 and this level has no children left: ``numbers[2, 0] == 0``.
    """
    work, moments, _, orders, numbers, rss = state
    limit, bound = lists[3], lists[4]
    V, D, B, C, keys = work[0], work[1], work[2], work[3], work[4]
    width = D.shape[1]
    many, sizes, left, bases, out = numbers[0], numbers[1], numbers[2], numbers[3], numbers[7]
    inflated = numbers[6, 0] > 0
    d = numbers[5, 0]
    nodes = 0
    while nodes < budget:
        if left[d] == 0:
            if d == 0:
                break
            inside[out[d]] = 1
            d -= 1
            continue
        left[d] -= 1
        j = orders[1, d, left[d]]
        m, n = many[d] - 1 - j, sizes[d] - 1
        leaving = orders[0, d, j]
        r = rss[d] + keys[d, j]
        allowed = bound[max(n - m, 1)] - r
        if not allowed > 0:
            continue
        nodes += 1
        base = bases[d]
        source = moments[base, leaving]
        if m == 1:
            k = orders[0, d, j + 1]
            h = source[k]
            for t in range(base + 1, d + 1):
                h -= V[t, leaving] * V[t, k]
            g = 1 / D[d, leaving]
            rest = D[d, k] - h * h * g
            if rest > work[5, base, k]:
                b = B[d, k] - h * B[d, leaving] * g
                value = r + b * b / rest
                if value < limit[n - 1]:
                    offer(lists, n - 1, value, inside, leaving, k)
                continue
        v = V[d + 1]
        for i in range(width):
            v[i] = source[i]
        t = base + 1
        while t + 3 <= d:
            v0, v1, v2, v3 = V[t], V[t + 1], V[t + 2], V[t + 3]
            a0, a1, a2, a3 = v0[leaving], v1[leaving], v2[leaving], v3[leaving]
            for i in range(width):
                v[i] -= a0 * v0[i] + a1 * v1[i] + a2 * v2[i] + a3 * v3[i]
            t += 4
        while t <= d:
            v0 = V[t]
            a0 = v0[leaving]
            for i in range(width):
                v[i] -= a0 * v0[i]
            t += 1
        g = 1 / np.sqrt(D[d, leaving])
        y = B[d, leaving] * g
        old_d, new_d, old_b, new_b, cost, least = D[d], D[d + 1], B[d], B[d + 1], C[d + 1], work[5, base]
        for i in range(width):
            a = v[i] * g
            v[i] = a
            rest = old_d[i] - a * a
            b = old_b[i] - a * y
            new_d[i] = rest
            new_b[i] = b
            cost[i] = b * b / rest if rest > least[i] else -1.0
        parent, order, key = orders[0, d], orders[0, d + 1], keys[d + 1]
        bases[d + 1] = base
        inside[leaving] = 0
        while True:
            q = 0
            lowest = np.inf
            for i in range(j + 1, j + 1 + m):
                k = parent[i]
                x = cost[k]
                order[q] = k
                key[q] = x
                lowest = min(lowest, x)
                q += x < allowed
            if lowest >= 0:
                break
            renew(state, base, d + 1, inside, parent[j + 1 : j + 1 + m], m)  # sets the base of level d + 1
        if r + lowest < limit[n - 1]:
            for i in range(j + 1, j + 1 + m):
                k = parent[i]
                if r + cost[k] < limit[n - 1]:
                    offer(lists, n - 1, r + cost[k], inside, k, -1)
        if q < 2 or r + lowest >= bound[max(n - q, 1)]:
            inside[leaving] = 1
            continue
        for i in range(1, q):
            x, k = key[i], order[i]
            e = i
            while e > 0 and key[e - 1] < x:
                key[e], order[e] = key[e - 1], order[e - 1]
                e -= 1
            key[e], order[e] = x, k
        # Retain the most costly columns permanently if their removal exceeds the bound of the smallest reachable size.
        first = 0
        while first < q - 1 and r + key[first] >= bound[max(n - q + first, 1)]:
            first += 1
        if first >= q - 1:
            inside[leaving] = 1
            continue
        q -= first
        if first > 0:
            for i in range(q):
                order[i], key[i] = order[first + i], key[first + i]
        if inflated:  # nearly dependent columns come first: after one is removed, precision is safe below
            e = 0
            for i in range(q):
                x, k = key[i], order[i]
                if new_d[k] > 1 / GUARD:
                    for f in range(i, e, -1):
                        order[f], key[f] = order[f - 1], key[f - 1]
                    order[e], key[e] = k, x
                    e += 1
        s = 0
        for e in range(q - 1):
            orders[1, d + 1, s] = e
            s += r + key[e] < bound[max(n - q + e, 1)]
        d += 1
        many[d], sizes[d], left[d], rss[d], out[d] = q, n, s, r, leaving
    numbers[5, 0] = d
    return nodes


@compiled
def pivot(A: FloatArray, k: int) -> None:
    """Sweep column k in or out: symmetric Gauss-Jordan; columns in the set have a negative diagonal."""
    d = A[k, k]
    row = A[k].copy()
    for i in range(len(A)):
        a = row[i] / d
        for c in range(len(A)):
            A[i, c] -= a * row[c]
        A[i, k] = row[i] / abs(d)
    A[k] = A[:, k]
    A[k, k] = -1 / d


@compiled
def list_good_sets(triangle: FloatArray, least: FloatArray, lists: Lists, inside: ByteArray, largest: int) -> None:  # noqa: PLR0912
    """List good sets of every size: remove the cheapest column, then swap pairs while that improves the set.

    This works on cross products without a precision guard; each set found is rated by its QR value.
    """
    p = len(inside)
    columns = np.ascontiguousarray(triangle.T)
    A = columns @ columns.T
    inside[:] = 1
    for k in range(p):
        pivot(A, k)
    for size in range(p - 1, 0, -1):
        out, most = -1, -np.inf
        for i in range(p):
            if inside[i]:
                gain = A[i, p] ** 2 / A[i, i]
                if gain > most:
                    out, most = i, gain
        if out < 0:
            return
        inside[out] = 0
        pivot(A, out)
        for _ in range(p):
            out, enter, most = -1, -1, 1e-6 * A[p, p]
            for i in range(p):
                if inside[i]:
                    a, y, row = A[i, i], A[i, p], A[i]
                    for k in range(p):
                        det = a * A[k, k] - row[k] * row[k]
                        gain = y * y * A[k, k] - 2 * y * A[p, k] * row[k] + A[p, k] ** 2 * a
                        if inside[k] == 0 and gain < most * det:
                            out, enter, most = i, k, gain / det
            if out < 0:
                break
            inside[out], inside[enter] = 0, 1
            pivot(A, enter)
            pivot(A, out)
        if size <= largest:
            offer(lists, size, exact(columns, least, np.flatnonzero(inside), size), inside, -1, -1)
