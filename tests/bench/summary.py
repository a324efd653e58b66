#!/usr/bin/env python3
"""From build/bench.json: the markdown table, and the columns that the Pareto picture is drawn from."""
import json
import re
import subprocess
import sys

TIERS = "draft", "fast", "exact32", "precise"


def rows_of(path):
    with open(path) as lines:
        return [json.loads(line) for line in lines if line.strip()]


def table(rows, isa):
    """fr of every variant on one instruction set: ratio to the textbook, ns and largest error, a column a tier."""
    print(f"\n### fr, {isa}: times faster than the textbook (ns; largest relative error)\n")
    print("| ndf | variant | textbook ns | " + " | ".join(TIERS) + " |")
    print("|---|---|---|" + "---|" * len(TIERS))
    models = sorted({(r["ndf"], r["variant"]) for r in rows}, reverse=True)
    for ndf, variant in models:
        mine = {r["tier"]: r for r in rows if (r["ndf"], r["variant"], r["isa"], r["quantity"]) == (ndf, variant, isa, "eval")}
        if not mine:
            continue
        some = next(iter(mine.values()))
        cells = [f'{r["ratio"]:.0f}× ({r["ns"]:.2f}; {r["max_rel"]:.1e})' if (r := mine.get(t)) else "–" for t in TIERS]
        print(f'| {ndf} | {variant} | {some["ns"] * some["ratio"]:.0f} | ' + " | ".join(cells) + " |")


def others(rows, isa):
    """Every quantity of the isotropic model on one instruction set."""
    print(f"\n### every quantity, isotropic, {isa}: ns (largest relative error)\n")
    print("| quantity | ndf | " + " | ".join(TIERS) + " |\n|---|---|" + "---|" * len(TIERS))
    seen = []
    for r in rows:
        key = (r["quantity"], r["ndf"])
        if r["isa"] == isa and r["variant"] == "iso_schlick" and key not in seen:
            seen.append(key)
    for quantity, ndf in seen:
        mine = {r["tier"]: r for r in rows
                if (r["quantity"], r["ndf"], r["isa"], r["variant"]) == (quantity, ndf, isa, "iso_schlick")}
        print(f"| {quantity} | {ndf} | "
              + " | ".join(f'{r["ns"]:.2f} ({r["max_rel"]:.1e})' if (r := mine.get(t)) else "–" for t in TIERS) + " |")


def pareto(rows, isa, folder):
    """One file a curve: textbook first (its error is a double's as printed), then the tiers."""
    for ndf in ("ggx", "beckmann"):
        for variant in ("iso_schlick", "full_dielectric"):
            mine = [r for r in rows if (r["ndf"], r["variant"], r["isa"], r["quantity"]) == (ndf, variant, isa, "eval")]
            with open(f"{folder}/pareto_{ndf}_{variant}.txt", "w") as out:
                for r in sorted(mine, key=lambda r: TIERS.index(r["tier"])):
                    print(r["ns"], r["max_rel"], r["tier"], file=out)
            with open(f"{folder}/textbook_{ndf}_{variant}.txt", "w") as out:
                if mine:
                    print(mine[0]["ns"] * mine[0]["ratio"], mine[0]["textbook_max_rel"], "textbook", file=out)


def vector_instructions(kernels, tier, isa, name):
    """Arithmetic on whole vectors in one loop, as the compiler left it: (all, quotients and roots)."""
    io = "double" if tier == "precise" else "float"
    text = subprocess.run(["objdump", "-d", "--no-show-raw-insn", f"--disassemble={name}", f"{kernels}/{tier}-{io}-{isa}.o"],
                          capture_output=True, text=True).stdout
    packed = re.findall(r"\sv?(\w+?)(?:\d{3})?p[sd]\s", text)
    heavy = [p for p in packed if p in ("div", "sqrt")]
    arithmetic = [p for p in packed if re.match(r"f?n?m(add|sub)|f?nmadd|mul|add|sub|min|max|rcp|rsqrt|scalef|div|sqrt|cvt", p)]
    return len(arithmetic), len(heavy)


def roofline(rows, isa, kernels):
    """Measured cycles beside the floor: two vector instructions a cycle and nothing else in the way."""
    width = {"base": 16, "avx2": 32, "avx512": 64}.get(isa, 16)
    print(f"\n### roofline, {isa}: cycles per f_r\n")
    print("The floor counts the arithmetic instructions of the compiled loop (both branches where it has any) at two vectors a cycle,\n"
          "quotients and roots at eight cycles each; the clock is measured by dependent additions.  A core that works 512-bit vectors\n"
          "in halves does one a cycle: twice the floor is then its limit.\n")
    print("| kernel | tier | vector instructions | floor | measured | measured / floor |\n|---|---|---|---|---|---|")
    shapes = {"iso_schlick": "ISO_SCHLICK", "full_dielectric": "SHEARED_DIELECTRIC"}
    for r in rows:
        if r["isa"] != isa or r["quantity"] != "eval" or r["variant"] not in shapes:
            continue
        name = f'FR_{r["ndf"].upper()}_{shapes[r["variant"]]}'
        lanes = width // (4 if r["tier"] in ("draft", "fast") else 8)
        count, heavy = vector_instructions(kernels, r["tier"], isa, name)
        if not count:
            continue
        floor, measured = ((count - heavy) / 2 + 8 * heavy) / lanes, r["ns"] * r["ghz"]
        print(f'| {name} | {r["tier"]} | {count} | {floor:.2f} | {measured:.2f} | {measured / floor:.1f} |')


def specialised(rows):
    """What each specialised loop gains over the general one, by instruction set; a gain below 5 % does not earn its place."""
    for isa in dict.fromkeys(r["isa"] for r in rows):
        print(f"\n### specialised loops, {isa}: how much longer the general loop takes (%)\n")
        print("| loop | ndf | " + " | ".join(TIERS) + " |\n|---|---|" + "---|" * len(TIERS))
        for loop, ndf in dict.fromkeys((r["loop"], r["ndf"]) for r in rows if r["isa"] == isa):
            mine = {r["tier"]: r for r in rows if (r["loop"], r["ndf"], r["isa"]) == (loop, ndf, isa)}
            print(f"| {loop} | {ndf} | " + " | ".join(f'{100 * r["gain"]:.0f}' if (r := mine.get(t)) else "–" for t in TIERS) + " |")


def main():
    rows, folder = rows_of(sys.argv[1]), sys.argv[2]
    isas = list(dict.fromkeys(r["isa"] for r in rows))
    for isa in reversed(isas):
        table(rows, isa)
    others(rows, isas[-1])
    roofline(rows, isas[-1], sys.argv[3])
    specialised(rows_of(f"{folder}/specialised.json"))
    pareto(rows, isas[-1], folder)


main()
