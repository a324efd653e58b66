// exr.js - one level of the tiled, MIP-mapped, uncompressed float EXR that /v1/leadr answers.

const MAGIC = 20000630;

function reader(buffer) {
    const view = new DataView(buffer),
        bytes = new Uint8Array(buffer);
    let at = 0;
    return {
        view,
        seek: (to) => {
            at = to;
        },
        at: () => at,
        int() {
            at += 4;
            return view.getInt32(at - 4, true);
        },
        byte: () => view.getUint8(at++),
        text() {
            const from = at;
            while (bytes[at++]);
            return new TextDecoder().decode(bytes.subarray(from, at - 1));
        },
    };
}

// Attributes that are needed: names of channels (in the file's order), size of the map and of a tile.
function header(r) {
    if (r.int() !== MAGIC) throw new Error("this is no EXR");
    r.int();
    const out = {channels: []};
    for (let name = r.text(); name; name = r.text()) {
        const type = r.text(),
            size = r.int(),
            from = r.at();
        if (type === "chlist") {
            for (let channel = r.text(); channel; channel = r.text()) {
                if (r.int() !== 2) throw new Error("channels of this EXR are not float");
                out.channels.push(channel);
                r.seek(r.at() + 12);
            }
        } else if (name === "dataWindow") {
            const [x0, y0, x1, y1] = [r.int(), r.int(), r.int(), r.int()];
            ((out.width = x1 - x0 + 1), (out.height = y1 - y0 + 1));
        } else if (name === "tiles") {
            out.tile = [r.int(), r.int()];
        } else if (name === "compression" && r.byte()) {
            throw new Error("this EXR is compressed");
        }
        r.seek(from + size);
    }
    return out;
}

// {width, height, channels: {E1: Float32Array, ...}} of a level, rows from the top.
export function exrLevel(buffer, level) {
    const r = reader(buffer),
        {channels, width, height, tile} = header(r);
    const sizeOf = (n) => [Math.max(1, width >> n), Math.max(1, height >> n)];
    const tilesOf = (n) => sizeOf(n).map((side, k) => Math.ceil(side / tile[k]));
    let skip = 0;
    for (let n = 0; n < level; n++) skip += tilesOf(n)[0] * tilesOf(n)[1];
    const table = r.at(),
        [w, h] = sizeOf(level),
        [tx, ty] = tilesOf(level);
    const out = Object.fromEntries(channels.map((name) => [name, new Float32Array(w * h)]));
    for (let k = 0; k < tx * ty; k++) {
        r.seek(Number(r.view.getBigUint64(table + 8 * (skip + k), true)));
        const x0 = r.int() * tile[0],
            y0 = r.int() * tile[1];
        r.seek(r.at() + 12); // level along x, along y, bytes
        const columns = Math.min(tile[0], w - x0),
            rows = Math.min(tile[1], h - y0);
        let at = r.at();
        for (let y = 0; y < rows; y++)
            for (const name of channels)
                for (let x = 0; x < columns; x++, at += 4)
                    out[name][(y0 + y) * w + x0 + x] = r.view.getFloat32(at, true);
    }
    return {width: w, height: h, channels: out};
}
