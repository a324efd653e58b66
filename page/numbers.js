// numbers.js - how numbers read: real units, three digits, superscripts for powers of ten.

const SUPERSCRIPT = {"-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹"};

export function power(exponent) {
    return "10" + [...String(exponent)].map((c) => SUPERSCRIPT[c]).join("");
}

export function short(x, digits = 3) {
    if (x === undefined || x === null || Number.isNaN(x)) return "–";
    if (x === 0) return "0";
    const size = Math.abs(x);
    if (!Number.isFinite(x)) return x > 0 ? "∞" : "−∞";
    if (size >= 1e-3 && size < 1e5) return String(Number(x.toPrecision(digits))).replace("-", "−");
    let e = Math.floor(Math.log10(size)),
        mantissa = (x / 10 ** e).toPrecision(Math.min(digits, 2));
    if (Math.abs(Number(mantissa)) === 10) ((mantissa = "1"), e++);
    mantissa = String(Number(mantissa)).replace("-", "−");
    return mantissa === "1" ? power(e) : `${mantissa}·${power(e)}`;
}

export function bytes(n) {
    if (n < 1000) return `${n} B`;
    if (n < 1e6) return `${short(n / 1e3)} kB`;
    return `${short(n / 1e6)} MB`;
}

export function milliseconds(ms) {
    return ms < 10 ? `${ms.toFixed(1)} ms` : ms < 1000 ? `${Math.round(ms)} ms` : `${(ms / 1000).toFixed(2)} s`;
}

export const DEGREE = Math.PI / 180;

export function degrees(radians) {
    return `${(radians / DEGREE).toFixed(0).replace("-", "−")}°`;
}

// Rec. 709; of one channel the number itself.
export function luminance(values, channels) {
    if (channels === 1) return values;
    const out = new Float64Array(values.length / 3);
    for (let i = 0; i < out.length; i++)
        out[i] = 0.2126 * values[3 * i] + 0.7152 * values[3 * i + 1] + 0.0722 * values[3 * i + 2];
    return out;
}

// Anchors of viridis, which keeps its order in grey and for every kind of colour vision.
const VIRIDIS = [0x440154, 0x482878, 0x3e4989, 0x31688e, 0x26828e, 0x1f9e89, 0x35b779, 0x6ece58, 0xb5de2b, 0xfde725];

export const viridis = (() => {
    const out = new Uint8ClampedArray(3 * 256);
    for (let i = 0; i < 256; i++) {
        const x = (i / 255) * (VIRIDIS.length - 1),
            k = Math.min(Math.floor(x), VIRIDIS.length - 2),
            f = x - k;
        for (let c = 0; c < 3; c++) {
            const a = (VIRIDIS[k] >> (16 - 8 * c)) & 255,
                b = (VIRIDIS[k + 1] >> (16 - 8 * c)) & 255;
            out[3 * i + c] = a + f * (b - a);
        }
    }
    return out;
})();

export function sRGB(x) {
    return x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055;
}
