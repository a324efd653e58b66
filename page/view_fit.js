// view_fit.js - a measured material in, the smallest model that meets the tolerance out.
import {Chart} from "./chart.js";
import {curlBox, line} from "./curl.js";
import {button, dropZone, el, explain, field, saveAs, select, slider, table} from "./dom.js";
import {bytes, milliseconds, short} from "./numbers.js";
import {schema, upload} from "./service.js";
import {set, state} from "./state.js";

export const title = "Fit";
export const lead =
    "Drop a measured material: MERL .binary, RGL .bsdf, UTIA .bin or CSV. The service fits every model it has and takes the smallest that is good enough.";
export const usesMaterial = false;

const PICTURE = "image/svg+xml";
// Logarithmic axes have no 0: an error below a double's rounding is shown there.
const ROUNDING = 1e-16;

function nameOf(c) {
    const parts = [
        c.model === "ggx" ? "GGX" : c.model === "beckmann" ? "Beckmann" : "Tabulated",
        c.fresnel === "schlick" ? "Schlick" : "Fresnel table",
    ];
    if (c.anisotropic) parts.push(c.azimuths ? "over the azimuth" : "anisotropic");
    if (c.diffuse) parts.push("diffuse");
    return parts.join(", ");
}

// What eval takes, where the candidate says all of it; the chosen one comes whole with the answer.
function materialOf(c) {
    if (c.model === "tabulated" || c.fresnel !== "schlick" || !c.f0) return null;
    const f0 = c.f0.length === 1 ? c.f0[0] : c.f0;
    const rough = c.anisotropic ? {alpha_x: c.alpha_x, alpha_y: c.alpha_y, rho: c.rho} : {alpha: c.alpha};
    return {
        ndf: c.model,
        ...rough,
        fresnel: {schlick: {f0}},
        ...(c.kd ? {diffuse: c.kd.length === 1 ? c.kd[0] : c.kd} : {}),
    };
}

export function create({problem, go}) {
    let file, answer, controller, picture;
    const drop = dropZone("Drop a measurement here, or click to choose one", ".binary,.bsdf,.bin,.csv", (chosen) => {
        file = chosen;
        fit();
    });
    drop.querySelector("input").setAttribute("aria-describedby", "fit-formats");
    const tolerance = slider({
        label: "rms of log error accepted",
        min: 1e-3,
        max: 1,
        value: 0.1,
        scale: "log",
        digits: 2,
        onchange: (x) => set({fit: {...state.fit, tolerance: x}}),
    });
    const model = select([["auto", "every model"]], "auto", (value) => set({fit: {...state.fit, model: value}}));
    const sample = button("No file? Fit the material of the other views", () => {
        file = new File([JSON.stringify({source: state.material})], "material.json");
        fit();
    });
    const again = button("Fit again", () => fit(), {disabled: true});
    const progress = el("progress", {max: 1, value: 0, "aria-label": "Progress of the fit"}),
        status = el("p", {class: "readout", role: "status"}, "No file yet.");
    const controls = el(
        "div",
        {class: "card"},
        el("h2", {}, "Measurement"),
        drop,
        el("p", {class: "small", id: "fit-formats"}, "It is sent to this daemon and nowhere else."),
        tolerance,
        field("Model", model),
        again,
        sample,
        progress,
        status,
    );
    const results = el("div"),
        exported = el("div"),
        curl = curlBox();
    const stage = el(
        "div",
        {class: "fit-view"},
        results,
        exported,
        explain(
            "A measured material is a table of how much light goes from each direction to each other one, tens of megabytes. A fit finds the few numbers of a formula that come close to it: 32 bytes for GGX with Schlick's term, some kilobytes with tables.",
            "The error is the root mean square of the log of measured over fitted: 0.1 is about ten percent. The smallest model within what you accept is taken; the table shows what more bytes would buy.",
        ),
        curl,
    );

    const path = (extra = "") =>
        `v1/fit?tolerance=${state.fit.tolerance}${state.fit.model === "auto" ? "" : `&model=${state.fit.model}`}${extra}`;

    function showCurl() {
        const body =
            file?.name === "material.json" ? {request: {source: state.material}} : {file: file?.name ?? "gold.binary"};
        curl.set([
            ["Fit a measurement; the material in the answer is what /v1/eval takes", line(path(), body)],
            ["The picture of measured and fitted lobes", line(path(), {...body, accept: PICTURE, output: "lobes.svg"})],
            ["The material as text for Mitsuba", line(path("&export=mitsuba"), body)],
        ]);
    }

    function pareto() {
        const rows = answer.candidates,
            chart = new Chart({title: "Candidates: size against error", height: 300});
        const chosen = rows.find((c) => isChosen(c)) ?? null;
        const shown = (c) => Math.max(c.error.rms_log, ROUNDING),
            errors = rows.map(shown),
            low = Math.min(...errors, state.fit.tolerance),
            high = Math.max(...errors, state.fit.tolerance);
        chart.draw({
            x: {
                label: "bytes of the model's numbers",
                log: true,
                min: 8,
                max: 10 ** Math.ceil(Math.log10(Math.max(...rows.map((c) => c.bytes))) + 0.1),
            },
            y: {
                label: "rms of log error",
                log: true,
                min: 10 ** Math.floor(Math.log10(low) - 0.05),
                max: 10 ** Math.ceil(Math.log10(high) + 0.05),
            },
            series: [
                {name: "front", color: 6, dash: "3 4", xs: rows.map((c) => c.bytes), ys: errors},
                {
                    name: "candidates",
                    kind: "points",
                    color: 1,
                    xs: rows.map((c) => c.bytes),
                    ys: errors,
                    labels: rows.map((c) => c.model),
                },
            ],
            rules: [{y: state.fit.tolerance, name: `accepted ${short(state.fit.tolerance)}`}],
            mark: chosen && {x: chosen.bytes, y: shown(chosen)},
        });
        chart.node.append(el("figcaption", {}, "Smaller is to the left, better is below; the ring is the one taken."));
        return chart.node;
    }

    const isChosen = (c) =>
        answer.material && c.error.rms_log === answer.error.rms_log && c.model === answer.chosen.model;
    const use = (material) => go("lobe", {material, theta: -0.7});

    function candidates() {
        return table(
            `Candidates that no smaller one equals, of ${answer.considered} fitted`,
            ["model", "rms log", "backscatter", "bytes", "ns", "α", "take it"],
            answer.candidates.map((c) => {
                const material = isChosen(c) ? answer.material : materialOf(c);
                return {
                    className: isChosen(c) ? "chosen" : undefined,
                    cells: [
                        nameOf(c),
                        short(c.error.rms_log),
                        short(c.error.backscatter_max),
                        String(c.bytes),
                        short(c.ns_per_eval),
                        c.alpha !== undefined
                            ? short(c.alpha)
                            : c.alpha_x !== undefined
                              ? `${short(c.alpha_x)} × ${short(c.alpha_y)}`
                              : `${c.slopes} nodes`,
                        material ? button("Use", () => use(material), {"aria-label": `Use ${nameOf(c)}`}) : "",
                    ],
                };
            }),
        );
    }

    function show() {
        const {chosen, error} = answer;
        const head = el(
            "div",
            {class: "card"},
            el("h2", {}, answer.fits ? nameOf(chosen) : "Nothing fits"),
            el(
                "p",
                {},
                answer.fits
                    ? `${chosen.why[0].toUpperCase()}${chosen.why.slice(1)}. rms of log error ${short(error.rms_log)}.`
                    : (answer.fits_why ?? chosen.why),
            ),
            answer.warning ? el("p", {}, answer.warning) : null,
            answer.material
                ? el(
                      "div",
                      {class: "row"},
                      button("Use this material", () => use(answer.material), {class: "main"}),
                      button("Save as JSON", () =>
                          saveAs(
                              new Blob([JSON.stringify(answer.material)], {type: "application/json"}),
                              `${file.name}.json`,
                          ),
                      ),
                  )
                : null,
        );
        results.replaceChildren(
            head,
            el(
                "figure",
                {},
                picture,
                el(
                    "figcaption",
                    {},
                    "Measured (solid) and fitted (dashed) f_r cos θi in the plane of incidence, red, green and blue, at three angles of view.",
                ),
            ),
            pareto(),
            candidates(),
        );
    }

    async function showExports() {
        const targets =
            (await schema(["paths", "/v1/fit", "post", "parameters"])).find((p) => p.name === "export")?.schema.enum ??
            [];
        const text = el("pre", {tabindex: 0, "aria-label": "The material as text"}),
            lost = el("p", {class: "readout", role: "status"});
        text.hidden = true;
        exported.replaceChildren(
            el(
                "div",
                {class: "card"},
                el("h2", {}, "As text for another tool"),
                el(
                    "div",
                    {class: "row"},
                    targets.map((target) =>
                        button(target, async () => {
                            lost.textContent = "Fitting and writing.";
                            try {
                                const {json} = await upload(path(`&export=${target}`), file);
                                const told = json().export;
                                text.hidden = false;
                                text.textContent = told.text;
                                lost.textContent = `${told.tool}: rms of log error ${short(told.rms_log)} against the fit${told.lost ? `; ${told.lost}` : ""}.`;
                            } catch (error) {
                                lost.textContent = `${target}: ${error.message}`;
                            }
                        }),
                    ),
                ),
                text,
                lost,
            ),
        );
    }

    async function showPicture(signal) {
        const {body} = await upload(path(), file, {accept: PICTURE, signal});
        picture.src = URL.createObjectURL(new Blob([body], {type: PICTURE}));
        picture.alt = `Measured and fitted lobes of ${file.name}`;
    }

    async function fit() {
        if (!file) return;
        controller?.abort();
        const mine = (controller = new AbortController());
        again.disabled = false;
        problem.clear();
        progress.value = 0;
        status.textContent = `Sending ${file.name}, ${bytes(file.size)}.`;
        showCurl();
        const began = performance.now();
        try {
            const result = await upload(path(), file, {
                signal: mine.signal,
                progress: (part) => {
                    progress.value = part * 0.9;
                    if (part === 1) {
                        progress.removeAttribute("value"); // how long a fit takes nobody knows
                        status.textContent = "All sent, fitting.";
                    }
                },
            });
            answer = result.json();
            progress.value = 1;
            status.textContent = `${file.name}: fitted in ${milliseconds(answer.timing_ms)}, ${milliseconds(performance.now() - began)} with the upload.`;
            picture = el("img", {class: "lobes", alt: "", width: 760, height: 720});
            show();
            await Promise.all([showPicture(mine.signal), showExports()]);
        } catch (error) {
            if (error.name === "AbortError") return;
            progress.value = 0;
            status.textContent = `${file.name}: not fitted.`;
            problem.show(error);
        }
    }

    let shown = "";
    return {
        controls,
        stage,
        async update() {
            tolerance.set(state.fit.tolerance);
            showCurl();
            const models = (await schema(["paths", "/v1/fit", "post", "parameters"])).find((p) => p.name === "model")
                .schema.enum;
            model.replaceChildren(
                ...models.map((m) =>
                    el("option", {value: m, selected: m === state.fit.model}, m === "auto" ? "every model" : m),
                ),
            );
            if (!answer)
                results.replaceChildren(
                    el(
                        "div",
                        {class: "empty"},
                        el(
                            "p",
                            {},
                            "Measured lobes, the fitted ones over them, and the table of candidates appear here.",
                        ),
                    ),
                );
            const now = JSON.stringify(state.fit);
            if (shown && shown !== now && file) fit();
            shown = now;
        },
    };
}
