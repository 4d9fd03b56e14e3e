// The force–state map in three dimensions: measured cells as tiles, the model as two sheets with the friction step
// between them. Drawn from back to front on a plain canvas: it needs no graphics card and no library.
(function map3d() {
  const widget = document.querySelector('[data-widget="map"]');
  if (!widget || !payload?.map) return;
  const data = payload.map;
  const canvas = widget.querySelector("canvas");
  const readout = widget.querySelector("output");
  const control = (role) => widget.querySelector(`[data-role="${role}"]`);
  const [xAxis, yAxis, zAxis] = data.axes;
  const n = xAxis.edges.length - 1;
  const START = { yaw: -0.75, pitch: 0.5, zoom: 1 };
  const view = { ...START };

  const heights = data.cells.map((cell) => cell[3]).concat(...data.upper, ...data.lower);
  const zLow = Math.min(...heights);
  const zHigh = Math.max(...heights);
  const unit = (value, low, high) => (high > low ? (2 * (value - low)) / (high - low) - 1 : 0);
  const place = (x, y, z) => [
    unit(x, xAxis.edges[0], xAxis.edges[n]),
    unit(y, yAxis.edges[0], yAxis.edges[n]),
    0.75 * unit(z, zLow, zHigh),
  ];

  const largest = (index) => Math.max(...data.cells.map((cell) => Math.abs(cell[index])), 1e-300);
  const SCALES = {
    moment: { index: 3, low: -largest(3), high: largest(3) },
    residual: { index: 5, low: -largest(5), high: largest(5) },
    count: { index: 2, low: 0, high: largest(2) },
  };

  // Tiles meet at their corners, at the mean of the cells around it that lie on the same side of zero rate.
  const corners = new Map();
  const cornersOf = ([i, j]) => [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]];
  const keyOf = (cell, [a, b]) => `${a} ${b} ${yAxis.edges[cell[1]] + yAxis.edges[cell[1] + 1] > 0}`;
  for (const cell of data.cells) {
    for (const corner of cornersOf(cell)) {
      const key = keyOf(cell, corner);
      const [sum, count] = corners.get(key) || [0, 0];
      corners.set(key, [sum + cell[3], count + 1]);
    }
  }
  const tiles = data.cells.map((cell) => ({
    cell,
    points: cornersOf(cell).map((corner) => {
      const [sum, count] = corners.get(keyOf(cell, corner));
      return place(xAxis.edges[corner[0]], yAxis.edges[corner[1]], sum / count);
    }),
  }));
  const sheets = [];
  function addSheet(grid, yFrom, yTo) {
    const rows = grid.length;
    const columns = rows ? grid[0].length : 0;
    const at = (r, c) => place(
      xAxis.edges[0] + ((xAxis.edges[n] - xAxis.edges[0]) * r) / (rows - 1),
      yFrom + ((yTo - yFrom) * c) / (columns - 1),
      grid[r][c],
    );
    for (let r = 0; r + 1 < rows; r++) {
      for (let c = 0; c + 1 < columns; c++) {
        sheets.push({ points: [at(r, c), at(r + 1, c), at(r + 1, c + 1), at(r, c + 1)] });
      }
    }
  }
  addSheet(data.upper, 0, yAxis.edges[n]);
  addSheet(data.lower, yAxis.edges[0], 0);

  let projected = [];
  const drawing = sharpCanvas(canvas, paint);

  function camera(width, height) {
    const [cosY, sinY, cosP, sinP] = [Math.cos(view.yaw), Math.sin(view.yaw), Math.cos(view.pitch), Math.sin(view.pitch)];
    const scale = view.zoom * Math.min(width / 3.3, height / 3.3);
    return ([x, y, z]) => {
      const across = x * cosY - y * sinY;
      const away = x * sinY + y * cosY;
      const depth = away * cosP - z * sinP;
      const up = away * sinP + z * cosP;
      const near = 5 / (5 + depth);
      return [width / 2 + across * scale * near, 0.46 * height - up * scale * near, depth];
    };
  }

  function paint(context, width, height) {
    const project = camera(width, height);
    drawFrame(context, project);
    const faces = [];
    if (control("cells").checked) for (const tile of tiles) faces.push([tile, true]);
    if (control("model")?.checked) for (const sheet of sheets) faces.push([sheet, false]);
    const scale = SCALES[control("colour").value];
    const ramp = data.colours[control("colour").value];
    projected = faces.map(([face, measured]) => {
      const points = face.points.map(project);
      return { points, measured, cell: face.cell, depth: points.reduce((sum, point) => sum + point[2], 0) / 4 };
    });
    projected.sort((a, b) => b.depth - a.depth);
    const ink = colour("--ink");
    context.lineWidth = 0.6;
    for (const face of projected) {
      context.beginPath();
      face.points.forEach(([x, y], index) => (index ? context.lineTo(x, y) : context.moveTo(x, y)));
      context.closePath();
      context.strokeStyle = ink;
      if (face.measured) {
        const share = (face.cell[scale.index] - scale.low) / (scale.high - scale.low);
        context.fillStyle = ramp[Math.max(0, Math.min(ramp.length - 1, Math.round(share * (ramp.length - 1))))];
        context.globalAlpha = 1;
        context.fill();
        context.globalAlpha = 0.25;
      } else {
        context.globalAlpha = 0.06;
        context.fillStyle = ink;
        context.fill();
        context.globalAlpha = 0.5;
      }
      context.stroke();
    }
    context.globalAlpha = 1;
    canvas.dataset.faces = String(projected.length);
    canvas.dataset.view = `${view.yaw.toFixed(3)} ${view.pitch.toFixed(3)} ${view.zoom.toFixed(3)}`;
  }

  // Floor, ticks on the two near edges, height on the left corner.
  function drawFrame(context, project) {
    const floor = -0.75;
    const line = (a, b) => {
      const [p, q] = [project(a), project(b)];
      context.beginPath();
      context.moveTo(p[0], p[1]);
      context.lineTo(q[0], q[1]);
      context.stroke();
    };
    context.font = "12px system-ui, sans-serif";
    context.lineWidth = 1;
    const yNear = Math.cos(view.yaw) > 0 ? -1 : 1;
    const xNear = Math.sin(view.yaw) > 0 ? -1 : 1;
    context.strokeStyle = colour("--rule");
    const xTicks = ticks(xAxis.edges[0], xAxis.edges[n], 5).map((v) => [v, unit(v, xAxis.edges[0], xAxis.edges[n])]);
    const yTicks = ticks(yAxis.edges[0], yAxis.edges[n], 5).map((v) => [v, unit(v, yAxis.edges[0], yAxis.edges[n])]);
    for (const [, x] of xTicks) line([x, -1, floor], [x, 1, floor]);
    for (const [, y] of yTicks) line([-1, y, floor], [1, y, floor]);
    context.strokeStyle = colour("--muted");
    line([-1, unit(0, yAxis.edges[0], yAxis.edges[n]), floor], [1, unit(0, yAxis.edges[0], yAxis.edges[n]), floor]);
    const label = (text, point, bold) => {
      const [x, y] = project(point);
      context.fillStyle = colour(bold ? "--ink" : "--muted");
      context.textAlign = "center";
      context.textBaseline = "middle";
      context.fillText(text, x, y);
    };
    for (const [value, x] of xTicks) label(tickText(value), [x, yNear * 1.12, floor], false);
    for (const [value, y] of yTicks) label(tickText(value), [xNear * 1.12, y, floor], false);
    label(`${xAxis.symbol} (${xAxis.unit})`, [0, yNear * 1.34, floor], true);
    label(`${yAxis.symbol} (${yAxis.unit})`, [xNear * 1.34, 0, floor], true);
    const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]];
    const left = corners.reduce((a, b) => (project([...a, 0])[0] < project([...b, 0])[0] ? a : b));
    line([...left, floor], [...left, 0.75]);
    context.textAlign = "right";
    for (const value of ticks(zLow, zHigh, 5)) {
      const [x, y] = project([...left, 0.75 * unit(value, zLow, zHigh)]);
      context.fillStyle = colour("--muted");
      context.fillText(tickText(value), x - 6, y);
    }
    const [x, y] = project([...left, 0.75]);
    context.fillStyle = colour("--ink");
    context.textAlign = "left";
    context.fillText(`${zAxis.name} (${zAxis.unit})`, Math.max(4, x - 40), Math.max(10, y - 16));
  }

  function inside(points, x, y) {
    let within = false;
    for (let i = 0, j = points.length - 1; i < points.length; j = i++) {
      const [xi, yi] = points[i];
      const [xj, yj] = points[j];
      if (yi > y !== yj > y && x < ((xj - xi) * (y - yi)) / (yj - yi) + xi) within = !within;
    }
    return within;
  }

  function read(x, y) {
    for (let k = projected.length - 1; k >= 0; k--) {
      const face = projected[k];
      if (!face.measured || !inside(face.points, x, y)) continue;
      const [i, j, count, mean, spread, residual] = face.cell;
      const range = (axis, index) => tickText((axis.edges[index] + axis.edges[index + 1]) / 2);
      readout.textContent = `${xAxis.symbol} = ${range(xAxis, i)} ${xAxis.unit}, ${yAxis.symbol} = ${range(yAxis, j)} ${yAxis.unit}: `
        + `mean ${tickText(mean)} ± ${tickText(spread)} ${zAxis.unit} over ${count} samples, residual ${tickText(residual)} ${zAxis.unit}`;
      return;
    }
  }

  function turn(yaw, pitch) {
    view.yaw += yaw;
    view.pitch = Math.max(-0.2, Math.min(1.55, view.pitch + pitch));
    drawing.draw();
  }
  function zoom(factor) {
    view.zoom = Math.max(0.5, Math.min(6, view.zoom * factor));
    drawing.draw();
  }

  let last = null;
  canvas.addEventListener("pointerdown", (event) => {
    last = [event.clientX, event.clientY];
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (last) {
      turn((event.clientX - last[0]) * 0.01, (event.clientY - last[1]) * 0.01);
      last = [event.clientX, event.clientY];
    } else {
      read(event.offsetX, event.offsetY);
    }
  });
  for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => { last = null; });
  // The wheel zooms only in a drawing that was chosen by a click or by Tab: elsewhere it scrolls the page.
  canvas.addEventListener("wheel", (event) => {
    if (document.activeElement !== canvas) return;
    event.preventDefault();
    zoom(Math.exp(-event.deltaY * 0.001));
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const keys = {
      ArrowLeft: () => turn(-0.1, 0), ArrowRight: () => turn(0.1, 0), ArrowUp: () => turn(0, 0.1), ArrowDown: () => turn(0, -0.1),
      "+": () => zoom(1.2), "=": () => zoom(1.2), "-": () => zoom(1 / 1.2), Home: reset,
    };
    if (!keys[event.key]) return;
    event.preventDefault();
    keys[event.key]();
  });
  function reset() {
    Object.assign(view, START);
    drawing.draw();
  }
  control("reset").addEventListener("click", reset);
  for (const role of ["colour", "cells", "model"]) control(role)?.addEventListener("change", () => drawing.draw());
  widget.hidden = false;
})();
