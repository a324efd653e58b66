// page.mjs FACETD - each view of the page does its work in a real browser against a live daemon.
import {copyFileSync, existsSync, readFileSync} from "node:fs";
import {accessible, browse, check, Daemon, failures, fitsWidth, note, open, runCurl, shot} from "./browser.mjs";

const shared = process.env.FACET_SHARED,
    SHOTS = "build/page";
const daemon = new Daemon(process.argv[2]);
let browser;

const settled = (page) => page.waitForFunction(() => document.querySelector(".rate")?.dataset.total > 0);
const visit = (page, fragment) => page.goto(`${daemon.url}/#/${fragment}`);
const post = async (path, request) =>
    (
        await fetch(`${daemon.url}/${path}`, {
            method: "POST",
            headers: {"Content-Type": "application/json"},
            body: JSON.stringify(request),
        })
    ).json();
// "4.9·10⁻⁴" and "0.001" as numbers.
const number = (text) =>
    Number(
        [...text.replace(/^10(?=[⁻⁰¹²³⁴-⁹])/, "1e").replace("·10", "e")]
            .map((c) => ("⁰¹²³⁴⁵⁶⁷⁸⁹".indexOf(c) < 0 ? c.replace(/[⁻−]/, "-") : "⁰¹²³⁴⁵⁶⁷⁸⁹".indexOf(c)))
            .join(""),
    );

async function lobe() {
    const page = await open(browser),
        network = await page.context().newCDPSession(page);
    let bytes = 0;
    await network.send("Network.enable");
    network.on("Network.loadingFinished", (event) => {
        bytes += event.encodedDataLength;
    });
    const began = performance.now();
    await visit(page, "lobe");
    await settled(page);
    note(`first view: ${Math.round(bytes / 1000)} kB in ${Math.round(performance.now() - began)} ms`);
    check("first view within 300 kB", bytes > 10000 && bytes <= 300e3, bytes);
    check(
        "lobe says its peak",
        /largest, 0\.\d+ sr⁻¹, at 4\d°/.test(await page.locator(".facts").textContent()),
        await page.locator(".facts").textContent(),
    );
    await shot(page, "lobe");
    await accessible(page, "lobe");

    // The curl line gives what the page shows.
    const {fr_cos} = JSON.parse(await runCurl(page, 0));
    const luminance = fr_cos.map(([r, g, b]) => 0.2126 * r + 0.7152 * g + 0.0722 * b),
        shown = number((await page.locator("figure .readout").first().textContent()).match(/[\d.]+/)[0]);
    check("lobe curl agrees", Math.abs(Math.max(...luminance) / shown - 1) < 0.01, [Math.max(...luminance), shown]);
    check("lobe curl of the plane", JSON.parse(await runCurl(page, 1)).fr_cos.length === 45);

    // Dragging wo: many redraws, one request of each kind at a time.
    const handle = await page.locator(".polar .handle").boundingBox(),
        picture = await page.locator(".polar").boundingBox();
    const before = await page.evaluate(() => Number(document.querySelector(".rate").dataset.total)),
        from = performance.now();
    await page.mouse.move(handle.x + handle.width / 2, handle.y + handle.height / 2);
    await page.mouse.down();
    for (let k = 0; k < 60; k++)
        await page.mouse.move(picture.x + picture.width * (0.15 + (0.7 * k) / 60), picture.y + 40);
    const seconds = (performance.now() - from) / 1000;
    const rate = await page.evaluate(() => ({...document.querySelector(".rate").dataset}));
    await page.mouse.up();
    note(
        `dragging: ${((rate.total - before) / seconds).toFixed(1)} redraws a second, a request ${Number(rate.median).toFixed(1)} ms (median), ${Number(rate.worst).toFixed(1)} ms (95 %)`,
    );
    check("dragging wo redraws", rate.total - before > 10, rate);
    const theta = async () => Number(await page.locator(".polar .handle").getAttribute("aria-valuenow"));
    check("wo followed the pointer", (await theta()) > 30, await theta());

    // The same by keys; the address keeps it.
    await page.locator(".polar .handle").focus();
    const at = await theta();
    for (let k = 0; k < 3; k++) await page.keyboard.press("ArrowLeft");
    check("wo by keys", (await theta()) === at - 3, [at, await theta()]);
    await page.getByLabel("Anisotropic").check();
    await page.getByLabel("ρ, correlation of slopes", {exact: true}).fill("0.6");
    await page.keyboard.press("Tab");
    await page.locator("select").filter({hasText: "Copper"}).selectOption("metal:Cu");
    for (const label of ["D(h)", "G", "F"]) await page.locator(".overlays").getByLabel(label, {exact: true}).check();
    await page.waitForFunction(
        () => /rho/.test(decodeURIComponent(location.hash)) && /metal/.test(decodeURIComponent(location.hash)),
    );
    await page.waitForTimeout(300);
    await shot(page, "lobe-copper");
    await page.getByLabel("As a body in space").check();
    const filled = () =>
        page.evaluate(() => {
            const small = Object.assign(document.createElement("canvas"), {width: 64, height: 64}).getContext("2d");
            small.drawImage(document.querySelector(".solid"), 0, 0, 64, 64);
            return small.getImageData(0, 0, 64, 64).data.filter((x, k) => k % 4 === 3 && x > 127).length;
        });
    await page.waitForTimeout(500);
    const area = await filled();
    await page.locator(".solid").press("ArrowRight");
    check("lobe as a body", area > 60 && area < 3000 && (await filled()) !== area, [area, await filled()]);
    await shot(page, "lobe-body");
    await page.getByLabel("As a body in space").uncheck();
    await page.waitForFunction(() => !/solid/.test(location.hash));
    const again = await open(browser, {colorScheme: "dark"});
    await again.goto(page.url());
    await settled(again);
    check(
        "the address brings it back",
        (await again.getByLabel("ρ, correlation of slopes", {exact: true}).inputValue()) === "0.6" &&
            (await again.locator(".facts").textContent()) === (await page.locator(".facts").textContent()),
    );
    await shot(again, "lobe-dark");
    await accessible(again, "lobe dark");
    await page.getByRole("link", {name: "Trade"}).focus();
    await page.keyboard.press("Enter");
    await page.locator("table").waitFor();
    check("views by keys", await page.evaluate(() => document.activeElement.matches("nav a[aria-current=page]")));
    check("lobe console", !page.errors.length && !again.errors.length, [...page.errors, ...again.errors]);
    await Promise.all([page.context().close(), again.context().close()]);
}

async function trade() {
    const page = await open(browser),
        row = (name) => page.locator(".facts-list div").filter({hasText: name}).locator("dd").textContent();
    await visit(page, "trade?material=" + encodeURIComponent('{"ndf":"beckmann","alpha":0.2}'));
    await page.locator("table").waitFor();
    check(
        "trade at 1e-3",
        (await row("Tier")) === "fast" && (await row("On the wire")).startsWith("4 B raw"),
        await row("Tier"),
    );
    check("trade tells what one costs", / ns$/.test(await row("One evaluation")), await row("One evaluation"));
    await shot(page, "trade");
    await accessible(page, "trade");
    const answer = JSON.parse(await runCurl(page, 0));
    check("trade curl agrees", answer.accuracy.tier === "fast" && answer.count === 3);
    await page.getByLabel("Tolerance, largest relative error accepted").fill(String(Math.log10(2e-3)));
    await page.waitForFunction(() => document.querySelector(".facts-list dd").textContent !== "fast");
    check("trade at 2e-3", (await row("Tier")) === "draft", await row("Tier"));
    await page.getByLabel("Tolerance, largest relative error accepted").fill("-12");
    await page.waitForFunction(() => document.querySelector(".facts-list dd").textContent === "precise");
    check("trade at 1e-12", (await row("On the wire")).startsWith("8 B raw"));
    const rows = await page
        .locator("tbody tr")
        .evaluateAll((all) => all.map((tr) => [...tr.children].map((cell) => cell.textContent)));
    check(
        "trade table",
        rows.length === 4 && rows.every((cells) => cells.length === 7) && Number(rows[0][5]) < Number(rows[3][5]),
        rows,
    );
    const holds = rows.every((cells) => cells[3] === "the reference" || number(cells[3]) <= number(cells[2]));
    check("trade: no error above its promise", holds, rows);
    await shot(page, "trade-precise");
    await page.getByLabel("Tolerance, largest relative error accepted").fill("-15");
    await page.getByText("none promises it").first().waitFor();
    check("trade says what no tier promises", /cannot be promised/.test(await page.locator(".problem").textContent()));
    check(
        "trade console",
        page.errors.every((text) => text.includes("422")),
        page.errors,
    );
    await page.context().close();
}

async function sphere() {
    const page = await open(browser);
    await visit(page, "sphere?environment=furnace&spp=16&material=" + encodeURIComponent('{"ndf":"ggx","alpha":0.8}'));
    await page.getByText("million samples").waitFor();
    // In the white furnace the middle pixels show the albedo at normal incidence.
    const middle = await page.evaluate(() => {
        const canvas = document.querySelector(".sphere"),
            n = canvas.width;
        const {data} = canvas.getContext("2d").getImageData(n / 2 - 12, n / 2 - 12, 24, 24);
        let sum = 0;
        for (let i = 0; i < data.length; i += 4) sum += (data[i] / 255) ** 2.2;
        return sum / (data.length / 4);
    });
    const {albedo} = await post("v1/albedo", {material: {ndf: "ggx", alpha: 0.8}, wo: [[0, 0, 1]]}),
        expected = 1 - Math.exp(-albedo[0]);
    check("sphere shows the albedo", Math.abs(middle - expected) < 0.03, [middle, expected]);
    await page.getByLabel("Environment", {exact: true}).selectOption("sky");
    await page.locator("select").filter({hasText: "Copper"}).selectOption("f0:Cu");
    await page.waitForFunction(
        () =>
            document.querySelector("progress").value === 1 &&
            /million/.test(document.querySelector(".readout").textContent),
    );
    note(`sphere: ${await page.locator(".sphere-view .readout").first().textContent()}`);
    await shot(page, "sphere");
    await accessible(page, "sphere");
    const answer = JSON.parse(await runCurl(page, 0));
    await page.getByLabel("Surface").selectOption("plane");
    const began = performance.now();
    await page.waitForFunction(() => document.querySelector("progress").value > 0.06);
    note(`plane: a 16th of the texels, a request each, in ${Math.round(performance.now() - began)} ms`);
    await page.getByRole("button", {name: "Stop", exact: true}).click();
    await shot(page, "plane");
    const colours = await page.evaluate(
        () => new Set(document.querySelector(".sphere").getContext("2d").getImageData(40, 100, 200, 100).data).size,
    );
    check("plane shows its bumps", colours > 50, colours);
    check("sphere curl", answer.wi.length === 8 && answer.weight.length === 8);
    check("sphere console", !page.errors.length, page.errors);
    await page.context().close();
}

async function fit(name, file) {
    if (!existsSync(file)) return console.log(`skip page/fit ${name}: ${file} is not there`);
    const page = await open(browser);
    await visit(page, "fit");
    await page.locator("input[type=file]").setInputFiles(file);
    await page.locator("tr.chosen").waitFor();
    await page.waitForFunction(() => document.querySelector("img.lobes")?.naturalWidth > 0);
    const rows = await page.locator("tbody tr").count(),
        errors = await page.locator("tbody tr td:nth-child(2)").allTextContents();
    check(
        `fit ${name} candidates`,
        rows > 1 && errors.every((e, k) => !k || Number(e) <= Number(errors[k - 1])),
        errors,
    );
    note(await page.locator("#controls .readout").textContent());
    await shot(page, `fit-${name}`);
    if (name === "gold") {
        await page.getByRole("button", {name: "gltf", exact: true}).click();
        await page.getByText("gltf: rms of log error").waitFor();
        await accessible(page, `fit ${name}`);
        const answer = JSON.parse(await runCurl(page, 0));
        check(`fit ${name} curl`, answer.candidates.length === rows);
    }
    await page.getByRole("button", {name: "Use this material"}).click();
    await settled(page);
    check(
        `fit ${name} is used`,
        /"ndf":/.test(decodeURIComponent(page.url())) && (await page.locator(".facts").textContent()) !== "",
    );
    if (name === "gold") await shot(page, `fit-${name}-used`);
    check(`fit ${name} console`, !page.errors.length, page.errors);
    await page.context().close();
}

async function maps() {
    const source = `${shared}/data/heights/microsurface/afm_matrix3_16.png`;
    if (!existsSync(source)) return console.log(`skip page/maps: ${source} is not there`);
    const file = `${SHOTS}/afm_matrix3_16.png`;
    copyFileSync(source, file);
    const page = await open(browser);
    await visit(page, "maps");
    await page.locator("input[type=file]").setInputFiles(file);
    await page.locator("tr.chosen").waitFor();
    await page.getByLabel("Level: each step halves the map").fill("4");
    await page.getByText("4: 16 × 16 texels").waitFor();
    await page
        .locator("canvas.map")
        .first()
        .click({position: {x: 60, y: 90}});
    await page.locator(".probe h2").waitFor();
    await page.locator("canvas.map").first().press("ArrowRight");
    await page.waitForTimeout(400);
    await shot(page, "maps");
    await accessible(page, "maps");
    const {probe} = JSON.parse(await runCurl(page, 1)),
        title = await page.locator(".probe h2").textContent(),
        alpha = await page.locator(".probe dd").first().textContent();
    check(
        "maps curl agrees",
        title === `Texel ${probe.column}, ${probe.row} of level 4` &&
            Math.abs(Number(alpha) / probe.material.alpha_x - 1) < 0.01,
        [title, alpha, probe],
    );
    const [download] = await Promise.all([
        page.waitForEvent("download"),
        page.getByRole("button", {name: "Download the EXR"}).click(),
    ]);
    const exr = readFileSync(await download.path());
    check("maps EXR", exr.readUInt32LE(0) === 20000630 && download.suggestedFilename() === "afm_matrix3_16-leadr.exr");
    await page.getByRole("button", {name: "Use this material"}).click();
    await settled(page);
    check("maps texel is used", /beckmann/.test(page.url()));
    check("maps console", !page.errors.length, page.errors);
    await page.context().close();
}

async function token() {
    const guarded = new Daemon(process.argv[2]),
        page = await open(browser);
    await guarded.start("--token", "s3cret");
    page.away = true; // 401 is an error to the console
    await page.goto(guarded.url);
    await page.getByLabel("Token").fill("s3cret");
    await accessible(page, "token");
    await page.getByRole("button", {name: "Use it"}).click();
    await settled(page);
    check("token: asked for, then it goes on", await page.locator("#notice").isHidden());
    await page.context().close();
    await guarded.end();
}

async function fitFormula() {
    const page = await open(browser);
    await visit(
        page,
        "fit?material=" + encodeURIComponent('{"ndf":"beckmann","alpha":0.2,"fresnel":{"conductor":{"metal":"Au"}}}'),
    );
    await page.getByRole("button", {name: "No file?"}).click();
    await page.locator("tr.chosen").waitFor();
    check(
        "fit of a formula",
        /Beckmann/.test(await page.locator("tr.chosen th").textContent()) &&
            JSON.parse(await runCurl(page, 0)).chosen.model === "beckmann",
    );
    // What fits exactly stands where its rounding is, not higher.
    await visit(page, "fit?material=" + encodeURIComponent('{"ndf":"ggx","alpha":0.3}'));
    await page.getByRole("button", {name: "No file?"}).click();
    await page.waitForFunction(() => document.querySelector("tr.chosen th")?.textContent.startsWith("GGX"));
    const ticks = (await page.locator("svg.chart .axes text").allTextContents()).filter((t) => /^10⁻/.test(t));
    check("fit that is exact", Math.min(...ticks.map(number)) < 1e-14, ticks);
    check("fit of a formula: console", !page.errors.length, page.errors);
    await page.context().close();
}

async function phone() {
    const page = await open(browser, {
        viewport: {width: 360, height: 740},
        hasTouch: true,
        isMobile: true,
        deviceScaleFactor: 2,
    });
    for (const view of ["lobe", "trade", "sphere?spp=16", "fit", "maps"]) {
        await visit(page, view);
        await page.waitForTimeout(500);
        const name = `phone ${view.split("?")[0]}`;
        await fitsWidth(page, name);
        if (view === "lobe" || view === "trade") await shot(page, name.replace(" ", "-"));
    }
    check("phone console", !page.errors.length, page.errors);
    await page.context().close();
}

async function killed() {
    const page = await open(browser);
    await visit(page, "lobe");
    await settled(page);
    await page.waitForTimeout(300);
    page.away = true;
    await daemon.end("SIGKILL");
    await page.locator(".polar .handle").focus();
    await page.keyboard.press("ArrowLeft");
    await page.locator("#notice").getByText("does not answer").waitFor();
    check("daemon gone: the page says so", true);
    await shot(page, "daemon-gone");
    await accessible(page, "daemon gone");
    const before = await page.evaluate(() => Number(document.querySelector(".rate").dataset.total));
    await daemon.start();
    await page.locator("#notice").waitFor({state: "hidden"});
    await page.waitForFunction((n) => Number(document.querySelector(".rate").dataset.total) > n, before);
    check(
        "daemon back: the page goes on",
        /wo at −4\d°/.test(await page.locator(".facts").textContent()),
        await page.locator(".facts").textContent(),
    );
    page.away = false;
    check("daemon killed: no failure of the page itself", !page.errors.length, page.errors);
    await page.context().close();
}

try {
    await daemon.start();
    browser = await browse();
    for (const part of [
        lobe,
        trade,
        sphere,
        () => fit("gold", `${SHOTS}/gold-metallic-paint.binary`),
        () => fit("rgl", `${shared}/data/brdf/rgl/cc_ibiza_sunset_rgb.bsdf`),
        fitFormula,
        maps,
        token,
        phone,
        killed,
    ]) {
        const began = performance.now();
        try {
            await part();
            note(`${part.name || "fit"}: ${((performance.now() - began) / 1000).toFixed(1)} s`);
        } catch (error) {
            check(part.name || "fit", false, error.stack);
        }
    }
} finally {
    await browser?.close();
    await daemon.end();
}
process.exitCode = failures() ? 1 : 0;
