// browser.mjs - a daemon, a browser, and what every check needs: console kept, axe, curl lines, screenshots.
import {execFile, spawn} from "node:child_process";
import {createRequire} from "node:module";
import {readFileSync} from "node:fs";
import {promisify} from "node:util";

const require = createRequire(process.env.FACET_NPM);
const {chromium} = require("playwright-core");
const AXE = readFileSync(require.resolve("axe-core/axe.min.js"), "utf8");
const SHOTS = "build/page";

export class Daemon {
    constructor(program) {
        this.program = program;
        this.port = 0;
    }
    // On the port it had before, if it had one.
    async start(...flags) {
        this.child = spawn(this.program, ["--port", String(this.port), "--log", "none", ...flags], {
            stdio: ["ignore", "pipe", "inherit"],
        });
        const line = await new Promise((resolve, reject) => {
            this.child.stdout.once("data", (data) => resolve(String(data)));
            this.child.once("exit", (code) => reject(new Error(`facetd ended with ${code}`)));
        });
        this.url = line.match(/http:\S+/)[0];
        this.port = Number(new URL(this.url).port);
    }
    async end(signal = "SIGTERM") {
        if (!this.child || this.child.exitCode !== null) return;
        const gone = new Promise((resolve) => this.child.once("exit", resolve));
        this.child.kill(signal);
        await gone;
    }
}

let failed = 0;
export const failures = () => failed;
export function check(name, holds, detail = "") {
    if (!holds) {
        failed++;
        if (detail !== "") console.log(`  ${typeof detail === "string" ? detail : JSON.stringify(detail)}`);
    }
    console.log(`${holds ? "ok" : "FAIL"} page/${name}`);
}
export const note = (text) => console.log(`# ${text}`);

export async function browse() {
    return chromium.launch({
        executablePath: process.env.FACET_BROWSER,
        args: ["--no-sandbox", "--enable-unsafe-swiftshader"],
    });
}

// A page whose errors are kept, but for what the network says while `page.away` is set.
export async function open(browser, options = {}) {
    const context = await browser.newContext({viewport: {width: 1280, height: 1000}, ...options});
    const page = await context.newPage();
    page.errors = [];
    page.on("console", (message) => message.type() === "error" && !page.away && page.errors.push(message.text()));
    page.on("pageerror", (error) => page.errors.push(error.stack));
    page.setDefaultTimeout(30000);
    return page;
}

export const shot = (page, name) => page.screenshot({path: `${SHOTS}/${name}.png`, fullPage: true});

export async function accessible(page, name) {
    await page.evaluate(AXE);
    const {violations} = await page.evaluate(() => window.axe.run(document, {resultTypes: ["violations"]}));
    check(
        `${name} axe`,
        !violations.length,
        violations
            .flatMap((v) => v.nodes.slice(0, 3).map((n) => `${v.id}: ${v.help}: ${n.html.slice(0, 160)}`))
            .join("\n  "),
    );
}

export async function fitsWidth(page, name) {
    const wide = await page.evaluate(() => [document.documentElement.scrollWidth, innerWidth]);
    check(`${name} fits its width`, wide[0] <= wide[1], wide);
}

// Runs a curl line of the page as a shell would; files named there lie in `directory`.
export async function runCurl(page, index, directory = SHOTS) {
    const text = await page.locator(".curl code").nth(index).textContent();
    const {stdout} = await promisify(execFile)("bash", ["-c", text], {
        cwd: directory,
        maxBuffer: 1 << 28,
        encoding: "buffer",
    });
    return stdout;
}
