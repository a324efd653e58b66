// material.js - the material that is looked at, edited: what there is to choose from comes from the service.
import {check, el, field, select, slider} from "./dom.js";
import {axesOf, bivariateOf, Ellipse} from "./ellipse.js";
import {ask, capabilities, schema} from "./service.js";
import {changes, set, state} from "./state.js";

const METALS = {
    Ag: "Silver",
    Al: "Aluminium",
    Au: "Gold",
    Cr: "Chromium",
    Cu: "Copper",
    Fe: "Iron",
    Ni: "Nickel",
    Ti: "Titanium",
    W: "Tungsten",
};
const GLASSES = [
    [1.333, "Water"],
    [1.5, "Glass"],
    [1.77, "Sapphire"],
    [2.417, "Diamond"],
];
const ROUGHNESS = ["alpha", "alpha_x", "alpha_y", "rho"];
const f0s = new Map();

// Reflectance of a metal at normal incidence, three digits: what Schlick's term takes.
async function metalF0(metal) {
    if (!f0s.has(metal)) {
        const up = [[0, 0, 1]];
        const {answer} = await ask("v1/eval", {
            material: {ndf: "ggx", alpha: 0.5, fresnel: {conductor: {metal}}},
            wi: up,
            wo: up,
            outputs: ["F"],
            tolerance: 1e-4,
        });
        f0s.set(
            metal,
            answer.F[0].map((x) => Number(x.toFixed(3))),
        );
    }
    return f0s.get(metal);
}

// In every form the service knows (moments, principal axes): as alpha or alpha_x, alpha_y, rho.
export async function settle(material) {
    if (!["alpha_1", "moments", "base"].some((name) => name in material)) return material;
    const {answer} = await ask("v1/material", {material});
    const rest = Object.fromEntries(
        Object.entries(material).filter(
            ([name]) =>
                !["alpha_1", "alpha_2", "phi", "moments", "height_scale", "jacobian", "base", ...ROUGHNESS].includes(
                    name,
                ),
        ),
    );
    const {alpha_x, alpha_y, rho} = answer.bivariate;
    return {
        ...rest,
        ...(answer.isotropic ? {alpha: alpha_x} : {alpha_x, alpha_y, rho}),
        ...(answer.central ? {} : {mean_slope: answer.mean_slope}),
    };
}

export function roughness(material) {
    if (material.alpha_x !== undefined)
        return {alpha_x: material.alpha_x, alpha_y: material.alpha_y, rho: material.rho ?? 0};
    const alpha = material.alpha ?? 1;
    return {alpha_x: alpha, alpha_y: alpha, rho: 0};
}

export function smallestAlpha(material) {
    return axesOf(roughness(material)).minor;
}

export async function samplersOf(material) {
    return (await capabilities()).models.find((model) => model.ndf === material.ndf)?.samplers ?? [];
}

// The sampler to ask for: the one chosen, unless this distribution has none of that name.
export function samplerFor(samplers) {
    return samplers.includes(state.sampler) ? state.sampler : "auto";
}

function change(members, without = []) {
    const material = {...state.material, ...members};
    for (const name of without) delete material[name];
    set({material});
}

// ---- Fresnel ---------------------------------------------------------------------------------

function fresnelKind(fresnel) {
    return !fresnel || fresnel === "ideal" ? "ideal" : Object.keys(fresnel)[0];
}

const three = (x) => (Array.isArray(x) ? x : [x, x, x]);

function presetOf(fresnel) {
    switch (fresnelKind(fresnel)) {
        case "ideal":
            return "ideal";
        case "schlick": {
            const known = [...f0s].find(([, f0]) => JSON.stringify(f0) === JSON.stringify(three(fresnel.schlick.f0)));
            return known ? `f0:${known[0]}` : "custom";
        }
        case "dielectric": {
            const known = GLASSES.find(([eta]) => eta === fresnel.dielectric.eta);
            return known ? `eta:${known[0]}` : "eta";
        }
        case "conductor":
            return fresnel.conductor.metal ? `metal:${fresnel.conductor.metal}` : "other";
        default:
            return "other";
    }
}

async function choosePreset(value) {
    const [kind, name] = value.split(":");
    const fresnel =
        kind === "ideal"
            ? "ideal"
            : kind === "f0"
              ? {schlick: {f0: await metalF0(name)}}
              : kind === "metal"
                ? {conductor: {metal: name}}
                : kind === "eta"
                  ? {dielectric: {eta: Number(name ?? 1.5)}}
                  : kind === "custom"
                    ? {schlick: {f0: [0.5, 0.5, 0.5]}}
                    : state.material.fresnel;
    change({fresnel}, kind === "eta" ? [] : ["transmission"]);
}

function fresnelFields(metals, hasTransmission) {
    const {fresnel} = state.material,
        preset = presetOf(fresnel),
        setters = [];
    const named = metals.map((symbol) => [symbol, METALS[symbol] ?? symbol]).sort((a, b) => a[1].localeCompare(b[1]));
    const options = [
        {
            label: "Metals, Schlick's F0",
            options: [...named.map(([s, name]) => [`f0:${s}`, name]), ["custom", "Custom F0"]],
        },
        {label: "Metals, complex index", options: named.map(([s, name]) => [`metal:${s}`, `${name} (${s})`])},
        {
            label: "Glass",
            options: [...GLASSES.map(([eta, name]) => [`eta:${eta}`, `${name}, η ${eta}`]), ["eta", "Custom η"]],
        },
        {label: "Other", options: [["ideal", "Ideal, F = 1"], ...(preset === "other" ? [["other", "As given"]] : [])]},
    ];
    const choice = select(options, preset, choosePreset);
    const nodes = [field("Fresnel term", choice)];
    setters.push(() => {
        choice.value = presetOf(state.material.fresnel);
    });
    const kind = fresnelKind(fresnel);
    if (kind === "schlick") {
        const inputs = ["Red", "Green", "Blue"].map((name, c) =>
            el("input", {
                type: "number",
                min: 0,
                max: 1,
                step: "any",
                "aria-label": `F0, ${name}`,
                onchange: (event) => {
                    const f0 = [...three(state.material.fresnel.schlick.f0)],
                        x = Number(event.target.value);
                    if (!(x >= 0 && x <= 1)) return;
                    f0[c] = x;
                    change({fresnel: {schlick: {f0}}});
                },
            }),
        );
        const patch = el("span", {class: "patch"});
        setters.push(() => {
            const f0 = three(state.material.fresnel.schlick.f0);
            inputs.forEach((input, c) => {
                if (document.activeElement !== input) input.value = f0[c];
            });
            patch.style.background = `color(srgb-linear ${f0.join(" ")})`;
        });
        nodes.push(
            el(
                "div",
                {class: "field", role: "group", "aria-label": "F0, reflectance at normal incidence"},
                el("span", {}, "F0: red, green, blue"),
                el("div", {class: "triple"}, inputs, patch),
            ),
        );
    }
    if (kind === "dielectric") {
        const eta = slider({
            label: "η, inside over outside",
            min: 1.01,
            max: 3,
            value: 1.5,
            digits: 4,
            onchange: (x) => change({fresnel: {dielectric: {eta: x}}}),
        });
        setters.push(() => eta.set(Number(three(state.material.fresnel.dielectric.eta)[0])));
        nodes.push(eta);
        if (hasTransmission) {
            const through = check("Transmits (rough glass)", !!state.material.transmission, (on) =>
                change(on ? {transmission: true} : {}, on ? [] : ["transmission"]),
            );
            setters.push(() => {
                through.input.checked = !!state.material.transmission;
            });
            nodes.push(through);
        }
    }
    return {nodes, setters};
}

// ---- The whole -------------------------------------------------------------------------------

const MASKINGS = {
    smith: "Smith, height-correlated",
    smith_uncorrelated: "Smith, uncorrelated",
    vgroove: "V-grooves",
    none: "none",
};
const NDFS = {ggx: "GGX", beckmann: "Beckmann", tabulated: "Tabulated"};

function chooseNdf(ndf) {
    if (ndf !== "tabulated") return change({ndf}, ["slopes"]);
}

function roughnessFields() {
    const isotropic = state.material.alpha_x === undefined,
        setters = [],
        nodes = [];
    const ellipse = new Ellipse((axes) => {
        if (axes.major === axes.minor && isotropic) return change({alpha: axes.major});
        change(bivariateOf(axes));
    });
    setters.push(() => ellipse.set(axesOf(roughness(state.material)), isotropic));
    const add = (options, read) => {
        const node = slider(options);
        setters.push(() => node.set(read(state.material)));
        nodes.push(node);
    };
    const alpha = (label, name) =>
        add(
            {label, min: 1e-3, max: 2, scale: "log", value: 0.3, onchange: (x) => change({[name]: x})},
            (m) => m[name] ?? 1,
        );
    if (isotropic) {
        alpha("α, roughness", "alpha");
    } else {
        alpha("αx", "alpha_x");
        alpha("αy", "alpha_y");
        add(
            {label: "ρ, correlation of slopes", min: -0.99, max: 0.99, value: 0, onchange: (rho) => change({rho})},
            (m) => m.rho ?? 0,
        );
    }
    const toggle = check("Anisotropic", !isotropic, (on) => {
        const {alpha_x, alpha_y} = roughness(state.material);
        if (on) change({alpha_x, alpha_y: Number((alpha_y / 3).toPrecision(3)), rho: 0}, ["alpha"]);
        else change({alpha: Number(Math.sqrt(alpha_x * alpha_y).toPrecision(3))}, ["alpha_x", "alpha_y", "rho"]);
    });
    return {nodes: [ellipse.svg, ...nodes, toggle], setters};
}

function slopeFields() {
    const setters = [];
    const nodes = ["x", "y"].map((axis, i) => {
        const node = slider({
            label: `Mean slope along ${axis}`,
            min: -1,
            max: 1,
            value: 0,
            step: 0.01,
            onchange: (x) => {
                const slope = [...(state.material.mean_slope ?? [0, 0])];
                slope[i] = x;
                change({mean_slope: slope}, slope.every((s) => s === 0) ? ["mean_slope"] : []);
            },
        });
        setters.push(() => node.set((state.material.mean_slope ?? [0, 0])[i]));
        return node;
    });
    return {nodes, setters};
}

function diffuseField() {
    const node = slider({
        label: "kd, diffuse part",
        min: 0,
        max: 1,
        value: 0,
        step: 0.01,
        onchange: (x) => change({diffuse: x}, x ? [] : ["diffuse"]),
    });
    return {nodes: [node], setters: [() => node.set(three(state.material.diffuse ?? 0)[0])]};
}

// A node that follows and changes state.material.
export function materialEditor() {
    const node = el("form", {class: "material", onsubmit: (event) => event.preventDefault()});
    let shape = "",
        setters = [];

    // What decides which controls there are.
    const shapeOf = (m) =>
        JSON.stringify([m.ndf, m.alpha_x === undefined, fresnelKind(m.fresnel), presetOf(m.fresnel) === "other"]);

    async function build() {
        const {models, metals} = await capabilities();
        const hasTransmission = !!(await schema([
            "components",
            "schemas",
            "Material",
            "properties",
            "transmission",
        ]).catch(() => false));
        const here = state.material,
            model = models.find((m) => m.ndf === here.ndf) ?? models[0];
        // A table comes with a fit; it cannot be chosen from nothing.
        const ndfs = models
            .map((m) => m.ndf)
            .filter((name) => NDFS[name] && (name !== "tabulated" || here.ndf === "tabulated"))
            .map((name) => [name, NDFS[name]]);
        const ndf = select(ndfs, here.ndf, chooseNdf);
        const masking = select(
            model.masking.map((name) => [name, MASKINGS[name] ?? name]),
            here.masking ?? "smith",
            (value) => change({masking: value}, value === "smith" ? ["masking"] : []),
        );
        const rough = roughnessFields(),
            fresnel = fresnelFields(metals, hasTransmission),
            slope = slopeFields(),
            diffuse = diffuseField();
        const open = here.mean_slope || here.diffuse || (here.masking && here.masking !== "smith");
        setters = [
            ...rough.setters,
            ...fresnel.setters,
            ...slope.setters,
            ...diffuse.setters,
            () => {
                ndf.value = state.material.ndf;
                masking.value = state.material.masking ?? "smith";
            },
        ];
        const focused = node.contains(document.activeElement) && document.activeElement.getAttribute("aria-label");
        node.replaceChildren(
            el("h2", {}, "Material"),
            field("Distribution of normals", ndf),
            ...rough.nodes,
            ...fresnel.nodes,
            el(
                "details",
                {open},
                el("summary", {}, "Masking, mean slope, diffuse"),
                field("Masking", masking),
                ...slope.nodes,
                ...diffuse.nodes,
            ),
        );
        setters.forEach((update) => update());
        if (focused) node.querySelector(`[aria-label="${CSS.escape(focused)}"]`)?.focus();
    }

    async function update() {
        const now = shapeOf(state.material);
        if (now === shape) return setters.forEach((follow) => follow());
        shape = now;
        try {
            await build();
        } catch {
            shape = ""; // main.js says that the daemon is away, and calls again
        }
    }
    changes.addEventListener("change", (event) => event.detail.includes("material") && update());
    node.update = update;
    update();
    return node;
}

// So that an F0 in an address, and the one the page opens with, has its metal's name.
export async function nameMetals() {
    for (const metal of (await capabilities()).metals) await metalF0(metal);
}
