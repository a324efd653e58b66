// service.js - asks facetd: JSON, arrays of float32 or float64 as they lie in memory, files.

export class Problem extends Error {
    constructor(status, problem) {
        super(problem.detail || problem.title || `status ${status}`);
        this.status = status;
        this.problem = problem;
    }
}

export class Unreachable extends Error {
    constructor() {
        super("facetd does not answer");
    }
}

// "lost" and "back" when the daemon leaves and returns, "token" when it asks for one.
export const events = new EventTarget();
let reachable = true;
let token = sessionStorage.getItem("token") ?? "";

export function setToken(text) {
    token = text;
    sessionStorage.setItem("token", text);
}

async function waitUntilBack() {
    while (!reachable) {
        await new Promise((resolve) => setTimeout(resolve, 500));
        try {
            const answer = await fetch("healthz", {cache: "no-store"});
            if (answer.ok) reachable = true;
        } catch {
            /* still gone */
        }
    }
    events.dispatchEvent(new Event("back"));
}

function lost() {
    if (reachable) {
        reachable = false;
        events.dispatchEvent(new Event("lost"));
        waitUntilBack();
    }
    return new Unreachable();
}

function authorization() {
    return token ? {Authorization: `Bearer ${token}`} : {};
}

function refusal(status, text) {
    let problem = {};
    try {
        problem = JSON.parse(text);
    } catch {
        /* a proxy's page */
    }
    if (status === 401) events.dispatchEvent(new Event("token"));
    return new Problem(status, problem);
}

const BUSY = [429, 503],
    PATIENCE = 3;

async function send(path, init) {
    let began, answer, body;
    for (let attempt = 0; ; attempt++) {
        began = performance.now();
        try {
            answer = await fetch(path, {...init, headers: {...authorization(), ...init.headers}});
            body = await answer.arrayBuffer();
        } catch (error) {
            if (error.name === "AbortError") throw error;
            throw lost();
        }
        const wait = Number(answer.headers.get("Retry-After"));
        if (!BUSY.includes(answer.status) || !wait || attempt === PATIENCE) break;
        await new Promise((resolve) => setTimeout(resolve, 1000 * wait));
    }
    if (!answer.ok) throw refusal(answer.status, new TextDecoder().decode(body));
    return {answer, body, ms: performance.now() - began};
}

export async function get(path) {
    const {body} = await send(path, {});
    return JSON.parse(new TextDecoder().decode(body));
}

// {answer, size in bytes of the text, wire: bytes that travelled, ms}
export async function ask(path, request, signal) {
    const {answer, body, ms} = await send(path, {
        method: "POST",
        body: JSON.stringify(request),
        signal,
        headers: {"Content-Type": "application/json", Accept: "application/json"},
    });
    return {
        answer: JSON.parse(new TextDecoder().decode(body)),
        size: body.byteLength,
        wire: Number(answer.headers.get("Content-Length")) || body.byteLength,
        ms,
    };
}

const ARRAYS = {"<f4": Float32Array, "<f8": Float64Array};

function unpack(layout, body) {
    const arrays = {};
    let at = 0;
    for (const {name, dtype, shape} of layout) {
        const Type = ARRAYS[dtype],
            count = shape.reduce((a, b) => a * b, 1),
            size = count * Type.BYTES_PER_ELEMENT;
        // A copy where the offset does not suit the type.
        arrays[name] = at % Type.BYTES_PER_ELEMENT ? new Type(body.slice(at, at + size)) : new Type(body, at, count);
        arrays[name].channels = shape.length > 1 ? shape[shape.length - 1] : 1;
        at += size;
    }
    return arrays;
}

// FormData would need a Blob for each array, and a Blob a message to another process.
function multipart(request, parts) {
    const boundary = `facet${Math.random().toString(36).slice(2)}${Math.random().toString(36).slice(2)}`,
        text = new TextEncoder();
    const pieces = [
        text.encode(`--${boundary}\r\nContent-Disposition: form-data; name="request"\r\n\r\n${request}\r\n`),
    ];
    for (const [name, array] of Object.entries(parts))
        pieces.push(
            text.encode(
                `--${boundary}\r\nContent-Disposition: form-data; name="${name}"\r\nContent-Type: application/octet-stream\r\n\r\n`,
            ),
            new Uint8Array(array.buffer, array.byteOffset, array.byteLength),
            text.encode("\r\n"),
        );
    pieces.push(text.encode(`--${boundary}--\r\n`));
    const body = new Uint8Array(pieces.reduce((sum, piece) => sum + piece.length, 0));
    let at = 0;
    for (const piece of pieces) (body.set(piece, at), (at += piece.length));
    return {body, type: `multipart/form-data; boundary=${boundary}`};
}

// The same request and answer with the numbers as they lie in memory; `parts`: arrays that go along.
export async function askArrays(path, request, parts, signal) {
    let body = JSON.stringify(request);
    const headers = {Accept: "application/octet-stream"};
    if (parts) {
        const form = multipart(body, parts);
        body = form.body;
        headers["Content-Type"] = form.type;
    } else {
        headers["Content-Type"] = "application/json";
    }
    const {answer, body: bytes, ms} = await send(path, {method: "POST", body, headers, signal});
    return {
        ...JSON.parse(answer.headers.get("Facet-Answer")),
        ms,
        size: bytes.byteLength,
        arrays: unpack(JSON.parse(answer.headers.get("Facet-Layout")), bytes),
    };
}

// Sends a file; fetch tells nothing of an upload's progress, so the older interface does it.
export function upload(path, file, {accept = "application/json", progress, signal} = {}) {
    return new Promise((resolve, reject) => {
        const began = performance.now(),
            xhr = new XMLHttpRequest();
        xhr.open("POST", path);
        xhr.responseType = "arraybuffer";
        xhr.setRequestHeader("Accept", accept);
        xhr.setRequestHeader("Content-Type", "application/octet-stream");
        for (const [name, value] of Object.entries(authorization())) xhr.setRequestHeader(name, value);
        xhr.upload.onprogress = (event) => progress?.(event.loaded / event.total);
        xhr.onload = () => {
            if (xhr.status !== 200) return reject(refusal(xhr.status, new TextDecoder().decode(xhr.response)));
            const type = xhr.getResponseHeader("Content-Type");
            resolve({
                body: xhr.response,
                type,
                ms: performance.now() - began,
                header: (name) => xhr.getResponseHeader(name),
                json: () => JSON.parse(new TextDecoder().decode(xhr.response)),
            });
        };
        xhr.onerror = () => reject(lost());
        xhr.onabort = () => reject(new DOMException("given up", "AbortError"));
        signal?.addEventListener("abort", () => xhr.abort());
        xhr.send(file);
    });
}

let once;
// What the daemon offers: asked once, again after it was away.
export function capabilities() {
    return (once ??= get("v1/capabilities").catch((error) => {
        once = undefined;
        throw error;
    }));
}
export function forgetCapabilities() {
    once = undefined;
}

let document;
export async function schema(path) {
    document ??= get("v1/openapi.json").catch((error) => {
        document = undefined;
        throw error;
    });
    return path.reduce((at, name) => at?.[name], await document);
}
