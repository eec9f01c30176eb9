"""Writes a synthetic daily file in the layout of the Danish Maritime Authority, 1.1 GB of 26 columns.

    python3 benches/rivals/make_dma_day.py FILE [MEGABYTES]

800 vessels report every ten seconds or so; one in a hundred sails between Laesoe and Frederikshavn
(ais/laesoe.toml), the others elsewhere. Some destinations are quoted, since they hold commas. The file is the same on
every run. Does nothing where it is there already.
"""

import math
import os
import random
import sys

HEADER = ("# Timestamp,Type of mobile,MMSI,Latitude,Longitude,Navigational status,ROT,SOG,COG,Heading,IMO,Callsign,"
          "Name,Ship type,Cargo type,Width,Length,Type of position fixing device,Draught,Destination,ETA,"
          "Data source type,A,B,C,D\n")
VESSELS = 800
STEP_S = 10


class Vessel:
    """Sails an ellipse about a centre, at a steady rate."""

    def __init__(self, number, rng):
        inside = number % 100 == 0
        self.latitude = rng.uniform(57.33, 57.47) if inside else rng.uniform(54.5, 57.0)
        self.longitude = rng.uniform(10.65, 11.05) if inside else rng.uniform(8.0, 12.5)
        self.reach_deg = rng.uniform(0.04, 0.1)
        speed_mps = rng.uniform(3.0, 10.0)
        self.rate = speed_mps / (self.reach_deg * 111_000.0)
        self.phase = rng.uniform(0.0, 2.0 * math.pi)
        self.late_s = rng.randrange(STEP_S)
        self.sog = f"{speed_mps / 0.514444:.1f}"
        self.start = f",Class A,{219_000_000 + number},"
        length = rng.randrange(20, 300)
        destination = rng.choice(["AARHUS", "GOTHENBURG", "FREDERIKSHAVN", "KIEL CANAL"] * 5 + ['"AALBORG, DK"'])
        kind = rng.choice(["Cargo", "Tanker", "Passenger", "Fishing", "Tug"])
        self.end = (f",Unknown,OX{number:04d},VESSEL {number},{kind},,{length // 7},{length},GPS,"
                    f"{rng.uniform(2.0, 12.0):.1f},{destination},04/11/2022 12:00:00,AIS,"
                    f"{length // 2},{length - length // 2},{length // 14},{length // 7 - length // 14}\n")

    def row(self, clock, second):
        angle = self.phase + self.rate * second
        north, east = math.sin(angle), math.cos(angle)
        course = math.degrees(math.atan2(-north, east)) % 360.0
        return (f"01/11/2022 {clock}{self.start}{self.latitude + self.reach_deg * north:.6f},"
                f"{self.longitude + self.reach_deg * 1.8 * east:.6f},Under way using engine,0.0,{self.sog},"
                f"{course:.1f},{int(course)}{self.end}")


def main():
    file = sys.argv[1]
    megabytes = float(sys.argv[2]) if len(sys.argv) > 2 else 1100.0
    if os.path.exists(file):
        return
    os.makedirs(os.path.dirname(file) or ".", exist_ok=True)
    print(f"writing {megabytes:.0f} MB to {file} ...", file=sys.stderr)
    rng = random.Random(20221101)
    vessels = [Vessel(number, rng) for number in range(VESSELS)]
    left = megabytes * 1e6
    with open(file + ".partial", "w", encoding="ascii", newline="") as out:
        out.write(HEADER)
        second = 0
        while left > 0.0:
            rows = []
            for vessel in vessels:
                at = second + vessel.late_s
                day_second = at % 86_400
                clock = f"{day_second // 3600:02d}:{day_second // 60 % 60:02d}:{day_second % 60:02d}"
                rows.append((vessel.late_s, vessel.row(clock, at)))
            rows.sort(key=lambda row: row[0])
            text = "".join(row for _, row in rows)
            out.write(text)
            left -= len(text)
            second += STEP_S
    os.replace(file + ".partial", file)


if __name__ == "__main__":
    main()
