// Moment–angle loops: choose a frequency, hide runs, move and zoom, read values.
(function loops() {
  const widget = document.querySelector('[data-widget="loops"]');
  if (!widget || !payload?.loops) return;
  const data = payload.loops;
  const canvas = widget.querySelector("canvas");
  const readout = widget.querySelector("output");
  const control = (role) => widget.querySelector(`[data-role="${role}"]`);
  const groups = [...new Set(data.runs.map((run) => run.group))];
  const EDGE = { left: 56, right: 14, top: 10, bottom: 44 };
  const DASHES = [[], [7, 3], [2, 2], [7, 2, 2, 2], [4, 2], [10, 2, 2, 2, 2, 2]];
  let shown = [];
  let box = null;
  let scales = null;

  const select = control("group");
  groups.forEach((group, index) => select.append(new Option(group, String(index))));
  // Curves of different units never share an axis.
  if (!data.each) select.append(new Option("all runs", "all"));

  function choose() {
    shown = data.runs
      .filter((run) => select.value === "all" || run.group === groups[Number(select.value)])
      .map((run, index) => ({ run, colour: data.palette[index % data.palette.length], dash: DASHES[index % DASHES.length], on: true }));
    const legend = control("legend");
    legend.replaceChildren(...shown.map((item) => {
      const button = document.createElement("button");
      button.type = "button";
      const dot = document.createElement("i");
      dot.style.background = item.colour;
      button.append(dot, item.run.label);
      button.setAttribute("aria-pressed", "true");
      button.addEventListener("click", () => {
        item.on = !item.on;
        button.setAttribute("aria-pressed", String(item.on));
        drawing.draw();
      });
      return button;
    }));
    reset();
  }

  const vertical = () => shown[0]?.run.axis ?? data.y;

  function whole() {
    const xs = shown.flatMap((item) => item.run.x);
    const ys = shown.flatMap((item) => item.run.y);
    const range = (values) => {
      let [low, high] = [Infinity, -Infinity];
      for (const value of values) { if (value < low) low = value; if (value > high) high = value; }
      const room = 0.06 * (high - low || 1);
      return [low - room, high + room];
    };
    return { x: range(xs), y: range(ys) };
  }

  function paint(context, width, height) {
    const plot = { width: width - EDGE.left - EDGE.right, height: height - EDGE.top - EDGE.bottom };
    const toX = (value) => EDGE.left + ((value - box.x[0]) / (box.x[1] - box.x[0])) * plot.width;
    const toY = (value) => EDGE.top + (1 - (value - box.y[0]) / (box.y[1] - box.y[0])) * plot.height;
    scales = { toX, toY, plot };
    drawAxes(context, width, height, toX, toY, plot);
    context.save();
    context.beginPath();
    context.rect(EDGE.left, EDGE.top, plot.width, plot.height);
    context.clip();
    for (const item of shown) {
      if (!item.on) continue;
      context.strokeStyle = item.colour;
      context.setLineDash(item.dash);
      context.lineWidth = 1.6;
      context.beginPath();
      item.run.x.forEach((x, index) => context[index ? "lineTo" : "moveTo"](toX(x), toY(item.run.y[index])));
      context.stroke();
    }
    context.setLineDash([]);
    if (control("model")?.checked) {
      context.fillStyle = colour("--ink");
      for (const item of shown) {
        if (!item.on) continue;
        item.run.model.forEach((y, index) => {
          if (y === null) return;
          context.beginPath();
          context.arc(toX(item.run.x[index]), toY(y), 1.3, 0, 7);
          context.fill();
        });
      }
    }
    context.restore();
    canvas.dataset.shown = String(shown.filter((item) => item.on).length);
    canvas.dataset.box = [...box.x, ...box.y].map((value) => value.toPrecision(4)).join(" ");
  }

  function drawAxes(context, width, height, toX, toY, plot) {
    context.font = "12px system-ui, sans-serif";
    context.lineWidth = 1;
    context.strokeStyle = colour("--rule");
    context.fillStyle = colour("--muted");
    context.textBaseline = "middle";
    context.textAlign = "center";
    const line = (x0, y0, x1, y1) => { context.beginPath(); context.moveTo(x0, y0); context.lineTo(x1, y1); context.stroke(); };
    for (const value of ticks(box.x[0], box.x[1], 7)) {
      line(toX(value), EDGE.top, toX(value), EDGE.top + plot.height);
      context.fillText(tickText(value), toX(value), EDGE.top + plot.height + 12);
    }
    context.textAlign = "right";
    for (const value of ticks(box.y[0], box.y[1], 6)) {
      line(EDGE.left, toY(value), EDGE.left + plot.width, toY(value));
      context.fillText(tickText(value), EDGE.left - 6, toY(value));
    }
    context.fillStyle = colour("--ink");
    context.textAlign = "center";
    context.fillText(`${data.x.name} (${data.x.unit})`, EDGE.left + plot.width / 2, height - 12);
    context.save();
    context.translate(12, EDGE.top + plot.height / 2);
    context.rotate(-Math.PI / 2);
    const { name, unit } = vertical();
    context.fillText(`${name} (${unit})`, 0, 0);
    context.restore();
  }

  function zoom(factor, atX = 0.5, atY = 0.5) {
    for (const [axis, at] of [["x", atX], ["y", atY]]) {
      const [low, high] = box[axis];
      const centre = low + (high - low) * at;
      box[axis] = [centre - (centre - low) / factor, centre + (high - centre) / factor];
    }
    drawing.draw();
  }
  function move(dx, dy) {
    box.x = box.x.map((value) => value - dx * (box.x[1] - box.x[0]));
    box.y = box.y.map((value) => value + dy * (box.y[1] - box.y[0]));
    drawing.draw();
  }
  function reset() {
    box = whole();
    drawing.draw();
  }

  function read(x, y) {
    let best = null;
    for (const item of shown) {
      if (!item.on) continue;
      item.run.x.forEach((value, index) => {
        const distance = (scales.toX(value) - x) ** 2 + (scales.toY(item.run.y[index]) - y) ** 2;
        if (distance < 400 && (!best || distance < best.distance)) best = { distance, item, index };
      });
    }
    if (!best) return;
    const { run } = best.item;
    const modelled = run.model.length && run.model[best.index] !== null ? `, model ${tickText(run.model[best.index])} ${data.y.unit}` : "";
    const where = `${data.x.symbol} = ${tickText(run.x[best.index])} ${data.x.unit}`;
    readout.textContent = `${run.run}: ${where}, ${tickText(run.y[best.index])} ${vertical().unit}${modelled}`;
  }

  const drawing = sharpCanvas(canvas, paint);
  let last = null;
  canvas.addEventListener("pointerdown", (event) => {
    last = [event.clientX, event.clientY];
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!last) { if (scales) read(event.offsetX, event.offsetY); return; }
    move((event.clientX - last[0]) / scales.plot.width, (event.clientY - last[1]) / scales.plot.height);
    last = [event.clientX, event.clientY];
  });
  for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => { last = null; });
  canvas.addEventListener("wheel", (event) => {
    if (document.activeElement !== canvas) return;
    event.preventDefault();
    const across = (event.offsetX - EDGE.left) / scales.plot.width;
    zoom(Math.exp(-event.deltaY * 0.001), across, 1 - (event.offsetY - EDGE.top) / scales.plot.height);
  }, { passive: false });
  canvas.addEventListener("dblclick", reset);
  canvas.addEventListener("keydown", (event) => {
    const keys = {
      ArrowLeft: () => move(0.1, 0), ArrowRight: () => move(-0.1, 0), ArrowUp: () => move(0, 0.1), ArrowDown: () => move(0, -0.1),
      "+": () => zoom(1.25), "=": () => zoom(1.25), "-": () => zoom(0.8), Home: reset,
    };
    if (!keys[event.key]) return;
    event.preventDefault();
    keys[event.key]();
  });
  control("in").addEventListener("click", () => zoom(1.25));
  control("out").addEventListener("click", () => zoom(0.8));
  control("reset").addEventListener("click", reset);
  select.addEventListener("change", choose);
  control("model")?.addEventListener("change", () => drawing.draw());
  widget.hidden = false;
  choose();
})();
