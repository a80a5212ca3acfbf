"""A long cut may be split in a revision: its pieces are put together again, to be judged as one move."""

import math

from state_run import MOVES, Move, Ran

from thermocomp.nc.linuxcnc import rs274

#: of a place from the path, beside the largest correction [mm]
OFF = 1e-3


def joined(was: Ran, now: Ran, most: tuple[float, float, float]) -> Ran:
    """Return the second run with the pieces of cuts put together that are one move in the first.

    Pieces are moves in feed of the original's kind, one right behind the other, all of whose ends lie on its path but
    for the corrections. What is none stays as it is, and whoever compares finds it wrong.
    """
    if len(was.moves) == len(now.moves):
        return now
    near = max(most) * 1e-3 + OFF
    out = Ran(left=now.left)
    k = move = 0
    while k < len(now.calls):
        call = now.calls[k]
        out.calls.append(call)
        k += 1
        if call[0] not in MOVES:
            continue
        piece = now.moves[move]
        move += 1
        whole = was.moves[len(out.moves)] if len(out.moves) < len(was.moves) else None
        while (
            whole is not None
            and whole.kind in ("feed", "arc")
            and _on(whole, piece, near)
            and k < len(now.calls)
            and now.calls[k][0] == call[0]
            and math.dist(piece.end[:3], whole.end[:3]) > near
        ):
            piece = _together(piece, now.moves[move])
            move, k = move + 1, k + 1
        out.moves.append(piece)
    return out


def _together(a: Move, b: Move) -> Move:
    return Move(a.kind, a.line, a.start, b.end, b.arc, (), a.seconds + b.seconds, a.steps + b.steps)


def _radius(move: Move) -> float:
    assert move.arc is not None
    i, j, _ = rs274.PLANE_AXES[move.arc.plane]
    centre = move.arc.machine_centre
    return math.dist((move.start[i], move.start[j]), (centre[i], centre[j]))


def _on(whole: Move, piece: Move, near: float) -> bool:
    """Return whether a piece ends on the way of a move."""
    if (whole.arc is None) != (piece.arc is None):
        return False
    if whole.arc and piece.arc:
        i, j, _ = rs274.PLANE_AXES[whole.arc.plane]
        first, second = whole.arc.machine_centre, piece.arc.machine_centre
        return (
            whole.arc.plane == piece.arc.plane
            and math.dist((first[i], first[j]), (second[i], second[j])) <= 2.0 * near
            and abs(math.dist((piece.end[i], piece.end[j]), (first[i], first[j])) - _radius(whole)) <= 2.0 * near
        )
    way = [b - a for a, b in zip(whole.start[:3], whole.end[:3], strict=True)]
    gone = [b - a for a, b in zip(whole.start[:3], piece.end[:3], strict=True)]
    squared = sum(w * w for w in way)
    share = sum(w * g for w, g in zip(way, gone, strict=True)) / squared if squared else 0.0
    beside = math.dist(gone, [share * w for w in way])
    return beside <= 2.0 * near and -near <= share * math.sqrt(squared) <= math.sqrt(squared) + near
