// chart.js - one picture of x and y: lines and points, linear or in decades, as SVG whose colours are
// the style sheet's.
import {el, svg} from "./dom.js";
import {power, short} from "./numbers.js";

const LEFT = 62,
    RIGHT = 14,
    TOP = 12,
    BOTTOM = 42;

export function linearTicks(min, max, count) {
    const raw = (max - min) / count,
        base = 10 ** Math.floor(Math.log10(raw));
    const step = base * [1, 2, 5, 10].find((k) => k * base >= raw);
    const out = [];
    for (let k = Math.ceil(min / step - 1e-9); k * step <= max + 1e-9 * step; k++) out.push(k * step);
    return out;
}

function decadeTicks(min, max, count) {
    const from = Math.ceil(Math.log10(min) - 1e-9),
        to = Math.floor(Math.log10(max) + 1e-9);
    const step = Math.max(1, Math.ceil((to - from) / count)),
        out = [];
    for (let e = from; e <= to; e += step) out.push(10 ** e);
    return out;
}

// axis: {label, min, max, log, ticks: [..] and format(x), where the usual ones do not do}
function scaleOf(axis, from, to) {
    const up = axis.log ? (x) => Math.log10(Math.max(x, axis.min / 10)) : (x) => x;
    const a = up(axis.min),
        b = up(axis.max);
    return (x) => from + ((up(x) - a) / (b - a)) * (to - from);
}

export class Chart {
    // title is what a screen reader says; a unit of the picture is a pixel, whatever its width.
    constructor({title, height = 300}) {
        this.height = height;
        this.width = 640;
        this.axes = svg("g", {class: "axes"});
        this.data = svg("g", {class: "data"});
        this.cursor = svg("line", {class: "cursor", visibility: "hidden"});
        this.svg = svg(
            "svg",
            {viewBox: `0 0 640 ${height}`, class: "chart", role: "img", "aria-label": title},
            this.axes,
            this.data,
            this.cursor,
        );
        this.readout = el("p", {class: "readout"}, "\u00a0");
        this.node = el("figure", {}, this.svg, this.readout);
        new ResizeObserver(
            ([
                {
                    contentRect: {width},
                },
            ]) => {
                if (!width || Math.abs(width - this.width) < 1) return;
                this.width = width;
                this.svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
                if (this.last) this.draw(this.last);
            },
        ).observe(this.svg);
        this.svg.addEventListener("pointermove", (event) => this.#read(event));
        this.svg.addEventListener("pointerleave", () => this.#read());
    }

    setTitle(text) {
        this.svg.setAttribute("aria-label", text);
    }

    #drawAxes(x, y) {
        const key = JSON.stringify([x, y, this.width]);
        if (key === this.key) return;
        this.key = key;
        const bottom = this.height - BOTTOM,
            parts = [];
        const xTicks =
            x.ticks ??
            (x.log ? decadeTicks(x.min, x.max, this.width / 80) : linearTicks(x.min, x.max, this.width / 80));
        const yTicks = y.ticks ?? (y.log ? decadeTicks(y.min, y.max, 7) : linearTicks(y.min, y.max, 5));
        const text = (axis, v) =>
            axis.format ? axis.format(v) : axis.log ? power(Math.round(Math.log10(v))) : short(v);
        for (const v of xTicks) {
            parts.push(
                svg("line", {x1: this.x(v), x2: this.x(v), y1: TOP, y2: bottom}),
                svg("text", {x: this.x(v), y: bottom + 17, "text-anchor": "middle"}, text(x, v)),
            );
        }
        for (const v of yTicks) {
            parts.push(
                svg("line", {x1: LEFT, x2: this.width - RIGHT, y1: this.y(v), y2: this.y(v)}),
                svg("text", {x: LEFT - 7, y: this.y(v) + 4, "text-anchor": "end"}, text(y, v)),
            );
        }
        parts.push(
            svg(
                "text",
                {class: "label", x: (LEFT + this.width - RIGHT) / 2, y: this.height - 6, "text-anchor": "middle"},
                x.label,
            ),
            svg(
                "text",
                {class: "label", transform: `translate(14 ${(TOP + bottom) / 2}) rotate(-90)`, "text-anchor": "middle"},
                y.label,
            ),
        );
        this.axes.replaceChildren(...parts);
    }

    // series: [{name, color: 1.., kind: "line" (default) | "points" | "rings", xs, ys, labels, dash}]
    // rules: [{y or x, name}]; mark: {x, y} is ringed.
    draw(picture) {
        const {x, y, series, rules = [], mark} = (this.last = picture),
            bottom = this.height - BOTTOM;
        this.x = scaleOf(x, LEFT, this.width - RIGHT);
        this.y = scaleOf(y, bottom, TOP);
        this.series = series;
        this.axis = {x, y};
        this.#drawAxes(x, y);
        const inside = (v) => Math.max(TOP - 4, Math.min(bottom + 4, v));
        const parts = rules.map((rule) =>
            rule.y !== undefined
                ? svg(
                      "g",
                      {class: "rule"},
                      svg("line", {x1: LEFT, x2: this.width - RIGHT, y1: this.y(rule.y), y2: this.y(rule.y)}),
                      svg("text", {x: this.width - RIGHT - 4, y: this.y(rule.y) - 5, "text-anchor": "end"}, rule.name),
                  )
                : svg(
                      "g",
                      {class: "rule"},
                      svg("line", {y1: TOP, y2: bottom, x1: this.x(rule.x), x2: this.x(rule.x)}),
                      svg("text", {x: this.x(rule.x) + 4, y: TOP + 12}, rule.name),
                  ),
        );
        for (const s of series) {
            if (s.kind === "points" || s.kind === "rings") {
                s.xs.forEach((v, i) => {
                    const cx = this.x(v),
                        cy = inside(this.y(s.ys[i]));
                    parts.push(svg("circle", {class: `${s.kind} c${s.color}`, cx, cy, r: 5}));
                    const nearEnd = cx > this.width - 150;
                    if (s.labels)
                        parts.push(
                            svg(
                                "text",
                                {x: cx + (nearEnd ? -9 : 9), y: cy - 7, "text-anchor": nearEnd ? "end" : "start"},
                                s.labels[i],
                            ),
                        );
                });
                continue;
            }
            let d = "",
                pen = "M";
            for (let i = 0; i < s.xs.length; i++) {
                const v = s.ys[i];
                if (!Number.isFinite(v) || (y.log && v <= 0)) {
                    pen = "M";
                    continue;
                }
                d += `${pen}${this.x(s.xs[i]).toFixed(1)} ${inside(this.y(v)).toFixed(1)}`;
                pen = "L";
            }
            parts.push(svg("path", {class: `line c${s.color}`, d, "stroke-dasharray": s.dash}));
        }
        if (mark) parts.push(svg("circle", {class: "mark", cx: this.x(mark.x), cy: inside(this.y(mark.y)), r: 10}));
        this.data.replaceChildren(...parts);
    }

    #read(event) {
        const lines = this.series?.filter((s) => !s.kind || s.kind === "line") ?? [];
        if (!event || !lines.length) {
            this.cursor.setAttribute("visibility", "hidden");
            this.readout.textContent = "\u00a0";
            return;
        }
        const box = this.svg.getBoundingClientRect(),
            px = ((event.clientX - box.left) / box.width) * this.width;
        const xs = lines[0].xs;
        let near = 0;
        for (let i = 1; i < xs.length; i++)
            if (Math.abs(this.x(xs[i]) - px) < Math.abs(this.x(xs[near]) - px)) near = i;
        const cx = this.x(xs[near]),
            {x} = this.axis;
        for (const [name, value] of [
            ["x1", cx],
            ["x2", cx],
            ["y1", TOP],
            ["y2", this.height - BOTTOM],
            ["visibility", "visible"],
        ])
            this.cursor.setAttribute(name, value);
        this.readout.textContent =
            `${x.name ?? x.label} ${x.format ? x.format(xs[near]) : short(xs[near])}:  ` +
            lines.map((s) => `${s.name} ${short(s.ys[near], 4)}`).join("   ");
    }
}

// Names and colours of the series, for people.
export function legend(entries) {
    return el(
        "ul",
        {class: "legend"},
        entries.map(({name, color, kind = "line", dash}) => el("li", {}, swatch(color, kind, dash), name)),
    );
}

export function swatch(color, kind = "line", dash) {
    return svg(
        "svg",
        {viewBox: "0 0 24 12", class: "swatch", "aria-hidden": "true"},
        kind === "line"
            ? svg("line", {class: `line c${color}`, x1: 1, x2: 23, y1: 6, y2: 6, "stroke-dasharray": dash})
            : svg("circle", {class: `${kind} c${color}`, cx: 12, cy: 6, r: 4.5}),
    );
}
