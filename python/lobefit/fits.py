"""Fits of models to tables."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from typing import Any, Mapping, Optional, Sequence, Union

import numpy as np
import numpy.typing as npt

from . import _lobefit
from .arrays import Array, Value, call_text, usage_error
from .models import Model, Progress
from .models import model as find_model
from .tables import Path, Table, table as read_table


@dataclass(frozen=True)
class FittedParameter:
    """One number of a fit; a colour counts three, "albedo.r" and so on."""

    name: str
    value: float
    #: Standard error and 95 % interval from the table's own error, or from blocks of directions.
    stderr: float
    ci95: tuple[float, float]
    #: What the model's misfit leaves open.
    misfit_stderr: float
    lower: float
    upper: float
    at_bound: bool
    #: False where the data do not decide it.
    identifiable: bool
    free: bool


class Fit:
    """A fit's result. `lobefit.fit` makes one, `lobefit.read_fit` reads one."""

    def __init__(self, text: str, place: str = "fit", summary: str = "") -> None:
        self._values = _lobefit.fitted_values(text, place)
        self._document: dict[str, Any] = json.loads(text)
        self._summary = summary
        #: The JSON document, as `lobefit fit -o` writes it.
        self.text = text

    @property
    def document(self) -> Mapping[str, Any]:
        """The same as Python's dictionaries and lists."""
        return self._document

    @property
    def model(self) -> str:
        """The model's name."""
        return self._document["model"]

    @property
    def parameters(self) -> Mapping[str, FittedParameter]:
        """All numbers that no axis of the table sets, by name, those that were free first."""
        found = [
            FittedParameter(
                **{key: p[key] for key in ("name", "value", "stderr", "misfit_stderr", "lower", "upper", "at_bound")},
                ci95=(p["ci95"][0], p["ci95"][1]),
                identifiable=p.get("identifiable", True),
                free=p["free"],
            )
            for p in self._document["params"]
        ]
        return {p.name: p for p in sorted(found, key=lambda p: not p.free)}

    @property
    def values(self) -> Mapping[str, Value]:
        """Numbers, colours and choices, ready for evaluate(**fit.values)."""
        return self._values

    @property
    def correlation(self) -> Array:
        """Of the free numbers, in the order of `parameters`."""
        return np.array(self._document["correlation"], dtype=np.float64)

    @property
    def metrics(self) -> Mapping[str, float]:
        """Rms of every quantity (cosine, brdf, log, cube_root) over the entries that were fitted."""
        return self._document["metrics"]

    @property
    def holdout(self) -> Mapping[str, float]:
        """The same over the entries that were held out; empty without a holdout."""
        return self._document["holdout"]

    @property
    def converged(self) -> bool:
        return self._document["solver"]["converged"]

    @property
    def identifiable(self) -> bool:
        """Whether the data decide all free parameters."""
        return self._document["identifiable"]

    @property
    def remarks(self) -> Sequence[str]:
        """What a person should know: bounds, directions that the data do not decide."""
        return self._document["remarks"]

    def evaluate(
        self, wi: npt.ArrayLike, wo: npt.ArrayLike, *, precision: str = "double", **parameters: Value
    ) -> npt.NDArray[Any]:
        """The fitted model, as Model.evaluate(); `parameters` are those that the table's axes set, or other values."""
        return find_model(self.model).evaluate(wi, wo, precision=precision, **{**self.values, **parameters})

    def shader(self, language: str) -> str:
        """The fitted model in a shading language, with its constants and their intervals, as lobefit.shader()."""
        return _lobefit.shader_of_fit(self.text, language)

    def write(self, path: Path, *, force: bool = False) -> None:
        """Writes the JSON document, whole or not at all; every verb of the command line takes it."""
        _lobefit.write_text(self.text + "\n", os.fspath(path), force)

    def __str__(self) -> str:
        return self._summary or repr(self)

    def __repr__(self) -> str:
        free = ", ".join(f"{p.name}={p.value:.6g}" for p in self.parameters.values() if p.free)
        return f"<lobefit.Fit of {self.model}: {free}>"


Names = Union[Sequence[str], Mapping[str, Optional[Value]]]


def _setting(name: str, value: Optional[Value]) -> str:
    if value is None:
        return name
    if isinstance(value, str):
        return f"{name}={value}"
    return f"{name}=" + ",".join(repr(float(x)) for x in np.asarray(value, dtype=np.float64).reshape(-1))


def _settings(names: Names, option: str) -> list[str]:
    if isinstance(names, str):
        raise usage_error(f"{option} is one text", f"give a list of names: {option}=[{names!r}]")
    return [_setting(n, v) for n, v in names.items()] if isinstance(names, Mapping) else list(names)


def fit(
    model: Union[str, Model],
    table: Union[Table, Path],
    *,
    free: Names = (),
    fix: Names = (),
    bounds: Optional[Mapping[str, tuple[float, float]]] = None,
    map: Sequence[str] = (),
    tier: str = "full",
    lobes: int = 2,
    compare_tiers: bool = False,
    metric: str = "log",
    weights: str = "",
    loss: str = "none",
    grid: str = "auto",
    directions: Optional[int] = None,
    starts: Optional[int] = None,
    staged: Optional[bool] = None,
    hops: bool = False,
    prior: float = 0.05,
    intervals: str = "",
    holdout: float = 0.0,
    seed: int = 1,
    progress: Optional[Progress] = None,
) -> Fit:
    """Fits a model's parameters to a table or measured file, as `lobefit fit` does it.

    free        names, or {name: start or None}; without them all numbers up to `tier` that neither the table's axes nor
                its reference's parameters set
    fix         names, or {name: value or None}, held
    bounds      {name: (lower, upper)}, narrower than a parameter's range
    map         "NAME=SCALE*AXIS^POWER": a table axis sets a parameter
    metric      what is squared: "cosine" (pi f cos theta_i), "brdf" (pi f), "log" (log(1 + f cos theta_i)), "cube_root"
    weights     "uniform", or a product of sin_theta_i, sin_theta_o, cos_theta_i, cos_theta_o, quadrature,
                inverse_variance
    loss        "none", "huber:SCALE" or "cauchy:SCALE", in units of the metric
    intervals   "data": ci95 from the table's own errors; "blocks": from blocks of directions
    holdout     fraction of entries kept out of the fit and scored
    progress    called with the fraction done and what is being done; False stops with Interrupted

    What is left out suits the table: dense measurements (MERL, isotropic RGL) are fitted on a grid of 45 x 45 x 90
    angles, stage by stage from six starts, with intervals by blocks. `lobefit fit --help` says more.

    A fit that did not converge is returned all the same: look at `converged`. Raises Error (code 2) for unknown names
    and values out of range, (code 3) for a table without usable entries.
    """
    given = table if isinstance(table, Table) else read_table(table)
    name = model if isinstance(model, str) else model.name
    settings: dict[str, Any] = dict(
        free=_settings(free, "free"),
        fix=_settings(fix, "fix"),
        bounds=[f"{n}={float(low)!r},{float(high)!r}" for n, (low, high) in (bounds or {}).items()],
        map=list(map),
        tier=tier,
        lobes=lobes,
        compare_tiers=compare_tiers,
        metric=metric,
        weights=weights,
        loss=loss,
        grid=grid,
        directions=directions,
        starts=starts,
        staged=staged,
        hops=hops,
        prior=prior,
        intervals=intervals,
        holdout=holdout,
    )
    defaults: dict[str, Any] = {**fit.__kwdefaults__, "free": [], "fix": [], "bounds": [], "map": []}
    command = call_text("fit", [repr(name), "table"], settings, defaults)
    document, summary = _lobefit.fit(name, given._file, settings, seed, command, given.path or "", progress)
    return Fit(document, summary=summary)


def read_fit(path: Path) -> Fit:
    """Reads what `lobefit fit -o` or Fit.write() wrote; raises Error (code 3) with the place that is wrong."""
    name = os.fspath(path)
    return Fit(_lobefit.read_text(name), name)
