"""What a window leaves out, estimated from how the bound changes when the window is shortened."""

import numpy as np

from locbounds.axes import Array, Bool, Float
from locbounds.verdict import Status, Verdict


def shortened(window: int) -> list[Bool[Array, " window"]]:
    """Which ages windows keep that are shorter by a quarter and by a half.

    >>> [int(kept.sum()) for kept in shortened(12)]
    [9, 6]
    """
    return [np.arange(window) < -(-n * window // 4) for n in (3, 2)]


def extrapolated(
    shorter: Float[Array, "2 times"], position_mse: Float[Array, " times"], window: int, steps: int
) -> float:
    """Relative error of the position RMSE at the worst step that is due to the window, extrapolated.

    Parameters
    ----------
    shorter
        Changes of the position mean square error, to first order, with the windows of :func:`shortened`.
    position_mse
        With the whole window.
    window, steps
        Ages kept, and ages that there are.

    Notes
    -----
    The changes on shortening the window by a quarter and by a half say how fast they decay with its length:
    geometrically with a ratio q per quarter, ``half / quarter = (1 + q) / q``, and what was left out makes
    ``quarter * q / (1 - q)``, or the last quarter as often as quarters were left out where nothing decays. The decay
    slows where a chain has several time scales, so that the last quarter itself is added: what is reported is the error
    that the window shortened by a quarter would have.
    """
    mse = np.asarray(position_mse)
    relative = np.abs(shorter) / (2 * np.where(mse > 0, mse, 1.0))
    quarter, half = (float(change.max()) for change in relative)
    beyond = quarter / (half - 2 * quarter) if half > 2 * quarter else np.inf  # q / (1 - q)
    return quarter * (1.0 + min(beyond, 4 * (steps - window) / window))


def judged(verdict: Verdict, truncation: float, window: int, steps: int) -> Verdict:
    """The verdict, under the condition that a given window is long enough where nobody has looked what it leaves out.

    Information that is left out has either sign: the number may lie above the bound.

    >>> judged(Verdict(Status.VALID, ("smooth noise",)), float("nan"), 2, 9).status.value
    'valid under'
    """
    if np.isfinite(truncation) or window >= steps:
        return verdict
    condition = (
        f"a window of {window} of {steps} steps leaves nothing out that matters: its truncation is not known, and the "
        "number may lie above the bound (leave the window out and it is chosen)"
    )
    if verdict.status is Status.VALID:
        return verdict._replace(status=Status.CONDITIONAL, reasons=(condition,))
    return verdict._replace(reasons=(*verdict.reasons, condition))
