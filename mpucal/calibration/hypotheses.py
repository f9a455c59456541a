"""Hypotheses about what happened while the board was turned, each weighed by its evidence.

The null hypothesis is that nothing happened: theta is constant. Each other hypothesis says that one quantity changed:
the accelerometer's bias, its scale factors, its mount (its rotation relative to the gyroscope), its linearity, or the
gyroscope's bias. The parts of the recording (parts.py) are joined to groups, which are intervals of time. In group k
the quantity differs by delta_k (3 numbers, one for each axis) from theta. The shape of a hypothesis says how delta_k
follows from numbers x ~ N(0, q):

    step    one x: delta_k is x from some time on, or grows evenly to x
    walk    one x in each group: delta_k is their sum so far
    pulse   one x: delta_k is x for a short time, as by a knock, or by a board that is taken up and put down
    each    one x in each group: delta_k is x_k, for an effect that no model has, such as a pivot that swings
    reading two x: delta_k grows with the square and the cube of each axis' reading

Log likelihoods are expanded to second order, for which the parts' scores are enough. With theta eliminated, the
quadratic form of x is S + I/q. With the eigenvalues lambda of S and the scores' components c along its eigenvectors,

    2 log p(q)/p(0) = sum c^2 / (lambda + 1/q) - log(1 + q lambda)

The evidence is the mean of p(q)/p(0) over the values of q, and over the times of a step or pulse. The null hypothesis
has half of the prior probability, and all others share the other half. They compete, so that one common cause is not
found under several names. But one cause may act on both sensors, as warming does on both biases. So a change of the
gyroscope that is certain is first taken out of the scores, and the other hypotheses are weighed again by what is left.

Source: Kass, Raftery, "Bayes factors" (1995); of random effects, Robinson, "That BLUP is a good thing" (1991).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby
from typing import Literal, NamedTuple

import numpy as np

from ..data import STANDARD_GRAVITY_MPS2, Recording, Vector
from ..rests.flat import Flat
from .parameters import PLACES
from .parts import Parts
from .rotation import cross

What = Literal["accelerometer", "scale", "mount", "gyroscope", "linearity"]
Kind = Literal["change", "time", "side"]
# Number of groups by shape. A step or pulse is tried at each group; a walk and `each` have an x in each.
GROUPS = {"step": 48, "walk": 16, "pulse": 48, "each": 16, "reading": 96}


class Hypothesis(NamedTuple):
    """Hypothesis that the quantity `what` changed in the course of time as `shape` says.

    prior : how often it happens, relative to the other hypotheses.
    """

    what: What
    shape: Literal["step", "walk", "pulse", "each", "reading"]
    prior: float = 1.0

    @property
    def is_change(self) -> bool:
        """True if the change remains afterwards."""
        return self.shape in ("step", "walk")

    @property
    def kind(self) -> Kind:
        """Kind of message about it: by a change of the accelerometer, by time, or by the side that is down."""
        if self.shape == "reading":
            return "side"
        return "change" if self.is_change and self.what != "gyroscope" else "time"


# Prior of a step, as every gyroscope's bias walks, and few step or drift steadily.
RARELY = 0.1
# Hypotheses of one shape must be neighbours here: they are computed together.
HYPOTHESES = (
    Hypothesis("accelerometer", "step"),
    Hypothesis("scale", "step"),
    Hypothesis("mount", "step"),
    Hypothesis("gyroscope", "step", prior=RARELY),
    Hypothesis("accelerometer", "walk"),
    Hypothesis("gyroscope", "walk"),
    Hypothesis("accelerometer", "pulse"),
    Hypothesis("accelerometer", "each"),
    Hypothesis("scale", "each"),
    Hypothesis("mount", "each"),
    Hypothesis("linearity", "reading"),
)
CHANGES = tuple(each for each in HYPOTHESES if each.is_change)
# Largest standard deviation of x that is tried, in m/s^2, 1, rad, rad/s and m/s^2; the smallest is a 10,000th of it.
LARGEST: dict[What, float] = {"accelerometer": 0.3, "scale": 0.01, "mount": 0.1, "gyroscope": 0.03, "linearity": 0.1}
# Standard deviation [m/s^2 at 1 g] of the square's and the cube's x: a tenth of what a data sheet allows (0.5 %).
NONLINEARITY_MPS2 = 0.005
VARIANCES = 10.0 ** np.arange(-8.0, 0.1, 0.5)
# A conclusion needs these odds: that something happened, against the null hypothesis, and what it was, against others.
SURE = 100.0
# The true cause may be missing in HYPOTHESES, and then the odds between others mean little. So a hypothesis is still
# possible whose log evidence is more than this share of the likeliest one's.
LEAST_EVIDENCE = 0.7
# Share of the largest eigenvalue below which a direction of x is left out: the parts hardly determine it.
UNSEEN = 3e-4
PULSES = (1, 2, 3)  # groups that a pulse lasts


class Explanation(NamedTuple):
    """Explanation of a recording by a hypothesis.

    Attributes
    ----------
    hypothesis : which one. evidence : log of its evidence, relative to that of the null hypothesis.
    delta : (k, 3) by group, m/s^2, 1, rad or rad/s, at the likeliest q and time.
    start, end : (k,) s after the flat segment, of the groups.
    aways : (m, p) rms errors of the estimated parameters if the hypothesis is true; m is the number of groups for a
        change, after which the true parameters differ, and else 1.
    shift : (1 + k, p) true parameters minus the estimate, in the flat segment and in each group, at the likeliest q and
        time.
    likeliest : index of the likeliest time, see _shapes. q : likeliest variance of x.
    weight : posterior probability.
    is_sure : True for the likeliest change of the accelerometer, where it is certain that there was one.
    is_possible : True if it is certain that something happened, and this hypothesis is about as good as the likeliest.
    """

    hypothesis: Hypothesis
    evidence: float
    delta: Vector
    start: Vector
    end: Vector
    aways: Vector
    shift: Vector
    likeliest: int
    q: float
    weight: float = 0.0
    is_sure: bool = False
    is_possible: bool = False

    @property
    def log_share(self) -> float:
        """Log of its posterior probability, relative to that of the null hypothesis."""
        return self.evidence + float(np.log(self.hypothesis.prior / sum(each.prior for each in HYPOTHESES)))

    @property
    def size(self) -> float:
        """Range of the quantity over the recording."""
        return float(np.linalg.norm(np.ptp(self.delta, axis=0)))

    @property
    def away(self) -> Vector:
        """Errors (p,) of the estimated parameters: the largest of all groups for a likely change, else the rms."""
        is_likely = self.is_possible and self.hypothesis.kind == "change" and self.weight > 0.5
        return np.asarray(self.aways.max(axis=0) if is_likely else np.sqrt(np.mean(self.aways**2, axis=0)))

    @property
    def span(self) -> tuple[float, float]:
        """Times [s after the flat segment] between which most of the change happened, or the largest delta_k was."""
        if not self.hypothesis.is_change:
            at = int(np.linalg.norm(self.delta, axis=1).argmax())
            return float(self.start[at]), float(self.end[at])
        steps = np.linalg.norm(np.diff(self.delta, axis=0), axis=1)
        large = np.flatnonzero(steps > 0.5 * steps.max())  # all steps of a steady drift, so that its span is the whole
        return float(self.middles[large[0]]), float(self.middles[large[-1] + 1])

    @property
    def middles(self) -> Vector:
        """Middles of the groups (k,) [s after the flat segment]."""
        return 0.5 * (self.start + self.end)


def rank(parts: Parts | None, D: Vector, hypotheses: Sequence[Hypothesis] = HYPOTHESES) -> list[Explanation]:
    """Return an explanation by each hypothesis, the likeliest first; none where the fit failed or has no parts."""
    if parts is None or not (parts.is_finite and np.isfinite(D).all()):
        return []
    return _weigh(hypotheses, parts, D)


def explain(parts: Parts | None, D: Vector, found: list[Explanation]) -> list[Explanation]:
    """Return the certain changes of the gyroscope, then explanations of what these leave, the likeliest first.

    found : what `rank` returned.
    """
    known: list[Explanation] = []
    while parts and sum(each.weight for each in found if each.hypothesis.what == "gyroscope") > 1.0 - 1.0 / SURE:
        known.append(found[0])
        parts = _without(parts, found[0])
        found = _weigh([each for each in HYPOTHESES if each not in {of.hypothesis for of in known}], parts, D)
    return known + found


def _weigh(hypotheses: Sequence[Hypothesis], parts: Parts, D: Vector) -> list[Explanation]:
    """Return an explanation by each hypothesis with its posterior probability, the likeliest first."""
    groups = {number: _Groups.of(parts, number) for number in {GROUPS[each.shape] for each in hypotheses}}
    found = [
        each
        for shape, alike in groupby(hypotheses, key=lambda each: each.shape)
        for each in _explain(list(alike), groups[GROUPS[shape]], parts, D)
    ]
    total = float(np.logaddexp.reduce([0.0, *(each.log_share for each in found)]))  # 0: the null hypothesis
    found = [each._replace(weight=float(np.exp(each.log_share - total))) for each in found]
    found.sort(key=lambda each: -each.weight)
    if total > np.log(SURE):
        most = found[0].log_share
        least = min(most - np.log(SURE), LEAST_EVIDENCE * most)
        found = [each._replace(is_possible=each.log_share > least) for each in found]
    changes = [each for each in found if each.hypothesis.kind == "change"]
    if sum(each.weight for each in changes) > 1.0 - 1.0 / SURE:
        of_sure = changes[0]._replace(weight=1.0, is_sure=True)
        found = [of_sure if each is changes[0] else each for each in found]
    return found


def _without(parts: Parts, known: Explanation) -> Parts:
    """Return the parts with scores at the parameters that hold in each part if an explanation is true."""
    shift = known.shift[1 + parts.by_time(GROUPS[known.hypothesis.shape])]
    moved = np.einsum("kpq,kq->kp", parts.fisher, shift)
    besides = parts.H - parts.fisher.sum(axis=0)  # Fisher matrix of the prior and the flat mean
    return replace(
        parts, gradient=parts.gradient + moved, left=parts.left + moved.sum(axis=0) + besides @ known.shift[0]
    )


def gyroscope_change(explanations: Sequence[Explanation]) -> Explanation | None:
    """Return the change of the gyroscope's bias; None where no change, or one of the accelerometer, is likelier."""
    first = next((each for each in explanations if each.hypothesis.is_change), None)
    is_likely = first is not None and first.hypothesis.what == "gyroscope" and first.log_share > np.log(SURE)
    return first if is_likely else None


def remove_change(recording: Recording, flat: Flat, change: Explanation) -> Recording:
    """Subtract a change of the gyroscope's bias from the rates after the flat segment.

    It is interpolated linearly between the middles of the groups, and begins with 0 in the middle of the flat segment.
    """
    t = recording.t - recording.t[flat.last - 1]
    at, delta = np.append(0.5 * t[flat.first], change.middles), np.vstack([np.zeros(3), change.delta])
    drift = np.stack([np.interp(t, at, column) for column in delta.T], axis=1)
    drift[: flat.last] = 0.0
    return replace(recording, gyr=recording.gyr - drift)


class _Groups(NamedTuple):
    """Groups of parts: gradients (k, p), Fisher matrices (k, p, p), times (k,), and readings (1 + k, 3) as of Parts."""

    gradient: Vector
    fisher: Vector
    reading: Vector
    start: Vector
    end: Vector

    @classmethod
    def of(cls, parts: Parts, groups: int) -> _Groups:
        """Group the parts into this many stretches of time."""
        group = parts.by_time(groups)
        first = np.unique(group, return_index=True)[1]
        last = np.append(first[1:], len(parts)) - 1
        reading = parts.reading[np.append(0, 1 + first)]
        return cls(*parts.grouped(first), reading, parts.start[first], parts.end[last])


class _Likelihood(NamedTuple):
    """Quadratic log likelihood of x with theta eliminated, along the eigenvectors of its quadratic form.

    It is computed for h hypotheses, and for the m times that their shape can have. x has r numbers for each axis, and
    d = 3 r components along the eigenvectors.

    Attributes
    ----------
    eigenvalues, scores : (h, m, d). strays : (h, m, d, p), error of the estimated parameters by a unit of a component.
    U : (h, m, r, 3, d) eigenvectors.
    """

    eigenvalues: Vector
    scores: Vector
    strays: Vector
    U: Vector

    @classmethod
    def of(cls, B: Vector, shapes: Vector, groups: _Groups, parts: Parts) -> _Likelihood:
        """Eliminate theta from the parts' scores.

        B : (h, p, 3) see _directions. shapes : (m, 1 + k, r, 1 or 3), see _shapes.
        """
        # The flat segment is in no group. The parameters that are eliminated are those that hold in it.
        flat, shapes = shapes[:, 0], shapes[:, 1:] - shapes[:, :1]
        (h, p, _), (m, k, r, axes) = B.shape, shapes.shape
        weights = shapes.transpose(3, 0, 2, 1).reshape(axes, m * r, k)
        pairs = weights.reshape(axes, 1, m, r, 1, k) * weights.reshape(1, axes, m, 1, r, k)
        across = (groups.fisher.reshape(-1, p) @ np.hstack(list(B))).reshape(k, p, h, 3).transpose(2, 3, 0, 1)
        own = (across @ B[:, None]).transpose(0, 1, 3, 2)[..., None]  # (h, 3, 3, k, 1)
        across = (weights @ across).reshape(h, 3, m, r, p).transpose(0, 2, 3, 1, 4).reshape(h, m, 3 * r, p)
        follow = across @ parts.covariance
        S = (pairs.reshape(axes, axes, -1, k) @ own).reshape(h, 3, 3, m, r, r)
        S = S.transpose(0, 3, 4, 1, 5, 2).reshape(h, m, 3 * r, 3 * r)
        eigenvalues, U = np.linalg.eigh(S - follow @ across.swapaxes(2, 3))
        of_groups = weights @ (groups.gradient @ B).swapaxes(1, 2)[..., None]  # (h, 3, m r, 1)
        of_x = follow @ parts.left - of_groups.reshape(h, 3, m, r).transpose(0, 2, 3, 1).reshape(h, m, 3 * r)
        scores = (of_x[:, :, None] @ U)[:, :, 0]
        follow += (flat[:, :, :, None] * B.swapaxes(1, 2)[:, None, None]).reshape(follow.shape)
        return cls(np.maximum(eigenvalues, 0.0), scores, U.swapaxes(2, 3) @ follow, U.reshape(h, m, r, 3, -1))

    def seen(self) -> _Likelihood:
        """Return it without the directions of x that the parts hardly determine."""
        eigenvalues, scores, strays, U = self
        is_seen = eigenvalues > UNSEEN * eigenvalues.max(axis=(1, 2), keepdims=True)
        return _Likelihood(eigenvalues, scores * is_seen, strays * is_seen[..., None], U * is_seen[:, :, None, None])


def _explain(alike: Sequence[Hypothesis], groups: _Groups, parts: Parts, D: Vector) -> list[Explanation]:
    """Return explanations by hypotheses of one shape, in their order."""
    B = np.array([_directions(each.what, D, len(parts.H)) for each in alike])
    shapes = _shapes(alike[0].shape, groups)
    likelihood = _Likelihood.of(B, shapes, groups, parts).seen()
    q = np.outer([LARGEST[each.what] ** 2 for each in alike], VARIANCES)[:, None, :, None]
    # (h, m, q, d): by hypothesis, by shape, by variance, by component
    eigenvalues, c = likelihood.eigenvalues[:, :, None], likelihood.scores[:, :, None]
    variance = 1.0 / (eigenvalues + 1.0 / q)
    x = c * variance
    log_p = 0.5 * np.sum(c * x - np.log1p(q * eigenvalues), axis=3)
    most = log_p.max(axis=(1, 2), keepdims=True)
    p = np.exp(log_p - most)
    evidence = most[:, 0, 0] + np.log(p.mean(axis=(1, 2)))
    p /= p.sum(axis=(1, 2), keepdims=True)
    weighed = p[..., None] * x
    squares = weighed.swapaxes(2, 3) @ x
    np.einsum("hmdd->hmd", squares)[:] += np.einsum("hmq,hmqd->hmd", p, variance)
    # The mean square error of the estimated parameters is needed in each group. An error is x times a sum over a of
    # basis (h, m, a, d, p) and weights (m, groups, a). For a change it has two terms, as the true parameters in a group
    # differ by delta_k. The products of the terms are averaged first, which needs no array of (h, m, groups, d, p).
    basis, weights = -likelihood.strays[:, :, None], np.ones((len(shapes), 1, 1))
    if alike[0].is_change:
        of_x = likelihood.U.swapaxes(3, 4) @ B.swapaxes(1, 2)[:, None, None]
        basis = np.concatenate([basis, of_x], axis=2)
        of_groups = shapes[:, 1:, :, 0]  # the axes change alike
        weights = np.concatenate([np.ones((*of_groups.shape[:2], 1)), of_groups], axis=2)
    products = np.einsum("hmadp,hmbdp->hmabp", basis, squares[:, :, None] @ basis)
    pairs = (weights[:, :, :, None] * weights[:, :, None]).swapaxes(0, 1)
    away2 = pairs.reshape(len(pairs), -1) @ products.reshape(len(alike), -1, products.shape[-1])
    away = np.sqrt(np.maximum(away2, 0.0))
    found = []
    for k, (hypothesis, of) in enumerate(zip(alike, log_p, strict=True)):
        m, best = divmod(int(of.argmax()), of.shape[1])
        likeliest, strays = x[k, m, best], likelihood.strays[k, m]
        delta = np.sum(shapes[m] * (likelihood.U[k, m] @ likeliest), axis=1)
        shift = delta @ B[k].T - likeliest @ strays
        about = groups.start, groups.end, away[k], shift, m, float(q[k, 0, best, 0])
        found.append(Explanation(hypothesis, float(evidence[k]), delta[1:], *about))
    return found


def nonlinearity(parts: Parts, D: Vector) -> Vector:
    """Return the covariance (p, p) of the estimate by a nonlinearity of NONLINEARITY_MPS2 that the parts may hide."""
    groups = _Groups.of(parts, GROUPS["reading"])
    return _unseen("linearity", NONLINEARITY_MPS2**2, _shapes("reading", groups), groups, parts, D)


def unseen_changes(changes: Sequence[Explanation], parts: Parts, D: Vector, rests_often: bool) -> Vector:
    """Return the covariance (p, p) of the estimate by the error that is left of changes that were removed.

    Each hypothesis counts once, with its largest change. A walk has one x in each group, if the board rests often. A
    machine that turns evenly does not rest, and there a walk within a group looks like an error of the mount: so it has
    one x in each part.
    """
    total = np.zeros_like(parts.H)
    largest = {each.hypothesis: each for each in sorted(changes, key=lambda each: each.q)}
    for hypothesis, change in largest.items():
        is_fine = hypothesis.shape == "walk" and not rests_often
        groups = _Groups.of(parts, len(parts) if is_fine else GROUPS[hypothesis.shape])
        shape = _shapes(hypothesis.shape, groups)[change.likeliest][None]
        total += _unseen(hypothesis.what, change.q, shape, groups, parts, D)
    return total


def _unseen(what: What, q: float, shapes: Vector, groups: _Groups, parts: Parts, D: Vector) -> Vector:
    """Return the covariance (p, p) of the estimate by x of variance q, given the parts, summed over the shapes."""
    if not parts.is_finite:
        return np.full_like(parts.H, np.nan)
    likelihood = _Likelihood.of(_directions(what, D, len(parts.H))[None], shapes, groups, parts)
    left = likelihood.strays / np.sqrt(likelihood.eigenvalues + 1.0 / q)[..., None]
    left = left.reshape(-1, left.shape[-1])
    return left.T @ left


def _directions(what: What, D: Vector, p: int) -> Vector:
    """Return (p, 3), the derivatives of the parameters by delta_k."""
    B = np.zeros((p, 3))
    if what == "mount":
        B[PLACES["D"]] = (D @ cross(np.eye(3))).reshape(3, 9).T
    elif what == "scale":
        B[PLACES["D"]] = (np.eye(3)[:, :, None] * D).reshape(3, 9).T
    else:
        B[PLACES["b_omega" if what == "gyroscope" else "b_a"]] = np.eye(3)
    return B


def _shapes(shape: str, groups: _Groups) -> Vector:
    """Return (m, 1 + k, r, 1 or 3) weights, with which x makes delta_k in the flat segment and in k groups.

    m : times at which a step or pulse may happen, else 1. r : numbers x of each axis. The last dimension is 3 where the
    weights of the axes differ.
    """
    k = len(groups.start)
    if shape == "reading":
        u = groups.reading / STANDARD_GRAVITY_MPS2
        # Averaged over all directions, these have no linear part, which theta has already.
        return np.stack([u**2 - 1.0 / 3.0, u**3 - 0.6 * u], axis=1)[None]
    at = np.arange(k + 1)
    if shape == "step":
        middles = groups.start + groups.end
        weights = np.vstack([at >= at[2:, None], np.append(0.0, middles / middles[-1])])[:, :, None]
    elif shape == "pulse":
        weights = np.vstack([(at >= at[:, None]) & (at < at[:, None] + width) for width in PULSES])[:, :, None]
    else:
        weights = (np.tri(k + 1)[:, 1:] if shape == "walk" else np.eye(k + 1)[:, 1:])[None]
    return np.asarray(weights[..., None], np.float64)
