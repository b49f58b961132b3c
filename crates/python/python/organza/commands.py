"""The commands as functions. Each computes exactly what the command of its name computes."""

from __future__ import annotations

import os
from typing import Any, Mapping, Optional, Sequence, Union

import numpy as np

from ._run import Progress, run
from .errors import InputError
from .tables import AnyPath, Fabric, GivenFiles, parsed
from .volumes import Volume

Table = Union[AnyPath, Mapping[str, Any]]
"""A scene or a fabric: the path of its file, or a dictionary."""

Settings = Optional[Mapping[str, Any]]


def render(
    scene: Table,
    spp: Optional[int] = None,
    seed: Optional[int] = None,
    *,
    progress: Optional[Progress] = None,
    crop: Optional[Sequence[int]] = None,
    samples: Optional[range] = None,
    time_limit: Union[str, float, None] = None,
    target_error: Optional[float] = None,
    target_median_error: Optional[float] = None,
    clamp: Optional[float] = None,
    engine: str = "auto",
    studio: Optional[str] = None,
    fit_yarn: bool = False,
    outfile: Optional[AnyPath] = None,
    set: Settings = None,
    threads: Optional[int] = None,
    max_memory: Union[str, int, None] = None,
    cache: Optional[AnyPath] = None,
) -> dict[str, Any]:
    """Path-traces a scene, or a cloth in a studio, as ``organza render`` does.

    Parameters
    ----------
    scene
        A :class:`Scene` or a :class:`Fabric`, a dictionary with its keys, the path of a scene, a
        fabric or a draft, or the name of a weave.
    spp
        Samples per pixel, the most with a target error or a time limit; the scene's if None.
    seed
        Seed of all random numbers; the scene's if None. The same seed gives the same bits, on
        any number of threads.
    progress
        Called as ``progress(task, share)`` in this thread, about twenty times a second at
        most, with the share of the task that is done, 0 to 1.
    crop
        Only these pixels: left, top, right, bottom; right and bottom outside.
    samples
        ``range(a, b)``: only these samples of every pixel, in place of ``spp``.
    time_limit
        Stop after so many seconds, or after a time such as ``"5m"``.
    target_error, target_median_error
        Stop when the error of the picture, or of the median pixel, is at most this share.
    clamp
        Darken single samples above this radiance, which biases the picture.
    engine
        What traces the paths: ``auto``, ``cpu``, ``walk`` or the name of a vector kernel.
    studio
        How a cloth is shown that comes without a scene: ``swatch`` (if None), ``macro``,
        ``drape``, ``window`` or ``flat``.
    fit_yarn
        Make yarns that the threads of a fabric have no room for finer until they fit.
    outfile
        Also write the picture: ``.exr``, ``.png`` and others, by the ending.
    set
        Overrides of the scene's keys: ``{"render.max_bounces": 8}``.
    threads
        Number of threads; all cores if None.
    max_memory
        Refuse to use more: bytes, or a size such as ``"2GiB"``.
    cache
        Folder in which built volumes are kept, see docs/cache.md; the variable
        ``ORGANZA_CACHE`` if None.

    Returns
    -------
    dict
        float32 arrays, rows from the top, equal to the channels of the command's EXR file:

        ========== ================ ============================================================
        rgb        (rows, cols, 3)  linear radiance, Rec.709
        variance   (rows, cols, 3)  variance of ``rgb``; NaN of a single sample
        tangent    (rows, cols, 3)  mean direction of the fibres first met
        yarn       (rows, cols)     number of the yarn first met, -1 where there is none
        depth_mm   (rows, cols)     mean distance of the first event; infinite where none
        bounces    (rows, cols)     mean number of events of a path
        through    (rows, cols)     share of samples seen straight through
        ========== ================ ============================================================

        with ``direct`` (rows, cols, 3) where the scene sets ``render.direct``, ``cache_error`` (rows,
        cols) where a cache of radiance was used, and ``figures``: what ``organza render --json`` prints (times, counts, means, errors).

    Raises
    ------
    InputError
        The scene or an argument is wrong: with ``file``, ``line``, ``key`` and ``message``.
    RunError
        Something failed while running.
    KeyboardInterrupt
        Ctrl-C; nothing is written.
    """
    files = GivenFiles()
    options = dict(
        scene=files.give_table(scene),
        spp=spp, seed=seed, crop=crop, samples=samples, time_limit=time_limit,
        target_error=target_error, target_median_error=target_median_error, clamp=clamp,
        engine=engine, studio=studio, fit_yarn=fit_yarn, outfile=outfile, set=set,
    )  # fmt: skip
    found = run(
        "render", options, files.files, progress,
        threads=threads, max_memory=max_memory, cache=cache,
    )
    del found["files"]
    return found


def measure(
    target: Table,
    pairs: Union[AnyPath, np.ndarray, Sequence[Sequence[float]], None] = None,
    *,
    layout: Optional[str] = None,
    albedo: bool = False,
    model: str = "auto",
    spp: Optional[int] = None,
    seed: Optional[int] = None,
    target_error: Optional[float] = None,
    grid: Optional[Sequence[int]] = None,
    klems_basis: Optional[str] = None,
    bands: Optional[Sequence[str]] = None,
    step: Optional[float] = None,
    tree_rank: Optional[int] = None,
    tree_depth: Optional[int] = None,
    prune: Optional[float] = None,
    rgl_grid: Optional[Sequence[int]] = None,
    ptm_lamps: Optional[int] = None,
    rows: Optional[range] = None,
    level: Optional[int] = None,
    voxel_um: Optional[float] = None,
    texels: Optional[int] = None,
    outfile: Optional[AnyPath] = None,
    progress: Optional[Progress] = None,
    set: Settings = None,
    threads: Optional[int] = None,
    max_memory: Union[str, int, None] = None,
    cache: Optional[AnyPath] = None,
) -> dict[str, Any]:
    """Measures reflection and transmission of a patch, as ``organza measure`` does.

    Parameters
    ----------
    target
        A :class:`Fabric`, a :class:`Scene` whose objects are measured, a dictionary of either,
        or a path.
    pairs
        Directions, degrees: rows of ``theta_i, phi_i, theta_o, phi_o`` (with ``albedo`` two
        columns suffice), or the path of a CSV file. They point away from the cloth, toward
        light and viewer; theta is above 90 behind the cloth.
    layout
        In place of ``pairs``: ``irawan``, ``grid``, ``klems`` or ``sweep``; ``irawan`` if both
        are None. ``grid=(polar, azimuths)``, ``klems_basis`` and ``step`` belong to them. Also ``tensor-tree`` (``.xml``; ``tree_rank``, ``tree_depth``,
        ``prune``), ``rgl`` (``.bsdf``; ``rgl_grid``) and ``ptm`` (``.ptm``; ``ptm_lamps``,
        ``texels``), see docs/tables.md. ``en14501``: the sheet of a shade.
    bands
        ``visible``, ``nir`` or ``solar``, of a fabric; ``["visible", "solar"]`` with a
        ``klems`` table in an ``.xml`` file and with ``en14501``. ``visible`` if None.
    albedo
        Measure where light from each direction goes instead of the BSDF of pairs.
    model
        How a fabric is shown: ``auto``, ``fibres``, ``microflake``, ``surface`` and others.
    spp
        Paths per pair, at least 2; 16384 if None. The most with ``target_error``, which stops
        a pair when its relative standard error is below it.
    rows
        ``range(a, b)``: only these rows of the table.
    level, voxel_um
        Level of detail, and edge of the finest voxels, of a fabric.
    outfile
        Also write the table: ``.csv``, ``.json``, ``.xml``, ``.bsdf`` (see ``layout``) or
        ``.exr``: one picture of the tile for each pair, ``texels`` wide, which are returned
        in place of single values.

    Returns
    -------
    dict
        float64 arrays, equal to the columns of the command's table. Pairs: ``theta_i``,
        ``phi_i``, ``theta_o``, ``phi_o`` (n,), ``rgb`` (n, 3) in 1/sr, ``se_rgb`` its standard
        error. Albedo: ``theta_i``, ``phi_i``; ``reflected``, ``transmitted``, ``direct``,
        ``absorbed`` (n, 3), each with ``se_``; ``openness``. Klems: also the four matrices
        (to, from, 3). Tensor tree: float32 matrices (from, to, 3). Sweep: ``axis`` (0 weft, 1 warp),
        ``angle``, ``rgb``, ``se_rgb``. Shade: ``sheet`` (``band``, ``side``, ``quantity``, ``value``,
        ``se``) and ``classes``.

    Other parameters and exceptions are those of :func:`render`.
    """
    files = GivenFiles()
    if pairs is not None and not isinstance(pairs, (str, os.PathLike)):
        names = ["theta_i", "phi_i"] if albedo else ["theta_i", "phi_i", "theta_o", "phi_o"]
        pairs = files.give("<pairs>.csv", _csv(names, np.asarray(pairs, dtype=float), "pairs"))
    elif pairs is None and layout is None:
        layout = "irawan"
    options = dict(
        file=files.give_table(target),
        pairs=pairs, layout=layout, albedo=albedo, model=model, spp=spp, seed=seed,
        target_error=target_error, grid=grid, klems_basis=klems_basis, bands=bands, step=step,
        tree_rank=tree_rank, tree_depth=tree_depth, prune=prune, rgl_grid=rgl_grid,
        ptm_lamps=ptm_lamps, rows=rows,
        level=level, voxel_um=voxel_um, texels=texels, outfile=outfile, set=set,
    )  # fmt: skip
    found = run(
        "measure", options, files.files, progress,
        threads=threads, max_memory=max_memory, cache=cache,
    )
    del found["files"]
    return found


def compare(
    fabric: Table,
    models: Optional[Sequence[str]] = None,
    *,
    data: Union[AnyPath, Mapping[str, Any], None] = None,
    spp: Optional[int] = None,
    seed: Optional[int] = None,
    target_error: Optional[float] = None,
    texels: Optional[int] = None,
    texel_spp: Optional[int] = None,
    limit: Optional[float] = None,
    level: Optional[int] = None,
    voxel_um: Optional[float] = None,
    outdir: Optional[AnyPath] = None,
    progress: Optional[Progress] = None,
    set: Settings = None,
    threads: Optional[int] = None,
    max_memory: Union[str, int, None] = None,
    cache: Optional[AnyPath] = None,
) -> dict[str, Any]:
    """Compares the models of a fabric with each other or with measured values, as ``organza
    compare`` does.

    Parameters
    ----------
    fabric
        A :class:`Fabric`, a dictionary with its keys, or a path.
    models
        What to compare, the reference first; fibres, the fabric's own model and its surface if
        None.
    data
        Measured values as the reference: what :func:`measure` returned for pairs, or the path
        of a table.
    outdir
        Also write ``report.html``, ``report.json`` and ``pairs.csv`` into this folder.

    Returns
    -------
    dict
        ``report``: the contents of ``report.json``. ``values``: for each model the arrays of
        :func:`measure`.

    Other parameters are those of ``organza compare`` and :func:`render`.
    """
    files = GivenFiles()
    options = dict(
        fabric=files.give_table(fabric),
        models=models, data=_data(data, files), spp=spp, seed=seed, target_error=target_error,
        texels=texels, texel_spp=texel_spp, limit=limit, level=level, voxel_um=voxel_um,
        outdir=outdir, set=set,
    )  # fmt: skip
    found = run(
        "compare", options, files.files, progress,
        threads=threads, max_memory=max_memory, cache=cache,
    )
    values: dict[str, dict[str, np.ndarray]] = {}
    for name, array in found.items():
        model, _, column = name.rpartition(".")
        if model:
            values.setdefault(model, {})[column] = array
    return {"report": found["report"], "values": values}


def fit(
    fabric: Table,
    *,
    what: str = "surface",
    data: Union[AnyPath, Mapping[str, Any], None] = None,
    colour: Union[str, Sequence[float], None] = None,
    yarn: Optional[str] = None,
    model: str = "auto",
    spp: Optional[int] = None,
    seed: Optional[int] = None,
    patience: Optional[Sequence[int]] = None,
    light: Optional[Sequence[float]] = None,
    view: Optional[Sequence[float]] = None,
    width_mm: Optional[float] = None,
    white: Optional[float] = None,
    voxel_um: Optional[float] = None,
    journal: Optional[AnyPath] = None,
    outfile: Optional[AnyPath] = None,
    progress: Optional[Progress] = None,
    set: Settings = None,
    threads: Optional[int] = None,
    max_memory: Union[str, int, None] = None,
    cache: Optional[AnyPath] = None,
) -> dict[str, Any]:
    """Finds surface or fibre parameters that match measured values, as ``organza fit`` does.

    Parameters
    ----------
    fabric
        A :class:`Fabric`, a dictionary with its keys, or a path: where the search starts.
    what
        What ``organza fit`` names: ``surface`` (the surface model, to ``data`` or to the fabric's own
        volume), ``fibres``
        (colour, roughness and density, to ``data``) or ``picture`` (colour and roughness, to
        the picture of which ``data`` is the path, with ``light``, ``view``, ``width_mm`` and
        ``white``), or ``colour`` (colour of the fibres, so that the cloth reflects ``colour``).
    data
        What :func:`measure` returned for pairs, or the path of a table or picture.
    colour
        What the cloth shall reflect: a name, ``"#8c3b2e"``, or linear RGB.
    yarn
        The yarn that is dyed; without it all, in proportion to their own colours.
    patience
        Evaluations: of the first scan, and at most of each descent.
    journal
        Save every evaluation to this file, and resume from it.
    outfile
        Also write the fitted fabric file.

    Returns
    -------
    dict
        ``fabric``: the fitted :class:`Fabric`. ``parameters``: a list of dictionaries with
        ``name``, ``value``, ``se`` and ``is_fixed`` (whether the data determine it).
        ``words``: how well the fit matches.

    Other parameters are those of ``organza fit`` and :func:`render`.
    """
    files = GivenFiles()
    options = dict(
        fabric=files.give_table(fabric),
        target=what, data=_data(data, files), colour=colour, yarn=yarn, model=model, spp=spp,
        seed=seed, patience=patience,
        light=light, view=view, width_mm=width_mm, white=white, voxel_um=voxel_um,
        journal=journal, outfile=outfile, set=set,
    )  # fmt: skip
    try:
        found = run(
            "fit", options, files.files, progress,
            threads=threads, max_memory=max_memory, cache=cache,
        )
    except InputError as e:
        e.key = "what" if e.key == "target" else e.key
        raise
    (text,) = found.pop("files").values()
    own = getattr(fabric, "path", fabric if isinstance(fabric, (str, os.PathLike)) else None)
    fitted = parsed(text, own)
    assert isinstance(fitted, Fabric)
    return {"fabric": fitted, **found}


def voxelize(
    fabric: Table,
    *,
    voxel_um: Optional[float] = None,
    levels: Optional[int] = None,
    footprint: Optional[str] = None,
    outfile: Optional[AnyPath] = None,
    progress: Optional[Progress] = None,
    set: Settings = None,
    threads: Optional[int] = None,
    max_memory: Union[str, int, None] = None,
    cache: Optional[AnyPath] = None,
) -> Volume:
    """Turns one tile of a fabric into a :class:`Volume`, as ``organza voxelize`` does.

    Parameters
    ----------
    fabric
        A :class:`Fabric`, a dictionary with its keys, or a path.
    voxel_um
        Edge of the finest voxels, micrometres; the fabric's if None.
    levels
        Number of levels of detail, 1 to 8; as many as fit, at most 6, if None.
    footprint
        ``covered`` or ``axis``; as the fabric's model wants it if None.
    outfile
        Also write the volume, in the format of the ending; it is what is returned then.

    Other parameters are those of :func:`render`.
    """
    files = GivenFiles()
    options = dict(
        fabric=files.give_table(fabric),
        voxel_um=voxel_um, levels=levels, footprint=footprint, outfile=outfile, set=set,
    )  # fmt: skip
    found = run(
        "voxelize", options, files.files, progress,
        threads=threads, max_memory=max_memory, cache=cache,
    )["files"]
    return Volume.from_files(next(iter(found)), found)


def bake(
    fabric: Table,
    *,
    colourways: Sequence[Table] = (),
    repeats: Optional[Sequence[int]] = None,
    resolution: Optional[int] = None,
    model: Optional[str] = None,
    texel_spp: Optional[int] = None,
    pairs: Optional[int] = None,
    spp: Optional[int] = None,
    fit_texels: Optional[int] = None,
    seed: Optional[int] = None,
    level: Optional[int] = None,
    voxel_um: Optional[float] = None,
    outdir: Optional[AnyPath] = None,
    progress: Optional[Progress] = None,
    set: Settings = None,
    threads: Optional[int] = None,
    max_memory: Union[str, int, None] = None,
    cache: Optional[AnyPath] = None,
) -> dict[str, Any]:
    """Makes textures and materials for glTF, MaterialX and USD, as ``organza bake`` does.

    Parameters
    ----------
    fabric
        A :class:`Fabric`, a dictionary with its keys, or a path.
    colourways
        Fabrics with the same threads in other colours, which the files hold as variants.
    repeats
        Repeats of the draft along weft and warp in the textures; the fabric's if None, or about 20
        threads.
    resolution
        Texels of the longer side of the textures; 1024 if None. If a power of two, so is the other
        side.
    model
        What is measured: ``fibres`` if None, or a volume.
    texel_spp, pairs, spp, fit_texels
        Paths per texel, pairs of directions, paths per pair, and texels that stand for the
        material while it is fitted.
    outdir
        Also write the files into this folder.

    Returns
    -------
    dict
        float32 maps in rows from the top: ``base_color``, ``normal`` and ``transmitted``
        (rows, columns, 3), ``opacity`` and ``height_mm`` (rows, columns). ``bake``: the
        contents of ``bake.json``, with all parameters and errors. ``files``: the bytes of all
        files by their names.

    Other parameters are those of ``organza bake`` and :func:`render`.
    """
    files = GivenFiles()
    options = dict(
        fabrics=[files.give_table(one) for one in [fabric, *colourways]],
        repeats=repeats, resolution=resolution, model=model, texel_spp=texel_spp, pairs=pairs, spp=spp,
        fit_texels=fit_texels, seed=seed, level=level, voxel_um=voxel_um, outdir=outdir,
        set=set,
    )  # fmt: skip
    return run(
        "bake", options, files.files, progress,
        threads=threads, max_memory=max_memory, cache=cache,
    )


def _data(data: Union[AnyPath, Mapping[str, Any], None], files: GivenFiles) -> Optional[str]:
    """Measured values as the path of a table."""
    if data is None or isinstance(data, (str, os.PathLike)):
        return None if data is None else os.fspath(data)
    angles = ["theta_i", "phi_i", "theta_o", "phi_o"]
    missing = [name for name in [*angles, "rgb"] if name not in data]
    if missing:
        message = f"has no {missing[0]!r}; expected what measure() returns for pairs"
        raise InputError(f"data: {message}", key="data", message=message)
    columns = [np.asarray(data[name], dtype=float).reshape(-1, 1) for name in angles]
    names = [*angles, "r", "g", "b"]
    columns.append(np.asarray(data["rgb"], dtype=float))
    if "se_rgb" in data:
        names += ["se_r", "se_g", "se_b"]
        columns.append(np.asarray(data["se_rgb"], dtype=float))
    return files.give("<data>.csv", _csv(names, np.concatenate(columns, axis=1), "data"))


def _csv(names: list[str], table: np.ndarray, key: str) -> bytes:
    if table.ndim != 2 or table.shape[1] < len(names):
        message = f"expected rows of {', '.join(names)}, found the shape {table.shape}"
        raise InputError(f"{key}: {message}", key=key, message=message)
    rows = (",".join(map(repr, row)) for row in table[:, : len(names)].tolist())
    return "\n".join([",".join(names), *rows]).encode()
