"""Which regressors a study trains, and by which of them a person is judged (Lips16 6)."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import Literal

from vermilion.storage.errors import InputError

Estimator = Literal["rbf", "affine", "kernel"]

#: Lips16 to the letter: made of every regressor.
PAPER = "paper"

#: Trained on the motion of many synthetic people; it holds nothing that is any person's own.
GENERIC = "generic"

#: Variant of a regressor -> (estimator, features); None is the configured estimator.
VARIANTS: dict[str, tuple[Estimator | None, str]] = {
    "": (None, "all"),
    "rbf": ("rbf", "all"),
    "affine": ("affine", "all"),
    "kernel": ("kernel", "all"),
    "shape-only": (None, "shape"),
    "distances-only": (None, "distances"),
    PAPER: ("rbf", "all"),
}


def generic_file(face_model: str) -> str:
    """The generic regressor of a face model, from the project's folder; it may not have one."""
    return f"models/{GENERIC}-{face_model}.h5"


def regressors_of_study(people: Sequence[str], trained: Collection[str]) -> list[str]:
    """Names of all regressors: PS of everyone who trains, MS, and GR of everyone.

    Args:
        people: subjects with an accurate mesh.
        trained: those of them who have training frames.
    """
    names = [f"PS-{subject}" for subject in people if subject in trained] + ["MS"]
    return names + [f"GR-{subject}" for subject in people if set(trained) - {subject}]


def regressors_of(subject: str, trained: Collection[str]) -> list[str]:
    """Names of the regressors that a person is judged by.

    A person who trains nothing has no PS, and to them MS would be GR under another name: GR alone.
    """
    own = [f"PS-{subject}", "MS"] if subject in trained else []
    return [*own, f"GR-{subject}"] if set(trained) - {subject} else own


def split_name(regressor: str) -> tuple[str, str | None, str]:
    """(kind, subject, variant) of a regressor's name: `MS`, `PS-anna`, `GR-anna-affine`, `generic`, ...

    Raises:
        InputError: any other name.
    """
    base, variant = regressor, ""
    for name in filter(None, VARIANTS):
        if regressor.endswith(f"-{name}"):
            base, variant = regressor.removesuffix(f"-{name}"), name
    kind, dash, subject = base.partition("-")
    if (kind in ("MS", GENERIC) and not dash) or (kind in ("PS", "GR") and subject):
        return kind, subject or None, variant
    raise InputError(
        f"a regressor named {regressor!r}",
        "MS, PS-<subject>, GR-<subject> or generic, with an optional variant "
        + ", ".join(f"-{v}" for v in VARIANTS if v),
        "Correct the name.",
    )


def trained_on(regressor: str, subjects: Sequence[str]) -> list[str]:
    """Whose frames a regressor trains on (Lips16 section 6): one, all, or all but one subject."""
    kind, subject, _ = split_name(regressor)
    everybody = kind in ("MS", GENERIC)
    return [s for s in subjects if everybody or (s == subject) == (kind == "PS")]


def measure_name(file_stem: str) -> str:
    """Name in `measures.tsv` of a model file: `PS-s1-affine` -> `PS-s1/affine`."""
    variant = split_name(file_stem)[2]
    return f"{file_stem.removesuffix(f'-{variant}')}/{variant}" if variant else file_stem


def with_variants(
    names: Sequence[str], variants: Sequence[str], kinds: Collection[str]
) -> list[str]:
    """The names, each of them to the letter of Lips16, then every variant of the kinds asked for.

    Args:
        names: of regressors.
        variants: names of `VARIANTS`.
        kinds: PS, MS, GR: whose variants are made.
    """
    of_kind = [name for name in names if name.split("-", 1)[0] in kinds]
    made = [f"{name}-{PAPER}" for name in names]
    made += [f"{name}-{variant}" for variant in variants for name in of_kind]
    return [*names, *dict.fromkeys(made)]


#: In the paper's order; what lies between the table's own columns is ours.
_ORDER = ("base", "contour", "null", "oracle", "PS", "MS", "GR")
#: Every table has them: told a neutral, a regressor is the same, told more; `paper` is Lips16's own.
_NO_VARIANTS = ("", "neutral", "paper", GENERIC)


def kind_of(regressor: str) -> str:
    """`PS-s1/affine` -> `PS/affine`: the regressor without the subject it was made for."""
    name, _, variant = regressor.partition("/")
    kind = name.split("-", 1)[0] if name.startswith(("PS-", "GR-")) else name
    return f"{kind}/{variant}" if variant else kind


def is_variant(regressor: str) -> bool:
    """Whether a row is of another estimator or features than the configured ones.

    A regressor told a neutral (`GR/neutral`) is none, nor is that of Lips16 to the letter (`GR/paper`), nor
    the generic one (`GR/generic`).
    """
    return regressor.partition("/")[2] not in _NO_VARIANTS


def is_shown(regressor: str) -> bool:
    """Whether sheets of renders show a row: no variants, and baselines without a neutral."""
    return "/" not in regressor or is_judged(regressor)


def is_judged(regressor: str) -> bool:
    """Whether a row is a configured regressor's, told a neutral or not: no baseline, no variant."""
    kind, _, variant = kind_of(regressor).partition("/")
    return kind in ("PS", "MS", "GR") and variant in ("", "neutral", GENERIC)


def in_order(regressors: Iterable[str]) -> list[str]:
    """Regressors in the order of the paper's table, variants after them."""

    def place(name: str) -> tuple[bool, int, str, str]:
        kind, _, variant = kind_of(name).partition("/")
        rank = _ORDER.index(kind) if kind in _ORDER else len(_ORDER)
        return is_variant(name), rank, variant, name

    return sorted(set(regressors), key=place)
