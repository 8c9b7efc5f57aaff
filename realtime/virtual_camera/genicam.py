"""GenICam features of a live camera: one table that makes the device's registers and the XML which describes them.

Names and meanings: EMVA, GenICam Standard Features Naming Convention (SFNC) 2.7. XML: GenApi schema 1.1. All numbers
lie big-endian in the registers; floats have 64 bits.
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING
from xml.sax.saxutils import escape, quoteattr

from realtime.virtual_camera.pixel_format import formats, named

if TYPE_CHECKING:
    from realtime.virtual_camera.gige_device import GigeDevice

FIRST = 0xA000  # address of the first feature's register
IMAGE_CHUNK, NUMBER_CHUNK, TRUTH_CHUNK = 1, 2, 3
Value = int | float | str
Get = Callable[["GigeDevice"], Value]
Put = Callable[["GigeDevice", Value], object]


@dataclass(frozen=True)
class Feature:
    """``kind``: Integer, Float, Enumeration, Boolean, Command or String. ``put`` raises BrightfieldError for a value
    that cannot be. ``high`` may be the name of another feature. ``locked``: fixed while images are acquired."""

    name: str
    category: str
    kind: str
    meaning: str
    get: Get = lambda device: 0
    put: Put | None = None
    unit: str = ""
    low: float | None = None
    high: float | str | None = None
    step: int = 1
    entries: dict[str, int] = field(default_factory=dict)
    locked: bool = False
    size: int = 0  # bytes of a string

    @property
    def length(self) -> int:
        return self.size or (8 if self.kind == "Float" else 4)

    def encode(self, value: Value) -> bytes:
        if self.kind == "String":
            return str(value).encode()[: self.length].ljust(self.length, b"\0")
        return (
            struct.pack(">d", value) if self.kind == "Float" else struct.pack(">I", int(value) & 0xFFFFFFFF)
        )

    def decode(self, data: bytes) -> Value:
        return struct.unpack(">d" if self.kind == "Float" else ">I", data)[0]


def features(device: "GigeDevice") -> list[Feature]:
    """What the camera of a device has; its sensor says which pixel formats."""
    camera = device.camera
    width, height = camera.sensor.resolution
    able = {f.name: f.code for f in formats(camera.sensor)}
    name_of = {code: name for name, code in able.items()}

    def setting(name: str, scale: float = 1.0) -> tuple[Get, Put]:
        return (
            lambda d: getattr(d.camera.settings, name) * scale,
            lambda d, v: d.camera.configure(**{name: float(v) / scale}),
        )

    def side(place: int) -> tuple[Get, Put]:
        def put(d: "GigeDevice", v: Value) -> None:
            region = list(d.camera.settings.region)
            region[place] = int(v)
            d.camera.configure(region=region)

        return lambda d: d.camera.settings.region[place], put

    def text(name: str, meaning: str, get: Get) -> Feature:
        return Feature(name, "DeviceControl", "String", meaning, get, size=64)

    def put_format(d: "GigeDevice", v: Value) -> None:
        d.camera.configure(format=name_of.get(int(v), f"0x{int(v):08X}"))

    even = 2 if any(named(n).mosaic.is_bayer for n in able) else 1
    image, acquisition = "ImageFormatControl", "AcquisitionControl"
    onoff = {"Off": 0, "On": 1}
    rows = [
        text("DeviceVendorName", "Maker", lambda d: "Brightfield"),
        text("DeviceModelName", "Model", lambda d: "VirtualCamera"),
        text("DeviceSerialNumber", "Serial number", lambda d: d.serial),
        text("DeviceUserID", "Camera in the scene", lambda d: d.camera.name),
        Feature("SensorWidth", image, "Integer", "Columns of the sensor", lambda d: width, unit="px"),
        Feature("SensorHeight", image, "Integer", "Rows of the sensor", lambda d: height, unit="px"),
        Feature("Width", image, "Integer", "Columns read out", *side(2), low=1, high="SensorWidth", locked=True),
        Feature("Height", image, "Integer", "Rows read out", *side(3), low=1, high="SensorHeight", locked=True),
        Feature("OffsetX", image, "Integer", "First column", *side(0), low=0, high=width - 1, step=even, locked=True),
        Feature("OffsetY", image, "Integer", "First row", *side(1), low=0, high=height - 1, step=even, locked=True),
        Feature(
            "PixelFormat", image, "Enumeration", "How pixels are read out",
            lambda d: d.camera.settings.format.code, put_format, entries=able, locked=True,
        ),
        Feature(
            "AcquisitionMode", acquisition, "Enumeration", "How many frames a start gives",
            lambda d: d.mode, lambda d, v: d.set_mode(int(v)), entries={"Continuous": 0, "SingleFrame": 1},
        ),
        Feature("AcquisitionStart", acquisition, "Command", "Begin", put=lambda d, v: d.begin()),
        Feature("AcquisitionStop", acquisition, "Command", "End", put=lambda d, v: d.end()),
        Feature(
            "AcquisitionFrameRate", acquisition, "Float", "Frames a second, where nothing triggers them",
            *setting("frame_rate"), unit="Hz", low=1e-3, high=1e5,
        ),
        Feature(
            "ResultingFrameRate", acquisition, "Float", "Frames a second that the exposure time leaves",
            lambda d: 1 / d.camera.settings.period, unit="Hz", low=0, high=1e5,
        ),
        Feature(
            "ExposureTime", acquisition, "Float", "Exposure time of the simulated sensor",
            *setting("t_exp", 1e6), unit="us", low=1, high=1e9,
        ),
        Feature(
            "TriggerSelector", acquisition, "Enumeration", "What a trigger does", lambda d: 0, lambda d, v: None,
            entries={"FrameStart": 0},
        ),
        Feature(
            "TriggerMode", acquisition, "Enumeration", "Whether a frame waits for a trigger",
            lambda d: int(d.camera.settings.triggered), lambda d, v: d.camera.configure(triggered=bool(v)),
            entries=onoff,
        ),
        Feature(
            "TriggerSource", acquisition, "Enumeration", "Where triggers come from",
            lambda d: int(d.camera.settings.trigger_period > 0), lambda d, v: d.set_trigger(bool(v), d.timer),
            entries={"Software": 0, "Timer0End": 1},
        ),
        Feature(
            "TimerDuration", acquisition, "Float", "From one trigger of the timer to the next",
            lambda d: d.timer * 1e6,
            lambda d, v: d.set_trigger(d.camera.settings.trigger_period > 0, float(v) / 1e6),
            unit="us", low=10, high=1e9,
        ),
        Feature("TriggerSoftware", acquisition, "Command", "One frame", put=lambda d, v: d.trigger()),
        Feature(
            "Gain", "AnalogControl", "Float", "Gain of the simulated sensor; 20 dB is tenfold",
            *setting("gain_dB"), unit="dB", low=-60, high=120,
        ),
        Feature(
            "ChunkModeActive", "ChunkDataControl", "Boolean", "Whether frames carry their number and the truth",
            lambda d: int(d.chunks), lambda d, v: d.set_chunks(bool(v)), locked=True,
        ),
        Feature("PayloadSize", "TransportLayerControl", "Integer", "Bytes of a frame", lambda d: d.payload),
        Feature(
            "TLParamsLocked", "TransportLayerControl", "Integer", "Set by clients while they acquire",
            lambda d: d.locked, lambda d, v: d.lock(int(v)), low=0, high=1,
        ),
    ]  # fmt: skip
    return rows


def addresses(rows: list[Feature]) -> dict[int, Feature]:
    """Where each feature's register lies."""
    placed, at = {}, FIRST
    for row in rows:
        placed[at] = row
        at += -(-row.length // 16) * 16
    return placed


def description(placed: dict[int, Feature], truth_bytes: int) -> bytes:
    """The XML of a device; ``truth_bytes`` has the chunk that tells the truth."""
    categories: dict[str, list[str]] = {}
    for row in placed.values():
        categories.setdefault(row.category, []).append(row.name)
    categories["ChunkDataControl"] += ["ChunkFrameID", "ChunkTruth"]
    nodes = [_category("Root", list(categories)), *(_category(n, names) for n, names in categories.items())]
    nodes += [_node(row, address) for address, row in placed.items()]
    nodes += [
        _chunk("IntReg", "ChunkFrameID", NUMBER_CHUNK, 8, "Number of the frame since the camera runs"),
        _chunk("StringReg", "ChunkTruth", TRUTH_CHUNK, truth_bytes, "The truth of the frame, as JSON"),
        '<Port Name="Device"/>',
    ]
    body = "\n".join(nodes)
    return f"""<?xml version="1.0" encoding="utf-8"?>
<RegisterDescription ModelName="VirtualCamera" VendorName="Brightfield" StandardNameSpace="GEV"
 SchemaMajorVersion="1" SchemaMinorVersion="1" SchemaSubMinorVersion="0" MajorVersion="1" MinorVersion="0"
 SubMinorVersion="0" ToolTip="A camera of a simulated scene" ProductGuid="6f1f6c1a-3c6b-4bb1-9d4f-2f7b64a5e0c1"
 VersionGuid="0b7d1e55-2f68-4d53-8f0e-6a1d5f6a9c30" xmlns="http://www.genicam.org/GenApi/Version_1_1"
 xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"
 xsi:schemaLocation="http://www.genicam.org/GenApi/Version_1_1 http://www.genicam.org/GenApi/GenApiSchema_Version_1_1.xsd">
{body}
</RegisterDescription>
""".encode()


def _category(name: str, members: list[str]) -> str:
    return _element("Category", name, "".join(f"<pFeature>{m}</pFeature>" for m in members))


def _element(kind: str, name: str, inner: str) -> str:
    standard = "" if name.endswith("Reg") else ' NameSpace="Standard"'
    return f"<{kind} Name={quoteattr(name)}{standard}>{inner}</{kind}>"


def _node(row: Feature, address: int) -> str:
    about = f"<ToolTip>{escape(row.meaning)}</ToolTip>"
    access = "RO" if row.put is None else "WO" if row.kind == "Command" else "RW"
    kind = {"Float": "FloatReg", "String": "StringReg"}.get(row.kind, "IntReg")
    register = (
        f"<Address>0x{address:X}</Address><Length>{row.length}</Length><AccessMode>{access}</AccessMode>"
    )
    register += "<pPort>Device</pPort>"
    if row.put is not None or row.kind != "String":
        register += "<Cachable>NoCache</Cachable>"  # what one feature sets another may change
    if kind == "IntReg":
        register += "<Sign>Unsigned</Sign>"
    if kind != "StringReg":
        register += "<Endianess>BigEndian</Endianess>"
    if row.kind == "String":
        return _element(kind, row.name, about + register)
    value = f"<pValue>{row.name}Reg</pValue>"
    bounds = "" if row.low is None else f"<Min>{row.low:g}</Min>"
    if isinstance(row.high, str):
        bounds += f"<pMax>{row.high}</pMax>"
    elif row.high is not None:
        bounds += f"<Max>{row.high:.17g}</Max>"
    match row.kind:
        case "Integer":
            inner = about + value + bounds + (f"<Inc>{row.step}</Inc>" if row.low is not None else "")
        case "Float":
            inner = about + value + bounds
        case "Enumeration":
            entries = (_element("EnumEntry", n, f"<Value>{v}</Value>") for n, v in row.entries.items())
            inner = about + "".join(entries) + value
        case "Boolean":
            inner = about + value + "<OnValue>1</OnValue><OffValue>0</OffValue>"
        case _:
            inner = about + value + "<CommandValue>1</CommandValue>"
    if row.unit and row.kind in ("Integer", "Float"):
        inner += f"<Unit>{row.unit}</Unit>"
    return _element(row.kind, row.name, inner) + "\n" + _element(kind, f"{row.name}Reg", register)


def _chunk(kind: str, name: str, number: int, length: int, meaning: str) -> str:
    order = "<Sign>Unsigned</Sign><Endianess>BigEndian</Endianess>" if kind == "IntReg" else ""
    inner = (
        f"<ToolTip>{escape(meaning)}</ToolTip><Address>0x0</Address><Length>{length}</Length>"
        f"<AccessMode>RO</AccessMode><pPort>{name}Port</pPort><Cachable>NoCache</Cachable>{order}"
    )
    return _element(kind, name, inner) + f'\n<Port Name="{name}Port"><ChunkID>{number:x}</ChunkID></Port>'
