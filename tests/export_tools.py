#!/usr/bin/env python3
"""Exports, judged by the tools themselves.

    tests/export_tools.py URL      prints a line "ok|FAIL|skip TOOL/..." per source

Mitsuba 3 (PyPI mitsuba) evaluates what is written for it, as the daemon evaluates the same
model; MaterialX (PyPI materialx) validates its document against its own library.  Without a
package its checks are skipped.
Equal means where the value passes 1e-6: within 2e-5 relative, Mitsuba computing in single
precision; within 1e-2 for Beckmann, whose masking is a rational fit there (Walter 2007, 0.35 %).
"""
import json
import math
import re
import sys
import urllib.request

URL = sys.argv[1]

try:
    import mitsuba as mi
    mi.set_variant('scalar_rgb')
except ImportError:
    mi = None
try:
    import MaterialX as mx
except ImportError:
    mx = None

SOURCES = {
    'ggx': {'ndf': 'ggx', 'alpha': 0.2, 'fresnel': {'schlick': {'f0': [0.95, 0.64, 0.54]}}},
    'beckmann': {'ndf': 'beckmann', 'alpha_x': 0.3, 'alpha_y': 0.1, 'fresnel': {'schlick': {'f0': 0.5}}},
    'diffuse': {'ndf': 'ggx', 'alpha': 0.1, 'fresnel': {'schlick': {'f0': 0.04}}, 'diffuse': [0.4, 0.2, 0.1]},
}


def ask(path, body):
    request = urllib.request.Request(URL + path, json.dumps(body).encode(), {'Content-Type': 'application/json'})
    return json.load(urllib.request.urlopen(request))


def numbers(text, name):
    return [float(x) for x in re.search(f'name="{name}" value="([^"]*)"', text)[1].split(',')]


def target(text, ndf):
    """The daemon's material for what the text says, and the weight of the diffuse part."""
    material = {'ndf': ndf, 'alpha_x': numbers(text, 'alpha_u')[0], 'alpha_y': numbers(text, 'alpha_v')[0],
                'masking': 'smith_uncorrelated',
                'fresnel': {'conductor': {'eta': numbers(text, 'eta'), 'k': numbers(text, 'k')}}}
    if 'blendbsdf' not in text:
        return material, 0, [0, 0, 0]
    return material, numbers(text, 'weight')[0], numbers(text, 'reflectance')


def directions():
    wi, wo = [], []
    for a in range(6):
        for b in range(9):
            for c in range(5):
                to, ti, p = 0.1 + 0.25 * a, 0.05 + 0.17 * b, 0.3 * a + 0.7 * c
                wo.append([math.sin(to) * math.cos(p), math.sin(to) * math.sin(p), math.cos(to)])
                q = p + math.pi + 0.4 * (c - 2)
                wi.append([math.sin(ti) * math.cos(q), math.sin(ti) * math.sin(q), math.cos(ti)])
    return wi, wo


def mitsuba(text, wi, wo):
    bsdf = mi.load_string(text.replace('<bsdf ', '<bsdf version="3.0.0" ', 1))
    out = []
    for i, o in zip(wi, wo):
        si = mi.SurfaceInteraction3f()
        si.wi = mi.Vector3f(o)
        si.sh_frame = mi.Frame3f(mi.Vector3f(0, 0, 1))
        value = bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(i), True)
        out.append([float(value[k]) for k in range(3)])
    return out


def check_materialx():
    if not mx:
        print('skip materialx: the PyPI package materialx is not installed')
        return
    library = mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), mx.getDefaultDataSearchPath(), library)
    for name, source in SOURCES.items():
        fit = ask('/v1/fit?export=materialx&model=ggx', {'source': dict(source, ndf='ggx')})
        document = mx.createDocument()
        mx.readFromXmlString(document, fit['export']['text'])
        document.importLibrary(library)
        valid, why = document.validate()
        unknown = [node.getName() for node in document.getNodes() if not node.getNodeDef()]
        print(f'{"ok" if valid and not unknown else "FAIL"} materialx/{name} {why} {" ".join(unknown)}')


def check_mitsuba():
    if not mi:
        print('skip mitsuba: the PyPI package mitsuba is not installed')
        return
    wi, wo = directions()
    for name, source in SOURCES.items():
        fit = ask('/v1/fit?export=mitsuba', {'source': source})
        text = fit['export']['text']
        material, weight, reflectance = target(text, source['ndf'])
        ours = ask('/v1/eval', {'material': material, 'wi': wi, 'wo': wo, 'outputs': ['fr_cos'], 'tolerance': 1e-9})
        worst = 0
        for a, b, i in zip(ours['fr_cos'], mitsuba(text, wi, wo), wi):
            for k in range(3):
                value = (1 - weight) * a[k] + weight * reflectance[k] / math.pi * i[2]
                if value > 1e-6:
                    worst = max(worst, abs(b[k] / value - 1))
        bound = 1e-2 if source['ndf'] == 'beckmann' else 2e-5
        print(f'{"ok" if worst < bound else "FAIL"} mitsuba/{name} error={worst:.2g}')


check_mitsuba()
check_materialx()
