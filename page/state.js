// state.js - what is looked at, kept in the URL's fragment so that a view can be shared:
// #/lobe?material={...}&theta=-0.7&...  Members at their default are left out.

const DEFAULTS = {
    material: {ndf: "ggx", alpha: 0.3, fresnel: {schlick: {f0: [0.942, 0.704, 0.404]}}},
    theta: -0.7, // of wo in the plane of incidence, signed
    phi: 0, // azimuth of that plane
    sampler: "auto",
    samples: 512,
    seed: 1,
    overlays: ["fr_cos", "pdf"],
    log: false, // polar plot and body in decades
    solid: false, // the body instead of the view from above
    tolerance: 1e-3,
    environment: "studio",
    surface: "sphere",
    spp: 64,
    fit: {tolerance: 0.1, model: "auto"},
    map: {kind: "displacement", scale: 0.1, border: "periodic"},
    level: 0,
    at: null,
};

export const state = structuredClone(DEFAULTS);
export const changes = new EventTarget(); // "change": detail names the members

const same = (a, b) => JSON.stringify(a) === JSON.stringify(b);

let view = "lobe",
    timer = 0,
    written = "";
export function currentView() {
    return view;
}

export function href(name) {
    const parts = Object.keys(DEFAULTS)
        .filter((key) => !same(state[key], DEFAULTS[key]))
        .map(
            (key) =>
                `${key}=${encodeURIComponent(typeof state[key] === "string" ? state[key] : JSON.stringify(state[key]))}`,
        );
    return `#/${name}${parts.length ? "?" + parts.join("&") : ""}`;
}

function write() {
    clearTimeout(timer);
    // Browsers refuse a few hundred changes a minute: once things are at rest.
    timer = setTimeout(() => {
        written = href(view);
        history.replaceState(null, "", written);
        changes.dispatchEvent(new Event("written"));
    }, 250);
}

export function set(members) {
    const changed = Object.keys(members).filter((key) => !same(state[key], members[key]));
    if (!changed.length) return;
    Object.assign(state, members);
    write();
    changes.dispatchEvent(new CustomEvent("change", {detail: changed}));
}

function parse(key, text) {
    if (typeof DEFAULTS[key] === "string") return text;
    const value = JSON.parse(text);
    const fits =
        DEFAULTS[key] === null ||
        (typeof value === typeof DEFAULTS[key] && Array.isArray(value) === Array.isArray(DEFAULTS[key]));
    if (!fits || (typeof value === "number" && !Number.isFinite(value))) throw new Error(key);
    return value;
}

// Returns the members it could not read.
export function read(views) {
    const [path, query = ""] = location.hash.replace(/^#\/?/, "").split("?");
    view = views.includes(path) ? path : views[0];
    Object.assign(state, structuredClone(DEFAULTS));
    const bad = [];
    for (const part of query.split("&").filter(Boolean)) {
        const [key, text = ""] = part.split("=");
        if (!(key in DEFAULTS)) continue;
        try {
            state[key] = parse(key, decodeURIComponent(text));
        } catch {
            bad.push(key);
        }
    }
    return bad;
}

export function wasWrittenHere() {
    return location.hash === written;
}

// wo and its plane, as the API takes angles: theta from the normal, phi any.
export function angles(signedTheta, phi) {
    return {theta: Math.abs(signedTheta), phi: signedTheta < 0 ? phi + Math.PI : phi};
}

const round = (x) => Number(x.toFixed(9));

// Signed angle in the plane of incidence as a vector: the service takes vectors exactly as they are,
// while angles come with the error of their sine.
export function direction(t, phi) {
    return [round(Math.sin(t) * Math.cos(phi)), round(Math.sin(t) * Math.sin(phi)), round(Math.cos(t))];
}

export function woOf() {
    return [direction(state.theta, state.phi)];
}

// What a picture needs; only one tier knows tables.
export function forPicture(material) {
    return material.ndf === "tabulated" ? {tier: "precise"} : {tolerance: 1e-3};
}
