"""``rig.json`` as it stands in the file."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from fringeworks.files.validation import Table

RIG_FORMAT = "fringeworks-rig/1"

FURTHER_KEYS = (
    "transfer",
    "response",
    "station_from_camera",
    "covariance",
    "calibration",
    "extended_fit",
    "provenance",
    "twin",
)
"""Keys that are kept as they stand in `Rig.further`; their owners check them."""

MAX_ORDER = 20
"""Of a residual field: more than any calibration tells."""

Extent = Annotated[int, Field(ge=1, le=65536)]
Focal = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Count = Annotated[int, Field(ge=0)]
Triple = Annotated[list[float], Field(min_length=3, max_length=3)]


class UnitsTable(Table):
    """Units, which are not a choice."""

    length: Literal["mm"]
    angle: Literal["rad"]
    image: Literal["px"]


class PoseTable(Table):
    """``X_device = rotation @ X_rig + translation_mm``."""

    rotation: Annotated[list[Triple], Field(min_length=3, max_length=3)]
    translation_mm: Triple


class DeviceTable(Table):
    """A camera or projector: size and lens, px, and pose."""

    kind: Literal["camera", "projector"]
    width: Extent
    height: Extent
    fx: Focal
    fy: Focal
    cx: float
    cy: float
    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0
    device_from_rig: PoseTable


class VolumeTable(Table):
    """Depth range of the calibration, mm, z of the camera frame."""

    z_min: float
    z_max: float


class QualityTable(Table):
    """See `Quality`."""

    camera_rms_px: NotNegative
    projector_rms_px: NotNegative
    joint_rms_px: NotNegative
    views_used: Count
    observations_used: Count
    observations_offered: Count


class ExtendedTable(Table):
    """See `Extended`."""

    axis: Literal["x", "y"]
    period_px: Annotated[float, Field(gt=0)]
    C1: float = 0.0
    C2: float = 0.0
    C3: float = 0.0
    C4: float = 0.0
    Kfp: float = 0.0
    Kphi: float = 0.0
    Ku0: float = 0.0
    Kv0: float = 0.0
    Kfc: float = 0.0
    Kz: float = 0.0


class ResidualTable(Table):
    """See `ResidualField`."""

    model: Literal["geometric", "extended", "full"]
    axis: Literal["x", "y"]
    order: Annotated[int, Field(ge=1, le=MAX_ORDER)]
    middle: Triple
    low: Triple
    high: Triple
    coefficients: list[float]
    gain: float
    gain_sigma: NotNegative


class BeyondTable(Table):
    """What a simulated lens does beyond the five terms; see `twin.optics.Optics`."""

    k4: float = 0.0
    k5: float = 0.0
    k6: float = 0.0
    pupil_shift_mm: float = 0.0


class TwinTable(Table):
    """Read by the twin alone; neither a calibration nor a scan knows of it."""

    camera: BeyondTable = BeyondTable()
    projector: BeyondTable = BeyondTable()


class RigFile(Table):
    """The whole ``rig.json``; of `FURTHER_KEYS` only `twin` has a form to keep to."""

    format: Literal["fringeworks-rig/1"]
    units: UnitsTable | None = None
    devices: dict[str, DeviceTable]
    volume_mm: VolumeTable | None = None
    quality: QualityTable | None = None
    scale_sigma: NotNegative | None = None
    extended: ExtendedTable | None = None
    residual: Annotated[list[ResidualTable], Field(default_factory=list)]
    transfer: Any = None
    response: Any = None
    station_from_camera: Any = None
    covariance: Any = None
    calibration: Any = None
    extended_fit: Any = None
    provenance: Any = None
    twin: TwinTable = TwinTable()
