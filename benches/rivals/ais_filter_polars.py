"""Filters the box of an area file from a DMA file with polars: time, MMSI, position, speed and course of the rows inside."""

import json
import resource
import sys
import time
import tomllib

import polars as pl

file, area = sys.argv[1:]
with open(area, "rb") as text:
    box = tomllib.load(text)["box"]

start = time.perf_counter()
names = ["# Timestamp", "MMSI", "Latitude", "Longitude", "SOG", "COG"]
rows = (
    pl.scan_csv(file, schema_overrides={"Latitude": pl.Float64, "Longitude": pl.Float64, "SOG": pl.Float64,
                                        "COG": pl.Float64, "MMSI": pl.Int64}, infer_schema_length=0)
    .select(names)
    .filter(pl.col("Latitude").is_between(box["south_deg"], box["north_deg"])
            & pl.col("Longitude").is_between(box["west_deg"], box["east_deg"]))
    .collect(engine="streaming")
)
seconds = time.perf_counter() - start
peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(json.dumps({"name": f"polars {pl.__version__}", "seconds": seconds, "rows_in_box": rows.height, "peak_mb": peak_mb}))
