"""Object classes of S-57 charts (IHO S-57, appendix A): what each is to a tether, and its size."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from netsp.exchange.maps.feature import Feature
from netsp.exchange.maps.import_policy import DEFAULT_IMPORT, ImportPolicy
from netsp.exchange.maps.word_tables import words

STANDING = words(
    "BRIDGE BUISGL CANBNK CAUSWY COALNE CRANES DAMCON DRYDOC DYKCON FLODOC FORSTC FSHFAC "
    "GATCON GRIDRN HULKES LAKSHR LNDARE LNDMRK LOGPON MARCUL MORFAC OBSTRN OFSPLF OILBAR "
    "PILPNT PONTON PYLONS RIVBNK SILTNK SLCONS SLOTOP UWTROC WRECKS"
)
"""Classes of structures and ground that a tether may catch on."""

BEACONS = frozenset({"BCNCAR", "BCNISD", "BCNLAT", "BCNSAW", "BCNSPP", "BCNWTW"})
"""Classes of beacons, which stand on the ground unless their shape says that they float."""

COURSES = frozenset({"CBLSUB", "CBLOHD", "PIPSOL", "PIPOHD"})
"""Classes of cables and pipelines: paths where they are lines."""

DEPTH_AREAS = frozenset({"DEPARE", "DRGARE"})
"""Classes of areas with a range of depths (`DRVAL1`, `DRVAL2`)."""

LAND = "LNDARE"
"""Class of areas of land."""

COVERAGE = "M_COVR"
"""Class of areas that the chart covers (`CATCOV` 1) or does not cover (2)."""

COVERED = 1
"""Code of an area with data in `CATCOV`."""

UNSURVEYED = "UNSARE"
"""Class of areas whose depth nobody knows."""

SOUNDINGS = "SOUNDG"
"""Class of soundings: points whose depth is their z, downwards."""

CONTOURS = "DEPCNT"
"""Class of depth contours (`VALDCO`)."""

BUOYANT_BEACON = 7
"""Code of a beacon that floats in `BCNSHP`."""

MOORING_BUOY = 7
"""Code of a mooring buoy in `CATMOR`."""

VIRTUAL_DISTANCE_MARK = 1
"""Code of a distance mark that is not installed in `CATDIS`."""

MOORED = "floats on a mooring whose place the chart does not give"
"""Reason to leave out buoys."""

EQUIPMENT = "equipment; what carries it is a feature of its own"
"""Reason to leave out lights, signs and the like."""

_GROUPS: dict[str, str] = {
    MOORED: ("BOYCAR BOYINB BOYISD BOYLAT BOYSAW BOYSPP BOYWTW LITFLT LITVES"),
    EQUIPMENT: (
        "DAYMAR FOGSIG LIGHTS NOTMRK RADRFL RDOSTA RADSTA RETRFL RTPBCN SISTAT SISTAW TOPMAR"
    ),
    "an area of cables or pipelines; their courses are not in it": "CBLARE PIPARE",
    "a use or a rule of an area, with nothing that stands there": (
        "ACHARE ACHBRT ADMARE ARCSLN ASLXIS BERTHS CGUSTA CHKPNT CONZNE COSARE CTNARE CTSARE "
        "CUSZNE DMPGRD EXEZNE FAIRWY FRPARE FSHGRD FSHZNE HRBARE HRBFAC ICNARE ISTZNE MIPARE "
        "OSPARE PILBOP PRCARE PRDARE RESARE RSCSTA SMCFAC SPLARE STSLNE SUBTLN SWPARE TESARE "
        "BUAARE AIRARE BRGARE BUNSTA COMARE DOCARE LKBSPT LOKARE LOKBSN PRTARE REFDMP TERMNL TRNBSN"
    ),
    "a route or a line of navigation, with nothing that stands there": (
        "DWRTCL DWRTPT FERYRT NAVLNE RADLNE RADRNG RCRTCL RCTLPT RDOCAL RECTRC TSELNE TSEZNE "
        "TSSBND TSSCRS TSSLPT TSSRON TWRTPT RTPLPT WTWAXS WTWPRF"
    ),
    "a depth, which shapes the sea floor only": "DEPARE DEPCNT DRGARE SOUNDG",
    "water of unknown depth": "UNSARE",
    "ice, which drifts or melts": "ICEARE",
    "open water": "CANALS HRBBSN LAKARE RAPIDS RIVERS SEAARE TIDEWY WATFAL",
    "the ground of the sea or its plants": "SBDARE SNDWAV SPRING VEGATN WEDKLP",
    "on land or overhead, above the water": (
        "CONVYR FNCLNE LNDELV LNDRGN RAILWY ROADWY RUNWAY SLOGRD SQUARE"
    ),
    "below the ground": "TUNNEL",
    "a point of measurement, with nothing that stands in the water": "CTRPNT DISMAR",
    "a current, tide or magnetic value": (
        "CURENT LOCMAG MAGVAR TS_FEB TS_PAD TS_PNH TS_PRH TS_TIS T_HMON T_NHMN T_TIMS WATTUR"
    ),
    "says how the chart was made": (
        "C_AGGR C_ASSO C_STAC DSID M_ACCY M_COVR M_CSCL M_HDAT M_HOPA M_NPUB M_NSYS M_PROD M_QUAL "
        "M_SDAT M_SREL M_UNIT M_VDAT"
    ),
}

FLOATING = frozenset(_GROUPS[MOORED].split())
"""Classes of buoys and lightships."""

REASONS = {layer: reason for reason, layers in _GROUPS.items() for layer in layers.split()}
"""Reasons to leave features out, by their class."""

UNKNOWN = "an object class that is not in the catalogue of S-57"
"""Reason to leave out a feature whose class is in no group."""


@dataclass(frozen=True)
class ChartDecision:
    """Kind of a chart's feature.

    Attributes
    ----------
    kind
        ``obstacle``, ``path`` or ``ignore``.
    reason
        Why it is left out; empty for the other kinds.
    """

    kind: str
    reason: str = ""


def chart_kind(feature: Feature) -> ChartDecision:
    """Return the kind of a chart's feature by its object class and attributes."""
    layer = feature.layer.upper()
    if layer in BEACONS and _code(feature, "bcnshp") == BUOYANT_BEACON:
        return ChartDecision("ignore", "a beacon that floats")
    if layer == "MORFAC" and _code(feature, "catmor") == MOORING_BUOY:
        return ChartDecision("ignore", MOORED)
    if layer == "DISMAR" and (_code(feature, "catdis") or 0) > VIRTUAL_DISTANCE_MARK:
        return ChartDecision("obstacle")
    if layer in STANDING or layer in BEACONS:
        return ChartDecision("obstacle")
    if layer in COURSES:
        if "Line" in feature.shape.geom_type:
            return ChartDecision("path")
        return ChartDecision("ignore", "a cable or pipeline without a course")
    return ChartDecision("ignore", REASONS.get(layer, UNKNOWN))


def lone_equipment(features: Sequence[Feature], policy: ImportPolicy = DEFAULT_IMPORT) -> set[str]:
    """Return the names (`Feature.where`) of a chart's equipment that no other feature carries.

    Something that the chart does not show must stand there.
    """
    import shapely

    equipment: list[Feature] = []
    carriers: list[Feature] = []
    for feature in features:
        layer = feature.layer.upper()
        if REASONS.get(layer) == EQUIPMENT:
            equipment.append(feature)
        elif layer in STANDING or layer in BEACONS or layer in FLOATING:
            carriers.append(feature)
    if not equipment:
        return set()
    tree = shapely.STRtree([carrier.shape for carrier in carriers])
    near, _ = tree.query(
        [feature.shape for feature in equipment],
        predicate="dwithin",
        distance=policy.carrier_distance,
    )
    carried = set(near.tolist())
    return {feature.where for k, feature in enumerate(equipment) if k not in carried}


def chart_radius(feature: Feature) -> float | None:
    """Return the radius of a circle that holds a point feature in any direction, metres.

    Half the diagonal of length and width (`HORLEN`, `HORWID`); None if the chart gives neither.
    """
    sides = [s for s in (_size(feature, "horlen"), _size(feature, "horwid")) if s is not None]
    if not sides:
        return None
    return 0.5 * math.hypot(sides[0], sides[-1])


def chart_width(feature: Feature) -> float | None:
    """Return the width of a line (`HORWID`), metres; None if the chart does not give it."""
    return _size(feature, "horwid")


def depth_range(feature: Feature) -> tuple[float | None, float | None]:
    """Return the least and the greatest depth of an area, downwards; None for what is not given."""
    return _number(feature, "drval1"), _number(feature, "drval2")


def contour_depth(feature: Feature) -> float | None:
    """Return the depth of a contour; None if the chart does not give it."""
    return _number(feature, "valdco")


def is_covered(feature: Feature) -> bool:
    """Return whether a feature is an area that its chart covers with data."""
    return feature.layer.upper() == COVERAGE and _code(feature, "catcov") == COVERED


def sounding_depth(feature: Feature) -> float | None:
    """Return the depth of the top of a danger; None if the chart does not give it."""
    return _number(feature, "valsou")


def _code(feature: Feature, name: str) -> int | None:
    value = _number(feature, name)
    return None if value is None else int(value)


def _size(feature: Feature, name: str) -> float | None:
    value = _number(feature, name)
    return value if value is not None and value > 0.0 else None


def _number(feature: Feature, name: str) -> float | None:
    value = feature.get(name)
    try:
        number = float(value)
    except (TypeError, ValueError):
        return None
    return number if math.isfinite(number) else None
