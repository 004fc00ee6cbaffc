"""Shapes: how directions, angles and parameters meet."""

from __future__ import annotations

from typing import Any, Mapping, Sequence, Union

import numpy as np
import numpy.typing as npt

from . import _lobefit
from ._lobefit import Error

#: A number, three numbers for a colour, the name of a choice, or an array of one of the first two.
Value = Union[float, str, Sequence[float], npt.NDArray[Any]]
Array = npt.NDArray[np.float64]

USAGE = 2


def usage_error(what: str, mend: str) -> Error:
    """An Error as a wrong call gets it."""
    error = Error(f"{what}: {mend}")
    error.code = USAGE
    return error


def number_array(value: npt.ArrayLike, name: str) -> npt.NDArray[Any]:
    """`value` as an array of float32, if it is one, else of float64."""
    array = np.asarray(value)
    if array.dtype.kind not in "fiu":
        raise usage_error(f"{name} holds {array.dtype}, not real numbers", "give an array of floats")
    return array if array.dtype == np.float32 else array.astype(np.float64, copy=False)


def call_text(function: str, first: Sequence[str], given: Mapping[str, Any], defaults: Mapping[str, Any]) -> str:
    """A call as provenance records it: what is not the default."""
    said = [f"{name}={value!r}" for name, value in given.items() if name not in defaults or value != defaults[name]]
    return f"lobefit.{function}({', '.join([*first, *said])})"


def direction_array(value: npt.ArrayLike, name: str) -> npt.NDArray[Any]:
    """An array of directions of shape (..., 3)."""
    array = number_array(value, name)
    if array.ndim == 0 or array.shape[-1] != 3:
        raise usage_error(f"{name} has the shape {array.shape}", "directions are unit vectors, shape (..., 3)")
    return array


def broadcast_shapes(shapes: Mapping[str, tuple[int, ...]]) -> tuple[int, ...]:
    """The common shape of named shapes."""
    try:
        return np.broadcast_shapes(*shapes.values())
    except ValueError:
        texts = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
        raise usage_error(f"shapes do not go together: {texts}", "see NumPy's rules of broadcasting") from None


def rows(array: npt.NDArray[Any], shape: tuple[int, ...]) -> npt.NDArray[Any]:
    """(n, k) rows of an array (..., k) broadcast to `shape`; one row for all is not copied."""
    count = int(np.prod(shape))
    if array.size == array.shape[-1]:
        return np.broadcast_to(array.reshape(1, -1), (count, array.shape[-1]))
    return np.broadcast_to(array, shape + array.shape[-1:]).reshape(count, array.shape[-1])


def directions(theta: npt.ArrayLike, phi: npt.ArrayLike = 0.0) -> Array:
    """Unit directions at polar angles `theta` and azimuths `phi`, in degrees, broadcast; shape (..., 3).

    z is the normal (of hair, the fibre's axis). `theta` lies in [0, 180]. The azimuth of the light less that of the
    view is 0 on the retro side, 180 on the mirror side. The same bits as `--wi THETA,PHI` on the command line.

        wi = lobefit.directions([0, 30, 60])           # (3, 3)
        wo = lobefit.directions(45, 180)               # (3,)
    """
    polar, azimuth = number_array(theta, "theta"), number_array(phi, "phi")
    shape = broadcast_shapes({"theta": polar.shape, "phi": azimuth.shape})
    flat = [np.ascontiguousarray(np.broadcast_to(a, shape), dtype=np.float64).reshape(-1) for a in (polar, azimuth)]
    return _lobefit.directions(*flat).reshape(shape + (3,))
