// view_lobe.js - f_r cos theta of a material: in the plane of incidence, from above, as curves, with samples.
import {Chart, swatch} from "./chart.js";
import {curlBox, line} from "./curl.js";
import {Disk} from "./disk.js";
import {button, check, el, explain, field, select} from "./dom.js";
import {axesOf} from "./ellipse.js";
import {roughness, samplerFor, samplersOf, smallestAlpha} from "./material.js";
import {DEGREE, degrees, luminance, milliseconds, short} from "./numbers.js";
import {Polar} from "./polar.js";
import {Solid} from "./solid.js";
import {askArrays} from "./service.js";
import {angles, direction, forPicture, set, state, woOf} from "./state.js";

export const title = "Lobe";
export const lead = "Where light from wo goes: drag the handle, shape the material, and see what each factor does.";
export const usesMaterial = true;

const OVERLAYS = [
    {name: "fr_cos", label: "f_r cos θi", unit: "sr⁻¹", color: 1},
    {name: "fr", label: "f_r", unit: "sr⁻¹", color: 6, dash: "1 4"},
    {name: "pdf", label: "pdf of the sampler", unit: "sr⁻¹", color: 2, dash: "7 4"},
    {name: "D", label: "D(h)", unit: "sr⁻¹", color: 3, dash: "10 3 2 3"},
    {name: "G", label: "G", unit: "", color: 4, dash: "3 3"},
    {name: "F", label: "F", unit: "", color: 5, dash: "12 4"},
];
const DECADES = 5;
const FROM_ABOVE =
    "From above, equal-area: colour is f_r cos θi over four decades, dots are samples, crosses outside the horizon are wasted.";
const IN_SPACE = "All around: distance from the centre is f_r cos θi. Drag, or use the arrow keys, to turn it.";
const SAMPLES = [0, 128, 512, 2048, 8192];

// Signed angles of wi in the plane: every degree, and dense where the lobe is.
function planeAngles() {
    const {material, theta, phi} = state,
        slope = material.mean_slope ?? [0, 0];
    const tilt = Math.atan(-(slope[0] * Math.cos(phi) + slope[1] * Math.sin(phi)));
    const width = axesOf(roughness(material)).minor,
        out = [];
    for (let d = -90; d <= 90; d++) out.push(d * DEGREE);
    for (let k = -40; k <= 40; k++) {
        const t = 2 * (tilt + Math.atan(width * Math.sinh(k / 13))) - theta;
        if (Math.abs(t) < Math.PI / 2) out.push(t);
    }
    return out.sort((a, b) => a - b);
}

// Where the mean normal reflects wo to: theta and phi.
function mirrored() {
    const [sx, sy] = state.material.mean_slope ?? [0, 0],
        length = Math.hypot(sx, sy, 1),
        m = [-sx / length, -sy / length, 1 / length];
    const [wo] = woOf(),
        d = 2 * (wo[0] * m[0] + wo[1] * m[1] + wo[2] * m[2]),
        wi = wo.map((x, k) => d * m[k] - x);
    return [Math.acos(Math.max(-1, Math.min(1, wi[2]))), Math.atan2(wi[1], wi[0])];
}

const round = (x) => Number(x.toFixed(5));

const planeOf = (ts) => Float32Array.from(ts.flatMap((t) => direction(t, state.phi)));

// The request of each picture; also what the curl lines show.
function requests(grid, sampler) {
    const common = {material: state.material, wo: woOf(), ...forPicture(state.material)},
        named = !sampler || sampler === "auto" ? {} : {sampler};
    // eval knows the density of the sampler taken by default.
    const outputs = [
        "fr_cos",
        ...state.overlays.filter((name) => name !== "fr_cos" && (name !== "pdf" || !named.sampler)),
    ];
    return {
        grid: {...common, wi: {grid}, outputs: ["fr_cos"]},
        samples: {...common, n: state.samples, seed: state.seed, ...named, outputs: ["wi", "weight"]},
        pdf: {...common, ...named},
        slice: {...common, outputs},
    };
}

function curlLines(grid, sampler) {
    const r = requests(grid, sampler),
        lit = {theta: "THETA", phi: [round(angles(-state.theta || 1e-9, state.phi).phi)]};
    const lines = [
        ["All directions of light, 64 × 128, one number each", line("v1/eval", {request: r.grid})],
        [
            "The plane of incidence, every two degrees on the lit side",
            line("v1/eval", {request: {...r.slice, wi: lit}}).replace('"THETA"', "['$(seq -s, 0 0.035 1.57)']"),
        ],
    ];
    if (state.samples && sampler)
        lines.push([
            `${state.samples} sampled directions with weight and density`,
            line("v1/sample", {request: {...r.samples, outputs: ["wi", "weight", "pdf"]}}),
        ]);
    return lines;
}

export function create({problem}) {
    const move = (theta) => set({theta: round(theta)});
    const polar = new Polar(move);
    const disk = new Disk(320, (theta, phi) => {
        // The plane keeps its side: the handle of the polar plot stays where it is.
        const side = state.theta > 0 ? 1 : -1;
        set({theta: round(side * theta), phi: round(side > 0 ? phi : phi - Math.PI)});
    });
    const chart = new Chart({title: "Factors over the angle of wi in the plane of incidence", height: 300});
    const facts = el("p", {class: "facts", role: "status"}),
        rate = el("p", {class: "rate"}),
        scale = el("p", {class: "readout"});
    const wasted = el("p", {class: "readout"});
    const curl = curlBox();
    const sampler = select([["auto", "auto"]], "auto", (value) => set({sampler: value}));
    const count = select(
        SAMPLES.map((n) => [n, n ? String(n) : "none"]),
        state.samples,
        (value) => set({samples: Number(value)}),
    );
    const solid = new Solid(320),
        inSpace = check("As a body in space", state.solid, (on) => set({solid: on})),
        caption = el("figcaption");
    const logarithmic = check("In decades", state.log, (on) => set({log: on}));
    const overlays = OVERLAYS.map(({name, label, color, dash}) =>
        check(
            label,
            state.overlays.includes(name),
            (on) =>
                set({
                    overlays: OVERLAYS.map((o) => o.name).filter((o) => (o === name ? on : state.overlays.includes(o))),
                }),
            swatch(color, "line", dash),
        ),
    );

    const stage = el(
        "div",
        {class: "lobe-view"},
        el(
            "div",
            {class: "pair"},
            el(
                "figure",
                {},
                polar.svg,
                el("figcaption", {}, "In the plane of incidence: f_r cos θi, and f_r and pdf where chosen below."),
                logarithmic,
                facts,
            ),
            el("figure", {}, disk.canvas, solid.canvas, caption, inSpace, scale, wasted),
        ),
        el("fieldset", {class: "overlays"}, el("legend", {}, "Curves"), overlays),
        chart.node,
        el(
            "div",
            {class: "row"},
            field("Sampler", sampler),
            field("Samples", count),
            button("New seed", () => set({seed: state.seed + 1})),
            rate,
        ),
        explain(
            "A microfacet surface is made of mirrors too small to see. α says how much they tilt: 0.01 is polished, 0.1 satin, 0.5 matte. Seen from wo, each direction of light wi is reflected by the mirrors that face the half vector h between the two.",
            "D(h) counts those mirrors, G is the part of them that is neither hidden nor in shadow, F how much each reflects (the Fresnel term); together f_r = D·G·F / (4 cos θi cos θo), the BRDF. The blue lobe is f_r cos θi: where the light goes.",
            "A renderer draws directions with a density, the pdf. The closer the pdf follows the lobe, the less noise; a direction below the horizon is wasted. Try the samplers at a low angle.",
        ),
        curl,
    );

    // ---- Asking and drawing, one at a time, always the newest --------------------------------------

    const frames = [],
        requestTimes = [];
    let told = 0;
    function note(ms, moving) {
        requestTimes.push(...ms);
        requestTimes.splice(0, Math.max(0, requestTimes.length - 120));
        const now = performance.now();
        frames.push(now);
        while (now - frames[0] > 1000) frames.shift();
        rate.dataset.total = Number(rate.dataset.total ?? 0) + 1;
        if (moving && now - told < 250) return;
        told = now;
        const sorted = [...requestTimes].sort((a, b) => a - b),
            median = sorted[sorted.length >> 1];
        rate.textContent = `${frames.length} redraw${frames.length > 1 ? "s" : ""} in the last second, ${milliseconds(median)} a request`;
        rate.dataset.median = median;
        rate.dataset.worst = sorted[Math.floor(sorted.length * 0.95)];
        for (const [node, text] of texts) node.textContent = text;
    }

    // Written a few times a second while wo moves: text costs a layout, and a screen reader reads it aloud.
    let texts = [];
    function draw({theta, phi}, ts, {slice, pdf, grid, gridShape, samples, around, fine}) {
        const values = {};
        for (const {name} of OVERLAYS)
            if (slice.arrays[name]) values[name] = luminance(slice.arrays[name], slice.arrays[name].channels);
        if (pdf) values.pdf = pdf.arrays.pdf;
        const shown = OVERLAYS.filter(({name}) => state.overlays.includes(name) && values[name]);
        polar.setView(state.theta);
        polar.draw(
            ts,
            [
                {values: values.fr_cos, color: 1, fill: true},
                ...shown
                    .filter(({name}) => name === "fr" || name === "pdf")
                    .map(({name, color, dash}) => ({values: values[name], color, dash})),
            ],
            state.log,
        );
        const most = Math.max(1e-9, ...shown.flatMap(({name}) => Math.max(...values[name]))),
            top = 10 ** Math.ceil(Math.log10(most) + 0.05);
        chart.draw({
            x: {
                label: "θi in the plane of incidence",
                name: "θi",
                min: -Math.PI / 2,
                max: Math.PI / 2,
                ticks: [-90, -60, -30, 0, 30, 60, 90].map((d) => d * DEGREE),
                format: degrees,
            },
            y: {label: "sr⁻¹; G and F without unit", log: true, min: top / 1e6, max: top},
            series: shown.map(({name, label, color, dash}) => ({name: label, color, dash, xs: ts, ys: values[name]})),
            rules: [{x: -theta, name: "mirror"}],
        });
        const wo = angles(theta, phi);
        if (!solid.canvas.hidden)
            solid.draw(luminance(grid.arrays.fr_cos, grid.arrays.fr_cos.channels), gridShape.theta, gridShape.phi, {
                wo: [wo.theta, wo.phi],
                peak: Math.max(...values.fr_cos),
                decades: state.log ? DECADES : 0,
            });
        const peak = disk.draw(
            luminance(grid.arrays.fr_cos, grid.arrays.fr_cos.channels),
            gridShape.theta,
            gridShape.phi,
            {
                samples: samples && {wi: samples.arrays.wi, weight: samples.arrays.weight},
                wo: [wo.theta, wo.phi],
                least: Math.max(...values.fr_cos),
                fine: fine && {
                    pixels: around.pixels,
                    values: luminance(fine.arrays.fr_cos, fine.arrays.fr_cos.channels),
                },
            },
        );
        const waste = samples
            ? `${samples.wasted} of ${samples.count} samples wasted (${short((100 * samples.wasted) / samples.count)} %), sampler ${samples.sampler}`
            : "";
        let best = 0;
        values.fr_cos.forEach((v, i) => {
            if (v > values.fr_cos[best]) best = i;
        });
        texts = [
            [scale, `brightest ${short(peak)} sr⁻¹`],
            [wasted, waste],
            [
                facts,
                `wo at ${degrees(theta)}: f_r cos θi is largest, ${short(values.fr_cos[best])} sr⁻¹, at ${degrees(ts[best])}. ` +
                    `Computed by tier ${slice.accuracy.tier}, each number within ${short(slice.accuracy.bound)} of the exact one.`,
            ],
        ];
    }

    // Asks for everything; what it returns draws it.
    async function fetchAll() {
        const samplers = await samplersOf(state.material),
            chosen = samplerFor(samplers);
        const options = [["auto", "auto"], ...samplers.map((s) => [s, s])];
        if (sampler.options.length !== options.length || [...sampler.options].some((o, i) => o.value !== options[i][0]))
            sampler.replaceChildren(...options.map(([v, text]) => el("option", {value: v}, text)));
        sampler.value = chosen;
        sampler.disabled = count.disabled = !samplers.length;
        const moving = polar.dragging || disk.dragging,
            narrow = smallestAlpha(state.material) < 0.1;
        const gridShape = narrow && !moving ? {theta: 128, phi: 256} : {theta: 64, phi: 128};
        const seen = {theta: state.theta, phi: state.phi},
            ts = planeAngles(),
            wi = planeOf(ts),
            r = requests(gridShape, chosen);
        const around = narrow && disk.window(mirrored());
        const [slice, grid, samples, pdf, fine] = await Promise.all([
            askArrays("v1/eval", r.slice, {wi}),
            askArrays("v1/eval", r.grid),
            state.samples && samplers.length ? askArrays("v1/sample", r.samples) : null,
            state.overlays.includes("pdf") && chosen !== "auto" ? askArrays("v1/pdf", r.pdf, {wi}) : null,
            around ? askArrays("v1/eval", {...r.slice, outputs: ["fr_cos"]}, {wi: around.wi}) : null,
        ]);
        return () => {
            draw(seen, ts, {slice, pdf, grid, gridShape, samples, around, fine});
            note(
                [slice, grid, samples, pdf, fine].filter(Boolean).map((a) => a.ms),
                moving,
            );
            problem.clear();
            if (!moving) curl.set(curlLines({theta: 64, phi: 128}, samplers.length ? chosen : ""));
        };
    }

    let busy = false,
        stale = false;
    async function update() {
        polar.setView(state.theta);
        stale = true;
        if (busy) return;
        busy = true;
        let coming = null;
        const request = () => {
            stale = false;
            coming = fetchAll();
            coming.catch(() => {}); // shown when its turn comes
        };
        while (stale || coming) {
            if (!coming) request();
            try {
                const drawIt = await coming;
                coming = null;
                if (stale) request(); // under way while this is drawn
                drawIt();
            } catch (error) {
                coming = null;
                problem.show(error);
            }
            await new Promise(requestAnimationFrame);
        }
        busy = false;
    }
    disk.canvas.addEventListener("lostpointercapture", update);
    polar.handle.addEventListener("lostpointercapture", update);
    return {
        stage,
        update: (changed) => {
            if (!changed) disk.colors = null; // perhaps other ones
            inSpace.input.checked = state.solid;
            solid.canvas.hidden = !state.solid || !solid.open();
            disk.canvas.hidden = !solid.canvas.hidden;
            caption.textContent = !solid.canvas.hidden
                ? IN_SPACE
                : state.solid
                  ? `This browser has no WebGL 2. ${FROM_ABOVE}`
                  : FROM_ABOVE;
            logarithmic.input.checked = state.log;
            count.value = state.samples;
            overlays.forEach((node, i) => {
                node.input.checked = state.overlays.includes(OVERLAYS[i].name);
            });
            return update();
        },
    };
}
