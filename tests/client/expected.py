#!/usr/bin/env python3
"""Fills in (or, with --check, verifies) the expected numbers of case files.

    tests/client/expected.py [--check] tests/client/cases/*/*.json

An independent model in 40-digit arithmetic (mpmath): slope densities and Fresnel amplitudes from
their definitions, projected areas by quadrature of the marginal slope density, none of the service's
closed or stable forms.  Only checks that have a member "is" at /<output> (or /wi, /weight, /pdf of
a sample) are filled in; everything else in a case is written by hand.  `make test` runs --check.
"""
import json
import struct
import sys
from mpmath import mp, mpf, mpc, sqrt, exp, pi, inf, quad, cos, sin, atan, atan2, beta

mp.dps = 40


def roughness(m):
    """(ax, ay, rho, slope_x, slope_y); the ellipse by rotating its axes (thesis eq. 2.25: phi_h + phi)."""
    sx, sy = [mpf(v) for v in m.get('mean_slope', [0, 0])]
    if 'alpha' in m:
        return mpf(m['alpha']), mpf(m['alpha']), mpf(0), sx, sy
    if 'alpha_x' in m:
        return mpf(m['alpha_x']), mpf(m['alpha_y']), mpf(m.get('rho', 0)), sx, sy
    if 'moments' in m:
        e = [mpf(v) for v in m['moments']]
        ax, ay = sqrt(2 * (e[2] - e[0] ** 2)), sqrt(2 * (e[3] - e[1] ** 2))
        return ax, ay, 2 * (e[4] - e[0] * e[1]) / (ax * ay), e[0], e[1]
    a1, a2, phi = mpf(m['alpha_1']), mpf(m['alpha_2']), mpf(m.get('phi', 0))
    # covariance R diag(a1^2, a2^2) R^T with the major axis at -phi
    c, s = cos(phi), -sin(phi)
    xx, yy, xy = a1**2 * c**2 + a2**2 * s**2, a1**2 * s**2 + a2**2 * c**2, (a1**2 - a2**2) * c * s
    return sqrt(xx), sqrt(yy), xy / sqrt(xx * yy), sx, sy


def slope_density(ndf, r, x, y):
    ax, ay, rho, sx, sy = r
    u, v = (x - sx) / ax, (y - sy) / ay
    q = (u * u - 2 * rho * u * v + v * v) / (1 - rho**2)
    det = ax * ay * sqrt(1 - rho**2)
    return exp(-q) / (pi * det) if ndf == 'beckmann' else 1 / (pi * det * (1 + q) ** 2)


def length(v):
    return sqrt(sum(a * a for a in v))


def normal_density(ndf, r, H):
    if H[2] <= 0:
        return mpf(0)
    return slope_density(ndf, r, -H[0] / H[2], -H[1] / H[2]) * (length(H) / H[2]) ** 4


def projected_area(ndf, r, k):
    """Integral of max(0, c - s t) over the marginal of the standard slope density."""
    ax, ay, rho, sx, sy = r
    c = k[2] - k[0] * sx - k[1] * sy
    var = (k[0] * ax) ** 2 + (k[1] * ay) ** 2 + 2 * rho * k[0] * k[1] * ax * ay
    s = sqrt(var)
    if s == 0:
        return max(c, mpf(0))
    if ndf == 'beckmann':
        v = c / s
        cuts = [-inf, v] if v < -3 else [-inf, -3, v] if v < 3 else [-inf, -3, 0, 3, min(v, 12)]
        return quad(lambda t: exp(-t * t) / sqrt(pi) * (c - s * t), cuts)
    # t = tan a turns dt / (2 (1 + t^2)^(3/2)) into cos(a) / 2 da
    return quad(lambda a: (c * cos(a) - s * sin(a)) / 2, [-pi / 2, 0 if c > 0 else -pi / 2, atan(c / s)])


def fresnel(f, cd):
    """A list: one entry, or one per channel."""
    if f == 'ideal':
        return [mpf(1)]
    kind, p = next(iter(f.items()))

    def channels(x):
        return [mpf(v) for v in x] if isinstance(x, list) else [mpf(x)]

    def reflect(n):  # amplitudes of a smooth boundary with (complex) relative index n
        st2 = (1 - cd * cd) / (n * n)
        ct = sqrt(mpc(1 - st2))
        rs, rp = (cd - n * ct) / (cd + n * ct), (n * cd - ct) / (n * cd + ct)
        return (abs(rs) ** 2 + abs(rp) ** 2) / 2

    if kind == 'schlick':
        return [f0 + (1 - f0) * (1 - cd) ** 5 for f0 in channels(p['f0'])]
    if kind == 'dielectric':
        return [reflect(e) for e in channels(p['eta'])]
    if kind == 'conductor':
        return [reflect(mpc(e, k)) for e, k in zip(channels(p['eta']), channels(p['k']))]
    if kind == 'table':
        xs, rows = [mpf(x) for x in p['cos_theta_d']], p['values']
        rows = [channels(v) for v in rows]
        if cd <= xs[0]:
            return rows[0]
        for a, b, ra, rb in zip(xs, xs[1:], rows, rows[1:]):
            if cd <= b:
                t = (cd - a) / (b - a)
                return [x + t * (y - x) for x, y in zip(ra, rb)]
        return rows[-1]
    raise ValueError(kind)


def minor_radius(r):
    ax, ay, rho = r[:3]
    half, off = (ax**2 - ay**2) / 2, rho * ax * ay
    return sqrt((ax**2 + ay**2) / 2 - sqrt(half**2 + off**2))


def sampler_of(m):
    """What auto stands for (README, Samplers)."""
    r = roughness(m)
    if m.get('ndf', 'ggx') == 'ggx':
        return 'bounded' if r[3] == r[4] == 0 and minor_radius(r) >= 0.1 else 'caps'
    return 'vcavity' if m.get('masking') == 'vgroove' else 'slope'


def density_of(m, sampler, wo, H, D, so, co):
    """That of the directions it draws above the horizon, seen from above (lib/NOTATION.md, Samplers)."""
    r = roughness(m)
    if sampler == 'auto':
        sampler = sampler_of(m)
    if sampler in ('caps', 'slope'):
        return D / (4 * so)
    if sampler == 'vcavity':
        return D * min(1 / (4 * co), H[2] / length(H) ** 2)
    if sampler != 'bounded' or wo[2] <= 0:
        raise ValueError(sampler + ': written by hand')
    a, side = minor_radius(r), sqrt(wo[0]**2 + wo[1]**2)
    if a > 1 and r[0] == r[1] and r[2] == 0:
        q = 1 - side
    else:
        a, q = min(a, mpf(1)), 1 + side
    share = (1 - a**2) * q**2 / (q**2 + a**2 * wo[2]**2)  # Eto & Tokuyoshi's K
    return D / (2 * (2 * so - (1 - share) * co))  # r = 2 sigma - c


def evaluate(m, wi, wo, sampler='auto'):
    """Every quantity of one pair, from the definitions (lib/NOTATION.md)."""
    ndf, r = m.get('ndf', 'ggx'), None
    if m.get('transmission'):
        return glass(m, wi, wo)
    if ndf == 'lambert':
        f = m['reflectance']
        f = [mpf(x) / pi for x in (f if isinstance(f, list) else [f])]
        up = wi[2] > 0 and wo[2] > 0
        return {'fr': [x * up for x in f], 'fr_cos': [x * wi[2] * up for x in f]}
    r = roughness(m)
    masking, shear = m.get('masking', 'smith'), m.get('shear', 'energy_safe')
    H = [a + b for a, b in zip(wi, wo)]
    D, cd = normal_density(ndf, r, H), length(H) / 2
    zi, zo = wi[2], wo[2]
    ci, co = [k[2] - k[0] * r[3] - k[1] * r[4] for k in (wi, wo)]
    si, so = projected_area(ndf, r, wi), projected_area(ndf, r, wo)
    F = fresnel(m.get('fresnel', 'ideal'), cd)
    if shear == 'thesis':
        ci, co = zi, zo
    out = {'D': D, 'pdf': density_of(m, sampler, wo, H, D, so, co), 'F': F, 'sigma_o': so}
    mk = [min(mpf(1), 4 * H[2] * c / length(H) ** 2) for c in (ci, co)]
    out['D_vis'] = cd * D / so
    out['G1_i'], out['G1_o'] = zi / si, zo / so
    if masking == 'smith':  # G = 1/(1/g_i + 1/g_o - 1), f cos = F D G / (4 c_o)
        if co > 0:
            value = D / (4 * co) / (si / ci + so / co - 1) if ci > 0 else mpf(0)
        else:
            value = D / (4 * so) if ci > 0 else mpf(0)
        value = max(value, mpf(0))
    elif masking == 'smith_uncorrelated':
        value = D * max(ci, mpf(0)) / (4 * si * so)
    elif masking == 'vgroove':
        value = D * max(min(mk), mpf(0)) / (4 * co)
        out['G1_i'], out['G1_o'] = mk[0] * zi / ci, mk[1] * zo / co
        out['D_vis'] = mk[1] * cd * D / co
    else:
        value = D * H[2] / (2 * length(H) ** 2)
        del out['G1_i'], out['G1_o'], out['D_vis']
    up = zi > 0 and zo > 0
    out['fr_cos'] = [f * value if up else mpf(0) for f in F]
    out['fr'] = [f / zi if up else mpf(0) for f in out['fr_cos']]
    if up and D > 0:
        out['G'] = 4 * zo * value / D
    if 'diffuse' in m:
        kd = m['diffuse'] if isinstance(m['diffuse'], list) else [m['diffuse']]
        n = max(len(kd), len(F))
        kd, fr = [mpf(x) for x in (kd * n)[:n]], (out['fr'] * n)[:n]
        out['fr'] = [(1 - k) * f + k / pi if up else mpf(0) for k, f in zip(kd, fr)]
        out['fr_cos'] = [f * zi for f in out['fr']]
    return out


def glass(m, wi, wo):
    """A rough dielectric from either side: Walter et al. 2007, eqs. 16 to 21, with Heitz 2016's G2 across."""
    ndf, r, eta = m.get('ndf', 'ggx'), roughness(m), mpf(m['fresnel']['dielectric']['eta'])
    eta_o, eta_i = (mpf(1), eta) if wo[2] > 0 else (eta, mpf(1))
    up, n = mpf(1 if wo[2] > 0 else -1), eta_i / eta_o
    across = wi[2] * up < 0

    def lobe(h, turn):
        """(density of wi, share that masking keeps, quantities); turn: the side wi is seen from."""
        size = length(h)
        h = [a / size for a in h] if h[2] > 0 else [-a / size for a in h]
        o, i = up * sum(a * b for a, b in zip(wo, h)), turn * sum(a * b for a, b in zip(wi, h))
        ko, ki = [[up * a for a in wo], [turn * a for a in wi]]
        co, ci = [k[2] - k[0] * r[3] - k[1] * r[4] for k in (ko, ki)]
        so, si = projected_area(ndf, r, ko), projected_area(ndf, r, ki)
        return h, o, i, co, ci, so, si, normal_density(ndf, r, h)

    h, o, i, co, ci, so, si, D = lobe([a + b for a, b in zip(wi, wo)], up)
    F = fresnel({'dielectric': {'eta': n}}, o)[0] if up * (wi[2] + wo[2]) > 0 else mpf(0)
    pdf = F * D / (4 * so) if F else mpf(0)
    kept = mpf(0)
    if not across and ci > 0:
        g = m.get('masking') == 'smith_uncorrelated'
        kept = ci / si if g else 1 / (1 + (si / ci - 1) * max(co, mpf(0)) / so)
    out = {'fr_cos': pdf * kept, 'D': D, 'F': F, 'G1_i': abs(wi[2]) / si, 'D_vis': o * D / so}
    h, o, i, co, ci, so, si, D = lobe([eta_o * a + eta_i * b for a, b in zip(wo, wi)], -up)
    T = mpf(0)
    if o > 0 and i > 0:
        T = 1 - fresnel({'dielectric': {'eta': n}}, o)[0]
        density = T * o * D / so * n**2 * i / (o - n * i) ** 2
        pdf += density
    if across:
        kept = mpf(0)
        if ci > 0 and m.get('masking') == 'smith_uncorrelated':
            kept = ci / si
        elif ci > 0 and co > 0:
            kept = so / co * beta(so / co, si / ci)
        scale = 1 / n**2 if m.get('transport') == 'radiance' else 1
        out = {'fr_cos': density * kept * scale if T else mpf(0), 'D': D if T else mpf(0), 'F': 1 - T if T else mpf(0),
               'G1_i': abs(wi[2]) / si, 'D_vis': o * D / so if T else mpf(0)}
    out.update(pdf=pdf, sigma_o=so, G1_o=abs(wo[2]) / so, G=kept * abs(wo[2]) / so)
    out['fr'] = [out['fr_cos'] / abs(wi[2])]
    out['fr_cos'], out['F'] = [out['fr_cos']], [out['F']]
    return out


def sample_glass(m, wo, u, lobe):
    """The normal of sample_caps seen from wo's side; reflected where lobe < F, else refracted."""
    up = 1 if wo[2] > 0 else -1
    eta = mpf(m['fresnel']['dielectric']['eta'])
    n, ko = eta if up > 0 else 1 / eta, [up * a for a in wo]
    s = sample_caps(dict(m, fresnel='ideal', transmission=False), ko, u)
    c = sum(a * b for a, b in zip(ko, s['h']))
    wi = s['wi']
    if lobe >= fresnel({'dielectric': {'eta': n}}, c)[0]:
        wi = [-(a + (sqrt(n * n - 1 + c * c) - c) * b) / n for a, b in zip(ko, s['h'])]
    wi = [up * a for a in wi]
    e = glass(m, wi, wo)
    return {'wi': wi, 'h': s['h'], 'weight': [f / e['pdf'] for f in e['fr_cos']], 'pdf': e['pdf']}


def sample_caps(m, wo, u):
    """Visible GGX normals by spherical caps (Dupuy & Benyoub 2023), reflected."""
    ax, ay, rho, sx, sy = roughness(m)
    kappa = sqrt(1 - rho**2)
    k = [ax * wo[0] + rho * ay * wo[1], ay * kappa * wo[1], wo[2] - wo[0] * sx - wo[1] * sy]
    n = length(k)
    k = [x / n for x in k]
    t = (1 - u[1]) * (1 + k[2]) - k[2]
    rim = sqrt(1 - t * t)
    c = [rim * cos(2 * pi * u[0]), rim * sin(2 * pi * u[0]), t]
    x, y, z = [a + b for a, b in zip(c, k)]
    h = [ax * x - sx * z, ay * (rho * x + kappa * y) - sy * z, z]
    n = length(h)
    h = [a / n for a in h]
    d = 2 * sum(a * b for a, b in zip(wo, h))
    wi = [d * a - b for a, b in zip(h, wo)]
    e = evaluate(m, wi, wo, 'caps')
    weight = [f / e['pdf'] for f in e['fr_cos']]
    return {'wi': wi, 'h': h, 'weight': weight, 'pdf': e['pdf']}


def directions(spec):
    if isinstance(spec, dict) and 'theta' in spec:
        return [[sin(mpf(t)) * cos(mpf(p)), sin(mpf(t)) * sin(mpf(p)), cos(mpf(t))]
                for t, p in zip(spec['theta'], spec['phi'])]
    if isinstance(spec, dict) and 'grid' in spec:  # cell centres, azimuth fast
        nt, np = spec['grid']['theta'], spec['grid']['phi']
        cells = [((i + mpf(1) / 2) * pi / 2 / nt, (j + mpf(1) / 2) * 2 * pi / np)
                 for i in range(nt) for j in range(np)]
        return [[sin(t) * cos(p), sin(t) * sin(p), cos(t)] for t, p in cells]
    if not isinstance(spec, list):
        raise ValueError('random directions: written by hand')
    flat = [mpf(x) for v in spec for x in (v if isinstance(v, list) else [v])]
    rows = [flat[i:i + 3] for i in range(0, len(flat), 3)]
    # within 1e-6 of unit length: as given; further off: normalised first
    return [v if abs(length(v) - 1) <= mpf('1e-6') else [x / length(v) for x in v] for v in rows]


def pairs(request):
    if 'h' in request:  # Rusinkiewicz: wi = Rz(phi_h) Ry(theta_h) d, wo = wi mirrored at h
        out = []
        for h, d in zip(directions(request['h']), directions(request['d'])):
            h, d = [x / length(h) for x in h], [x / length(d) for x in d]
            t, p = atan2(sqrt(h[0]**2 + h[1]**2), h[2]), atan2(h[1], h[0])
            x, y, z = d[0] * cos(t) + d[2] * sin(t), d[1], d[2] * cos(t) - d[0] * sin(t)
            wi = [x * cos(p) - y * sin(p), x * sin(p) + y * cos(p), z]
            dot = 2 * sum(a * b for a, b in zip(wi, h))
            out.append((wi, [dot * a - b for a, b in zip(h, wi)]))
        return out
    wi, wo = directions(request['wi']), directions(request['wo'])
    if request.get('pairing') == 'outer':
        return [(i, o) for i in wi for o in wo]
    n = max(len(wi), len(wo))
    return list(zip((wi * n)[:n], (wo * n)[:n]))


def as_number(x):
    return float(x)


def shape(values, channels):
    """One number per pair while the material is achromatic, else a list of three."""
    if not isinstance(values[0], list):
        return [as_number(v) for v in values]
    if max(len(v) for v in values) == 1 and channels != 3:
        return [as_number(v[0]) for v in values]
    return [[as_number(x) for x in (v * 3)[:3]] for v in values]


def expected(path, request):
    m = request['material']
    if path == '/v1/sample':
        wo, u = directions(request['wo']), [[mpf(x) for x in v] for v in request['u']]
        n = max(len(wo), len(u))
        rows = [sample_caps(m, o, v) for o, v in zip((wo * n)[:n], (u * n)[:n])] if not m.get('transmission') else [
            sample_glass(m, o, v, mpf(x)) for o, v, x in zip((wo * n)[:n], (u * n)[:n], (request['u_lobe'] * n)[:n])]
        out = {k: [r[k] for r in rows] for k in rows[0]}
        return {'wi': [[float(x) for x in v] for v in out['wi']],
                'h': [[float(x) for x in v] for v in out['h']],
                'weight': shape(out['weight'], request.get('channels')),
                'pdf': shape(out['pdf'], 1)}
    rows = [evaluate(m, i, o, request.get('sampler', 'auto')) for i, o in pairs(request)]
    coloured = any(len(r[k]) > 1 for r in rows for k in ('fr', 'F') if k in r)
    channels = request.get('channels', 3 if coloured else 1)
    return {k: shape([r[k] for r in rows], channels if isinstance(rows[0][k], list) else 1)
            for k in rows[0] if all(k in r for r in rows)}


def rounded(values, kind):
    """What a part holds of the numbers written in its case (tests/client/body.c)."""
    if isinstance(values, list):
        return [rounded(v, kind) for v in values]
    return struct.unpack('<f', struct.pack('<f', values))[0] if kind != 'float64' else values


def body_of(request):
    """The request as one JSON, whether sent so or as a form."""
    if 'json' in request:
        return request['json']
    parts = {name: rounded(numbers, kind) for name, part in request['form'].items() if name != 'request'
             for kind, numbers in part.items()}
    return {**request['form']['request'], **parts}


def main():
    check = '--check' in sys.argv
    bad = cases = 0
    for name in [a for a in sys.argv[1:] if a != '--check']:
        with open(name) as f:
            text = f.read()
        case = json.loads(text)
        checks = case['expect'].get('json', {})
        wanted = [k for k, v in checks.items() if isinstance(v, dict) and 'is' in v and
                  k[1:] in ('fr', 'fr_cos', 'pdf', 'D', 'D_vis', 'G', 'G1_i', 'G1_o', 'F', 'sigma_o',
                            'wi', 'h', 'weight')]
        request = case['request']
        if not wanted or case.get('by_hand') or request.get('path') not in ('/v1/eval', '/v1/pdf', '/v1/sample'):
            continue
        try:
            answer = expected(request['path'], body_of(request))
        except Exception as error:
            sys.exit(f'{name}: {error}')
        cases += 1
        for k in wanted:
            if check and checks[k]['is'] != answer[k[1:]]:
                print(' ', name, k, checks[k]['is'], answer[k[1:]])
                bad = 1
            checks[k]['is'] = answer[k[1:]]
        if not check:
            with open(name, 'w') as f:
                f.write(dump(case) + '\n')
    if check:
        print('FAIL' if bad else 'ok', f'expected/numbers of {cases} case files by mpmath')
    sys.exit(bad)


def dump(value, indent=0):
    """Objects over several lines until they fit one; arrays on one line."""
    flat = json.dumps(value, ensure_ascii=False)
    if not isinstance(value, dict) or indent + len(flat) <= 100 and indent > 0:
        return flat
    pad = ' ' * (indent + 2)
    rows = [f'{pad}{json.dumps(k)}: {dump(v, indent + 2)}' for k, v in value.items()]
    return '{\n' + ',\n'.join(rows) + '\n' + ' ' * indent + '}'


if __name__ == '__main__':
    main()
