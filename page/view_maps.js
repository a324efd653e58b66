// view_maps.js - a displacement map in, what its texels mean as lobes at every distance out (LEADR).
import {curlBox, line} from "./curl.js";
import {button, dropZone, el, explain, field, saveAs, select, slider, table} from "./dom.js";
import {DEGREE, bytes, luminance, milliseconds, short, viridis} from "./numbers.js";
import {mapFile} from "./plane.js";
import {Polar} from "./polar.js";
import {askArrays, upload} from "./service.js";
import {direction, set, state} from "./state.js";

export const title = "Maps";
export const lead =
    "Drop a displacement map: seen from afar its bumps become roughness. Pick a level and a texel and see the lobe it stands for (LEADR).";
export const usesMaterial = false;

const PREVIEWS = [
    ["roughness", "Roughness"],
    ["normal", "Mean normal"],
    ["anisotropy", "Anisotropy"],
];
const BORDERS = [
    ["periodic", "repeats"],
    ["clamp", "ends, continued by a parabola"],
    ["mirror", "is reflected"],
];
const KINDS = [
    ["displacement", "heights"],
    ["normal", "normals"],
    ["slope", "slopes"],
];

// A grey picture in viridis, up to the roughness that all but a hundredth of the texels stay below.
function coloured(bitmap, range) {
    const canvas = new OffscreenCanvas(bitmap.width, bitmap.height),
        context = canvas.getContext("2d");
    context.drawImage(bitmap, 0, 0);
    const image = context.getImageData(0, 0, bitmap.width, bitmap.height),
        {data} = image,
        counts = new Uint32Array(256);
    for (let i = 0; i < data.length; i += 4) counts[data[i]]++;
    let top = 255;
    for (let above = counts[255]; top > 1 && above <= data.length / 400; above += counts[top]) top--;
    for (let i = 0; i < data.length; i += 4) {
        const c = 3 * Math.min(255, Math.round((data[i] / top) * 255));
        ((data[i] = viridis[c]), (data[i + 1] = viridis[c + 1]), (data[i + 2] = viridis[c + 2]));
    }
    context.putImageData(image, 0, 0);
    return {bitmap: canvas, range: (range * top) / 255};
}

export function create({problem, go}) {
    let file,
        answer,
        probe,
        controller,
        pictures = {},
        shownKey = "",
        levelKey = "",
        textures = new Map();
    const drop = dropZone("Drop an EXR or PNG map here, or click to choose one", ".exr,.png", (chosen) => {
        file = chosen;
        textures.clear();
        set({level: 0, at: null});
        filter();
    });
    const option = (members) => set({map: {...state.map, ...members}});
    const kind = select(KINDS, state.map.kind, (value) => option({kind: value}));
    const border = select(BORDERS, state.map.border, (value) => option({border: value}));
    const scale = slider({
        label: "Height of the map, for a width of 1",
        min: 1e-4,
        max: 1,
        value: 0.1,
        scale: "log",
        onchange: (x) => option({scale: x}),
    });
    const progress = el("progress", {max: 1, value: 0, "aria-label": "Progress of the filter"}),
        status = el("p", {class: "readout", role: "status"}, "No map yet.");
    const save = button("Download the EXR", download, {class: "main", disabled: true});
    const controls = el(
        "div",
        {class: "card"},
        el("h2", {}, "Map"),
        drop,
        el("p", {class: "small"}, "It is sent to this daemon and nowhere else."),
        field("It holds", kind),
        field("Beyond its edge it", border),
        scale,
        progress,
        status,
        save,
    );

    const level = el("input", {
        type: "range",
        min: 0,
        max: 0,
        step: 1,
        value: 0,
        oninput: () => set({level: Number(level.value), at: null}),
    });
    const levelName = el("output"),
        images = el("div", {class: "triptych"}),
        probeHere = el("div", {class: "card probe"}),
        levels = el("div"),
        curl = curlBox();
    const polar = new Polar((theta) => {
        lobeTheta = theta;
        drawLobe();
    });
    polar.svg.setAttribute("aria-label", "Lobe of the texel: f_r cos θ in the plane of incidence along x");
    let lobeTheta = -0.7;
    const stage = el(
        "div",
        {class: "maps-view"},
        el(
            "div",
            {class: "empty"},
            el(
                "p",
                {},
                "Roughness, mean normal and anisotropy of each level appear here; a texel that you pick shows its lobe.",
            ),
        ),
    );
    const shade = button("Shade a plane under this map", () => go("sphere", {surface: "plane"}));
    const content = [
        el(
            "figure",
            {},
            el("div", {class: "row"}, field("Level: each step halves the map", level), levelName),
            images,
            el("figcaption", {}, "Pick a texel with the pointer, or with the arrow keys on a picture."),
            el("div", {class: "row"}, shade),
        ),
        probeHere,
        levels,
        explain(
            "A displacement map says how high a surface is. A texel of a coarser level stands for many bumps: their mean slope tilts it, the spread of their slopes is its roughness, along two axes. Five numbers a texel hold that (mean slopes and second moments), and they may be averaged like colours: that is LEADR.",
            "The EXR holds them for every level; a renderer looks them up like any texture and shades each pixel with the right lobe at any distance.",
        ),
        curl,
    ];

    const query = (extra = "") =>
        `v1/leadr?kind=${state.map.kind}&scale=${state.map.scale}&border=${state.map.border}&form=central${extra}`;

    function showCurl() {
        const name = file?.name ?? "heights.exr",
            at = state.at ?? [0.5, 0.5];
        curl.set([
            ["All levels as one MIP-mapped EXR", line(query(), {file: name, output: "leadr.exr"})],
            [
                "The material of this texel, as /v1/eval takes it",
                line(query(`&at=${at.join(",")}&level=${state.level}`), {file: name}),
            ],
            [
                "A picture of one level",
                line(query(`&preview=roughness&level=${state.level}`), {file: name, output: "roughness.png"}),
            ],
        ]);
    }

    // ---- Pictures ----------------------------------------------------------------------------------

    const sizeOf = (n) => answer.levels[n];
    function texelAt(u, v) {
        const {width, height} = sizeOf(state.level);
        return [
            (Math.min(width - 1, Math.floor(u * width)) + 0.5) / width,
            (Math.min(height - 1, Math.floor(v * height)) + 0.5) / height,
        ].map((x) => Number(x.toFixed(6)));
    }

    function canvasFor(name, label) {
        const canvas = el("canvas", {
            class: "map",
            width: 512,
            height: 512,
            tabindex: 0,
            role: "application",
            "aria-label": `${label}; arrow keys pick a texel`,
        });
        canvas.addEventListener("click", (event) => {
            const box = canvas.getBoundingClientRect();
            pick((event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height);
        });
        canvas.addEventListener("keydown", (event) => {
            const by = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1]}[event.key];
            if (!by || !answer) return;
            event.preventDefault();
            const {width, height} = sizeOf(state.level),
                [u, v] = state.at ?? [0.5, 0.5];
            pick((u + by[0] / width + 1) % 1, (v + by[1] / height + 1) % 1);
        });
        const note = el("span", {class: "readout"});
        return {canvas, note, node: el("div", {}, el("h3", {}, label), canvas, note)};
    }

    function pick(u, v) {
        set({at: texelAt(Math.min(0.999999, Math.max(0, u)), Math.min(0.999999, Math.max(0, v)))});
    }

    function paint(name) {
        const {canvas, bitmap} = pictures[name];
        if (!bitmap) return;
        const {width, height} = sizeOf(state.level),
            context = canvas.getContext("2d");
        canvas.width = 512;
        canvas.height = Math.max(16, Math.round((512 * height) / width));
        context.imageSmoothingEnabled = bitmap.width > canvas.width;
        context.drawImage(bitmap, 0, 0, canvas.width, canvas.height);
        if (!state.at) return;
        const w = canvas.width / width,
            h = canvas.height / height,
            side = Math.max(10, w),
            tall = Math.max(10, h);
        const x = state.at[0] * canvas.width - side / 2,
            y = state.at[1] * canvas.height - tall / 2;
        for (const [color, wide] of [
            ["#000", 5],
            ["#fff", 2],
        ]) {
            context.strokeStyle = color;
            context.lineWidth = wide;
            context.strokeRect(x, y, side, tall);
        }
    }

    async function showLevel(signal) {
        const key = `${shownKey} ${state.level}`,
            {width, height} = sizeOf(state.level);
        levelName.textContent = `${state.level}: ${width} × ${height} texels`;
        level.setAttribute("aria-valuetext", levelName.textContent);
        if (key !== levelKey) {
            levelKey = key;
            await Promise.all(
                PREVIEWS.map(async ([name]) => {
                    const cached = `${key} ${name}`;
                    if (!textures.has(cached)) {
                        const result = await upload(query(`&preview=${name}&level=${state.level}`), file, {
                            accept: "image/png",
                            signal,
                        });
                        const bitmap = await createImageBitmap(new Blob([result.body], {type: "image/png"}));
                        textures.set(
                            cached,
                            name === "roughness"
                                ? coloured(bitmap, Number(result.header("Facet-Preview-Range")))
                                : {bitmap},
                        );
                    }
                    if (levelKey !== key) return;
                    Object.assign(pictures[name], textures.get(cached));
                    pictures[name].note.textContent =
                        name === "roughness"
                            ? `dark: 0, yellow: √(V11 + V22) ≥ ${short(textures.get(cached).range)}`
                            : name === "anisotropy"
                              ? "hue: direction, saturation: 1 − α₂/α₁"
                              : "n/2 + ½ as colour";
                }),
            );
        }
        PREVIEWS.forEach(([name]) => paint(name));
    }

    // ---- One texel -----------------------------------------------------------------------------------

    async function drawLobe() {
        polar.setView(lobeTheta);
        if (!probe?.material) return;
        const ts = Array.from({length: 181}, (_, k) => (k - 90) * DEGREE);
        const result = await askArrays(
            "v1/eval",
            {material: probe.material, outputs: ["fr_cos"], tolerance: 1e-3, wo: [direction(lobeTheta, 0)]},
            {wi: Float32Array.from(ts.flatMap((t) => direction(t, 0)))},
        );
        polar.draw(
            ts,
            [{values: luminance(result.arrays.fr_cos, result.arrays.fr_cos.channels), color: 1, fill: true}],
            false,
        );
    }

    async function showProbe(signal) {
        if (!state.at) {
            probe = null;
            probeHere.replaceChildren(el("p", {}, "No texel picked."));
            return;
        }
        const result = await upload(query(`&at=${state.at.join(",")}&level=${state.level}`), file, {signal});
        ({probe} = result.json());
        const m = probe.material,
            mine = probe;
        probeHere.replaceChildren(
            el("h2", {}, `Texel ${probe.column}, ${probe.row} of level ${probe.level}`),
            ...(m
                ? [
                      el(
                          "div",
                          {class: "pair"},
                          polar.svg,
                          el(
                              "dl",
                              {class: "facts-list"},
                              [
                                  ["αx", short(m.alpha_x)],
                                  ["αy", short(m.alpha_y)],
                                  ["ρ", short(m.rho)],
                                  ["Mean slope", m.mean_slope.map((x) => short(x)).join(", ")],
                              ].map(([name, value]) => el("div", {}, el("dt", {}, name), el("dd", {}, value))),
                          ),
                      ),
                      el(
                          "div",
                          {class: "row"},
                          button("Use this material", () => go("lobe", {material: useful(mine.material)}), {
                              class: "main",
                          }),
                      ),
                  ]
                : [el("p", {}, "No Beckmann lobe has this texel's slopes.")]),
        );
        await drawLobe();
    }

    const useful = (m) => ({...m, fresnel: state.material.fresnel});

    // ---- The whole map ------------------------------------------------------------------------------

    function showTable() {
        levels.replaceChildren(
            table(
                "Levels: the finer the bumps that a texel holds, the rougher it is",
                ["level", "size", "mean variance of slopes", "as α, isotropic", "worst loss of storing"],
                answer.levels.map((l, n) => ({
                    className: n === state.level ? "chosen" : undefined,
                    cells: [
                        String(n),
                        `${l.width} × ${l.height}`,
                        short(l.variance),
                        short(Math.sqrt(l.variance)),
                        short(l.worst_loss),
                    ],
                })),
            ),
        );
    }

    async function download() {
        try {
            const {body} = await upload(query(), file, {accept: "image/x-exr"});
            saveAs(new Blob([body], {type: "image/x-exr"}), file.name.replace(/\.[^.]*$/, "") + "-leadr.exr");
            status.textContent = `${bytes(body.byteLength)} of EXR saved.`;
        } catch (error) {
            problem.show(error);
        }
    }

    async function filter() {
        if (!file) return;
        controller?.abort();
        const mine = (controller = new AbortController());
        problem.clear();
        progress.value = 0;
        status.textContent = `Sending ${file.name}, ${bytes(file.size)}.`;
        try {
            const result = await upload(query(), file, {
                signal: mine.signal,
                progress: (part) => {
                    progress.value = part * 0.9;
                },
            });
            answer = result.json();
            progress.value = 1;
            status.textContent = `${file.name}, ${answer.width} × ${answer.height}, ${answer.sample}: filtered in ${milliseconds(result.ms)}.`;
            shownKey = `${file.name} ${file.size} ${query()}`;
            Object.assign(mapFile, {file, query: query().replace(/^.*\?/, "").replace("&form=central", "")});
            save.disabled = false;
            level.max = answer.levels.length - 1;
            if (state.level >= answer.levels.length) state.level = 0;
            pictures = Object.fromEntries(PREVIEWS.map(([name, label]) => [name, canvasFor(name, label)]));
            images.replaceChildren(...PREVIEWS.map(([name]) => pictures[name].node));
            stage.replaceChildren(...content);
            levelKey = "";
            await follow(mine.signal);
        } catch (error) {
            if (error.name === "AbortError") return;
            progress.value = 0;
            status.textContent = `${file.name}: not filtered.`;
            problem.show(error);
        }
    }

    async function follow(signal) {
        level.value = state.level;
        showCurl();
        showTable();
        await Promise.all([showLevel(signal), showProbe(signal)]);
    }

    return {
        controls,
        stage,
        async update() {
            kind.value = state.map.kind;
            border.value = state.map.border;
            scale.set(state.map.scale);
            showCurl();
            if (!file) return;
            if (!answer || shownKey !== `${file.name} ${file.size} ${query()}`) return filter();
            await follow(controller.signal);
        },
    };
}
