"""Models and references: what they are, and their values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Callable, Mapping, Optional, Union

import numpy as np
import numpy.typing as npt

from . import _lobefit
from .arrays import Array, Value, broadcast_shapes, direction_array, number_array, rows, usage_error

#: Called about ten times a second with the fraction done and what is being done; False stops the work.
Progress = Callable[[float, str], Optional[bool]]


@dataclass(frozen=True)
class Parameter:
    """One parameter of a model or reference, as its source describes it."""

    name: str
    symbol: str
    #: "" if it has none.
    unit: str
    #: 1, 3 for a colour (linear Rec.709 RGB), 0 for a file's path.
    components: int
    #: None for a choice.
    lower: Optional[float]
    upper: Optional[float]
    #: A choice by its name.
    initial: Union[float, str]
    #: "base", "advanced" or "full".
    tier: str
    doc: str
    #: Names to choose from, if it is not a number.
    choices: tuple[str, ...]


def _parameters(description: Mapping[str, Any]) -> tuple[Parameter, ...]:
    return tuple(
        Parameter(
            name=p["name"],
            symbol=p["symbol"],
            unit=p["unit"],
            components=p["components"],
            lower=p["range"][0] if "range" in p else None,
            upper=p["range"][1] if "range" in p else None,
            initial=p["default"],
            tier=p["tier"],
            doc=p["doc"],
            choices=tuple(p.get("choices", ())),
        )
        for p in description["params"]
    )


class _Described:
    """What models and references have in common."""

    def __init__(self, description: Mapping[str, Any]) -> None:
        self._description = description
        self._parameters = _parameters(description)

    @property
    def name(self) -> str:
        """As `lobefit eval NAME` has it."""
        return self._description["name"]

    @property
    def doc(self) -> str:
        """What it does, in a sentence or two."""
        return self._description["doc"]

    @property
    def source(self) -> str:
        """Where it was published."""
        return self._description["source"]

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Its parameters, in its own order."""
        return self._parameters

    def _albedo_shape(self, albedo: tuple[Array, Array], shape: tuple[int, ...]) -> tuple[Array, Array]:
        return albedo[0].reshape(shape + (3,)), albedo[1].reshape(shape + (3,))


class Model(_Described):
    """A closed form: a BRDF, a term of one, or a hair model. `lobefit.model(name)` makes one.

    Values are BRDFs in 1/sr, without cosine, linear Rec.709 RGB; 0 for directions below the horizon, unless light
    passes. Terms are evaluated at the half vector and have the same number in all channels.
    """

    @property
    def title(self) -> str:
        """Name for a heading."""
        return self._description["title"]

    @property
    def kind(self) -> str:
        """"brdf", "term" or "hair"."""
        return self._description["kind"]

    @property
    def properties(self) -> Mapping[str, Optional[bool]]:
        """What its source claims: reciprocal, energy_conserving (None for terms), isotropic, non_negative, transmits,
        fibre, samplable."""
        return self._description["properties"]

    @property
    def operations(self) -> Mapping[str, int]:
        """Scalar operations of one evaluation, counted on the traced text."""
        return self._description["operations"]

    def evaluate(
        self, wi: npt.ArrayLike, wo: npt.ArrayLike, *, precision: str = "double", **parameters: Value
    ) -> npt.NDArray[Any]:
        """Values at pairs of directions, shape (..., 3), in 1/sr without cosine.

        wi, wo      unit vectors to the light and to the viewer, shape (..., 3), broadcast against each other;
                    `lobefit.directions` makes them of angles
        precision   "double": the formula's own text; the same bits as `lobefit eval`, result float64.
                    "single": the vectorised float batch, as a GPU would; result float32
        parameters  by name, see `parameters`; unset ones have their `initial` value. A number; of a colour also three
                    numbers; of a choice its name. Or an array of one value per pair, broadcast like the directions: a
                    colour's last axis is 3, or 1 for grey. Choices are the same for all pairs. Pairs in a row with
                    equal parameters run as one batch; in "single", where each pair has others, nothing is vectorised.

        Raises Error (code 2) for shapes that do not go together, directions that are not unit vectors, unknown
        parameters (it names the nearest) and values out of range. Uses all cores without the interpreter's lock, and
        hears Ctrl-C.

            f = lobefit.model("callisto").evaluate(wi, wo, alpha=0.2, albedo=(0.8, 0.5, 0.2))
        """
        if precision not in ("double", "single"):
            raise usage_error(f"unknown precision {precision!r}", "choose 'double' or 'single'")
        lights, views = direction_array(wi, "wi"), direction_array(wo, "wo")
        constant: dict[str, Any] = {}
        varying: dict[str, npt.NDArray[Any]] = {}
        known = {p.name: p for p in self.parameters}
        for name, value in parameters.items():
            components = known[name].components if name in known else 1
            array = None if isinstance(value, str) else number_array(value, name)
            if array is None or array.ndim == 0 or (components == 3 and array.shape in ((1,), (3,))):
                constant[name] = value if array is None else array.reshape(-1)
            elif components == 3 and array.shape[-1] not in (1, 3):
                raise usage_error(f"{name} has the shape {array.shape}", "a colour's last axis is 3, or 1 for grey")
            else:
                varying[name] = array if components == 3 else array[..., np.newaxis]
        shape = broadcast_shapes(
            {"wi": lights.shape[:-1], "wo": views.shape[:-1], **{name: a.shape[:-1] for name, a in varying.items()}}
        )
        per_pair = {
            name: rows(np.broadcast_to(a, a.shape[:-1] + (known[name].components if name in known else 1,)), shape)
            for name, a in varying.items()
        }
        values = _lobefit.evaluate_model(
            self.name, rows(lights, shape), rows(views, shape), constant, per_pair, precision == "single"
        )
        return values.reshape(shape + (3,))

    def albedo(self, theta: npt.ArrayLike, *, fixed: str = "view", **parameters: Value) -> tuple[Array, Array]:
        """Directional albedo and its error, both of shape (..., 3): f times cosine over all directions of the light.

        theta       polar angles of the fixed direction in degrees
        fixed       "view", or "light": then over all directions of the view
        parameters  as in evaluate(), the same for all angles

        By quadrature, refined until two steps agree to 1e-6; the error is their difference. Over both sides where light
        passes; of a fibre without cosine. As `lobefit albedo`.
        """
        angles = number_array(theta, "theta")
        found = _lobefit.albedo_of_model(self.name, angles.reshape(-1).tolist(), parameters, _is_light(fixed))
        return self._albedo_shape(found, angles.shape)

    def __repr__(self) -> str:
        return f"lobefit.model({self.name!r})"


class Reference(_Described):
    """Ground truth by integration. `lobefit.reference(name)` makes one; `lobefit.render` fills tables from it."""

    def evaluate(
        self, wi: npt.ArrayLike, wo: npt.ArrayLike, *, progress: Optional[Progress] = None, **parameters: Value
    ) -> Array:
        """Values at pairs of directions by deterministic means, shape (..., 3), in 1/sr without cosine.

        wi, wo and parameters are as in Model.evaluate(), but parameters are the same for all pairs. Raises Error (code
        2) where a reference has no quadrature at these parameters: `lobefit.render` samples it.
        """
        lights, views = direction_array(wi, "wi"), direction_array(wo, "wo")
        shape = broadcast_shapes({"wi": lights.shape[:-1], "wo": views.shape[:-1]})
        values = _lobefit.evaluate_reference(self.name, rows(lights, shape), rows(views, shape), parameters, progress)
        return values.reshape(shape + (3,))

    def albedo(self, theta: npt.ArrayLike, *, fixed: str = "view", **parameters: Value) -> tuple[Array, Array]:
        """Directional albedo and its error, as Model.albedo()."""
        angles = number_array(theta, "theta")
        found = _lobefit.albedo_of_reference(self.name, angles.reshape(-1).tolist(), parameters, _is_light(fixed))
        return self._albedo_shape(found, angles.shape)

    def __repr__(self) -> str:
        return f"lobefit.reference({self.name!r})"


def _is_light(fixed: str) -> bool:
    if fixed not in ("view", "light"):
        raise usage_error(f"unknown fixed direction {fixed!r}", "choose 'view' or 'light'")
    return fixed == "light"


def models() -> list[str]:
    """Names of all models and terms."""
    return _lobefit.model_names()


def model(name: str) -> Model:
    """A model by name; raises Error with the nearest name."""
    return Model(_lobefit.describe_model(name))


def references() -> list[str]:
    """Names of all references."""
    return _lobefit.reference_names()


def reference(name: str) -> Reference:
    """A reference by name; raises Error with the nearest name."""
    return Reference(_lobefit.describe_reference(name))


def shader(model: Union[str, Model], language: str, **parameters: Value) -> str:
    """The model's text in a shading language ("hlsl", "glsl", "c", "wgsl"), with these parameters baked in.

    As `lobefit export NAME --lang LANGUAGE`: `float3 Lobefit_NAME(float3 wi, float3 wo, Lobefit_NAME_Parameters p)` in
    the tangent frame, without cosine, and `Lobefit_NAME_Fitted()` for the parameters.
    """
    return _lobefit.shader(model if isinstance(model, str) else model.name, language, parameters)
