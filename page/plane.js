// plane.js - a plane under a map, each pixel one texel of a level: slope moments from /v1/leadr, and for
// every texel's lobe directions of light from /v1/sample.  Coarse levels first.
import {lookup, texel} from "./environment.js";
import {exrLevel} from "./exr.js";
import {askArrays, upload} from "./service.js";

export const TILT = Math.PI / 6; // of its normal from the view
const LARGEST = 64,
    AT_ONCE = 6,
    PIXELS_MAX = 1 << 20;
// Too smooth a texel is no lobe: a base keeps every variance positive.
const BASE = "base_alpha=0.06&y=up&compression=none";

// The file of the Maps view, and its options.
export const mapFile = {file: null, query: ""};

// Waves that cross, and dents: where the page has no file.
function builtIn() {
    const n = 256,
        scattered = (k, c) => (((Math.sin(12.9898 * k + 78.233 * c) * 43758.5453) % 1) + 1) % 1;
    const dents = Array.from({length: 26}, (_, k) => [
        scattered(k, 1),
        scattered(k, 2),
        0.025 + 0.05 * scattered(k, 3),
    ]);
    return Array.from({length: n}, (_, j) =>
        Array.from({length: n}, (_, i) => {
            const x = i / n,
                y = j / n;
            let height =
                0.002 * Math.sin(2 * Math.PI * (3 * x + 2 * y)) +
                0.0006 * Math.sin(2 * Math.PI * 61 * y + 2 * Math.sin(2 * Math.PI * 2 * x)) * (x > 0.5 ? 1 : 0.2);
            for (const [cx, cy, r] of dents) {
                const dx = Math.abs(x - cx),
                    dy = Math.abs(y - cy),
                    d2 = (Math.min(dx, 1 - dx) ** 2 + Math.min(dy, 1 - dy) ** 2) / (r * r);
                height -= 0.3 * r * Math.exp(-d2);
            }
            return Number(height.toFixed(6));
        }),
    );
}

async function fetchLevels(signal) {
    const accept = "image/x-exr",
        {file, query} = mapFile;
    const {body} = file
        ? await upload(`v1/leadr?${query}&${BASE}`, file, {accept, signal})
        : await upload(`v1/leadr?${BASE}`, new Blob([JSON.stringify({heights: builtIn()})]), {accept, signal});
    return body;
}

// The frame of the plane in the world: x to the right, y up and away, z its normal; seen along the world's z.
const S = Math.sin(TILT),
    C = Math.cos(TILT);
export const PLANE_WO = [0, -S, C];
const toWorld = (x, y, z) => [x, y * C + z * S, z * C - y * S];

// What stands in for the texels of a level until they are there.
function magnified(from, to) {
    const out = new Float32Array(3 * to.width * to.height);
    for (let j = 0; j < to.height; j++) {
        for (let i = 0; i < to.width; i++) {
            const at = Math.floor((j * from.height) / to.height) * from.width + Math.floor((i * from.width) / to.width);
            out.set(from.out.subarray(3 * at, 3 * at + 3), 3 * (j * to.width + i));
        }
    }
    return out;
}

// paint(width, height, radiance of each texel) after every level; tell(part, text) while at it.
export async function renderPlane({material, environment, samples, accuracy, signal, paint, tell}) {
    tell(0, mapFile.file ? `Filtering ${mapFile.file.name}.` : "Filtering the map built in.");
    const exr = await fetchLevels(signal),
        levels = [];
    if (exr.byteLength > 28 * PIXELS_MAX) throw new Error("this page shades maps of up to a million texels");
    for (let n = 0; ; n++) {
        const level = exrLevel(exr, n);
        if (Math.max(level.width, level.height) <= LARGEST) levels.unshift(level);
        if (level.width === 1 && level.height === 1) break;
    }
    const total = levels.reduce((sum, {width, height}) => sum + width * height, 0),
        light = lookup(environment);
    let done = 0,
        refused = 0;
    const shade = async (level, k, out) => {
        const {E1, E2, E3, E4, E5} = level.channels;
        const request = {
            material: {...material, moments: [E1[k], E2[k], E3[k], E4[k], E5[k]]},
            wo: [PLANE_WO],
            n: samples,
            sequence: "r2",
            seed: k,
            outputs: ["wi", "weight"],
            ...accuracy,
        };
        out.fill(0, 3 * k, 3 * k + 3);
        const {
                arrays: {wi, weight},
            } = await askArrays("v1/sample", request, null, signal),
            step = weight.channels;
        for (let s = 0; s < samples; s++) {
            if (!(weight[step * s] > 0)) continue;
            const at = texel(...toWorld(wi[3 * s], wi[3 * s + 1], wi[3 * s + 2]));
            for (let c = 0; c < 3; c++)
                out[3 * k + c] += (light[at + c] * weight[step === 3 ? 3 * s + c : s]) / samples;
        }
    };
    let coarser = null;
    for (const level of levels) {
        const count = level.width * level.height,
            out = coarser ? magnified(coarser, level) : new Float32Array(3 * count);
        let next = 0;
        const work = async () => {
            while (next < count) {
                const k = next++;
                try {
                    await shade(level, k, out);
                } catch (error) {
                    if (error.status !== 422) throw error;
                    refused++; // a slope so steep that it has no lobe seen from here
                }
                if (++done % 64 === 0) tell(done / total, `${done} of ${total} texels`);
                if (done % 256 === 0) paint(level.width, level.height, out);
            }
        };
        await Promise.all(Array.from({length: AT_ONCE}, work));
        paint(level.width, level.height, out);
        coarser = {...level, out};
    }
    return {total, refused};
}
