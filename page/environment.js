// environment.js - light from all around, as a function of direction: linear sRGB radiance, y up.

const mix = (a, b, t) => a.map((x, i) => x + (b[i] - x) * t);
const smooth = (a, b, x) => {
    const t = Math.max(0, Math.min(1, (x - a) / (b - a)));
    return t * t * (3 - 2 * t);
};

// A rectangle of light around a direction, seen through the plane in front of it.
function box(direction, width, height, color) {
    const length = Math.hypot(...direction),
        d = direction.map((x) => x / length);
    const right = [d[2], 0, -d[0]],
        r = Math.hypot(...right),
        u = right.map((x) => x / r);
    const v = [d[1] * u[2] - d[2] * u[1], d[2] * u[0] - d[0] * u[2], d[0] * u[1] - d[1] * u[0]];
    return (x, y, z) => {
        const depth = x * d[0] + y * d[1] + z * d[2];
        if (depth <= 0) return null;
        const a = Math.abs(x * u[0] + y * u[1] + z * u[2]) / depth,
            b = Math.abs(x * v[0] + y * v[1] + z * v[2]) / depth;
        const inside = (1 - smooth(width * 0.9, width, a)) * (1 - smooth(height * 0.9, height, b));
        return inside > 0 ? color.map((c) => c * inside) : null;
    };
}

const studio = (() => {
    const lights = [
        box([-0.9, 0.7, 0.8], 0.55, 0.8, [5, 4.8, 4.4]),
        box([1, 0.35, 0.3], 0.3, 0.9, [2, 2.4, 3.2]),
        box([0.1, 1, -0.3], 0.8, 0.4, [2.4, 2.4, 2.4]),
    ];
    return (x, y, z) => {
        const out = mix([0.05, 0.05, 0.055], [0.28, 0.29, 0.32], smooth(-0.4, 0.8, y));
        for (const light of lights) {
            const add = light(x, y, z);
            if (add) ((out[0] += add[0]), (out[1] += add[1]), (out[2] += add[2]));
        }
        return out;
    };
})();

const SUN = [0.48, 0.64, 0.6];
function sky(x, y, z) {
    if (y < -0.02) return mix([0.16, 0.13, 0.1], [0.3, 0.26, 0.2], smooth(-1, 0, y));
    const out = mix([1.0, 0.95, 0.88], [0.16, 0.34, 0.8], smooth(-0.02, 0.55, y));
    const d = x * SUN[0] + y * SUN[1] + z * SUN[2],
        disc = 16 * smooth(0.965, 0.985, d) + 0.8 * Math.max(0, d) ** 24;
    return [out[0] + disc, out[1] + 0.92 * disc, out[2] + 0.75 * disc];
}

export const ENVIRONMENTS = {
    studio: {label: "Studio, three soft boxes", radiance: studio},
    sky: {label: "Sky and sun", radiance: sky},
    furnace: {label: "White furnace, 1 everywhere", radiance: () => [1, 1, 1]},
};

// Looked up a million times a second: baked into an octahedral map (no trigonometry), nearest texel.
const SIDE = 512;
const baked = new Map();

export function lookup(name) {
    if (!baked.has(name)) {
        const table = new Float32Array(3 * SIDE * SIDE),
            {radiance} = ENVIRONMENTS[name];
        for (let j = 0; j < SIDE; j++) {
            for (let i = 0; i < SIDE; i++) {
                let u = ((i + 0.5) / SIDE) * 2 - 1,
                    v = ((j + 0.5) / SIDE) * 2 - 1;
                const y = 1 - Math.abs(u) - Math.abs(v);
                if (y < 0) [u, v] = [Math.sign(u) * (1 - Math.abs(v)), Math.sign(v) * (1 - Math.abs(u))];
                const length = Math.hypot(u, y, v);
                table.set(radiance(u / length, y / length, v / length), 3 * (j * SIDE + i));
            }
        }
        baked.set(name, table);
    }
    return baked.get(name);
}

// Where a direction lies in the table.
export function texel(x, y, z) {
    const n = 1 / (Math.abs(x) + Math.abs(y) + Math.abs(z));
    let u = x * n,
        v = z * n;
    if (y < 0) {
        const w = u;
        u = (u < 0 ? -1 : 1) * (1 - Math.abs(v));
        v = (v < 0 ? -1 : 1) * (1 - Math.abs(w));
    }
    const i = Math.min(SIDE - 1, (((u + 1) * SIDE) / 2) | 0),
        j = Math.min(SIDE - 1, (((v + 1) * SIDE) / 2) | 0);
    return 3 * (j * SIDE + i);
}

// All of it as a picture: longitude to the right, up is up.
export function panorama(table, width, height) {
    const out = new Float32Array(3 * width * height);
    for (let j = 0; j < height; j++) {
        for (let i = 0; i < width; i++) {
            const theta = ((j + 0.5) / height) * Math.PI,
                phi = (((i + 0.5) / width) * 2 - 1) * Math.PI;
            const at = texel(Math.sin(theta) * Math.sin(phi), Math.cos(theta), Math.sin(theta) * Math.cos(phi));
            out.set(table.subarray(at, at + 3), 3 * (j * width + i));
        }
    }
    return out;
}
