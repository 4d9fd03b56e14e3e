"use strict";
// The page works without any of this; it adds sorting, copying, a theme switch, and the drawings that turn.
const drawings = [];

function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

function redrawAll() {
  for (const drawing of drawings) drawing.draw();
}

(function theme() {
  const button = document.getElementById("theme");
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const current = () => document.documentElement.dataset.theme || (dark.matches ? "dark" : "light");
  const label = () => { button.textContent = current() === "dark" ? "Light" : "Dark"; };
  button.hidden = false;
  label();
  button.addEventListener("click", () => {
    document.documentElement.dataset.theme = current() === "dark" ? "light" : "dark";
    label();
    redrawAll();
  });
  dark.addEventListener("change", () => { label(); redrawAll(); });
})();

function copyText(text, button) {
  const label = button.textContent;
  const done = (ok) => {
    button.textContent = ok ? "Copied" : "Copying is not allowed here";
    setTimeout(() => { button.textContent = label; }, 1500);
  };
  const fallback = () => {
    const area = document.createElement("textarea");
    area.value = text;
    document.body.append(area);
    area.select();
    const ok = document.execCommand("copy");
    area.remove();
    button.focus();
    done(ok);
  };
  if (navigator.clipboard) navigator.clipboard.writeText(text).then(() => done(true), fallback);
  else fallback();
}

function copyButton(label, text) {
  const button = document.createElement("button");
  button.type = "button";
  button.textContent = label;
  button.addEventListener("click", () => copyText(text(), button));
  return button;
}

for (const table of document.querySelectorAll("table.data")) {
  const tools = document.createElement("div");
  tools.className = "tools";
  const cells = (row) => [...row.cells].map((cell) => cell.textContent.trim().replace(/\s+/g, " ")).join("\t");
  tools.append(copyButton("Copy table", () => [...table.rows].map(cells).join("\n")));
  (table.closest(".scroll") || table).after(tools);
}

for (const code of document.querySelectorAll("code.copyable")) {
  code.after(" ", copyButton("Copy", () => code.textContent));
}

// The number that a cell shows, such as "(−2.68 ± 0.01)·10⁹"; undefined for words.
function shownNumber(text) {
  const found = text.replace(/−/g, "-").match(/^[+(]?(-?\d+(?:\.\d+)?)(?:[^·]*·10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+))?/);
  if (!found) return undefined;
  const power = [...(found[2] || "")].map((digit) => "⁰¹²³⁴⁵⁶⁷⁸⁹".indexOf(digit)).map((d) => (d < 0 ? "-" : d)).join("");
  return Number(found[1]) * 10 ** Number(power || 0);
}

function sortKeys(cells) {
  const shown = cells.map((cell) => cell.textContent.trim());
  const numbers = shown.map(shownNumber);
  const isNumeric = shown.every((text, index) => numbers[index] !== undefined || text === "–" || text === "");
  return isNumeric ? numbers.map((value) => value ?? -Infinity) : shown.map((text) => text.toLowerCase());
}

for (const table of document.querySelectorAll("table.sortable")) {
  [...table.tHead.rows[0].cells].forEach((heading, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...heading.childNodes);
    heading.append(button);
    button.addEventListener("click", () => {
      const up = heading.getAttribute("aria-sort") !== "ascending";
      for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
      heading.setAttribute("aria-sort", up ? "ascending" : "descending");
      const bare = [...table.tBodies[0].rows];
      const keys = sortKeys(bare.map((row) => row.cells[column]));
      const rows = bare.map((row, index) => [keys[index], row]);
      rows.sort(([a], [b]) => (a < b ? -1 : a > b ? 1 : 0) * (up ? 1 : -1));
      table.tBodies[0].append(...rows.map(([, row]) => row));
    });
  });
}

addEventListener("beforeprint", () => {
  for (const details of document.querySelectorAll("details")) details.open = true;
});

// A canvas with as many dots as the screen has, drawn again when its size changes.
function sharpCanvas(canvas, paint) {
  const context = canvas.getContext("2d");
  const drawing = {
    width: 0,
    height: 0,
    context,
    draw() {
      const ratio = devicePixelRatio || 1;
      drawing.width = canvas.clientWidth;
      drawing.height = canvas.clientHeight;
      if (!drawing.width || !drawing.height) return;
      const wide = Math.round(drawing.width * ratio);
      const high = Math.round(drawing.height * ratio);
      if (canvas.width !== wide || canvas.height !== high) {
        canvas.width = wide;
        canvas.height = high;
      }
      context.setTransform(ratio, 0, 0, ratio, 0, 0);
      context.clearRect(0, 0, drawing.width, drawing.height);
      paint(context, drawing.width, drawing.height);
    },
  };
  new ResizeObserver(() => drawing.draw()).observe(canvas);
  drawings.push(drawing);
  return drawing;
}

function ticks(low, high, count) {
  const raw = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = power * [1, 2, 5, 10].find((m) => m * power >= raw * 0.999);
  const found = [];
  for (let value = Math.ceil(low / step - 1e-9) * step; value <= high + 1e-9 * step; value += step) {
    found.push(Math.abs(value) < step * 1e-6 ? 0 : value);
  }
  return found;
}

function tickText(value) {
  return String(parseFloat(value.toPrecision(4))).replace("-", "−");
}

const payload = JSON.parse(document.getElementById("payload")?.textContent || "null");
