#!/usr/bin/env python3
"""Prints the gist of a report that `strata mesh --report` wrote."""
import json
import sys


def line(name, statistics):
    if not statistics or not int(statistics.get("count", 0)):
        return
    count = int(statistics["count"])
    print(f"  {name:<14} {count:>10,} hexes   scaled Jacobian min {statistics['min']:.3f}  mean {statistics['mean']:.3f}")


def main():
    with open(sys.argv[1], encoding="utf-8") as file:
        report = json.load(file)
    quality = report["quality"]
    print("\nquality")
    for name, key in (("all", "all"), ("in layers", "layers"), ("volume", "rest")):
        line(name, quality.get(key))
    print("patches")
    for patch in quality.get("patches", []):
        layers = int(patch.get("layers_wished", 0))
        wish = f"{layers} layers on {100 * patch.get('coverage', 0):.0f} % of the area" if layers else "no layers asked for"
        print(f"  {patch['name']:<14} {int(patch['quads']):>10,} quads   {wish}")
    print(f"rung: {report.get('rung', '?')}, adjustments: {len(report.get('adjustments', []))}")
    for adjustment in report.get("adjustments", [])[:5]:
        print(f"  {adjustment.get('message', '')}")


if __name__ == "__main__":
    main()
