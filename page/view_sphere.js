// view_sphere.js - a sphere under light from all around, averaged over directions that the service samples.
import {curlBox, line} from "./curl.js";
import {button, el, explain, field, select, slider} from "./dom.js";
import {ENVIRONMENTS, lookup, panorama, texel} from "./environment.js";
import {samplerFor, samplersOf} from "./material.js";
import {bytes, milliseconds, sRGB} from "./numbers.js";
import {mapFile, PLANE_WO, renderPlane, TILT} from "./plane.js";
import {askArrays} from "./service.js";
import {forPicture, set, state} from "./state.js";

export const title = "Sphere";
export const lead =
    "Every pixel asks the service for directions of light, in binary float32, and averages what the environment shows there.";
export const usesMaterial = true;

const SIZE = 288,
    TILE = 4096,
    AT_ONCE = 2;

// Pixels of the sphere: place in the picture, normal, and the frame whose z it is (x along the parallel).
function pixelsOfSphere() {
    const index = [],
        frames = [],
        wo = [];
    for (let j = 0; j < SIZE; j++) {
        for (let i = 0; i < SIZE; i++) {
            const x = (((i + 0.5) / SIZE) * 2 - 1) * 1.03,
                y = (1 - ((j + 0.5) / SIZE) * 2) * 1.03,
                r2 = x * x + y * y;
            if (r2 >= 1) continue;
            const z = Math.sqrt(1 - r2),
                t = Math.hypot(z, x) || 1,
                T = [z / t, 0, -x / t];
            const B = [y * T[2] - z * T[1], z * T[0] - x * T[2], x * T[1] - y * T[0]];
            index.push(j * SIZE + i);
            frames.push(...T, ...B, x, y, z);
            wo.push(T[2], B[2], z); // the view is along z
        }
    }
    return {index: Uint32Array.from(index), frames: Float64Array.from(frames), wo: Float32Array.from(wo)};
}

export function create({problem}) {
    const canvas = el("canvas", {
        width: SIZE,
        height: SIZE,
        class: "sphere",
        role: "img",
        "aria-label": "The shaded sphere",
    });
    const context = canvas.getContext("2d");
    const progress = el("progress", {max: 1, value: 0, "aria-label": "Samples taken"});
    const status = el("p", {class: "readout", role: "status"});
    const strip = el("canvas", {
        width: 288,
        height: 72,
        class: "strip",
        role: "img",
        "aria-label": "The environment, all around",
    });
    const environment = select(
        Object.entries(ENVIRONMENTS).map(([name, {label}]) => [name, label]),
        state.environment,
        (value) => set({environment: value}),
    );
    const spp = select(
        [16, 64, 256, 1024].map((n) => [n, `${n} samples a pixel`]),
        state.spp,
        (value) => set({spp: Number(value)}),
    );
    const surface = select(
        [
            ["sphere", "Sphere"],
            ["plane", "Plane under a map"],
        ],
        state.surface,
        (value) => set({surface: value}),
    );
    const exposure = slider({
        label: "Exposure, stops",
        min: -3,
        max: 3,
        value: 0,
        step: 0.1,
        onchange: (x) => {
            stops = x;
            paint();
        },
    });
    const stop = button("Stop", () => {
        controller?.abort();
        say("Stopped.");
    });
    const curl = curlBox();
    const stage = el(
        "div",
        {class: "sphere-view"},
        el(
            "div",
            {class: "pair"},
            el("figure", {}, canvas, progress, status),
            el(
                "div",
                {class: "card"},
                field("Surface", surface),
                field("Environment", environment),
                strip,
                field("Quality", spp),
                exposure,
                el(
                    "div",
                    {class: "row"},
                    stop,
                    button("Again", () => start()),
                ),
            ),
        ),
        explain(
            "Light leaves a pixel's point toward the eye from every direction above it. The service draws directions of light by the material's own lobe and says how much each weighs; the mean of weight times light is the pixel. More samples, less noise.",
            "In the white furnace light is 1 everywhere: what is missing to white was absorbed by the Fresnel term or lost to light that bounces more than once among the facets.",
            "The plane shades each texel of a map by the lobe of its own slopes, coarse levels first: from afar bumps become roughness.",
        ),
        curl,
    );

    let plane = null; // width, height, radiance of its texels
    let pixels,
        sums,
        taken,
        controller,
        stops = 0,
        drawnKey = "";
    const say = (text) => {
        status.textContent = text;
    };

    function tone(x) {
        return 255 * sRGB(1 - Math.exp(-x * 2 ** stops));
    }

    function paintPlane() {
        const {width, height, radiance} = plane,
            image = new ImageData(width, height);
        for (let k = 0; k < width * height; k++) {
            for (let c = 0; c < 3; c++) image.data[4 * k + c] = tone(radiance[3 * k + c]);
            image.data[4 * k + 3] = 255;
        }
        const small = new OffscreenCanvas(width, height),
            tall = SIZE * Math.cos(TILT);
        small.getContext("2d").putImageData(image, 0, 0);
        context.clearRect(0, 0, SIZE, SIZE);
        context.imageSmoothingEnabled = false;
        context.drawImage(small, 0, (SIZE - tall) / 2, SIZE, tall);
    }

    function paintSphere() {
        const image = context.createImageData(SIZE, SIZE);
        for (let p = 0; p < pixels.index.length; p++) {
            if (!taken[p]) continue;
            const to = 4 * pixels.index[p];
            for (let c = 0; c < 3; c++) image.data[to + c] = tone(sums[3 * p + c] / taken[p]);
            image.data[to + 3] = 255;
        }
        context.putImageData(image, 0, 0);
    }

    function paint() {
        if (plane) paintPlane();
        else if (sums) paintSphere();
        const all = panorama(lookup(state.environment), strip.width, strip.height),
            picture = strip.getContext("2d").createImageData(strip.width, strip.height);
        for (let k = 0; k < strip.width * strip.height; k++) {
            for (let c = 0; c < 3; c++) picture.data[4 * k + c] = tone(all[3 * k + c]);
            picture.data[4 * k + 3] = 255;
        }
        strip.getContext("2d").putImageData(picture, 0, 0);
    }

    const request = (n, seed, sampler) => ({
        material: state.material,
        n,
        seed,
        sequence: "r2",
        outputs: ["wi", "weight"],
        ...forPicture(state.material),
        ...(sampler === "auto" ? {} : {sampler}),
    });

    // Adds n samples for the pixels from .. to.
    async function tile(from, to, n, seed, sampler, signal) {
        const answer = await askArrays(
            "v1/sample",
            request(n, seed, sampler),
            {wo: pixels.wo.subarray(3 * from, 3 * to)},
            signal,
        );
        const {wi, weight} = answer.arrays,
            step = weight.channels,
            light = lookup(state.environment),
            f = pixels.frames;
        for (let p = from, s = 0; p < to; p++) {
            const o = 9 * p;
            for (let k = 0; k < n; k++, s++) {
                if (!(weight[step * s] > 0)) continue;
                const x = wi[3 * s],
                    y = wi[3 * s + 1],
                    z = wi[3 * s + 2];
                const at = texel(
                    x * f[o] + y * f[o + 3] + z * f[o + 6],
                    x * f[o + 1] + y * f[o + 4] + z * f[o + 7],
                    x * f[o + 2] + y * f[o + 5] + z * f[o + 8],
                );
                for (let c = 0; c < 3; c++) sums[3 * p + c] += light[at + c] * weight[step === 3 ? 3 * s + c : s];
            }
            taken[p] += n;
        }
        return answer.size;
    }

    async function shadePlane(signal) {
        const began = performance.now(),
            {alpha, alpha_x, alpha_y, rho, mean_slope, slopes, ...rest} = state.material;
        const {total, refused} = await renderPlane({
            signal,
            samples: state.spp,
            environment: state.environment,
            accuracy: {tolerance: 1e-3},
            material: {...rest, ndf: "beckmann"},
            tell: (part, text) => {
                ((progress.value = part), say(text));
            },
            paint: (width, height, radiance) => {
                ((plane = {width, height, radiance}), paint());
            },
        });
        progress.value = 1;
        say(
            `${total} texels of ${mapFile.file?.name ?? "the map built in"}, each a request with ${state.spp} samples, in ${milliseconds(performance.now() - began)}.` +
                (refused ? ` ${refused} are too steep to have a lobe.` : "") +
                " Roughness comes from the map; of the material the Fresnel term, masking and diffuse part are taken.",
        );
    }

    async function render(signal) {
        plane = null;
        if (state.surface === "plane") return shadePlane(signal);
        const samplers = await samplersOf(state.material),
            sampler = samplerFor(samplers);
        pixels ??= pixelsOfSphere();
        sums = new Float64Array(3 * pixels.index.length);
        taken = new Uint32Array(pixels.index.length);
        const count = pixels.index.length,
            tiles = Math.ceil(count / TILE),
            began = performance.now();
        let received = 0,
            samples = 0;
        for (let done = 0, n = 1; done < state.spp; done += n, n = Math.min(16, 2 * n, state.spp - done)) {
            let next = 0;
            const work = async () => {
                while (next < tiles) {
                    const from = TILE * next++,
                        to = Math.min(count, from + TILE);
                    received += await tile(from, to, n, 1 + 7919 * done + from, sampler, signal);
                    samples += n * (to - from);
                    progress.value = samples / (state.spp * count);
                    if (done + n < 4) paint();
                }
            };
            await Promise.all(Array.from({length: AT_ONCE}, work));
            paint();
            say(
                `${done + n} of ${state.spp} samples a pixel, ${bytes(received)} received, ${milliseconds(performance.now() - began)}`,
            );
        }
        say(
            `${(samples / 1e6).toFixed(1)} million samples, ${bytes(received)} of float32, in ${milliseconds(performance.now() - began)}: ` +
                `${((samples / 1e6 / (performance.now() - began)) * 1000).toFixed(1)} million a second with this page's own work.`,
        );
    }

    const keyNow = () =>
        JSON.stringify([
            state.material,
            state.environment,
            state.spp,
            state.sampler,
            state.surface,
            state.surface === "plane" && mapFile.file?.name,
            mapFile.query,
        ]);

    async function start() {
        controller?.abort();
        const mine = (controller = new AbortController());
        drawnKey = keyNow();
        progress.value = 0;
        problem.clear();
        stop.disabled = false;
        try {
            await render(mine.signal);
        } catch (error) {
            if (error.name !== "AbortError") problem.show(error);
            if (controller === mine) drawnKey = "";
        }
        if (controller === mine) stop.disabled = true;
    }

    return {
        stage,
        update() {
            environment.value = state.environment;
            spp.value = state.spp;
            surface.value = state.surface;
            canvas.setAttribute(
                "aria-label",
                state.surface === "plane"
                    ? "The shaded plane, its normal 30 degrees from the view"
                    : "The shaded sphere",
            );
            exposure.set(stops);
            if (state.surface === "plane")
                curl.set([
                    [
                        "The slope moments of every texel and level",
                        line("v1/leadr?compression=none&y=up", {
                            file: mapFile.file?.name ?? "heights.png",
                            output: "leadr.exr",
                        }),
                    ],
                    [
                        "Light for one texel, from its moments E1 to E5",
                        line("v1/sample", {
                            request: {
                                material: {ndf: "beckmann", moments: [0.1, 0, 0.05, 0.03, 0]},
                                wo: [PLANE_WO.map((x) => Number(x.toFixed(9)))],
                                n: 64,
                                sequence: "r2",
                                tolerance: 1e-3,
                            },
                        }),
                    ],
                ]);
            else
                curl.set([
                    [
                        "Eight directions of light for one pixel, with their weights",
                        line("v1/sample", {request: {wo: [[0, 0.6, 0.8]], ...request(8, 1, "auto")}}),
                    ],
                    [
                        "The same for the directions of view in a file of float32",
                        `${line("v1/sample", {accept: "application/octet-stream", output: "samples.bin"})} -F wo=@wo.f32 -F 'request=${JSON.stringify(request(8, 1, "auto"))}'`,
                    ],
                ]);
            if (drawnKey !== keyNow()) return start();
            paint();
        },
        stop() {
            if (!stop.disabled) controller?.abort();
        },
    };
}
