"""Several results as one labelled dataset, and in a netCDF file."""

from collections.abc import Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any

from locbounds.result import Result

if TYPE_CHECKING:
    import xarray


def dataset(results: Sequence[Result]) -> "xarray.Dataset":
    """Results on the same time steps, stacked along a ``method`` axis.

    Examples
    --------
    >>> import locbounds as lb
    >>> scenario = lb.papers.fritsche2013.scenario(steps=10)
    >>> dataset([lb.bcrb(scenario), lb.enumer(scenario)]).position_rmse.sel(method="bcrb").sizes["step"]
    11
    """
    import xarray

    parts = []
    for result in results:
        part = result.to_dataset().drop_vars("replicates")
        labels = {name: ("method", [value]) for name, value in part.attrs.items() if name != "method"}
        parts.append(part.drop_attrs(deep=False).expand_dims(method=[result.id]).assign_coords(labels))
    joined: Any = xarray.concat(parts, "method", join="exact", combine_attrs="override")
    joined.attrs = {"title": "position accuracy over time", "source": "locbounds"}
    return joined


def save(results: Sequence[Result], path: str | PathLike) -> None:
    """Write results to a netCDF file, strings and units included.

    Examples
    --------
    >>> import tempfile, xarray, locbounds as lb
    >>> path = tempfile.mkdtemp() + "/run.nc"
    >>> save([lb.bcrb(lb.papers.fritsche2013.scenario(steps=10))], path)
    >>> with xarray.open_dataset(path, engine="h5netcdf") as file:
    ...     print(file.verdict.values[0])
    valid (Gaussian prior and motion; smooth noise)
    """
    joined = dataset(results)
    joined = joined.assign_coords({k: v.astype(object) for k, v in joined.coords.items() if v.dtype.kind in "US"})
    joined.to_netcdf(path, engine="h5netcdf")
