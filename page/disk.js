// disk.js - all directions of light seen from above, in Lambert's equal-area projection: equal areas are
// equal solid angles, so that the density of dots is the density of samples.  The ring outside is below
// the horizon.
import {draggable, el} from "./dom.js";
import {viridis} from "./numbers.js";

export const RING = 1.22; // radius of the picture; 1 is the horizon
const LIMIT = (89 * Math.PI) / 180;
const DECADES = 4;
const WINDOW = 48; // pixels of the style sheet

const radiusOf = (theta) => Math.SQRT2 * Math.sin(theta / 2);

export class Disk {
    // move(theta, phi): wo was dragged there
    constructor(size, move) {
        this.size = size;
        const dpr = Math.min(2, window.devicePixelRatio || 1);
        this.n = Math.round(size * dpr);
        this.canvas = el("canvas", {
            class: "disk",
            width: this.n,
            height: this.n,
            role: "slider",
            tabindex: 0,
            "aria-label":
                "All directions of light from above, equal-area; moves the viewing direction around the normal",
            "aria-valuemin": -180,
            "aria-valuemax": 180,
            "aria-valuenow": 0,
        });
        this.context = this.canvas.getContext("2d");
        this.image = this.context.createImageData(this.n, this.n);
        draggable(this.canvas, {
            move: (event) => {
                const box = this.canvas.getBoundingClientRect();
                const x = (((event.clientX - box.left) / box.width) * 2 - 1) * RING,
                    y = (1 - ((event.clientY - box.top) / box.height) * 2) * RING;
                const r = Math.min(1, Math.hypot(x, y));
                move(Math.min(LIMIT, 2 * Math.asin(r / Math.SQRT2)), Math.atan2(y, x));
            },
            step: (dx, dy) => move(this.wo[0], this.wo[1] + ((dx + dy) * Math.PI) / 180),
            start: () => {
                this.dragging = true;
            },
            end: () => {
                this.dragging = false;
            },
        });
    }

    // For each pixel above the horizon four cells of the grid and their weights.
    #prepare(rows, columns) {
        if (this.rows === rows && this.columns === columns) return;
        ((this.rows = rows), (this.columns = columns));
        const n = this.n,
            pixels = [],
            cells = [],
            weights = [];
        for (let py = 0; py < n; py++) {
            for (let px = 0; px < n; px++) {
                const x = (((px + 0.5) / n) * 2 - 1) * RING,
                    y = (1 - ((py + 0.5) / n) * 2) * RING,
                    r = Math.hypot(x, y);
                if (r >= 1) continue;
                const theta = 2 * Math.asin(r / Math.SQRT2),
                    phi = (Math.atan2(y, x) + 2 * Math.PI) % (2 * Math.PI);
                const u = Math.max(0, Math.min(rows - 1, (theta / (Math.PI / 2)) * rows - 0.5));
                const v = ((phi / (2 * Math.PI)) * columns - 0.5 + columns) % columns;
                const i = Math.min(rows - 2, Math.floor(u)),
                    j = Math.floor(v) % columns,
                    k = (j + 1) % columns;
                pixels.push(py * n + px);
                cells.push(i * columns + j, i * columns + k, (i + 1) * columns + j, (i + 1) * columns + k);
                weights.push(u - i, v - Math.floor(v));
            }
        }
        this.pixels = Uint32Array.from(pixels);
        this.cells = Uint32Array.from(cells);
        this.weights = Float32Array.from(weights);
    }

    // The directions of the pixels around one of them: where a lobe is narrower than a cell of the grid.
    window([theta, phi]) {
        const n = this.n,
            r = ((radiusOf(theta) / RING) * n) / 2,
            cx = n / 2 + r * Math.cos(phi),
            cy = n / 2 - r * Math.sin(phi);
        const pixels = [],
            wi = [],
            half = Math.round(((WINDOW / 2) * n) / this.size);
        for (let py = Math.max(0, Math.floor(cy) - half); py < Math.min(n, cy + half); py++) {
            for (let px = Math.max(0, Math.floor(cx) - half); px < Math.min(n, cx + half); px++) {
                const x = (((px + 0.5) / n) * 2 - 1) * RING,
                    y = (1 - ((py + 0.5) / n) * 2) * RING,
                    r2 = x * x + y * y;
                if (r2 >= 0.9999) continue;
                const s = Math.sqrt(2 - r2); // sin theta = r sqrt(2 - r^2), cos theta = 1 - r^2
                pixels.push(py * n + px);
                wi.push(x * s, y * s, 1 - r2);
            }
        }
        return {pixels, wi: Float32Array.from(wi)};
    }

    // values on a grid of cell centres, theta by theta, and fine: {pixels, values} in their place; the
    // colours span four decades below the largest, which is at least `least`.
    draw(values, rows, columns, {samples, wo, fine, least}) {
        this.#prepare(rows, columns);
        let most = Math.max(1e-30, least);
        for (const v of values) if (v > most) most = v;
        const logs = new Float32Array(values.length),
            top = Math.log10(most);
        const level = (v) => Math.max(0, 1 + (Math.log10(v + 1e-30) - top) / DECADES);
        for (let i = 0; i < logs.length; i++) logs[i] = level(values[i]);
        const {data} = this.image,
            {pixels, cells, weights} = this;
        data.fill(0);
        for (let p = 0; p < pixels.length; p++) {
            const a = weights[2 * p],
                b = weights[2 * p + 1],
                c = 4 * p;
            const v =
                (1 - a) * ((1 - b) * logs[cells[c]] + b * logs[cells[c + 1]]) +
                a * ((1 - b) * logs[cells[c + 2]] + b * logs[cells[c + 3]]);
            const color = 3 * Math.min(255, (v * 255) | 0),
                to = 4 * pixels[p];
            ((data[to] = viridis[color]),
                (data[to + 1] = viridis[color + 1]),
                (data[to + 2] = viridis[color + 2]),
                (data[to + 3] = 255));
        }
        fine?.pixels.forEach((pixel, p) => {
            const color = 3 * Math.min(255, (level(fine.values[p]) * 255) | 0);
            data.set(viridis.subarray(color, color + 3), 4 * pixel);
        });
        this.context.putImageData(this.image, 0, 0);
        this.#overlay(samples, wo);
        return most;
    }

    #place(x, y, z) {
        const theta = Math.acos(Math.max(-1, Math.min(1, z))),
            s = Math.hypot(x, y) || 1;
        const r = ((Math.min(radiusOf(theta), RING - 0.02) / RING) * this.n) / 2;
        return [this.n / 2 + (r * x) / s, this.n / 2 - (r * y) / s];
    }

    // Kept, as each look at a style makes the browser compute the layout.
    #colors() {
        const style = getComputedStyle(this.canvas);
        return {
            line: style.getPropertyValue("--line"),
            waste: style.getPropertyValue("--c2"),
            accent: style.getPropertyValue("--accent"),
        };
    }

    #overlay(samples, [theta, phi]) {
        const c = this.context,
            n = this.n,
            unit = n / this.size;
        const {line, waste, accent} = (this.colors ??= this.#colors());
        c.lineWidth = unit;
        c.strokeStyle = line;
        c.beginPath();
        c.arc(n / 2, n / 2, n / 2 / RING, 0, 7);
        c.stroke();
        if (samples) {
            const {wi, weight} = samples,
                step = weight.channels;
            c.fillStyle = "#fff";
            c.strokeStyle = waste;
            c.lineWidth = 1.5 * unit;
            c.beginPath();
            for (let i = 0; i < wi.length / 3; i++) {
                const [x, y] = this.#place(wi[3 * i], wi[3 * i + 1], wi[3 * i + 2]);
                if (weight[step * i] > 0 || wi[3 * i + 2] > 0) {
                    c.fillRect(x - unit, y - unit, 2 * unit, 2 * unit);
                } else {
                    (c.moveTo(x - 2.5 * unit, y - 2.5 * unit), c.lineTo(x + 2.5 * unit, y + 2.5 * unit));
                    (c.moveTo(x + 2.5 * unit, y - 2.5 * unit), c.lineTo(x - 2.5 * unit, y + 2.5 * unit));
                }
            }
            c.stroke();
        }
        this.wo = [theta, phi];
        const [x, y] = this.#place(Math.sin(theta) * Math.cos(phi), Math.sin(theta) * Math.sin(phi), Math.cos(theta));
        c.fillStyle = accent;
        c.strokeStyle = "#fff";
        c.lineWidth = 2 * unit;
        c.beginPath();
        c.arc(x, y, 7 * unit, 0, 7);
        c.fill();
        c.stroke();
        const azimuth = Math.round((Math.atan2(Math.sin(phi), Math.cos(phi)) * 180) / Math.PI);
        this.canvas.setAttribute("aria-valuenow", azimuth);
        this.canvas.setAttribute("aria-valuetext", `azimuth ${azimuth}°`);
    }
}
