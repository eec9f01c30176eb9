"""What the rivals share: their command line, the clock, and the JSON line they print."""

import argparse
import json
import os
import sys
import time


def parse(subjects, **options):
    """The command line: which of `subjects` (all of them if none), `--threads N`, and further numbers with their
    defaults."""
    parser = argparse.ArgumentParser(description=sys.modules["__main__"].__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    if len(subjects) > 1:
        parser.add_argument("subjects", nargs="*", help=", ".join(subjects))
    for name, default in {"threads": 1, **options}.items():
        parser.add_argument(f"--{name}", type=int, default=default)
    arguments = parser.parse_args()
    arguments.subjects = getattr(arguments, "subjects", None) or list(subjects)
    unknown = [subject for subject in arguments.subjects if subject not in subjects]
    if unknown:
        parser.error(f"no subject {unknown[0]}: choose among {', '.join(subjects)}")
    return arguments


def median_seconds(work, seconds=2.0):
    """Median seconds of one call, over about `seconds` of calls after a warm-up."""
    start = time.perf_counter()
    while time.perf_counter() - start < seconds / 4:
        work()
    times, start = [], time.perf_counter()
    while len(times) < 5 or time.perf_counter() - start < seconds:
        call = time.perf_counter()
        work()
        times.append(time.perf_counter() - call)
    return sorted(times)[len(times) // 2]


def report(subject, who, threads, variants, **more):
    """Times every variant, `{name: function that measures it}`, and prints the fastest. A variant that cannot run
    here, such as one that wants a compiler, is told of and must not hide the others. With BENCH_VARIANTS, a list of
    names such as `eager,unroll=4`, only variants that contain one of them run, or all where none does."""
    wanted = os.environ.get("BENCH_VARIANTS", "").split(",")
    variants = {name: run for name, run in variants.items() if any(part in name for part in wanted)} or variants
    results = {}
    for name, measure in variants.items():
        try:
            results[name] = measure()
        except Exception as error:
            results[name] = None
            print(f"# {name}: {type(error).__name__}: {str(error)[:200]}", flush=True)
    seconds, best = min((value, name) for name, value in results.items() if value)
    print(json.dumps({"subject": subject, "who": f"{who}-{best}", "threads": threads, "seconds": seconds,
                      "variants": results, **more}), flush=True)
