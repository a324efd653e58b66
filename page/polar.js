// polar.js - the lobe in the plane of incidence: distance from the centre is f_r cos theta, the handle is wo.
import {draggable, svg} from "./dom.js";
import {DEGREE, degrees, power, short} from "./numbers.js";
import {linearTicks} from "./chart.js";

const R = 190,
    CX = 220,
    CY = 214,
    HANDLE = 204;
const LIMIT = 89 * DEGREE,
    DECADES = 5;

const at = (t, r) => [CX + r * Math.sin(t), CY - r * Math.cos(t)];

export class Polar {
    // move(theta): wo was dragged to this signed angle from the normal, in radians.
    constructor(move) {
        this.rings = svg("g", {class: "axes"});
        this.lobes = svg("g", {class: "data"});
        this.ray = svg("line", {class: "ray", x1: CX, y1: CY});
        this.mirror = svg("line", {class: "mirror", x1: CX, y1: CY});
        this.handle = svg("circle", {
            class: "handle",
            r: 12,
            tabindex: 0,
            role: "slider",
            "aria-label": "Viewing direction wo, angle from the normal",
            "aria-valuemin": -89,
            "aria-valuemax": 89,
        });
        this.name = svg("text", {class: "name", "text-anchor": "middle", "aria-hidden": "true"}, "wo");
        this.svg = svg(
            "svg",
            {
                viewBox: "0 0 440 250",
                class: "polar",
                role: "group",
                "aria-label": "Polar plot of f_r cos θ in the plane of incidence",
            },
            this.rings,
            svg("line", {class: "ground", x1: 16, x2: 424, y1: CY, y2: CY}),
            this.lobes,
            this.mirror,
            this.ray,
            this.name,
            this.handle,
        );
        const clamp = (t) => Math.max(-LIMIT, Math.min(LIMIT, t));
        const moved = (event) => {
            const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(this.svg.getScreenCTM().inverse());
            move(clamp(Math.atan2(point.x - CX, Math.max(CY - point.y, 0))));
        };
        draggable(this.handle, {
            move: moved,
            step: (dx, dy) => move(clamp(this.theta + (dx + dy) * DEGREE)),
            start: () => {
                this.dragging = true;
            },
            end: () => {
                this.dragging = false;
            },
        });
        // Anywhere on the picture: the handle comes to the pointer.
        this.svg.addEventListener("pointerdown", (event) => {
            if (event.target === this.handle || event.button || event.pointerType === "touch") return;
            this.handle.setPointerCapture(event.pointerId);
            moved(event);
        });
    }

    setView(theta) {
        this.theta = theta;
        const [x, y] = at(theta, HANDLE),
            [mx, my] = at(-theta, R),
            [nx, ny] = at(theta + (theta < 0 ? -1 : 1) * 9 * DEGREE, HANDLE - 4);
        (this.handle.setAttribute("cx", x), this.handle.setAttribute("cy", y));
        (this.name.setAttribute("x", nx), this.name.setAttribute("y", ny + 5));
        (this.ray.setAttribute("x2", x), this.ray.setAttribute("y2", y));
        (this.mirror.setAttribute("x2", mx), this.mirror.setAttribute("y2", my));
        this.handle.setAttribute("aria-valuenow", Math.round(theta / DEGREE));
        this.handle.setAttribute("aria-valuetext", `${degrees(theta)} from the normal`);
    }

    #drawRings(top, log) {
        const key = `${top} ${log}`;
        if (key === this.key) return;
        this.key = key;
        const parts = [];
        const values = log
            ? Array.from({length: DECADES}, (_, k) => top / 10 ** k)
            : linearTicks(0, top, 3).filter((v) => v > 0);
        for (const v of values) {
            const r = this.radius(v);
            if (r > R + 0.5) continue;
            parts.push(
                svg("path", {d: `M${CX - r} ${CY}A${r} ${r} 0 0 1 ${CX + r} ${CY}`}),
                svg(
                    "text",
                    {x: CX + r, y: CY + 14, "text-anchor": "middle"},
                    log ? power(Math.round(Math.log10(v))) : short(v),
                ),
            );
        }
        for (let d = -60; d <= 60; d += 30) {
            const [x, y] = at(d * DEGREE, R),
                [tx, ty] = at(d * DEGREE, R + 10);
            parts.push(
                svg("line", {x1: CX, y1: CY, x2: x, y2: y}),
                svg("text", {x: tx, y: ty + 3, "text-anchor": "middle"}, `${Math.abs(d)}°`),
            );
        }
        parts.push(svg("text", {class: "label", x: CX, y: CY + 31, "text-anchor": "middle"}, "sr⁻¹"));
        this.rings.replaceChildren(...parts);
    }

    // angles: signed, radians, growing; series: [{color, values, fill, dash}]
    draw(angles, series, log) {
        let most = 1e-30;
        for (const s of series) for (const v of s.values) if (v > most) most = v;
        // Steps of 1, 2, 5, so that the rings stay while wo moves.
        const e = Math.floor(Math.log10(most)),
            m = most / 10 ** e;
        const top = log
            ? 10 ** Math.ceil(Math.log10(most) - 1e-9)
            : [1.5, 2, 3, 5, 7.5, 10].find((k) => k >= m - 1e-9) * 10 ** e;
        this.radius = log ? (v) => R * Math.max(0, 1 + Math.log10(v / top) / DECADES) : (v) => (R * v) / top;
        this.#drawRings(top, log);
        this.lobes.replaceChildren(
            ...series.map((s) => {
                let d = `M${CX} ${CY}`;
                for (let i = 0; i < angles.length; i++) {
                    const [x, y] = at(angles[i], this.radius(Math.max(s.values[i], 1e-30)));
                    d += `L${x.toFixed(1)} ${y.toFixed(1)}`;
                }
                return svg("path", {
                    class: `${s.fill ? "lobe" : "line"} c${s.color}`,
                    d: d + "Z",
                    "stroke-dasharray": s.dash,
                });
            }),
        );
    }
}
