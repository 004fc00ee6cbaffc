"""lobefit: fits analytic BRDFs to ground truth and measures how far they fall short.

    import lobefit

    wi, wo = lobefit.directions(60, 0), lobefit.directions(30, 180)
    lobefit.model("proxima").evaluate(wi, wo, alpha=0.5)                 # 1/sr, without cosine, RGB

    truth = lobefit.render("microfacet_diffuse", axes={"alpha": [0.1, 0.5, 1]}, masking="area_mean")
    found = lobefit.fit("proxima", truth, free=["a", "b"], metric="cosine")
    print(found)                                                         # values with 95 % intervals

Directions are unit vectors (..., 3) away from the surface, z the normal: wi points to the light, wo to the viewer.
Angles are in degrees. The same library as the command line's: the same arguments give the same bits.
"""

from ._lobefit import Error, Interrupted
from ._lobefit import version as __version__
from .arrays import directions
from .fits import Fit, FittedParameter, fit, read_fit
from .models import Model, Parameter, Reference, model, models, reference, references, shader
from .tables import Axis, Table, render, table

__all__ = [
    "Axis",
    "Error",
    "Fit",
    "FittedParameter",
    "Interrupted",
    "Model",
    "Parameter",
    "Reference",
    "Table",
    "directions",
    "fit",
    "model",
    "models",
    "read_fit",
    "reference",
    "references",
    "render",
    "shader",
    "table",
]
