"""Arguments that are numbers, or arrays of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["real_array"]


def real_array(name: str, given: ArrayLike) -> np.ndarray:
    """An argument as an array of floats of its own shape.

    Raises
    ------
    InputError
        The argument called ``name`` is ragged, or holds something else than real numbers.
    """
    try:
        array = np.asarray(given)
    except ValueError as error:
        raise InputError(f"{name}: {error}") from None
    if array.dtype.kind not in "iuf":
        raise InputError(f"{name} has the dtype {array.dtype}: must be real numbers")
    return np.asarray(array, dtype=float, order="C")
