// main.js - the frame: views, colours, what to say when the daemon is away.
import {button, el} from "./dom.js";
import {materialEditor, nameMetals, settle} from "./material.js";
import {capabilities, events, forgetCapabilities, Problem, setToken, Unreachable} from "./service.js";
import {changes, currentView, href, read, set, state, wasWrittenHere} from "./state.js";

const VIEWS = {
    lobe: {title: "Lobe", load: () => import("./view_lobe.js")},
    trade: {title: "Trade", load: () => import("./view_trade.js")},
    sphere: {title: "Sphere", load: () => import("./view_sphere.js")},
    fit: {title: "Fit", load: () => import("./view_fit.js")},
    maps: {title: "Maps", load: () => import("./view_maps.js")},
};
const names = Object.keys(VIEWS);
const at = (id) => document.getElementById(id);
const controls = at("controls"),
    stage = at("stage"),
    notice = at("notice");

// ---- What goes wrong ------------------------------------------------------------------------------

function problemBox() {
    const node = el("div", {class: "problem", role: "alert"});
    node.hidden = true;
    return {
        node,
        show(error) {
            if (error.name === "AbortError" || error instanceof Unreachable) return; // the notice says it
            if (!(error instanceof Problem)) console.error(error);
            node.hidden = false;
            node.replaceChildren(
                el(
                    "strong",
                    {},
                    error instanceof Problem ? `The service refuses this (${error.status}). ` : "This page failed. ",
                ),
                error.message,
            );
        },
        clear() {
            node.hidden = true;
            node.replaceChildren();
        },
    };
}

function say(...content) {
    notice.hidden = !content.length;
    notice.replaceChildren(...content);
}

events.addEventListener("lost", () =>
    say(
        el("strong", {}, "facetd does not answer. "),
        "What you see is from before; it goes on by itself when the daemon is back.",
    ),
);
events.addEventListener("back", () => {
    say();
    forgetCapabilities();
    refresh();
});
events.addEventListener("token", () => {
    if (notice.querySelector("input")) return;
    const input = el("input", {type: "password", autocomplete: "off", "aria-label": "Token"});
    say(
        el(
            "form",
            {
                onsubmit: (event) => {
                    event.preventDefault();
                    setToken(input.value);
                    say();
                    forgetCapabilities();
                    refresh();
                },
            },
            el("strong", {}, "This daemon asks for its token. "),
            input,
            " ",
            el("button", {}, "Use it"),
        ),
    );
});

// ---- Views ------------------------------------------------------------------------------------------

const opened = {};
let editor;

async function open(name) {
    if (!opened[name]) {
        const module = await VIEWS[name].load(),
            problem = problemBox();
        opened[name] = {module, problem, ...module.create({problem, go})};
    }
    return opened[name];
}

function go(name, members) {
    if (members) set(members);
    location.hash = href(name);
}

async function refresh(changed) {
    const name = currentView(),
        view = await open(name);
    if (name !== currentView()) return;
    editor ??= materialEditor();
    if (!changed) editor.update();
    try {
        await view.update(changed);
    } catch (error) {
        view.problem.show(error);
    }
}

async function show() {
    const bad = read(names),
        name = currentView();
    try {
        state.material = await settle(state.material);
    } catch {
        /* the view says what is wrong with it */
    }
    const view = await open(name);
    if (name !== currentView()) return;
    for (const [key, other] of Object.entries(opened)) if (key !== name) other.stop?.();
    document.title = `facetd: ${VIEWS[name].title}`;
    at("lead").textContent = view.module.lead;
    link();
    at("jump").hidden = !view.module.usesMaterial;
    editor ??= materialEditor();
    controls.replaceChildren(...[view.controls, view.module.usesMaterial && editor].filter(Boolean));
    stage.replaceChildren(view.problem.node, view.stage);
    if (bad.length) say(`Left out of the address, as it cannot be read: ${bad.join(", ")}.`);
    await refresh();
}

// Not by fragments, which are the views'.
at("skip").addEventListener("click", () => stage.focus());
at("jump").addEventListener("click", () => {
    controls.scrollIntoView();
    controls.querySelector("select, input")?.focus({preventScroll: true});
});

// Made once, so that the focus stays on the one that was followed; they carry the state along.
const links = names.map((name) => el("a", {}, VIEWS[name].title));
at("views").append(
    el(
        "ul",
        {},
        links.map((link) => el("li", {}, link)),
    ),
);
function link() {
    links.forEach((node, i) => {
        node.setAttribute("href", href(names[i]));
        node.toggleAttribute("aria-current", names[i] === currentView());
        if (names[i] === currentView()) node.setAttribute("aria-current", "page");
    });
}

changes.addEventListener("change", (event) => refresh(event.detail));
changes.addEventListener("written", link);
window.addEventListener("hashchange", () => wasWrittenHere() || show());

// ---- Colours ----------------------------------------------------------------------------------------

const THEMES = ["system", "light", "dark"];
function paint() {
    const theme = localStorage.getItem("theme") ?? "system";
    document.documentElement.dataset.theme = theme;
    at("theme").setAttribute("aria-label", `Colours: ${theme === "system" ? "as the system" : theme}`);
    at("theme").textContent = {system: "◐", light: "☀", dark: "☾"}[theme];
}
at("theme").addEventListener("click", () => {
    const now = localStorage.getItem("theme") ?? "system";
    localStorage.setItem("theme", THEMES[(THEMES.indexOf(now) + 1) % THEMES.length]);
    paint();
    refresh();
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => refresh());

async function foot() {
    const {isa, models} = await capabilities();
    at("foot").replaceChildren(
        el(
            "p",
            {},
            `Computed by this daemon (${isa}): ${models.map((m) => m.ndf).join(", ")}. `,
            el("a", {href: "v1/openapi.json"}, "The API as OpenAPI"),
            " · ",
            el("a", {href: "v1/capabilities"}, "what it promises and costs"),
        ),
    );
}

paint();
show();
foot().catch(() => {});
nameMetals().then(
    () => editor?.update(),
    () => {},
);
