// view_trade.js - what a tolerance costs: tier, promised bound, actual error, nanoseconds, bytes.
import {Chart, legend} from "./chart.js";
import {curlBox, line} from "./curl.js";
import {el, explain, field, table} from "./dom.js";
import {bytes, milliseconds, power, short} from "./numbers.js";
import {ask, askArrays, capabilities, Problem} from "./service.js";
import {set, state, woOf} from "./state.js";

export const title = "Trade";
export const lead =
    "You say how wrong a number may be, the service takes the cheapest way that promises it. Move the tolerance and see what it buys.";
export const usesMaterial = true;

const PAIRS = 2048;
const EXAMPLES = [1e-3, 1e-6, 1e-9, 1e-12];
const QUANTITY = "fr_cos";

const request = () => ({material: state.material, wo: woOf(), outputs: [QUANTITY]});

// Directions over the hemisphere, even in solid angle (a golden spiral), as float32 holds them.
const WI = Float32Array.from({length: PAIRS}, (_, k) => (k + 0.5) / PAIRS).reduce(
    (out, z, k) => {
        const s = Math.sqrt(1 - z * z),
            phi = k * 2.399963229728653;
        out.set([s * Math.cos(phi), s * Math.sin(phi), z], 3 * k);
        return out;
    },
    new Float32Array(3 * PAIRS),
);
const vectors = (count) =>
    Array.from({length: count}, (_, k) => [...WI.subarray(3 * k, 3 * k + 3)].map((x) => Number(x.toPrecision(9))));

function largestError(values, exact, floor) {
    let worst = 0;
    for (let i = 0; i < values.length; i++)
        worst = Math.max(worst, Math.abs(values[i] - exact[i]) / Math.max(Math.abs(exact[i]), floor));
    return worst;
}

// ns of one evaluation as the daemon measured it for this distribution; tables over the azimuth have their own.
function costOf(tiers, tier, {ndf, transmission, slopes}) {
    const hasRows = Array.isArray(slopes?.log_D[0]);
    const speeds = tiers.find((t) => t.name === tier)?.[transmission ? "transmission" : "models"];
    const model = speeds?.find((m) => m.ndf === ndf && hasRows === "azimuths" in m);
    return model?.quantities.find((q) => q.quantity === QUANTITY)?.ns;
}

// Errors are against precise float64, which has none against itself.
const actual = (row) => (row.tier === "precise" && !row.error ? "the reference" : short(row.error));

export function create({problem}) {
    let exact,
        exactKey = "",
        forced = [],
        examples = new Map(),
        tiers = [];
    const range = el("input", {
        type: "range",
        min: -15,
        max: -1,
        step: 0.25,
        "aria-label": "Tolerance, largest relative error accepted",
        oninput: () => set({tolerance: Number((10 ** Number(range.value)).toPrecision(3))}),
    });
    const big = el("output", {class: "big"}),
        facts = el("dl", {class: "facts-list"}),
        verdict = el("p", {class: "facts", role: "status"});
    const chart = new Chart({title: "Relative error against nanoseconds per evaluation, a point a tier", height: 330});
    const tableHere = el("div"),
        curl = curlBox();
    const key = legend([
        {name: "promised bound", color: 1, kind: "points"},
        {name: "actual largest error for this material", color: 2, kind: "rings"},
    ]);
    chart.node.append(key);
    const stage = el(
        "div",
        {class: "trade-view"},
        el(
            "div",
            {class: "card"},
            field("Tolerance: the largest relative error you accept in each number", range),
            big,
            facts,
        ),
        verdict,
        chart.node,
        tableHere,
        explain(
            "Each tier computes the same formula with more care: draft in float with estimated quotients and roots, fast in float, exact32 in double, right to a float, precise in compensated double. Each has a bound on its error that tests enforce; the service takes the first whose bound is within your tolerance.",
            "What you save at a loose tolerance: arithmetic (try Beckmann, whose exponentials cost most), half the bytes (float32 instead of float64), and digits of JSON. A picture needs 1e-3; a reference value 1e-12.",
            "Blue is what is promised for every input, the ring what really happened for this material over 2048 directions, against precise. Nanoseconds are this daemon's own measurement for the distribution, without its Fresnel term.",
        ),
        curl,
    );

    // "dtype" is of what is sent and of what comes back.
    const asked = (members, signal) =>
        askArrays(
            "v1/eval",
            {...request(), ...members},
            {wi: members.dtype === "float64" ? Float64Array.from(WI) : WI},
            signal,
        );

    // One answer in float32 or float64 as it would travel, and its error against precise float64.
    async function measure(members, signal) {
        const answer = await asked(members, signal);
        return {
            tier: answer.accuracy.tier,
            bound: answer.accuracy.bound,
            ms: answer.ms,
            size: answer.size,
            error: largestError(answer.arrays[QUANTITY], exact.arrays[QUANTITY], exact.accuracy.floor),
        };
    }

    // What does not depend on the tolerance: the reference, each tier, the examples of the table.
    async function prepare(signal) {
        const now = JSON.stringify(request());
        if (now === exactKey) return;
        ({tiers} = await capabilities());
        exact = await asked({tier: "precise", dtype: "float64"}, signal);
        const each = async (list, members) =>
            Promise.all(
                list.map(async (value) => {
                    try {
                        return [value, await measure(members(value), signal)];
                    } catch (error) {
                        if (error instanceof Problem) return [value, null]; // this one promises nothing here
                        throw error;
                    }
                }),
            );
        forced = await each(
            tiers.map((t) => t.name),
            (tier) => ({tier, dtype: "float64"}),
        );
        examples = new Map(await each(EXAMPLES, (tolerance) => ({tolerance})));
        for (const [tolerance, row] of examples)
            if (row) row.json = (await ask("v1/eval", {...request(), wi: vectors(PAIRS), tolerance}, signal)).size;
        exactKey = now;
    }

    function pairs(current) {
        facts.replaceChildren(
            ...[
                ["Tier", current.tier],
                ["Promised", `≤ ${short(current.bound)}`],
                ["Actual, largest of " + PAIRS.toLocaleString("en"), actual(current)],
                ["One evaluation", current.ns === undefined ? "–" : `${short(current.ns)} ns`],
                [
                    "On the wire, a direction",
                    `${short(current.size / PAIRS)} B raw, ${short(current.json / PAIRS)} B JSON`,
                ],
                ["This request", milliseconds(current.ms)],
            ].map(([name, value]) => el("div", {}, el("dt", {}, name), el("dd", {}, value))),
        );
    }

    function draw(current) {
        const cost = (tier) => costOf(tiers, tier, state.material);
        const known = forced.filter(([tier, row]) => row && cost(tier) !== undefined);
        const most = Math.max(2, ...known.map(([tier]) => cost(tier)), current?.ns ?? 0) * 1.2;
        const floor = 1e-16;
        chart.draw({
            x: {label: "ns per evaluation, measured by this daemon", min: 0, max: most},
            y: {label: "relative error", log: true, min: floor, max: 1},
            series: [
                {
                    name: "promised",
                    kind: "points",
                    color: 1,
                    xs: known.map(([tier]) => cost(tier)),
                    ys: known.map(([, r]) => r.bound),
                    labels: known.map(([tier]) => tier),
                },
                {
                    name: "actual",
                    kind: "rings",
                    color: 2,
                    xs: known.map(([tier]) => cost(tier)),
                    ys: known.map(([, r]) => Math.max(r.error, floor)),
                },
            ],
            rules: [{y: state.tolerance, name: `tolerance ${short(state.tolerance)}`}],
            mark: current?.ns !== undefined && {x: current.ns, y: current.bound},
        });
    }

    function drawTable(current) {
        const rows = [...examples].map(([tolerance, row]) => ({tolerance, row}));
        if (!EXAMPLES.includes(state.tolerance)) rows.push({tolerance: state.tolerance, row: current});
        rows.sort((a, b) => b.tolerance - a.tolerance);
        tableHere.replaceChildren(
            table(
                "What a tolerance costs for this material",
                ["tolerance", "tier", "promised", "actual", "ns", "bytes raw", "bytes JSON"],
                rows.map(({tolerance, row}) => ({
                    className: tolerance === state.tolerance ? "chosen" : undefined,
                    cells: row
                        ? [
                              short(tolerance),
                              row.tier,
                              short(row.bound),
                              actual(row),
                              short(costOf(tiers, row.tier, state.material)),
                              short(row.size / PAIRS),
                              short(row.json / PAIRS),
                          ]
                        : [short(tolerance), "none promises it", "–", "–", "–", "–", "–"],
                })),
            ),
        );
    }

    function sentence(current) {
        const other = examples.get(1e-12),
            ns = (row) => costOf(tiers, row.tier, state.material);
        if (!other)
            return `No tier can promise ${power(-12)} for this material: its own constants amplify rounding. The chosen tolerance takes ${current.tier}.`;
        if (current.tier === other.tier && current.size === other.size)
            return `At ${short(state.tolerance)} you pay what ${power(-12)} costs: tier ${current.tier}, ${short(current.size / PAIRS)} bytes a direction.`;
        const ratio = (a, b) => `${short(b / a, 2)} times`;
        return (
            `Against a tolerance of ${power(-12)} you save: evaluation ${ratio(ns(current), ns(other))} as fast, ` +
            `${ratio(current.size, other.size)} fewer bytes raw and ${ratio(current.json, other.json)} fewer as JSON. ` +
            `The error stays ${short(current.error)}, below the ${short(current.bound)} promised.`
        );
    }

    async function redraw(signal) {
        await prepare(signal);
        let current = null;
        try {
            current = await measure({tolerance: state.tolerance}, signal);
            const text = await ask("v1/eval", {...request(), wi: vectors(PAIRS), tolerance: state.tolerance}, signal);
            Object.assign(current, {json: text.size, ns: costOf(tiers, current.tier, state.material)});
            problem.clear();
        } catch (error) {
            if (!(error instanceof Problem)) throw error;
            problem.show(error);
        }
        if (current) (pairs(current), (verdict.textContent = sentence(current)));
        else (facts.replaceChildren(), (verdict.textContent = ""));
        draw(current);
        drawTable(current);
        const example = {...request(), wi: vectors(3), tolerance: state.tolerance};
        curl.set([
            [
                "Three of these directions as JSON, with the tier and bound they came with",
                line("v1/eval", {request: example}),
            ],
            [
                "Half a million as raw numbers; the headers name the layout and the accuracy",
                line("v1/eval", {
                    request: {...example, wi: {random: {n: 500000}}},
                    accept: "application/octet-stream",
                    output: "fr_cos.bin -D -",
                }),
            ],
            ["What each tier promises and costs here", line("v1/capabilities")],
        ]);
    }

    let busy = false,
        stale = false;
    return {
        stage,
        async update() {
            range.value = Math.log10(state.tolerance);
            range.setAttribute("aria-valuetext", short(state.tolerance));
            big.textContent = short(state.tolerance);
            stale = true;
            if (busy) return;
            busy = true;
            while (stale) {
                stale = false;
                try {
                    await redraw();
                } catch (error) {
                    problem.show(error);
                }
            }
            busy = false;
        },
    };
}
