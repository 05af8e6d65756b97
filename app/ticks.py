"""Round numbers along an axis."""

import numpy as np


def ticks(low: float, high: float) -> np.ndarray:
    """Two to four round numbers within an interval."""
    rough = (high - low) / 3
    power = 10 ** np.floor(np.log10(rough))
    step = power * min((1, 2, 5, 10), key=lambda factor: abs(factor * power - rough))
    return np.arange(np.ceil(low / step), np.floor(high / step) + 1) * step


def log_ticks(low: float, high: float) -> np.ndarray:
    """Powers of ten, at most five, within an interval of exponents; round numbers where it holds fewer than two."""
    powers = np.arange(np.ceil(low), np.floor(high) + 1)
    if len(powers) >= 2:
        return 10.0 ** powers[:: -(-len(powers) // 5)]
    found = ticks(10.0**low, 10.0**high)
    return found[found > 0]
