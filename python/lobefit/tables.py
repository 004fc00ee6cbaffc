"""Tables of BRDF values over directions, whatever they came from."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any, Mapping, Optional, Sequence, Union

import numpy as np
import numpy.typing as npt

from . import _lobefit
from .arrays import Array, Value, broadcast_shapes, call_text, direction_array, number_array, rows, usage_error
from .models import Model, Progress, Reference

Path = Union[str, "os.PathLike[str]"]


@dataclass(frozen=True)
class Axis:
    """One axis of a table."""

    name: str
    #: "degree" for angles, "" for parameters and counters.
    unit: str
    values: Array
    #: Quadrature weights, in the axis' unit.
    weights: Array
    #: Values are the middles of cells, else points.
    midpoints: bool


class Table:
    """BRDF values in 1/sr without cosine over a grid, with their errors and provenance. Arrays are read-only views.

    `lobefit.table` reads one, `lobefit.render` makes one, `Table.of_grid` and `Table.of_directions` take your own
    numbers. Axes come in the order of the arrays' dimensions: parameters, then theta_o, theta_i, phi (degrees).
    Measured files keep their own coordinates: Rusinkiewicz angles, or a `list` of entries; `directions()` tells them
    all.
    """

    def __init__(self, file: _lobefit.File, path: Optional[str] = None) -> None:
        self._file = file
        self._description = file.describe()
        #: The file it was read from, if any.
        self.path = path

    @classmethod
    def of_grid(
        cls,
        theta_i: npt.ArrayLike,
        theta_o: npt.ArrayLike,
        phi: npt.ArrayLike,
        values: npt.ArrayLike,
        *,
        stderr: Optional[npt.ArrayLike] = None,
        valid: Optional[npt.ArrayLike] = None,
        midpoints: bool = False,
    ) -> Table:
        """A table of your own values over a grid of angles in degrees, rising: theta in [0, 90), phi in [0, 360).

        values      shape (theta_o, theta_i, phi), or (theta_o, theta_i, phi, 3) for RGB, in 1/sr without cosine
        stderr      standard errors of the same shape (default: exact)
        valid       shape (theta_o, theta_i, phi), False where an entry does not count. What is not finite never does
        midpoints   the angles are the middles of cells, else points
        """
        angles = {"theta_i": theta_i, "theta_o": theta_o, "phi": phi}
        grid: dict[str, Any] = {name: number_array(a, name).reshape(-1).tolist() for name, a in angles.items()}
        shape = tuple(len(grid[name]) for name in ("theta_o", "theta_i", "phi"))
        grid["midpoints"] = midpoints
        channels, arrays = _checked(shape, values, stderr, valid)
        return cls(_lobefit.table_of_grid(grid, channels, *arrays))

    @classmethod
    def of_directions(
        cls,
        wi: npt.ArrayLike,
        wo: npt.ArrayLike,
        values: npt.ArrayLike,
        *,
        stderr: Optional[npt.ArrayLike] = None,
        valid: Optional[npt.ArrayLike] = None,
        isotropic: bool = False,
    ) -> Table:
        """A table of your own values at any pairs of directions, one entry each.

        wi, wo      unit vectors to the light and to the viewer, shape (n, 3); entries below the horizon are masked
        values      shape (n,), or (n, 3) for RGB; stderr and valid as in of_grid()
        isotropic   whether turning a pair about the normal changes nothing
        """
        lights, views = direction_array(wi, "wi"), direction_array(wo, "wo")
        if lights.ndim != 2 or lights.shape != views.shape or len(lights) == 0:
            raise usage_error(f"wi has the shape {lights.shape}, wo {views.shape}", "give both as (n, 3)")
        channels, arrays = _checked(lights.shape[:1], values, stderr, valid)
        return cls(_lobefit.table_of_directions(lights, views, isotropic, channels, *arrays))

    @property
    def axes(self) -> tuple[Axis, ...]:
        """One per dimension of `valid`."""
        return tuple(
            Axis(a["name"], a["unit"], np.array(a["values"]), np.array(a["weights"]), a["kind"] == "midpoints")
            for a in self._description["axes"]
        )

    def axis(self, name: str) -> Axis:
        """An axis by name."""
        for axis in self.axes:
            if axis.name == name:
                return axis
        raise usage_error(f"the table has no axis {name!r}", f"choose of {', '.join(a.name for a in self.axes)}")

    @property
    def values(self) -> npt.NDArray[np.float32]:
        """f in 1/sr, shape (*axes, channels), channels 1 or 3; not copied."""
        return self._file.values()

    @property
    def stderr(self) -> npt.NDArray[np.float32]:
        """Standard errors of `values`, 0 where exact; not copied."""
        return self._file.stderr()

    @property
    def valid(self) -> npt.NDArray[np.bool_]:
        """False where an entry is masked, shape (*axes); not copied."""
        return self._file.valid().view(np.bool_)

    @property
    def coordinates(self) -> str:
        """"spherical", "rusinkiewicz" or "list"."""
        return self._description["coordinates"]

    @property
    def format(self) -> str:
        """Of the file it was read from; "exr" for what was made here."""
        return self._description["format"]

    @property
    def provenance(self) -> Mapping[str, Any]:
        """What the values came from: reference, params, method, seed, samples, version, command."""
        return self._description["provenance"]

    def describe(self) -> Mapping[str, Any]:
        """All of it, as `lobefit table info --json` prints it."""
        return self._description

    def directions(self) -> tuple[Array, Array]:
        """wi and wo of all entries, shape (*axes, 3) each.

            model.evaluate(*table.directions(), alpha=0.5)      # where the table has values
        """
        wi, wo = self._file.directions()
        shape = self.valid.shape + (3,)
        return wi.reshape(shape), wo.reshape(shape)

    def row(self, **at: float) -> Table:
        """The part of a table with parameter axes that has these values of them."""
        return Table(self._file.row({axis: float(value) for axis, value in at.items()}))

    def evaluate(self, wi: npt.ArrayLike, wo: npt.ArrayLike, **at: float) -> Array:
        """Values at any pairs of directions, shape (..., 3), interpolated; NaN where the table has none.

        `at` names the row, of tables with parameter axes: table.evaluate(wi, wo, alpha=0.5).
        """
        lights, views = direction_array(wi, "wi"), direction_array(wo, "wo")
        shape = broadcast_shapes({"wi": lights.shape[:-1], "wo": views.shape[:-1]})
        row = {axis: float(value) for axis, value in at.items()}
        return self._file.evaluate(rows(lights, shape), rows(views, shape), row).reshape(shape + (3,))

    def compare(
        self,
        other: Any,
        *,
        weights: str = "uniform",
        sphere: int = 64,
        map: Sequence[str] = (),
        **parameters: Value,
    ) -> Mapping[str, Any]:
        """How far another Table, a Fit or a model (by name, with `parameters`) is from this one, in every metric.

        weights     of `metrics`: "uniform", or a product of sin_theta_i, sin_theta_o, cos_theta_i, cos_theta_o,
                    quadrature, inverse_variance
        sphere      pixels across the spheres that are rendered and compared; 0 for none
        map         "NAME=SCALE*AXIS^POWER": how axes set the model's parameters, if not by the same name

        `metrics` holds the rms of pi f cos theta_i ("cosine"), pi f ("brdf"), log(1 + f cos theta_i) ("log") and
        (f cos theta_i)^(1/3) ("cube_root"); `report` is that of `lobefit table compare --json`; docs/metrics.md
        defines each figure.
        """
        if isinstance(other, Table):
            if parameters or map:
                raise usage_error("a table has no parameters to set", "leave them out")
            return self._file.compare_file(other._file, weights, sphere)
        name = other if isinstance(other, str) else other.model if hasattr(other, "model") else other.name
        text = other.text if hasattr(other, "text") else ""
        return self._file.compare_model(name, text, parameters, list(map), weights, sphere)

    def write(self, path: Path, *, force: bool = False) -> None:
        """Writes .exr, .csv, .alta, .binary (MERL) or, from RGL files, .bsdf: whole or not at all.

        Raises Error if the file exists, unless `force`.
        """
        self._file.write(os.fspath(path), force)

    def __repr__(self) -> str:
        sizes = " x ".join(f"{a.name} {len(a.values)}" for a in self.axes)
        return f"<lobefit.Table of {self.provenance['reference']}: {sizes}, {self.values.shape[-1]} channels>"


def _checked(
    shape: tuple[int, ...], values: npt.ArrayLike, stderr: Optional[npt.ArrayLike], valid: Optional[npt.ArrayLike]
) -> tuple[int, list[Any]]:
    """The number of channels, and contiguous arrays."""
    array = number_array(values, "values")
    if array.shape not in (shape, shape + (1,), shape + (3,)):
        raise usage_error(f"values have the shape {array.shape}", f"give {shape}, or {shape + (3,)} for RGB")
    if stderr is not None:
        errors = number_array(stderr, "stderr")
        if errors.shape != array.shape:
            raise usage_error(f"stderr has the shape {errors.shape}", f"give that of values, {array.shape}")
        stderr = np.ascontiguousarray(errors, dtype=np.float32)
    if valid is not None:
        mask = np.asarray(valid, dtype=np.bool_)
        if mask.shape != shape:
            raise usage_error(f"valid has the shape {mask.shape}", f"give {shape}")
        valid = np.ascontiguousarray(mask).view(np.uint8)
    channels = 3 if array.shape == shape + (3,) else 1
    return channels, [np.ascontiguousarray(array, dtype=np.float32), stderr, valid]


def table(path: Path, *, material: str = "") -> Table:
    """Reads a table or a measured file, known by its bytes: lobefit's EXR, MERL, RGL, UTIA, ALTA, Klems, lat-long
    pictures, Neural-BRDF weights (`material` names one of those).

    Raises Error (code 3) with the byte or line that is wrong.
    """
    name = os.fspath(path)
    return Table(_lobefit.read_file(name, material), name)


def render(
    source: Union[str, Model, Reference],
    *,
    grid: Union[str, Mapping[str, Any]] = "default",
    axes: Optional[Mapping[str, npt.ArrayLike]] = None,
    samples: int = 1 << 14,
    stderr: Optional[float] = None,
    exact: bool = False,
    orders: bool = False,
    sampler: str = "sobol",
    facets: str = "shared",
    seed: int = 1,
    progress: Optional[Progress] = None,
    **parameters: Value,
) -> Table:
    """A reference or a model over a grid of directions, as `lobefit render` does it.

    grid        "small" (9 x 9 x 10), "default" (18 x 18 x 19), "fine" (36 x 36 x 37), "measured", a JSON file, or a
                mapping of theta_i, theta_o and phi to angles in degrees
    axes        parameters that become axes of the table: {"alpha": [0.1, 0.5, 1]}
    samples     Monte Carlo samples per entry
    stderr      instead: samples are doubled until no standard error (1/sr) is larger
    exact       instead: by quadrature, where the reference has it. Models are always exact
    orders      keep the orders of scattering apart (in the file that write() makes)
    sampler     "sobol" or "philox"
    facets      "shared": one facet set for all lights of a line, fast, their errors correlated (replicates are kept,
                and fits propagate them); "independent"
    progress    called with the fraction done and what is being done; False stops with Interrupted
    parameters  of the reference or model, as in evaluate(), the same for all entries

    The same arguments give the same bits for any number of threads.
    """
    name = source if isinstance(source, str) else source.name
    known = (("sampler", sampler, ("sobol", "philox")), ("facets", facets, ("shared", "independent")))
    for option, value, choices in known:
        if value not in choices:
            raise usage_error(f"unknown {option} {value!r}", f"choose {' or '.join(choices)}")
    lists = {axis: number_array(values, axis).reshape(-1).tolist() for axis, values in (axes or {}).items()}
    for axis, values in lists.items():
        if not values:
            raise usage_error(f"axis {axis!r} is empty", "give it values")
    if not isinstance(grid, str):
        grid = {name: x if isinstance(x, bool) else number_array(x, name).tolist() for name, x in grid.items()}
    options: dict[str, Any] = dict(
        samples=samples, stderr=stderr, exact=exact, orders=orders, sampler=sampler, facets=facets, seed=seed
    )
    given: dict[str, Any] = {"grid": grid, "axes": lists or None, **options, **parameters}
    command = call_text("render", [repr(name)], given, render.__kwdefaults__)
    return Table(_lobefit.render(name, grid, parameters, lists, options, command, progress))
