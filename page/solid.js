// solid.js - the lobe as a body: distance from the centre is f_r cos theta_i, all around.  WebGL 2, turned by
// dragging or by arrow keys.
import {draggable, el} from "./dom.js";
import {viridis} from "./numbers.js";

const VERTEX = `#version 300 es
in vec4 place; // direction, distance
uniform mat3 turn;
out vec3 seen;
out float far;
void main() {
    seen = turn * (place.xyz * place.w);
    far = place.w;
    gl_Position = vec4(seen.xy * 0.92 - vec2(0.0, 0.25), -seen.z * 0.5, 1.0);
}`;
const FRAGMENT = `#version 300 es
precision highp float;
in vec3 seen;
in float far;
uniform vec3 colors[5]; // of distances 0 to 1
uniform vec4 plain;     // of a line, where its alpha is 1
out vec4 color;
void main() {
    vec3 normal = normalize(cross(dFdx(seen), dFdy(seen)));
    float light = 0.5 + 0.5 * abs(dot(normal, normalize(vec3(-0.4, 0.7, 0.9))));
    float at = clamp(far, 0.0, 1.0) * 3.999;
    int k = int(at);
    vec3 body = mix(colors[k], colors[k + 1], at - float(k)) * light;
    color = vec4(mix(body, plain.rgb, plain.a), 1.0);
}`;
const RIM = 96; // points of the horizon

function program(gl) {
    const out = gl.createProgram();
    for (const [type, source] of [
        [gl.VERTEX_SHADER, VERTEX],
        [gl.FRAGMENT_SHADER, FRAGMENT],
    ]) {
        const shader = gl.createShader(type);
        gl.shaderSource(shader, source);
        gl.compileShader(shader);
        gl.attachShader(out, shader);
    }
    gl.bindAttribLocation(out, 0, "place");
    gl.linkProgram(out);
    if (!gl.getProgramParameter(out, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(out));
    return out;
}

// Triangles between the cell centres of a grid, around and over the pole, which is the last vertex.
function trianglesOf(rows, columns) {
    const out = [];
    for (let i = 0; i < rows; i++) {
        for (let j = 0; j < columns; j++) {
            const k = (j + 1) % columns;
            if (i === 0) out.push(rows * columns, j, k);
            else
                out.push(
                    (i - 1) * columns + j,
                    i * columns + j,
                    i * columns + k,
                    (i - 1) * columns + j,
                    i * columns + k,
                    (i - 1) * columns + k,
                );
        }
    }
    return Uint32Array.from(out);
}

export class Solid {
    constructor(size) {
        const n = Math.round(size * Math.min(2, window.devicePixelRatio || 1));
        this.canvas = el("canvas", {
            class: "solid",
            width: n,
            height: n,
            tabindex: 0,
            role: "img",
            "aria-label": "The lobe as a body; arrow keys turn it",
        });
        this.azimuth = 0.5;
        this.elevation = 0.45;
        let last = null;
        draggable(this.canvas, {
            start: () => {
                last = null;
            },
            move: (event) => {
                if (last) this.#turn((event.clientX - last[0]) * 0.01, (event.clientY - last[1]) * 0.01);
                last = [event.clientX, event.clientY];
            },
            step: (dx, dy) => this.#turn(dx * 0.1, -dy * 0.1),
        });
    }

    // Only when it is wanted, as a context takes a while; false where the browser has none.
    open() {
        if (this.gl !== undefined) return !!this.gl;
        this.gl = this.canvas.getContext("webgl2", {antialias: true, preserveDrawingBuffer: true});
        if (!this.gl) return false;
        this.program = program(this.gl);
        this.vertices = this.gl.createBuffer();
        this.triangles = this.gl.createBuffer();
        return true;
    }

    #turn(azimuth, elevation) {
        this.azimuth += azimuth;
        this.elevation = Math.max(0, Math.min(Math.PI / 2, this.elevation + elevation));
        this.#render();
    }

    // values on a grid of cell centres, theta by theta; peak is at distance 1; decades: logarithmic, so many.
    draw(values, rows, columns, {wo, peak, decades}) {
        const level = decades
            ? (v) => Math.max(0, 1 + Math.log10(v / peak + 1e-30) / decades)
            : (v) => Math.min(1, v / peak);
        const place = new Float32Array(4 * (rows * columns + 1 + RIM + 4));
        let at = 0,
            top = 0;
        const put = (theta, phi, r) => {
            place.set([Math.sin(theta) * Math.cos(phi), Math.sin(theta) * Math.sin(phi), Math.cos(theta), r], at);
            at += 4;
        };
        for (let i = 0; i < rows; i++)
            for (let j = 0; j < columns; j++)
                put(
                    (((i + 0.5) / rows) * Math.PI) / 2,
                    ((j + 0.5) / columns) * 2 * Math.PI,
                    level(values[i * columns + j]),
                );
        for (let j = 0; j < columns; j++) top += values[j] / columns;
        put(0, 0, level(top));
        for (let k = 0; k < RIM; k++) put(Math.PI / 2, (k / RIM) * 2 * Math.PI, 1);
        (put(0, 0, 0), put(wo[0], wo[1], 1.05)); // to the viewer
        (put(0, 0, 0), put(wo[0], wo[1] + Math.PI, 1.05)); // and its mirror
        const gl = this.gl;
        gl.bindBuffer(gl.ARRAY_BUFFER, this.vertices);
        gl.bufferData(gl.ARRAY_BUFFER, place, gl.DYNAMIC_DRAW);
        if (this.shape !== rows * columns) {
            this.shape = rows * columns;
            const triangles = trianglesOf(rows, columns);
            this.count = triangles.length;
            gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.triangles);
            gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, triangles, gl.STATIC_DRAW);
        }
        this.#render();
    }

    #render() {
        if (!this.count) return;
        const {gl, shape} = this,
            n = this.canvas.width,
            uniform = (name) => gl.getUniformLocation(this.program, name);
        const ca = Math.cos(this.azimuth),
            sa = Math.sin(this.azimuth),
            ce = Math.cos(this.elevation),
            se = Math.sin(this.elevation);
        // The plane's x to the right, z up, then tipped toward the eye; column by column.
        const turn = [ca, sa * se, -sa * ce, -sa, ca * se, -ca * ce, 0, ce, se];
        const colors = [60, 105, 150, 195, 255].flatMap((c) =>
            [...viridis.subarray(3 * c, 3 * c + 3)].map((x) => x / 255),
        );
        gl.viewport(0, 0, n, n);
        gl.clearColor(0, 0, 0, 0);
        gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
        gl.enable(gl.DEPTH_TEST);
        gl.useProgram(this.program);
        gl.bindBuffer(gl.ARRAY_BUFFER, this.vertices);
        gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.triangles);
        gl.enableVertexAttribArray(0);
        gl.vertexAttribPointer(0, 4, gl.FLOAT, false, 0, 0);
        gl.uniformMatrix3fv(uniform("turn"), false, turn);
        gl.uniform3fv(uniform("colors"), colors);
        gl.uniform4f(uniform("plain"), 0, 0, 0, 0);
        gl.drawElements(gl.TRIANGLES, this.count, gl.UNSIGNED_INT, 0);
        gl.uniform4f(uniform("plain"), 0.55, 0.58, 0.62, 1);
        gl.drawArrays(gl.LINE_LOOP, shape + 1, RIM);
        gl.drawArrays(gl.LINES, shape + 1 + RIM + 2, 2);
        gl.uniform4f(uniform("plain"), 0.2, 0.55, 0.9, 1);
        gl.drawArrays(gl.LINES, shape + 1 + RIM, 2);
    }
}
