"""Which regressors a study trains, and by which of them a person is judged (Lips16 6)."""

from __future__ import annotations

from collections.abc import Collection, Sequence


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


def trained_on(name: str, trained: Sequence[str]) -> list[str]:
    """Whose frames a regressor of `regressors_of_study` trains on."""
    kind, _, subject = name.partition("-")
    return [s for s in trained if kind == "MS" or (s == subject) == (kind == "PS")]


def with_variants(
    names: Sequence[str], variants: Sequence[str], kinds: Collection[str]
) -> list[str]:
    """The names, then every variant of those of them whose kind (PS, MS, GR) is asked for."""
    of_kind = [name for name in names if name.split("-", 1)[0] in kinds]
    return [*names, *(f"{name}-{variant}" for variant in variants for name in of_kind)]


#: In the paper's order; what lies between the table's own columns is ours.
_ORDER = ("base", "contour", "oracle", "PS", "MS", "GR")


def kind_of(regressor: str) -> str:
    """`PS-s1/affine` -> `PS/affine`: the regressor without the subject it was made for."""
    name, _, variant = regressor.partition("/")
    kind = name.split("-", 1)[0] if name.startswith(("PS-", "GR-")) else name
    return f"{kind}/{variant}" if variant else kind


def is_variant(regressor: str) -> bool:
    """Whether a row is of another estimator, features or method than the configured ones.

    A regressor told a neutral (`GR/neutral`) is none: it is the same, told more.
    """
    return regressor.partition("/")[2] not in ("", "neutral")


def in_order(regressors) -> list[str]:
    """Regressors in the order of the paper's table, variants after them."""

    def place(name: str):
        kind, _, variant = kind_of(name).partition("/")
        rank = _ORDER.index(kind) if kind in _ORDER else len(_ORDER)
        return is_variant(name), rank, variant, name

    return sorted(set(regressors), key=place)
