// dom.js - elements without a framework: el("p", {class: "x"}, "text", child).

const SVG = "http://www.w3.org/2000/svg";

function apply(node, attributes, children) {
    for (const [name, value] of Object.entries(attributes ?? {})) {
        if (value === undefined || value === null || value === false) continue;
        if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
        else if (name === "value" || name === "checked") node[name] = value;
        else node.setAttribute(name, value === true ? "" : value);
    }
    node.append(...children.flat().filter((child) => child !== undefined && child !== null));
    return node;
}

export function el(tag, attributes, ...children) {
    return apply(document.createElement(tag), attributes, children);
}

export function svg(tag, attributes, ...children) {
    return apply(document.createElementNS(SVG, tag), attributes, children);
}

let ids = 0;
export function unique(prefix) {
    return `${prefix}-${++ids}`;
}

// A select of [value, label] pairs or of groups {label, options}.
export function select(options, value, onchange, attributes = {}) {
    const option = ([v, label]) => el("option", {value: v, selected: v === value}, label);
    const node = el(
        "select",
        {...attributes, onchange: () => onchange(node.value)},
        options.map((entry) =>
            Array.isArray(entry) ? option(entry) : el("optgroup", {label: entry.label}, entry.options.map(option)),
        ),
    );
    return node;
}

// A label above its control; `unit` and `hint` follow.
export function field(label, control, hint) {
    const id = control.id || unique("field");
    control.id = id;
    const parts = [el("label", {for: id}, label), control];
    if (hint) {
        const note = el("small", {id: unique("hint")}, hint);
        control.setAttribute("aria-describedby", note.id);
        parts.push(note);
    }
    return el("div", {class: "field"}, parts);
}

// A slider and a number input that move together.  scale: "log" or "linear"; both show real values.
export function slider({label, min, max, value, scale = "linear", digits = 3, step, onchange}) {
    const up = scale === "log" ? Math.log10 : (x) => x,
        down = scale === "log" ? (x) => 10 ** x : (x) => x;
    const show = (x) => String(Number(x.toPrecision(digits)));
    const range = el("input", {
        type: "range",
        min: up(min),
        max: up(max),
        step: step ?? (up(max) - up(min)) / 400,
        "aria-label": `${label}, slider`,
    });
    const number = el("input", {type: "number", min, max, step: "any", inputmode: "decimal"});
    const set = (x) => {
        range.value = up(Math.max(x, min));
        range.setAttribute("aria-valuetext", show(x));
        if (document.activeElement !== number) number.value = show(x);
    };
    range.addEventListener("input", () => {
        const x = Number(show(down(Number(range.value))));
        number.value = show(x);
        range.setAttribute("aria-valuetext", show(x));
        onchange(x);
    });
    number.addEventListener("change", () => {
        const x = Math.min(max, Math.max(min, Number(number.value)));
        if (number.value === "" || !Number.isFinite(x)) return;
        range.value = up(x);
        onchange(x);
    });
    number.addEventListener("blur", () => {
        number.value = show(Number(number.value));
    });
    set(value);
    const node = el("div", {class: "slider"}, field(label, number), range);
    node.set = set;
    return node;
}

export function check(label, checked, onchange, mark) {
    const input = el("input", {type: "checkbox", checked, onchange: () => onchange(input.checked)});
    const node = el("label", {class: "check"}, input, mark, label);
    node.input = input;
    return node;
}

export function button(label, onclick, attributes = {}) {
    return el("button", {type: "button", onclick, ...attributes}, label);
}

// What a view is about, for who sees such a thing for the first time.
export function explain(...paragraphs) {
    return el(
        "details",
        {class: "card explain"},
        el("summary", {}, "What is this?"),
        paragraphs.map((text) => el("p", {}, text)),
    );
}

// A table: head of texts, rows of cells (text, node, or number already formatted).
export function table(caption, head, rows, attributes = {}) {
    return el(
        "div",
        {class: "scroll", tabindex: 0, role: "region", "aria-label": caption},
        el(
            "table",
            attributes,
            el("caption", {}, caption),
            el(
                "thead",
                {},
                el(
                    "tr",
                    {},
                    head.map((text) => el("th", {scope: "col"}, text)),
                ),
            ),
            el(
                "tbody",
                {},
                rows.map((row) =>
                    el(
                        "tr",
                        {class: row.className},
                        (row.cells ?? row).map((cell, i) => (i ? el("td", {}, cell) : el("th", {scope: "row"}, cell))),
                    ),
                ),
            ),
        ),
    );
}

// A place that drops and clicks take a file from.
export function dropZone(text, accept, onfile) {
    const input = el("input", {type: "file", accept, onchange: () => input.files[0] && onfile(input.files[0])});
    const zone = el("label", {class: "drop"}, el("span", {}, text), input);
    const over = (on) => (event) => {
        event.preventDefault();
        zone.classList.toggle("over", on);
    };
    zone.addEventListener("dragover", over(true));
    zone.addEventListener("dragleave", over(false));
    zone.addEventListener("drop", (event) => {
        over(false)(event);
        if (event.dataTransfer.files[0]) onfile(event.dataTransfer.files[0]);
    });
    return zone;
}

// Keeps a pointer or arrow keys on a handle: move(event) while it is held, step(dx, dy) by keys.
export function draggable(node, {move, step, start, end}) {
    node.addEventListener("pointerdown", (event) => {
        event.preventDefault();
        node.setPointerCapture(event.pointerId);
        node.focus?.();
        move(event);
    });
    node.addEventListener("gotpointercapture", () => start?.());
    node.addEventListener("pointermove", (event) => {
        if (node.hasPointerCapture(event.pointerId)) move(event);
    });
    node.addEventListener("lostpointercapture", () => end?.());
    const keys = {
        ArrowLeft: [-1, 0],
        ArrowRight: [1, 0],
        ArrowUp: [0, 1],
        ArrowDown: [0, -1],
        PageUp: [0, 10],
        PageDown: [0, -10],
    };
    node.addEventListener("keydown", (event) => {
        const by = keys[event.key];
        if (!by) return;
        event.preventDefault();
        step(by[0] * (event.shiftKey ? 10 : 1), by[1] * (event.shiftKey ? 10 : 1));
    });
}

export function saveAs(blob, name) {
    const url = URL.createObjectURL(blob);
    el("a", {href: url, download: name}).click();
    setTimeout(() => URL.revokeObjectURL(url), 10000);
}
