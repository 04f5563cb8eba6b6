"""Bytes of DataFlash logs."""

import struct

FORMATS = {
    "FMT": ("BBnNZ", "Type,Length,Name,Format,Columns"),
    "XKF1": ("QBccCfffffffccce", "TimeUS,C,Roll,Pitch,Yaw,VN,VE,VD,dPD,PN,PE,PD,GX,GY,GZ,OH"),
    "XKF4": ("QBcccccfffHBIHb", "TimeUS,C,SV,SP,SH,SM,SVT,errRP,OFN,OFE,FS,TS,SS,GPS,PI"),
    "NKF1": ("QBccCfffffffccce", "TimeUS,C,Roll,Pitch,Yaw,VN,VE,VD,dPD,PN,PE,PD,GX,GY,GZ,OH"),
    "NKF4": ("QBcccccfbbHBIHb", "TimeUS,C,SV,SP,SH,SM,SVT,errRP,OFN,OFE,FS,TS,SS,GPS,PI"),
    "ARM": ("QBIBB", "TimeUS,ArmState,ArmChecks,Forced,Method"),
    "MODE": ("QMBB", "TimeUS,Mode,ModeNum,Rsn"),
    "POS": ("QLLfff", "TimeUS,Lat,Lng,Alt,RelHomeAlt,RelOriginAlt"),
    "WINC": ("QBBBBBfffHfb", "TimeUS,Heal,ThEnd,Mov,Clut,Mode,DLen,Len,DRate,Tens,Vcc,Temp"),
}


CODES = {
    "n": "4s", "N": "16s", "Z": "64s", "c": "h", "C": "H", "e": "i", "M": "B", "L": "i",
    **{k: k for k in "BbHIQf"},
}  # fmt: skip


TYPES = {name: 128 + k for k, name in enumerate(FORMATS)}


def packed(name, *values):
    code = "<" + "".join(CODES[c] for c in FORMATS[name][0])
    return struct.pack("<BBB", 0xA3, 0x95, TYPES[name]) + struct.pack(code, *values)


def header():
    out = b""
    for name, (letters, columns) in FORMATS.items():
        size = 3 + struct.calcsize("<" + "".join(CODES[c] for c in letters))
        out += packed("FMT", TYPES[name], size, name.encode(), letters.encode(), columns.encode())
    return out


def place(t, north, east, down, velocity=(0.0, 0.0, 0.0), yaw=0.0, core=0, name="XKF1"):
    return packed(
        name,
        int(t * 1e6),
        core,
        0,
        0,
        int(yaw * 100),
        *velocity,
        0.0,
        north,
        east,
        down,
        0,
        0,
        0,
        0,
    )
