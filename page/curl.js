// curl.js - the lines to take home: the same request from a shell, for this daemon.
import {button, el} from "./dom.js";

const origin = () => location.href.replace(/[?#].*/, "").replace(/\/$/, "");

const quote = (text) => `'${text.replaceAll("'", "'\\''")}'`;

export function line(path, {request, file, accept, output} = {}) {
    const parts = ["curl -s", path.includes("?") ? quote(`${origin()}/${path}`) : `${origin()}/${path}`];
    if (accept) parts.push(`-H ${quote(`Accept: ${accept}`)}`);
    if (file) parts.push(`--data-binary ${quote(`@${file}`)}`);
    if (request) parts.push(`-d ${quote(JSON.stringify(request))}`);
    if (output) parts.push(`-o ${output}`);
    return parts.join(" ");
}

// Without https, and away from localhost, browsers give no clipboard: then the line is selected, ready to be copied.
async function copied(code) {
    try {
        await navigator.clipboard.writeText(code.textContent);
        return true;
    } catch {
        getSelection().selectAllChildren(code);
        return document.execCommand("copy");
    }
}

// Lines with what they do; set([[what, line], ...]).
export function curlBox() {
    const list = el("div");
    const node = el("section", {class: "curl"}, el("h2", {}, "The same from a shell"), list);
    node.set = (lines) => {
        const key = JSON.stringify(lines);
        if (node.key === key) return;
        node.key = key;
        list.replaceChildren(
            ...lines.map(([what, text]) => {
                const code = el("code", {}, text);
                const copy = button(
                    "Copy",
                    async () => {
                        copy.textContent = (await copied(code)) ? "Copied" : "Selected";
                        setTimeout(() => {
                            copy.textContent = "Copy";
                        }, 1500);
                    },
                    {"aria-label": `Copy the line: ${what}`},
                );
                return el(
                    "div",
                    {class: "line"},
                    el("p", {}, what),
                    el("pre", {tabindex: 0, "aria-label": `curl: ${what}`}, code),
                    copy,
                );
            }),
        );
    };
    return node;
}
