"""Axis ticks: round numbers within an interval, and their labels."""

import numpy as np

from app.html import number

LONG = 1e5  # larger numbers are labelled in thousands (k), millions (M) or billions (G)
UNITS = {1e3: "k", 1e6: "M", 1e9: "G"}


def ticks(low: float, high: float) -> np.ndarray:
    """Two to four round numbers within an interval."""
    rough = (high - low) / 3
    power = 10 ** np.floor(np.log10(rough))
    step = power * min((1, 2, 5, 10), key=lambda factor: abs(factor * power - rough))
    return np.arange(np.ceil(low / step), np.floor(high / step) + 1) * step


def log_ticks(low: float, high: float) -> np.ndarray:
    """At most five powers of ten within an interval of exponents; if it contains fewer than two, their multiples by 1, 2
    and 5, or round numbers."""
    powers = np.arange(np.ceil(low), np.floor(high) + 1)
    if len(powers) >= 2:
        return 10.0 ** powers[:: -(-len(powers) // 5)]
    multiples = np.outer(10.0 ** np.arange(np.floor(low), np.ceil(high)), [1, 2, 5]).ravel()
    within = multiples[(multiples >= 10.0**low) & (multiples <= 10.0**high)]
    if len(within) >= 2:
        return within
    found = ticks(10.0**low, 10.0**high)
    return found[found > 0]


def tick_labels(values: np.ndarray) -> list[str]:
    """A distinct label of at most seven characters for each value (n,)."""
    largest = float(np.abs(values).max(initial=0))
    if not LONG <= largest < 1e12 or len(values) < 2:
        for digits in (3, 4, 5, 6):
            labels = [number(float(value), digits) for value in values]
            if len(set(labels)) == len(labels):
                break
        return labels
    apart = np.diff(values)
    if apart.max() > 2 * apart.min():  # a log scale
        return [_in_units(float(value), abs(float(value)), 0) for value in values]
    return [_in_units(float(value), largest, float(apart.min())) for value in values]


def _in_units(value: float, largest: float, apart: float) -> str:
    """A value in k, M or G of `largest`, with the decimals that distinguish values `apart`; 0: as few as possible."""
    unit = max((unit for unit in UNITS if unit <= largest), default=1.0)
    decimals = int(np.clip(np.ceil(-np.log10(apart / unit) - 1e-9), 0, 3)) if apart > 0 else 0
    figure = f"{value / unit:.{decimals}f}" if apart > 0 else f"{value / unit:g}"
    return figure.replace("-", "\u2212") + (f"\u2009{UNITS[unit]}" if unit in UNITS else "")
