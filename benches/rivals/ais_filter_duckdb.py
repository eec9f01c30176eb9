"""Filters the box of an area file from a DMA file with DuckDB: time, MMSI, position, speed and course of the rows inside."""

import json
import os
import resource
import sys
import time
import tomllib

import duckdb

file, area = sys.argv[1:]
with open(area, "rb") as text:
    box = tomllib.load(text)["box"]
with open(file, encoding="utf-8") as text:
    columns = {name: "VARCHAR" for name in text.readline().rstrip("\n").split(",")}
columns |= {"MMSI": "BIGINT", "Latitude": "DOUBLE", "Longitude": "DOUBLE", "SOG": "DOUBLE", "COG": "DOUBLE"}

start = time.perf_counter()
connection = duckdb.connect(config={"threads": int(os.environ.get("BENCH_CORES", "1"))})
# The layout is given and not guessed, which is the faster way.
connection.execute(
    f"""CREATE TEMP TABLE kept AS
        SELECT "# Timestamp", MMSI, Latitude, Longitude, SOG, COG
        FROM read_csv(?, header = true, auto_detect = false, delim = ',', quote = '"', escape = '"', columns = {columns})
        WHERE Latitude BETWEEN ? AND ? AND Longitude BETWEEN ? AND ?""",
    [file, box["south_deg"], box["north_deg"], box["west_deg"], box["east_deg"]],
)
rows_in_box = connection.execute("SELECT count(*) FROM kept").fetchone()[0]
seconds = time.perf_counter() - start
peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(json.dumps({"name": f"duckdb {duckdb.__version__}", "seconds": seconds, "rows_in_box": rows_in_box, "peak_mb": peak_mb}))
