// ellipse.js - roughness as an ellipse in the plane of slopes, with a handle at the end of each axis.
import {draggable, svg} from "./dom.js";
import {short} from "./numbers.js";

const SIZE = 220,
    C = SIZE / 2,
    R = 92,
    MIN = 1e-3,
    MAX = 2;

// Lengths are in decades: 0.001 at the centre, 2 at the rim.
const place = (alpha) => (R * Math.log10(Math.max(alpha, MIN) / MIN)) / Math.log10(MAX / MIN);
const alphaAt = (r) => Number((MIN * (MAX / MIN) ** Math.max(0.03, Math.min(1, r / R))).toPrecision(3));

// Covariance of slopes [[ax^2, r ax ay], [r ax ay, ay^2]] and its axes; angle of the longer one from x.
export function axesOf({alpha_x: ax, alpha_y: ay, rho}) {
    const xx = ax * ax,
        yy = ay * ay,
        xy = rho * ax * ay,
        mean = (xx + yy) / 2,
        half = Math.hypot((xx - yy) / 2, xy);
    return {
        major: Math.sqrt(mean + half),
        minor: Math.sqrt(Math.max(mean - half, 0)),
        angle: Math.atan2(2 * xy, xx - yy) / 2,
    };
}

export function bivariateOf({major, minor, angle}) {
    const c = Math.cos(angle),
        s = Math.sin(angle),
        a = major * major,
        b = minor * minor;
    const alpha_x = Math.sqrt(a * c * c + b * s * s),
        alpha_y = Math.sqrt(a * s * s + b * c * c);
    const rho = ((a - b) * c * s) / (alpha_x * alpha_y),
        digits = (x) => Number(x.toPrecision(4));
    return {
        alpha_x: digits(alpha_x),
        alpha_y: digits(alpha_y),
        rho: Math.max(-0.9999, Math.min(0.9999, Number(rho.toFixed(4)))),
    };
}

export class Ellipse {
    // change({major, minor, angle}); isotropic: one handle, a circle
    constructor(change) {
        this.change = change;
        const ring = (alpha) => [
            svg("circle", {cx: C, cy: C, r: place(alpha)}),
            svg(
                "text",
                {x: C - 0.72 * place(alpha), y: C + 0.72 * place(alpha) + 9, "text-anchor": "end"},
                short(alpha),
            ),
        ];
        this.shape = svg("ellipse", {class: "lobe c1"});
        this.major = this.#handle(
            "Larger roughness and its direction",
            (a, r, angle) => ({...a, major: Math.max(r, a.minor), angle}),
            (a, dx, dy) => ({
                ...a,
                major: Math.max(a.minor, Math.min(MAX, a.major * 1.05 ** dy)),
                angle: a.angle + (dx * Math.PI) / 60,
            }),
        );
        this.minor = this.#handle(
            "Smaller roughness",
            (a, r) => ({...a, minor: Math.min(r, a.major)}),
            (a, dx, dy) => ({...a, minor: Math.min(a.major, Math.max(MIN * 1.3, a.minor * 1.05 ** (dx + dy)))}),
        );
        this.svg = svg(
            "svg",
            {
                viewBox: `0 0 ${SIZE} ${SIZE}`,
                class: "ellipse",
                role: "group",
                "aria-label": "Roughness along the slopes' axes, in decades",
            },
            svg(
                "g",
                {class: "axes"},
                ring(0.01),
                ring(0.1),
                ring(1),
                svg("line", {x1: 8, x2: SIZE - 8, y1: C, y2: C}),
                svg("line", {x1: C, x2: C, y1: 8, y2: SIZE - 8}),
                svg("text", {x: SIZE - 12, y: C - 5}, "x"),
                svg("text", {x: C + 6, y: 14}, "y"),
            ),
            this.shape,
            this.minor,
            this.major,
        );
    }

    #handle(label, drag, key) {
        const node = svg("circle", {
            class: "handle",
            r: 8,
            tabindex: 0,
            role: "slider",
            "aria-label": label,
            "aria-valuemin": MIN,
            "aria-valuemax": MAX,
        });
        const send = (axes) =>
            this.change(this.isotropic ? {major: axes.touched, minor: axes.touched, angle: 0} : axes);
        draggable(node, {
            move: (event) => {
                const p = new DOMPoint(event.clientX, event.clientY).matrixTransform(this.svg.getScreenCTM().inverse());
                const r = alphaAt(Math.hypot(p.x - C, p.y - C));
                send({...drag(this.axes, r, Math.atan2(C - p.y, p.x - C)), touched: r});
            },
            step: (dx, dy) => {
                const axes = key(this.axes, this.isotropic ? 0 : dx, this.isotropic ? dx + dy : dy);
                send({...axes, touched: axes.major});
            },
        });
        return node;
    }

    set(axes, isotropic) {
        this.axes = axes;
        this.isotropic = isotropic;
        const {major, minor, angle} = axes,
            a = place(major),
            b = place(minor),
            turn = (-angle * 180) / Math.PI;
        const put = (node, members) => Object.entries(members).forEach(([k, v]) => node.setAttribute(k, v));
        put(this.shape, {cx: C, cy: C, rx: a, ry: b, transform: `rotate(${turn} ${C} ${C})`});
        put(this.major, {
            cx: C + a * Math.cos(angle),
            cy: C - a * Math.sin(angle),
            "aria-valuenow": major,
            "aria-valuetext": isotropic
                ? `alpha ${short(major)}`
                : `alpha ${short(major)} at ${((angle * 180) / Math.PI).toFixed(0)} degrees`,
        });
        put(this.minor, {
            cx: C - b * Math.sin(angle),
            cy: C - b * Math.cos(angle),
            "aria-valuenow": minor,
            "aria-valuetext": `alpha ${short(minor)}`,
            visibility: isotropic ? "hidden" : "visible",
            tabindex: isotropic ? -1 : 0,
        });
    }
}
